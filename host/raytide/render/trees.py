"""The trees of a scene over its edits: which of them stay, which follow their positions, which are built anew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from raytide.accel import FlatGeometry, Forest, Tree, build_tree, compact_tree, update_tree
from raytide.device import Device, Program


class Trees:
    """Trees of the world and of meshes that were built so far, with what each was built of, and how."""

    def __init__(self) -> None:
        self._kept: list[tuple[Tree, FlatGeometry, tuple[str, bool]]] = []

    def forest(
        self, parts: Sequence[FlatGeometry], builder: str, compact: bool, device: Device,
        programs: Mapping[str, Program],
    ) -> Forest:
        """Trees of `parts`, the world first. They stay while geometry, builder and layout do: that of a mesh, wherever
        its instances go. The world's follows positions while its primitives stay."""
        how = (builder, compact)
        kept = [(tree, of) for tree, of, by in self._kept if by == how]
        trees: list[Tree] = []
        for place, part in enumerate(parts):
            likely = kept[place : place + 1] + kept  # most keep their places
            tree = next((tree for tree, of in likely if _same(of, part)), None)
            if tree is None:
                before = kept[0] if kept and place == 0 else None
                tree = _new_tree(part, before, builder, compact, device, programs)
            trees.append(tree)
        self._kept = [(tree, part, how) for tree, part in zip(trees, parts, strict=True)]
        return Forest(trees[0], trees[1:])


def _new_tree(
    geometry: FlatGeometry,
    before: tuple[Tree, FlatGeometry] | None,
    builder: str,
    compact: bool,
    device: Device,
    programs: Mapping[str, Program],
) -> Tree:
    """A tree of `geometry`; `before` is one of nearly the same, in the same layout, by the same builder."""
    if compact:
        return compact_tree(build_tree(geometry, builder, device, programs=programs), geometry, device)
    if before is not None:
        return update_tree(*before, geometry, builder, device, programs)
    return build_tree(geometry, builder, device, programs=programs)


def _same(a: FlatGeometry, b: FlatGeometry) -> bool:
    """Whether two geometries are equal, byte by byte."""
    counts = (a.plane_count, a.instance_count) == (b.plane_count, b.instance_count)
    return counts and all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in ("vertices", "triangles", "shapes")
    )
