"""Helpers of the geometry and traversal tests: a simple tree builder, a tracer, meshes and aimed rays.

The builder is deliberately plain (split at the median of the longest axis), so that traversal is checked without the
product's builders and the other way round.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from raytide.accel.compact import compact_buffers, compact_source
from raytide.kernels import NONE, RECORDS, Features, assemble
from raytide.verify import lab
from trace_programs import PACKET_KERNELS, TRACE_KERNELS

FAR = np.float32(3.0e38)
SHAPES = ("box", "disk", "plane", "rectangle", "sphere")


def features(tree: bool = True, triangles: bool = True, shapes: tuple[str, ...] = SHAPES, **more: bool) -> Features:
    """Switches of a test program."""
    return Features(tree=tree, triangles=triangles, shapes=shapes, **more)


@dataclass
class Mesh:
    """Triangles and shapes as the device gets them: vertices (V, 4) f4, triangles (T, 4) u4, shapes of record Shape."""

    vertices: np.ndarray
    triangles: np.ndarray
    shapes: np.ndarray
    planes: int = 0
    normals: np.ndarray | None = None

    @property
    def corners(self) -> np.ndarray:
        """(T, 3, 3) float32."""
        return self.vertices[self.triangles[:, :3], :3]


def mesh(vertices: np.ndarray, faces: np.ndarray, shapes: np.ndarray | None = None, planes: int = 0) -> Mesh:
    """A Mesh from (V, 3) points and (T, 3) indices; object 7 owns every triangle."""
    points = np.zeros((max(len(vertices), 1), 4), np.float32)
    points[: len(vertices), :3] = vertices
    rows = np.full((len(faces), 4), 7, np.uint32)
    rows[:, :3] = faces
    return Mesh(points, rows, np.zeros(0, RECORDS["Shape"].dtype) if shapes is None else shapes, planes)


def soup(corners: np.ndarray, **more: object) -> Mesh:
    """A Mesh of separate triangles, corners (T, 3, 3)."""
    return mesh(np.reshape(corners, (-1, 3)), np.arange(3 * len(corners)).reshape(-1, 3), **more)  # type: ignore[arg-type]


def shape_record(kind: str, center: object, axes: object, owner: int = 3) -> np.ndarray:
    """One Shape record of object `owner`; axes are the rows u, v, w."""
    row = lab.shape_record(kind, center, axes)
    row["object"] = owner
    return row


def sphere_record(center: object, radius: float) -> np.ndarray:
    return shape_record("sphere", center, np.eye(3) * radius)


def plane_record(point: object, normal: object) -> np.ndarray:
    n = np.asarray(normal, np.float64) / np.linalg.norm(np.asarray(normal, np.float64))
    u = np.cross(n, [1.0, 0, 0] if abs(n[0]) < 0.8 else [0, 1.0, 0])
    u /= np.linalg.norm(u)
    return shape_record("plane", point, [u, np.cross(n, u), n])


def crowd(triangles: int, seed: int = 1) -> Mesh:
    """Random triangles and shapes of all kinds, some thin, some far larger than others."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(triangles, 1, 3)) * 2 + rng.normal(size=(triangles, 3, 3)) * rng.choice([0.05, 0.3, 2.0])
    shapes = [plane_record((0, -4, 0), (0.1, 1, 0.2)), plane_record((0, 0, -7), (0, 0, 1))]
    shapes += [sphere_record(rng.normal(size=3) * 3, 0.1 + 0.2 * i) for i in range(5)]
    shapes += [
        shape_record("box", rng.normal(size=3) * 3, np.linalg.qr(rng.normal(size=(3, 3)))[0] * (0.2, 0.5, 0.9))
        for _ in range(4)
    ]
    for kind in ("rectangle", "disk"):
        for _ in range(4):
            frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            shapes.append(shape_record(kind, rng.normal(size=3) * 3, frame * np.array([[0.7], [0.4], [1.0]])))
    return soup(corners, shapes=np.concatenate(shapes), planes=2)


def _shape_boxes(shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    center = shapes["center"][:, :3].astype(np.float64)
    reach = sum(np.abs(shapes[a][:, :3].astype(np.float64)) for a in "uvw")
    return center - reach * 1.000001, center + reach * 1.000001


def simple_tree(geometry: Mesh, leaf: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Node and Block records of an 8-wide tree by median splits; leaves of up to `leaf` triangles."""
    corners = geometry.corners
    low, high = corners.min(axis=1).astype(np.float64), corners.max(axis=1).astype(np.float64)
    shapes = geometry.shapes[geometry.planes :]
    shape_low, shape_high = _shape_boxes(shapes)
    low, high = np.concatenate([low, shape_low]), np.concatenate([high, shape_high])
    first_shape = len(corners)
    nodes: list[np.ndarray] = []
    blocks: list[np.ndarray] = []

    def is_leaf(ids: np.ndarray) -> bool:
        return len(ids) == 1 or (len(ids) <= leaf and bool((ids < first_shape).all()))

    def halves(ids: np.ndarray) -> list[np.ndarray]:
        if (ids < first_shape).any() and (ids >= first_shape).any():
            return [ids[ids < first_shape], ids[ids >= first_shape]]
        middle = low[ids] + high[ids]
        order = np.argsort(middle[:, np.argmax(np.ptp(middle, axis=0))], kind="stable")
        return [ids[order[: len(ids) // 2]], ids[order[len(ids) // 2 :]]]

    def add_leaf(ids: np.ndarray) -> int:
        if ids[0] >= first_shape:
            return 0xC0000000 | int(ids[0] - first_shape + geometry.planes)
        blocks.append(_block(corners, np.sort(ids)))
        return 0x80000000 | (len(blocks) - 1) << 3 | (len(ids) - 1)

    def add_node(ids: np.ndarray) -> int:
        groups = [ids]
        while len(groups) < 8 and not all(is_leaf(group) for group in groups):
            widest = max((g for g in groups if not is_leaf(g)), key=len)
            groups = [g for g in groups if g is not widest] + halves(widest)
        index = len(nodes)
        node = np.zeros((), RECORDS["Node"].dtype)
        nodes.append(node)
        for row in ("lox", "loy", "loz"):
            node[row], node[row.replace("lo", "hi")] = 1e30, -1e30
        node["child"] = NONE
        for lane, group in enumerate(groups):
            for axis, name in enumerate("xyz"):
                node["lo" + name][lane] = _down(low[group, axis].min())
                node["hi" + name][lane] = -_down(-high[group, axis].max())
            node["child"][lane] = add_leaf(group) if is_leaf(group) else add_node(group)
        return index

    if len(low):
        add_node(np.arange(len(low)))
    node_array = np.array(nodes, RECORDS["Node"].dtype) if nodes else np.zeros(0, RECORDS["Node"].dtype)
    return node_array, np.array(blocks, RECORDS["Block"].dtype) if blocks else np.zeros(0, RECORDS["Block"].dtype)


def _down(value: float) -> np.float32:
    rounded = np.float32(value)
    rounded = rounded if float(rounded) <= value else np.nextafter(rounded, np.float32(-np.inf))
    return np.nextafter(rounded, np.float32(-np.inf))


def _block(corners: np.ndarray, ids: np.ndarray) -> np.ndarray:
    block = np.zeros((), RECORDS["Block"].dtype)
    block["prim"] = NONE
    block["prim"][: len(ids)] = ids
    for lane in range(8):
        points = corners[ids[lane]] if lane < len(ids) else np.repeat(corners[ids[:1], 0], 3, axis=0)
        for vertex in range(3):
            for axis, name in enumerate("xyz"):
                block[f"v{vertex}{name}"][lane] = points[vertex, axis]
    return block


def blocks_in_order(geometry: Mesh) -> np.ndarray:
    """Blocks of brute force: triangles in order of id."""
    corners = geometry.corners
    groups = [np.arange(i, min(i + 8, len(corners))) for i in range(0, len(corners), 8)]
    return np.array([_block(corners, ids) for ids in groups], RECORDS["Block"].dtype)


def rays_of(origins: np.ndarray, directions: np.ndarray, t_max: object = FAR, left: object = NONE) -> np.ndarray:
    """Ray records from (n, 3) origins and directions."""
    count = max(len(np.atleast_2d(origins)), len(np.atleast_2d(directions)))
    rays = np.zeros(count, RECORDS["Ray"].dtype)
    rays["origin"][:, :3], rays["direction"][:, :3] = origins, directions
    rays["direction"][:, 3] = t_max
    rays["origin"].view(np.uint32)[:, 3] = left
    return rays


class Tracer:
    """A geometry on a device, with or without its tree, and the kernels above."""

    def __init__(
        self,
        device: object,
        geometry: Mesh,
        program: object,
        tree: object = True,
        packets: object = None,
        compact: object = None,
    ) -> None:
        self.device, self.program, self.geometry = device, program, geometry
        self.packets, self.compact = packets, compact
        if tree is True:
            nodes, blocks = simple_tree(geometry)
        elif tree is False:
            nodes, blocks = np.zeros(0, RECORDS["Node"].dtype), blocks_in_order(geometry)
        else:
            nodes, blocks = tree  # type: ignore[misc]
        self.nodes = nodes
        normals = geometry.normals if geometry.normals is not None else np.zeros((0, 4), np.float32)
        arrays = (nodes, blocks, geometry.triangles, geometry.vertices, normals, geometry.shapes)
        self.arguments = [device.upload(array) for array in arrays]  # type: ignore[attr-defined]
        counts = (len(blocks), len(geometry.triangles), len(geometry.shapes), geometry.planes)
        self.arguments += [np.uint32(n) for n in counts]
        if compact is not None:
            packing = programs(device)["packing"]
            wide = (self.arguments[0], self.arguments[1])
            *buffers, count = compact_buffers(device, packing, nodes, wide, len(blocks))  # type: ignore[arg-type]
            self.compact_arguments = [*buffers, *self.arguments[2:6], np.uint32(count), *self.arguments[7:]]

    def _launch(self, kernel: str, count: int, *arguments: object) -> None:
        self.device.launch(self.program, kernel, (count,), (64,), *self.arguments, np.uint32(count), *arguments)  # type: ignore[attr-defined]

    def trace(self, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Hit records, and whether any-hit met something (bool). With a tree, packets and the compact layout must give
        the same bits."""
        device, count = self.device, len(rays)
        given = device.upload(rays)  # type: ignore[attr-defined]
        hits, met = device.empty(16 * count), device.empty(4 * count)  # type: ignore[attr-defined]
        self._launch("probe_trace", count, given, hits, met)
        found = device.read(hits, RECORDS["Hit"].dtype, count)  # type: ignore[attr-defined]
        anything = device.read(met, np.uint32, count) != 0  # type: ignore[attr-defined]
        if self.packets is not None:
            queue = device.upload(np.arange(count, dtype=np.uint32))  # type: ignore[attr-defined]
            for any_hit in (0, 1):
                device.launch(self.packets, "closest_packet", (-(-count // 64),), (4,), *self.arguments,  # type: ignore[attr-defined]
                              np.uint32(count), queue, given, np.uint32(any_hit), hits, met)  # fmt: skip
            self._expect(hits, met, found, anything)
        if self.compact is not None:
            device.fill(hits, 0)  # type: ignore[attr-defined]
            device.launch(self.compact, "probe_trace", (count,), (64,), *self.compact_arguments, np.uint32(count),  # type: ignore[attr-defined]
                          given, hits, met)  # fmt: skip
            self._expect(hits, met, found, anything)
        return found, anything

    def _expect(self, hits: object, met: object, found: np.ndarray, anything: np.ndarray) -> None:
        count, read = len(found), self.device.read  # type: ignore[attr-defined]
        assert read(hits, RECORDS["Hit"].dtype, count).tobytes() == found.tobytes()
        assert np.array_equal(read(met, np.uint32, count) != 0, anything)

    def surfaces(self, rays: np.ndarray, hits: np.ndarray, onward: np.ndarray) -> dict[str, np.ndarray]:
        """Surfaces at hits, and where rays in directions `onward` (n, 3) leave them."""
        device, count = self.device, len(rays)
        rows = np.zeros((count, 4, 4), np.float32)
        rows[:, 0, :3] = onward
        out = device.upload(rows)  # type: ignore[attr-defined]
        self._launch("probe_surface", count, device.upload(rays), device.upload(hits), out)  # type: ignore[attr-defined]
        got = device.read(out, np.float32, 16 * count).reshape(count, 4, 4)  # type: ignore[attr-defined]
        return {
            "p": got[:, 0, :3], "error": got[:, 0, 3], "ng": got[:, 1, :3], "n": got[:, 2, :3],
            "uv": got[:, 1:3, 3], "origin": got[:, 3, :3], "object": got[:, 3, 3].view(np.uint32),
        }  # fmt: skip

    def words(self, kernel: str, rays: np.ndarray) -> np.ndarray:
        """One uint32 a ray from kernel `probe_boxes` (lanes of the root that it meets), `depths` or `redone`."""
        device, count = self.device, len(rays)
        out = device.upload(np.zeros(count, np.uint32))  # type: ignore[attr-defined]
        roots = [device.upload(np.repeat(self.nodes[:1], count))] if kernel == "probe_boxes" else []  # type: ignore[attr-defined]
        self._launch(kernel, count, *roots, device.upload(rays), out)  # type: ignore[attr-defined]
        return device.read(out, np.uint32, count)  # type: ignore[attr-defined]

    def sample(self, shape: int, origins: np.ndarray, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """Points sampled on a shape as seen from `origins` (n, 3) by `numbers` (n, 2)."""
        device, count = self.device, len(origins)
        given = [np.zeros((count, 4), np.float32) for _ in range(2)]
        given[0][:, :3], given[1][:, :2] = origins, numbers
        out = device.empty(48 * count)  # type: ignore[attr-defined]
        buffers = [device.upload(array) for array in given]  # type: ignore[attr-defined]
        self._launch("probe_light_point", count, np.uint32(shape), *buffers, out)
        got = device.read(out, np.float32, 12 * count).reshape(count, 3, 4)  # type: ignore[attr-defined]
        return {
            "p": got[:, 0, :3], "pdf": got[:, 0, 3], "ng": got[:, 1, :3],
            "error": got[:, 1, 3], "wi": got[:, 2, :3], "pdf_again": got[:, 2, 3],
        }  # fmt: skip


@cache
def programs(device: object) -> dict[str, object]:
    """The programs that all tests share: "tree", "packets" and "compact" beside it, and "all" for brute force."""
    sources = {
        "packing": compact_source(),
        "compact": assemble("probe/trace.cl", features(tree=True, compact=True)),
        "packets": assemble("", features(tree=True), PACKET_KERNELS),
        "tree": assemble("", features(tree=True), TRACE_KERNELS),
        "all": assemble("", features(tree=False), TRACE_KERNELS),
    }
    return device.build(sources)  # type: ignore[attr-defined]


def tracer(device: object, geometry: Mesh, tree: object = True) -> Tracer:
    """A Tracer with the shared programs; tree: True, False (brute force) or (nodes, blocks)."""
    built = programs(device)
    if tree is False:
        return Tracer(device, geometry, built["all"], False)
    return Tracer(device, geometry, built["tree"], tree, built["packets"], built["compact"])


def ring_sphere(rings: int, segments: int, center: object = (0, 0, 0)) -> Mesh:
    """A closed sphere of radius 1 around `center`, its vertices rounded to float32 there."""
    theta = np.linspace(0, np.pi, rings + 1)[1:-1]
    phi = np.arange(segments) * (2 * np.pi / segments)
    grid = np.stack([np.outer(np.sin(theta), np.cos(phi)), np.outer(np.cos(theta), np.ones(segments)),
                     np.outer(np.sin(theta), np.sin(phi))], -1)  # fmt: skip
    points = np.concatenate([[[0, 1, 0], [0, -1, 0]], grid.reshape(-1, 3)])
    row = 2 + np.arange((rings - 1) * segments).reshape(rings - 1, segments)
    a, b = row[:-1], row[1:]
    a_next, b_next = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    faces = [np.stack(f, -1).reshape(-1, 3) for f in ((a, a_next, b), (a_next, b_next, b))]
    first, last = row[0], row[-1]
    faces += [np.stack([np.zeros_like(first), np.roll(first, -1), first], -1)]
    faces += [np.stack([np.ones_like(last), last, np.roll(last, -1)], -1)]
    return mesh(points + np.asarray(center, np.float64), np.concatenate(faces))


def closest_triangle(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """t and index of the closest triangle of (T, 3, 3) by float64 arithmetic; inf and -1 where none."""
    best, index = np.full(len(origin), np.inf), np.full(len(origin), -1)
    o, d = origin.astype(np.float64), direction.astype(np.float64)
    for k, (a, b, c) in enumerate(corners.astype(np.float64)):
        e1, e2 = b - a, c - a
        normal = np.cross(e1, e2)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = d @ normal
            t = ((a - o) @ normal) / slope
            turn = np.cross(o - a, d)
            u, v = -(turn @ e2) / slope, (turn @ e1) / slope
            met = (t >= 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t < best)
        best[met], index[met] = t[met], k
    return best, index
