"""The tree of bounds by which one of many lights is picked (Conty Estevez and Kulla 2018, HPG).

Every node knows the box around its lights, a cone around the ways they face, and their intensity. `cl/light/tree.cl`
weighs the two children of a node by them at the point to be lit. Lights without a place (suns, skies) are leaves of a
part of their own, whose shares are fixed. Lights are halved at the median along the longest side of the box around
them, all nodes of a level at once; three such levels make one of eight lanes, so n lights are log8(n) steps away.
(Splitting by the way they face, too, where that promises less, gave 4 % less error in a tree of two lanes; it takes
longer to build.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raytide.accel import FlatGeometry
from raytide.kernels.features import SKIES, kind_number
from raytide.kernels.records import RECORDS

LEAF, TWO_SIDED = 1 << 31, 1 << 30
LEAST_SHARE = 0.1  # of lights with, and of lights without a place, where there are both
LANES = 8
FEW = 8  # lights with a place, up to which an alias table picks as well


@dataclass
class Bounds:
    """Bounds of n things: corners (n, 3) float64 [m]; axis (n, 3), unit; cosines of the angles to it (normals, light);
    intensity (n,) [W/sr]; whether anything shines to both sides."""

    low: np.ndarray
    high: np.ndarray
    axis: np.ndarray
    cos_o: np.ndarray
    cos_e: np.ndarray
    intensity: np.ndarray
    both: np.ndarray

    def take(self, index: np.ndarray) -> Bounds:
        """Those of some of them."""
        return Bounds(*(getattr(self, name)[index] for name in self.__dataclass_fields__))

    def put(self, index: np.ndarray, values: Bounds) -> None:
        """Replace some of them."""
        for name in self.__dataclass_fields__:
            getattr(self, name)[index] = getattr(values, name)

    @staticmethod
    def empty(count: int) -> Bounds:
        low, high, axis = (np.zeros((count, 3)) for _ in range(3))
        cos_o, cos_e, intensity = (np.zeros(count) for _ in range(3))
        return Bounds(low, high, axis, cos_o, cos_e, intensity, np.zeros(count, bool))


def has_place(lights: np.ndarray) -> np.ndarray:
    """(n,) bool: lights that are nearer to some points than to others."""
    endless = [kind_number("light", name) for name in ("directional", *SKIES)]
    return ~np.isin(lights["kind"], endless)


def light_bounds(lights: np.ndarray, geometry: FlatGeometry, intensity: np.ndarray) -> Bounds:
    """Of records Light that have a place."""
    count = len(lights)
    out = Bounds.empty(count)
    out.low[:] = out.high[:] = lights["position"][:, :3]
    out.axis[:] = lights["direction"][:, :3]
    out.cos_o[:], out.cos_e[:] = -1.0, 0.0
    out.intensity[:] = np.maximum(intensity, max(1e-12 * float(intensity.max(initial=0.0)), 1e-30))  # none is nothing
    out.both[:] = False
    spots = np.isin(lights["kind"], [kind_number("light", name) for name in ("spot", "textured_spot", "projector")])
    out.cos_o[spots] = np.cos(lights["extra"][spots, 2])
    out.cos_e[spots] = np.cos(0.02)  # no light beyond the cone; a little for rounding
    emitters = np.nonzero(lights["kind"] == kind_number("light", "emitter"))[0]
    out.both[emitters] = lights["extra"][emitters, 0] != 0
    prims = lights["prim"][emitters].astype(np.int64)
    flat = prims < len(geometry.triangles)
    corners = geometry.vertices[geometry.triangles[prims[flat], :3], :3].astype(np.float64)
    where = emitters[flat]
    out.low[where], out.high[where], out.cos_o[where] = corners.min(axis=1), corners.max(axis=1), 1.0
    shapes = geometry.shapes[prims[~flat] - len(geometry.triangles)]
    where = emitters[~flat]
    center = shapes["center"][:, :3].astype(np.float64)
    level = np.isin(shapes["kind"], [kind_number("shape", name) for name in ("rectangle", "disk")])
    half = sum(np.abs(shapes[name][:, :3].astype(np.float64)) for name in "uv")
    half = half + np.where(level[:, None], 0.0, np.abs(shapes["w"][:, :3].astype(np.float64)))
    out.low[where], out.high[where] = center - half, center + half
    out.axis[where] = shapes["w"][:, :3]
    out.cos_o[where] = np.where(level, 1.0, -1.0)
    length = np.linalg.norm(out.axis, axis=1)
    out.axis[length == 0] = (0.0, 0.0, 1.0)
    out.axis /= np.where(length > 0, length, 1.0)[:, None]
    return out


def build_light_tree(bounds: Bounds, endless: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes (records LightNode, the root first) over n lights with a place and lights without one, of which `endless`
    holds the weights; `share` is the probability of the latter.

    Returns nodes, trails of the lights with a place and of those without, uint32: three bits a level, those of the root
    lowest. Leaves hold the place of a light among those with one, or n + its place among those without.
    """
    near, far = len(bounds.intensity), len(endless)
    both = bool(near and far)
    far_nodes, far_trails = _endless_nodes(endless, near) if far else (_empty_nodes(0), np.zeros(0, np.uint32))
    near_nodes, near_trails = _near_nodes(bounds) if near else (_empty_nodes(0), np.zeros(0, np.uint32))
    if not both:
        return np.concatenate([far_nodes, near_nodes]), near_trails, far_trails
    share = min(max(share, LEAST_SHARE), 1 - LEAST_SHARE)
    root = _empty_nodes(1)
    root["share"][0] = (share, 1 - share, *[0.0] * (LANES - 2))
    root["child"][0, :2] = 1, 1 + len(far_nodes)
    for nodes, shift in ((far_nodes, 1), (near_nodes, 1 + len(far_nodes))):
        inner = nodes["child"] < LEAF
        nodes["child"][inner] += np.uint32(shift)
    return np.concatenate([root, far_nodes, near_nodes]), near_trails << np.uint32(3) | np.uint32(1), far_trails << 3


def _empty_nodes(count: int) -> np.ndarray:
    """Nodes whose lanes are picked by nothing."""
    nodes = np.zeros(count, RECORDS["LightNode"].dtype)
    nodes["share"] = -1.0
    nodes["child"] = LEAF
    nodes["radius"], nodes["cos_o"] = 1.0, -1.0
    return nodes


def _endless_nodes(weights: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Eight to a node, by fixed shares, until all lights are told."""
    lights = np.arange(len(weights))
    trails, levels = np.zeros(len(weights), np.uint32), []
    children, weight = (LEAF | (first + lights)).astype(np.uint32), weights.astype(float)
    of_light, bits = lights.copy(), []
    while True:
        count = -(-len(weight) // LANES)
        bits.append(of_light % LANES)
        of_light = of_light // LANES
        nodes = _empty_nodes(count)
        padded = np.zeros(count * LANES)
        padded[: len(weight)] = weight
        sums = padded.reshape(count, LANES).sum(axis=1)
        nodes["share"] = padded.reshape(count, LANES) / np.where(sums > 0, sums, 1)[:, None]
        below = np.full(count * LANES, LEAF, np.uint32)
        below[: len(children)] = children
        nodes["child"] = below.reshape(count, LANES)
        levels.append(nodes)
        if count == 1:
            break
        children, weight = np.arange(count, dtype=np.uint32), sums
    firsts = np.cumsum([0, *(len(nodes) for nodes in levels[::-1])])[::-1][1:]
    for nodes, first_below in zip(levels[1:], firsts[:-1], strict=True):
        nodes["child"][nodes["child"] < TWO_SIDED] += np.uint32(first_below)
    for depth, lane in enumerate(bits[::-1]):
        trails |= (lane << 3 * depth).astype(np.uint32)
    return np.concatenate(levels[::-1]), trails


def _near_nodes(bounds: Bounds) -> tuple[np.ndarray, np.ndarray]:
    """Splits all nodes of a level at once into two, joins bounds from the leaves up, and takes three levels as one."""
    count = len(bounds.intensity)
    order, total = np.arange(count), 2 * count - 1
    first_child, light = np.full(total, -1), np.full(total, -1)
    starts, sizes, ids, used = np.array([0]), np.array([count]), np.array([0]), 1
    levels = []
    while len(ids):
        leaf = sizes == 1
        light[ids[leaf]] = order[starts[leaf]]
        starts, sizes, ids = starts[~leaf], sizes[~leaf], ids[~leaf]
        _sort_segments(bounds, order, starts, sizes)
        first_child[ids] = used + 2 * np.arange(len(ids))
        used += 2 * len(ids)
        levels.append(ids)
        halves = (sizes + 1) // 2
        starts = np.stack([starts, starts + halves], 1).ravel()
        sizes = np.stack([halves, sizes - halves], 1).ravel()
        ids = np.stack([first_child[ids], first_child[ids] + 1], 1).ravel()
    whole = Bounds.empty(total)
    leaves = np.nonzero(light >= 0)[0]
    whole.put(leaves, bounds.take(light[leaves]))
    for parents in reversed(levels):
        whole.put(parents, join(whole.take(first_child[parents]), whole.take(first_child[parents] + 1)))
    return _widened(whole, first_child, light, count)


def _sort_segments(bounds: Bounds, order: np.ndarray, starts: np.ndarray, sizes: np.ndarray) -> None:
    """Sorts each segment of `order` along the longest side of the box around the centres of its lights."""
    if not len(starts):
        return
    segment = np.repeat(np.arange(len(starts)), sizes)
    first = np.cumsum(sizes) - sizes
    places = np.repeat(starts, sizes) + np.arange(sizes.sum()) - np.repeat(first, sizes)
    members = order[places]
    centers = (bounds.low[members] + bounds.high[members]) / 2
    extent = np.maximum.reduceat(centers, first) - np.minimum.reduceat(centers, first)
    key = centers[np.arange(len(members)), extent.argmax(axis=1)[segment]]
    order[places] = members[np.lexsort((key, segment))]


def _widened(
    whole: Bounds, first_child: np.ndarray, light: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of eight lanes, level by level, out of a tree of pairs; trails of the lights."""
    frontier, ways = np.array([0]), np.zeros(1, np.uint32)
    trails, parts, used, depth = np.zeros(count, np.uint32), [], 0, 0
    while len(frontier):
        lanes = frontier[:, None]
        for _ in range(3):
            inner = (lanes >= 0) & (first_child[lanes] >= 0)
            first, second = np.where(inner, first_child[lanes], lanes), np.where(inner, first_child[lanes] + 1, -1)
            lanes = np.stack([first, second], 2).reshape(len(frontier), -1)
        nodes = _lane_bounds(whole, lanes)
        used += len(frontier)
        inner = (lanes >= 0) & (first_child[lanes] >= 0)
        leaf = (lanes >= 0) & ~inner
        nodes["child"][inner] = used + np.arange(inner.sum())
        nodes["child"][leaf] = LEAF | light[lanes[leaf]]
        nodes["child"][(lanes >= 0) & whole.both[lanes]] |= np.uint32(TWO_SIDED)
        along = ways[:, None] | (np.arange(LANES, dtype=np.uint32) << np.uint32(3 * depth))
        trails[light[lanes[leaf]]] = along[leaf]
        frontier, ways, depth = lanes[inner], along[inner], depth + 1
        parts.append(nodes)
    return np.concatenate(parts), trails


def join(a: Bounds, b: Bounds) -> Bounds:
    """Bounds of pairs. Cones: the smallest around both (the union of 4.1.2 in the paper)."""
    swap = a.cos_o > b.cos_o
    wide_o, thin_o = (np.arccos(np.clip(np.where(swap, x.cos_o, y.cos_o), -1, 1)) for x, y in ((b, a), (a, b)))
    wide = np.where(swap[:, None], b.axis, a.axis)
    thin = np.where(swap[:, None], a.axis, b.axis)
    between = np.arccos(np.clip(np.sum(wide * thin, axis=1), -1, 1))
    inside = np.minimum(between + thin_o, np.pi) <= wide_o
    angle = np.where(inside, wide_o, (wide_o + between + thin_o) / 2)
    turn = angle - wide_o
    across = thin - wide * np.sum(wide * thin, axis=1)[:, None]
    length = np.linalg.norm(across, axis=1)
    unclear = ~inside & (length < 1e-9) & (between > 1)  # opposite ways
    side = across / np.maximum(length, 1e-30)[:, None]
    axis = np.where(inside[:, None], wide, wide * np.cos(turn)[:, None] + side * np.sin(turn)[:, None])
    whole = unclear | (angle >= np.pi)
    axis = np.where(whole[:, None], wide, axis)
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    return Bounds(
        np.minimum(a.low, b.low), np.maximum(a.high, b.high), axis, np.where(whole, -1.0, np.cos(angle)),
        np.minimum(a.cos_e, b.cos_e), a.intensity + b.intensity, a.both | b.both,
    )  # fmt: skip


def _lane_bounds(whole: Bounds, lanes: np.ndarray) -> np.ndarray:
    """Records with the bounds of `lanes` (n, 8), nodes of the tree of pairs or -1; rounded outwards."""
    nodes, there = _empty_nodes(len(lanes)), lanes >= 0
    of = whole.take(lanes[there])
    middle, half = (of.low + of.high) / 2, np.linalg.norm(of.high - of.low, axis=1) / 2
    size = np.maximum(np.abs(of.low), np.abs(of.high)).max(axis=1)
    for k, axis in enumerate("xyz"):
        nodes[axis][there], nodes[f"axis_{axis}"][there] = middle[:, k], of.axis[:, k]
    nodes["radius"][there] = half * (1 + 1e-5) + size * 1e-6
    nodes["intensity"][there] = of.intensity
    nodes["cos_o"][there] = np.maximum(of.cos_o - 1e-5, -1.0)
    nodes["cos_e"][there] = of.cos_e - 1e-5
    return nodes
