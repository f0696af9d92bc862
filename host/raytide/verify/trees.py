"""Building trees: few and equal primitives, degenerate extents, boxes that hold what is in them, the same bytes (U)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from raytide.accel import FlatGeometry, build_tree
from raytide.accel.limits import max_depth
from raytide.accel.tree import LEAF_BIT, Tree, node_boxes
from raytide.importers.limits import MOST_TRIANGLES
from raytide.importers.meshdata import MeshData
from raytide.kernels.records import NONE
from raytide.verify.case import Inputs, Judged, Trial, bounded, case, forbidden, once
from raytide.verify.host import outcome
from raytide.verify.lab import Lab, f4, flat, plane_record, rays_of, unit_vectors

BUILDERS = ("sah", "sah-hq", "lbvh")


def soup(rng: np.random.Generator, count: int, size: float = 0.05) -> FlatGeometry:
    """Random triangles in a unit cube."""
    corners = rng.random((count, 1, 3)) + rng.normal(size=(count, 3, 3)) * size
    return flat(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def unheld(tree: Tree, geometry: FlatGeometry) -> int:
    """How many lanes do not hold what is below them, how many triangles no leaf has; exact comparisons."""
    nodes, blocks = tree.nodes, tree.blocks
    low, high = node_boxes(nodes)
    child, filled = nodes["child"], nodes["child"] != NONE
    leaf = filled & ((child & LEAF_BIT) != 0)
    inner = filled & ~leaf
    own_low, own_high = (np.where(filled[..., None], x, end) for x, end in ((low, np.inf), (high, -np.inf)))
    total = (own_low.min(1), own_high.max(1))  # of each node
    wrong = 0
    rows, lanes = np.nonzero(inner)
    below = child[rows, lanes]
    wrong += int(((low[rows, lanes] > total[0][below]) | (high[rows, lanes] < total[1][below])).any(1).sum())
    rows, lanes = np.nonzero(leaf)
    block = (child[rows, lanes] & np.uint32(0x3FFFFFFF)) >> 3
    prims = blocks["prim"][block]
    corners = geometry.vertices[geometry.triangles[np.where(prims == NONE, prims[:, :1], prims), :3], :3]
    wrong += int(((low[rows, lanes] > corners.min((1, 2))) | (high[rows, lanes] < corners.max((1, 2)))).any(1).sum())
    found = np.unique(prims[prims != NONE])
    return wrong + len(geometry.triangles) - len(found)


@case("U1", "bvh", "trees of 0, 1, 2 and 3 triangles, and of planes alone, by every builder", "as brute force",
      "builders of the Karras kind need two")  # fmt: skip
def few(lab: Lab) -> Iterator[Trial]:
    def judge(geometry: FlatGeometry, builder: str, inputs: Inputs) -> Judged:
        rays = rays_of(inputs["origin"], inputs["direction"])
        (one, one_met), (two, two_met) = (lab.tracer(geometry, by).trace(rays) for by in (builder, "none"))
        wrong = (one.view(np.uint32).reshape(-1, 4) != two.view(np.uint32).reshape(-1, 4)).any(1) | (one_met != two_met)
        return Judged(forbidden(wrong), {"met": f"{one_met.mean():.0%}"})

    ground = plane_record((0.5, 0.5, 0.5), (0, 1, 0))
    for count in (0, 1, 2, 3):
        rng, n = lab.rng(801), lab.count(2_000, 50_000)
        bare = soup(rng, count, 0.3)
        origin = f4(0.5 + unit_vectors(rng, n) * 3)
        inputs = {"origin": origin, "direction": f4(rng.random((n, 3)) - origin)}
        for name, planes in (("", 0), (" and a plane", 1)):
            geometry = FlatGeometry(bare.vertices, bare.triangles, ground[:planes], planes)
            for builder in BUILDERS:
                yield Trial(f"{count}{name}, {builder}", inputs, partial(judge, geometry, builder))


@case("U2", "bvh", "100,000 identical triangles", "depth within the stack; the lowest id met; full: at most 3 times as "
      "long to build as random ones", "depth grows with the number where codes tie")  # fmt: skip
def identical(lab: Lab) -> Iterator[Trial]:
    count = 100_000
    geometry = flat([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.tile([[0, 1, 2]], (count, 1)))

    def seconds(of: FlatGeometry, builder: str) -> float:
        build_tree(of, builder, lab.device)
        start = lab.seconds()
        build_tree(of, builder, lab.device)
        return lab.seconds() - start

    def judge(builder: str) -> Judged:
        tree = build_tree(geometry, builder, lab.device)
        hits, _ = lab.tracer(geometry, builder).trace(rays_of(f4([[0.2, 0.2, 1]]), f4([[0, 0, -1]])))
        whole = {"the lowest id": hits["prim"][0] == 0, "stack": tree.stats.depth <= max_depth()}
        figures: dict[str, Any] = {"depth": tree.stats.depth}
        if lab.full:
            ratio = seconds(geometry, builder) / seconds(soup(lab.rng(802), count), builder)
            figures, whole = figures | {"time / random": f"{ratio:.2f}"}, whole | {"3 times": ratio <= 3}
        return Judged(np.array([tree.stats.depth / 64]), figures, whole)

    for builder in BUILDERS:
        yield once(builder, partial(judge, builder))


@case("U3", "bvh", "triangles on a line, in a plane, in one point", "no NaN in the boxes, which hold everything",
      "0/0 in the codes")  # fmt: skip
def flat_extents(lab: Lab) -> Iterator[Trial]:
    def judge(spread: tuple[float, float, float], builder: str) -> Judged:
        rng, count = lab.rng(803), lab.count(3_000, 100_000)
        corners = rng.random((count, 1, 3)) * spread + rng.normal(size=(1, 3, 3)) * (np.array(spread) > 0) * 1e-3
        geometry = flat(np.broadcast_to(corners, (count, 3, 3)).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
        tree = build_tree(geometry, builder, lab.device)
        low, high = node_boxes(tree.nodes)
        wrong = unheld(tree, geometry) + int((~np.isfinite(low) | ~np.isfinite(high)).sum())
        return Judged(forbidden(np.array([wrong > 0])), {"wrong": wrong, "depth": tree.stats.depth})

    for name, spread in (("line", (1.0, 0.0, 0.0)), ("plane", (1.0, 0.0, 1.0)), ("point", (0.0, 0.0, 0.0))):
        for builder in BUILDERS:
            yield once(f"{name}, {builder}", partial(judge, spread, builder))


@case("U4", "bvh", "100,000 triangles in a unit cube and one at 1e15", "rays in the cube visit at most twice as much",
      "116 of 127 share one 10-bit code")  # fmt: skip
def one_far_away(lab: Lab) -> Iterator[Trial]:
    count = lab.count(20_000, 100_000)
    near = soup(lab.rng(804), count, 0.01)
    far = np.array([[1e15, 0, 0], [1e15, 1, 0], [1e15, 0, 1e8]])
    both = flat(np.concatenate([near.vertices[:, :3], far]), np.arange(3 * count + 3).reshape(-1, 3))

    def judge(builder: str, inputs: Inputs) -> Judged:
        rays = rays_of(inputs["origin"], inputs["direction"])
        alone, with_far = (lab.tracer(of, builder, counters=True).visits(rays).sum(1).mean() for of in (near, both))
        return Judged(bounded(np.array([with_far / alone]), 2.0), {"visits": f"{alone:.1f}, {with_far:.1f} with it"})

    rng, n = lab.rng(805), lab.count(2_000, 50_000)
    inputs = {"origin": f4(rng.random((n, 3))), "direction": f4(unit_vectors(rng, n))}
    for builder in BUILDERS:
        yield Trial(builder, inputs, partial(judge, builder))


@case("U5", "bvh", "vertices that are NaN, infinite or beyond 1.8e18 in a mesh",
      "dropped and counted exactly; the rest as if they had never been there",
      "the root's box is poisoned")  # fmt: skip
def poisoned(lab: Lab) -> Iterator[Trial]:
    def judge(inputs: Inputs) -> Judged:
        rng, count = lab.rng(806), 2_000
        corners = rng.random((count, 3, 3))
        bad = rng.random(count) < 0.1
        broken = corners.copy()
        broken[bad, rng.integers(3, size=bad.sum()), rng.integers(3, size=bad.sum())] = inputs["value"][0]
        faces = np.arange(3 * count).reshape(-1, 3)
        made = MeshData.inline(broken.reshape(-1, 3), faces)
        clean = MeshData.inline(corners.reshape(-1, 3), faces[~bad])
        told = f"dropped {bad.sum()} vertices" in made.warnings[0] and f"{bad.sum()} triangles" in made.warnings[0]
        same = np.array_equal(made.vertices[made.triangles], clean.vertices[clean.triangles])
        return Judged(forbidden(np.array([not (told and same)])), {"told": made.warnings[0]})

    for value in (np.nan, np.inf, -np.inf, 1.9e18, -1e30):
        yield Trial(f"{value:g}", {"value": np.array([value])}, judge)


@case("U6", "bvh", "boxes of a tree of 20,000 triangles (full: a million)", "each holds its children and its triangles "
      "by exact comparison; each triangle is in a leaf", "transforms round inwards")  # fmt: skip
def boxes_hold(lab: Lab) -> Iterator[Trial]:
    def judge(offset: float, builder: str) -> Judged:
        bare = soup(lab.rng(807), lab.count(20_000, 1_000_000), 0.01)
        geometry = flat(bare.vertices[:, :3].astype(np.float64) + offset, bare.triangles[:, :3])
        wrong = unheld(build_tree(geometry, builder, lab.device), geometry)
        return Judged(forbidden(np.array([wrong > 0])), {"violations": wrong})

    for offset in (0.0, 1e5):
        for builder in BUILDERS:
            yield once(f"offset {offset:g}, {builder}", partial(judge, offset, builder))


@case("U7", "bvh", "more triangles than a mesh may have: 2^26 + 1", "refused before anything is built, with the limit",
      "16777217 is 16777216 in float32")  # fmt: skip
def too_many(lab: Lab) -> Iterator[Trial]:
    def judge() -> Judged:
        view = np.broadcast_to(np.zeros((1, 3), np.int64), (MOST_TRIANGLES + 1, 3))  # one row in memory
        said = outcome(lambda: MeshData.inline(np.zeros((3, 3)), view))
        return Judged(forbidden(np.array([said != "refused"])), {"outcome": said})

    yield once("", judge)


@case("U8", "bvh", "the same build ten times", "the same bytes of nodes and leaves",
      "the order of atomics")  # fmt: skip
def same_bytes(lab: Lab) -> Iterator[Trial]:
    def judge(builder: str) -> Judged:
        geometry = soup(lab.rng(808), lab.count(5_000, 100_000))
        digests = set()
        for _ in range(lab.count(4, 10)):
            tree = build_tree(geometry, builder, lab.device)
            digests.add(hashlib.sha256(tree.nodes.tobytes() + tree.blocks.tobytes()).hexdigest())
        return Judged(forbidden(np.array([len(digests) != 1])), {"different": len(digests)})

    for builder in BUILDERS:
        yield once(builder, partial(judge, builder))
