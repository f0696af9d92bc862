"""Refit: new positions in an old tree, and when it pays no longer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import raytide as rt
from build_cases import check_tree, mixed, soup, terrain
from raytide.accel import FlatGeometry, build_tree, refit_tree, update_tree
from raytide.accel.refit import MOST_GROWTH


def test_refit_to_unmoved_geometry_gives_the_same_bytes(device):
    geometry = mixed(2500, 40)
    for builder in ("sah", "sah-hq", "lbvh"):
        tree = build_tree(geometry, builder, device)
        again = refit_tree(tree, geometry, device)
        assert again.nodes.tobytes() == tree.nodes.tobytes()
        assert again.blocks.tobytes() == tree.blocks.tobytes()
        assert again.stats.refits == 1 and again.stats.refit_s > 0
        seconds = tree.stats.kernel_build_s
        assert replace(again.stats, refits=0, refit_s=0.0, kernel_build_s=seconds) == tree.stats


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


def moved(geometry: FlatGeometry, share: float, seed: int = 0) -> FlatGeometry:
    """Every vertex shifted at random by up to `share` of the largest extent."""
    vertices = geometry.vertices.copy()
    shift = share * np.ptp(vertices[:, :3], axis=0).max()
    vertices[:, :3] += np.random.default_rng(seed).uniform(-shift, shift, (len(vertices), 3))
    return replace(geometry, vertices=vertices)


def test_a_tree_is_refitted_until_it_costs_half_as_much_again_as_when_it_was_built(device):
    geometry = terrain(60)
    tree = build_tree(geometry, "sah", device)
    refits = []
    for step in range(40):
        before, geometry = geometry, moved(geometry, 0.004, step)
        tree = update_tree(tree, before, geometry, "sah", device)
        check_tree(tree, geometry)
        assert tree.stats.sah_cost <= MOST_GROWTH * tree.stats.built_cost
        refits.append(tree.stats.refits)
    rebuilt = refits.index(0)
    assert refits[:rebuilt] == list(range(1, rebuilt + 1)) and rebuilt > 2
    fresh = build_tree(geometry, "sah", device).stats
    assert fresh.sah_cost * MOST_GROWTH * 1.2 > tree.stats.sah_cost  # so it did not get worse with every step


def test_other_primitives_and_trees_of_the_host_are_built_anew(device):
    small, large = soup(500), soup(5000)
    for before, after in ((large, soup(5001)), (large, replace(large, triangles=large.triangles[::-1].copy())),
                          (small, moved(small, 0.001)), (mixed(4000, 4), mixed(4000, 3))):  # fmt: skip
        tree = update_tree(build_tree(before, "sah", device), before, after, "sah", device)
        assert tree.stats.refits == 0
        check_tree(tree, after)


def test_the_same_edits_give_the_same_bytes(device):
    made = []
    for _ in range(2):
        geometry = terrain(40)
        tree = build_tree(geometry, "sah-hq", device)
        for step in range(3):
            before, geometry = geometry, moved(geometry, 0.001, step)
            tree = update_tree(tree, before, geometry, "sah-hq", device)
        assert tree.stats.refits == 3
        made.append(tree.nodes.tobytes() + tree.blocks.tobytes())
    assert made[0] == made[1]


def bumpy_scene() -> rt.Scene:
    made = rt.Scene(camera=rt.Camera(origin=(0, 2, 3), target=(0, 0, 0), fov=45, size=(32, 24)))
    hills = terrain(40)
    mesh = rt.mesh(vertices=hills.vertices[:, :3].astype(float), faces=hills.triangles[:, :3])
    made.add(mesh, rt.Diffuse(0.6), name="hills")
    made.add(rt.sphere((0, 0.6, 0), 0.4), rt.Mirror(0.9), name="ball")
    made.add(rt.point((2, 4, 1), intensity=40.0), name="bulb")
    return made


def spread(scene: rt.Scene) -> None:
    points = np.asarray(scene["hills"].shape.vertices)
    scene["hills"].shape = scene["hills"].shape.changed(vertices=np.random.default_rng(1).permutation(points))


EDITS = {
    "turn": (lambda scene: setattr(scene["hills"], "shape", scene["hills"].shape.rotate("y", 30)), 1),
    "ball": (lambda scene: setattr(scene["ball"], "center", (0.3, 0.8, 0.1)), 1),
    "camera": (lambda scene: setattr(scene.camera, "origin", (0.5, 2, 3)), 1),
    "spread": (spread, 0),
    "material": (lambda scene: setattr(scene["hills"].material, "reflectance", 0.2), None),
}


@pytest.mark.parametrize("name", EDITS)
def test_an_edited_scene_gives_the_picture_of_a_fresh_one_bit_for_bit(device, name):
    edit, refits = EDITS[name]
    scene = bumpy_scene()
    with rt.Renderer(scene, device, spp=4) as renderer:
        first, tree = renderer.render().rgb, renderer.forest.world
        edit(scene)
        renderer.update()
        film, stats = renderer.render().rgb, renderer.report()["tree"]
        assert (renderer.forest.world is tree) if refits is None else stats["refits"] == refits
        assert (stats["refit_s"] > 0) == (refits == 1) and stats["built_cost"] > 0
    with rt.Renderer(scene, device, spp=4) as fresh:
        assert np.array_equal(film, fresh.render().rgb)
    assert not np.array_equal(film, first)
