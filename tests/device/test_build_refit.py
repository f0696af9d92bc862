"""Refit: new positions in an old tree."""

from __future__ import annotations

import numpy as np

from build_cases import check_tree, mixed
from raytide.accel import FlatGeometry, build_tree, refit_tree


def test_refit_to_unmoved_geometry_gives_the_same_bytes(device):
    geometry = mixed(2500, 40)
    for builder in ("sah", "lbvh"):
        tree = build_tree(geometry, builder, device)
        again = refit_tree(tree, geometry, device)
        assert again.nodes.tobytes() == tree.nodes.tobytes()
        assert again.blocks.tobytes() == tree.blocks.tobytes()
        assert again.stats == tree.stats


def test_refit_to_moved_geometry_obeys_the_laws_and_leaves_the_old_tree_alone(device):
    geometry = mixed(2500, 40)
    tree = build_tree(geometry, "sah", device)
    before = tree.nodes.tobytes() + tree.blocks.tobytes()
    vertices, shapes = geometry.vertices.copy(), geometry.shapes.copy()
    vertices[:, :3] = vertices[:, :3] * [2.0, 0.5, 1.0] + np.sin(9 * vertices[:, [1, 2, 0]]) + 5
    shapes["center"][:, :3] += [3.0, -2.0, 0.1]
    moved = FlatGeometry(vertices, geometry.triangles, shapes, geometry.plane_count)
    refitted = refit_tree(tree, moved, device)
    check_tree(refitted, moved)
    nodes, blocks = refitted.buffers(device)
    assert device.read(nodes, np.uint8, nodes.nbytes).tobytes() == refitted.nodes.tobytes()
    assert blocks.nbytes == refitted.blocks.nbytes
    assert tree.nodes.tobytes() + tree.blocks.tobytes() == before
