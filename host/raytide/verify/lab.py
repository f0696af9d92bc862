"""The bench on which cases are tried: a device, the product's own tracing kernels, random numbers, and records."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from raytide.accel import FlatGeometry, build_tree, tree_sources
from raytide.device import Buffer, Device, Program
from raytide.importers.measured import load_measurement
from raytide.kernels.constants import PROBES
from raytide.kernels.features import Features, kind_number, kinds
from raytide.kernels.records import NONE, RECORDS
from raytide.kernels.source import assemble
from raytide.render import Film, Renderer
from raytide.render.measured import place_tables
from raytide.scene import Scene
from raytide.scene.material_parts import SWITCHES, Material
from raytide.scene.materials import MATERIALS
from raytide.scene.measured import Measured
from raytide.verify.variants import Variant, VariantDevice, variant_named

FREE = np.float32(3.0e38)  # t_max of a ray that nothing ends
ULP = 2.0**-23  # of 1
LOCAL = 64


@dataclass
class Lab:
    """`full` asks for the catalogue's counts, else for a fraction that takes seconds."""

    device: Device
    full: bool = False

    def __post_init__(self) -> None:
        self._programs: dict[str, Program] = {}
        self._variants: dict[str, Lab] = {}

    def variant(self, name: str) -> Lab:
        """The same bench on the same device with other arithmetic: one of VARIANTS."""
        return self.with_variant(variant_named(name))

    def with_variant(self, variant: Variant) -> Lab:
        """The same bench on the same device with an arithmetic of one's own."""
        if variant.name not in self._variants:
            self._variants[variant.name] = Lab(VariantDevice(self.device, variant), self.full)
        return self._variants[variant.name]

    def close(self) -> None:
        """Lets the devices of the variants go."""
        for lab in self._variants.values():
            lab.device.close()

    def count(self, quick: int, full: int) -> int:
        """How many inputs to try."""
        return full if self.full else quick

    def seconds(self) -> float:
        """A clock for differences: processor time where the device is this machine's processor, so that other work on
        the machine does not count; else time as it passes."""
        return time.process_time() if self.device.info.type == "cpu" else time.perf_counter()

    def rng(self, seed: int) -> np.random.Generator:
        """Random numbers of one trial; the same in every run, so that a failure can be looked at."""
        return np.random.default_rng(seed)

    def tracer(
        self, geometry: FlatGeometry, builder: str = "sah", counters: bool = False, leaky: bool = False
    ) -> Tracer:
        """Something to trace rays through `geometry` with; builder "none" is brute force. `counters` for `visits`;
        `leaky` for the triangle test that others are measured against."""
        tree, shapes = builder != "none", tuple(kinds("shape"))
        features = Features(tree=tree, triangles=True, shapes=shapes, counters=counters, leaky=leaky)
        name = ("trace" if tree else "trace_all") + "_counted" * counters + "_leaky" * leaky
        program = self._program(name, "probe/trace.cl", features)
        return Tracer(self.device, program, geometry, builder)

    def render(self, scene: Scene, **settings: Any) -> Film:
        """A picture, read from the device; one set of kernels serves all scenes."""
        with self.renderer(scene, **settings) as renderer:
            film = renderer.render()
            _ = film.data
        return film

    def renderer(self, scene: Scene, **settings: Any) -> Renderer:
        """What makes pictures of `scene`, with every feature built."""
        return Renderer(scene, self.device, **{"traversal": "single", "everything": True, **settings})

    def function(self, name: str, a: np.ndarray, b: np.ndarray | None = None) -> np.ndarray:
        """One of PROBES on every row of `a` and `b`, (n, up to 4) float32 each: rows (n, 4) float32."""
        program = self._program("math", "probe/math.cl", Features())
        count, out = len(a), self.device.empty(16 * len(a))
        rows = [np.zeros((count, 4), np.float32) for _ in range(2)]
        for row, given in zip(rows, (a, b), strict=True):
            if given is not None:
                row[:, : given.shape[1]] = given
        numbers = np.uint32(PROBES.index(name)), np.uint32(count)
        self.device.launch(program, "probe_math", count, LOCAL, *numbers, *map(self.device.upload, rows), out)
        return self.device.read(out, np.float32, 4 * count).reshape(count, 4)

    def bsdf(self, material: Material) -> Bsdf:
        """The functions of one material of a scene."""
        switches: dict[str, Any] = dict.fromkeys(SWITCHES, True) | {"nested": False}  # a material without neighbours
        parameters = tuple((kind, MATERIALS[kind].PARAMETERS) for kind in sorted(MATERIALS))
        features = Features(materials=parameters, tree=False, **switches)
        return Bsdf(self.device, self._program("material", "probe/material.cl", features), material_record(material))

    def _program(self, name: str, entry: str, features: Features) -> Program:
        if name not in self._programs:
            self._programs[name] = self.device.build({name: assemble(entry, features)})[name]
        return self._programs[name]

    def spheres(self, *records: np.ndarray) -> Tracer:
        """A tracer of Shape records, by brute force."""
        return self.tracer(flat(shapes=np.concatenate(records)), "none")


@dataclass
class Bsdf:
    """The kernels of cl/probe/material.cl on one Material record; directions (n, 3) are in the shading frame."""

    device: Device
    program: Program
    record: np.ndarray

    def sample(self, wo: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """wi (n, 3), weight (n, 3), pdf (n,), flags (n,) of numbers u (n, 4)."""
        direction, weight = self._run("probe_sample", wo, u, 2)
        return direction[:, :3], weight[:, :3], direction[:, 3], weight[:, 3].astype(int)

    def eval(self, wo: np.ndarray, wi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """f |cos wi| (n, 3) and pdf (n,)."""
        (value,) = self._run("probe_eval", wo, wi, 1)
        return value[:, :3], value[:, 3]

    def _run(self, kernel: str, a: np.ndarray, b: np.ndarray, outputs: int) -> list[np.ndarray]:
        count = len(a)
        rows = np.zeros((2, count, 4), np.float32)
        rows[0, :, : a.shape[1]], rows[1, :, : b.shape[1]] = a, b
        out = [self.device.empty(16 * count) for _ in range(outputs)]
        inputs = map(self.device.upload, (self.record, *rows))
        self.device.launch(self.program, kernel, count, LOCAL, np.uint32(count), *inputs, *out)
        return [self.device.read(one, np.float32, 4 * count).reshape(count, 4) for one in out]


def material_record(material: Material) -> np.ndarray:
    """What the device gets of a material, (1,), and behind it the table of a measured one."""
    row = np.zeros(1, RECORDS["Material"].dtype)
    row["kind"] = kind_number("material", material.type)
    numbers = [x for _, values in material.parameters() for x in values]
    for place, x in enumerate(numbers):
        row[f"p{place // 4}"][0, place % 4] = x
    return place_tables(row, {0: load_measurement(Path(material.file))} if isinstance(material, Measured) else {})


class Tracer:
    """The kernels of cl/probe/trace.cl on one geometry."""

    def __init__(self, device: Device, program: Program, geometry: FlatGeometry, builder: str) -> None:
        self.device, self.program, self.geometry = device, program, geometry
        device.build(tree_sources(geometry, builder))
        self.tree = build_tree(geometry, builder, device)
        normals = np.zeros((0, 4), np.float32)
        arrays = (geometry.triangles, geometry.vertices, normals, geometry.shapes)
        counts = (self.tree.block_count, len(geometry.triangles), len(geometry.shapes), geometry.plane_count)
        buffers = [*self.tree.buffers(device), *map(device.upload, arrays)]
        self._scene: list[Buffer | np.uint32] = [*buffers, *map(np.uint32, counts)]

    def trace(self, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Records Hit (n,) of the closest hits of records Ray (n,), and whether any-hit met something, (n,) bool."""
        count = len(rays)
        hits, met = self.device.empty(16 * count), self.device.empty(4 * count)
        self._launch("probe_trace", count, self.device.upload(rays), hits, met)
        found = self.device.read(hits, RECORDS["Hit"].dtype, count)
        return found, self.device.read(met, np.uint32, count) != 0

    def surfaces(self, rays: np.ndarray, hits: np.ndarray, onward: np.ndarray) -> dict[str, np.ndarray]:
        """Surfaces at hits: p, ng, n (n, 3), error (n,), and `origin` (n, 3) of rays that leave towards `onward`."""
        count = len(rays)
        rows = np.zeros((count, 4, 4), np.float32)
        rows[:, 0, :3] = onward
        out = self.device.upload(rows)
        self._launch("probe_surface", count, self.device.upload(rays), self.device.upload(hits), out)
        got = self.device.read(out, np.float32, 16 * count).reshape(count, 4, 4)
        names = {"p": 0, "ng": 1, "n": 2, "origin": 3}
        return {name: got[:, row, :3] for name, row in names.items()} | {"error": got[:, 0, 3]}

    def sampled(self, origin: np.ndarray, u: np.ndarray) -> dict[str, np.ndarray]:
        """Points of shape 0 picked as a light does, seen from `origin` (n, 3) by numbers u (n, 2): p (n, 3), pdf (n,)
        per steradian, and `pdf_again` (n,), what the shape says of a point that was met by chance."""
        count, out = len(origin), self.device.empty(48 * len(origin))
        rows = np.zeros((2, count, 4), np.float32)
        rows[0, :, :3], rows[1, :, :2] = origin, u
        self._launch("probe_light_point", count, np.uint32(0), *map(self.device.upload, rows), out)
        got = self.device.read(out, np.float32, 12 * count).reshape(count, 3, 4)
        return {"p": got[:, 0, :3], "pdf": got[:, 0, 3], "pdf_again": got[:, 2, 3]}

    def boxes(self, nodes: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """Mask (n,) uint32 of the lanes of nodes[i] that ray i meets: the slab test alone, records Node (n,)."""
        out = self.device.empty(4 * len(rays))
        self._launch("probe_boxes", len(rays), self.device.upload(nodes), self.device.upload(rays), out)
        return self.device.read(out, np.uint32, len(rays))

    def visits(self, rays: np.ndarray) -> np.ndarray:
        """Nodes and leaves (n, 2) that each ray visits on the way to its closest hit; wants `counters`."""
        out = self.device.empty(8 * len(rays))
        self._launch("probe_visits", len(rays), self.device.upload(rays), out)
        return self.device.read(out, np.uint32, 2 * len(rays)).reshape(-1, 2)

    def _launch(self, kernel: str, count: int, *arguments: Buffer | np.uint32) -> None:
        self.device.launch(self.program, kernel, count, LOCAL, *self._scene, np.uint32(count), *arguments)


def flat(
    vertices: np.ndarray | Sequence[Sequence[float]] = (),
    faces: np.ndarray | Sequence[Sequence[int]] = (),
    shapes: np.ndarray | None = None,
    planes: int = 0,
) -> FlatGeometry:
    """Geometry of (V, 3) points, rounded to float32, (T, 3) indices, and records Shape."""
    points = np.zeros((max(len(vertices), 1), 4), np.float32)
    rows = np.zeros((len(faces), 4), np.uint32)
    if len(vertices):
        points[: len(vertices), :3] = vertices
    if len(faces):
        rows[:, :3] = faces
    return FlatGeometry(points, rows, np.zeros(0, RECORDS["Shape"].dtype) if shapes is None else shapes, planes)


def rays_of(origin: np.ndarray, direction: np.ndarray, t_max: Any = FREE, left: Any = NONE) -> np.ndarray:
    """Records Ray (n,) from (n, 3) arrays, either of which may be one row for all; `left`: the primitive they left."""
    count = max(len(np.atleast_2d(origin)), len(np.atleast_2d(direction)))
    rays = np.zeros(count, RECORDS["Ray"].dtype)
    rays["origin"][:, :3], rays["direction"][:, :3] = origin, direction
    rays["direction"][:, 3] = t_max
    rays["origin"].view(np.uint32)[:, 3] = left
    return rays


def shape_record(kind: str, center: Any, axes: Any) -> np.ndarray:
    """One Shape record (1,); axes: rows u, v, w in float64."""
    row = np.zeros(1, RECORDS["Shape"].dtype)
    rows = np.asarray(axes, np.float64)
    row["kind"] = kind_number("shape", kind)
    row["center"][0, :3] = center
    for name, axis, dual in zip("uvw", rows, np.linalg.inv(rows).T, strict=True):
        row[name][0] = (*axis, 1.0 / (axis @ axis))
        row["inverse_" + name][0, :3] = dual
    if kind == "sphere":
        row["center"][0, 3] = np.linalg.norm(rows[0])
    return row


def sphere_record(center: object, radius: float) -> np.ndarray:
    """A sphere."""
    return shape_record("sphere", center, np.eye(3) * float(radius))


def plane_record(point: object, normal: object) -> np.ndarray:
    """An infinite plane."""
    n = np.asarray(normal, np.float64)
    n = n / np.linalg.norm(n)
    u = np.cross(n, np.eye(3)[int(abs(n[0]) > 0.8)])
    u /= np.linalg.norm(u)
    return shape_record("plane", point, [u, np.cross(n, u), n])


def f4(x: object) -> np.ndarray:
    """An array of float32, rounded to nearest."""
    return np.asarray(x, np.float32)


def unit_vectors(rng: np.random.Generator, count: int) -> np.ndarray:
    """Directions spread evenly, (count, 3) float64."""
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def sampler_numbers(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Numbers as samplers give them, float32 of that shape: multiples of 2^-24 in [0, 1)."""
    return f4(rng.integers(0, 2**24, shape) * 2.0**-24)


def ulp(x: object) -> np.ndarray:
    """Spacing of float32 at |x|, float64."""
    return np.spacing(np.abs(np.asarray(x, np.float32))).astype(np.float64)
