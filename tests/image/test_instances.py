"""Whole renders with instances: the picture of their copies, in the memory of one, and edits that rebuild little."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from instance_cases import ball
from raytide.accel import Forest, build_tree
from raytide.device import Device
from raytide.image import write_exr
from raytide.kernels.records import RECORDS
from raytide.render.pack import features_of, pack
from raytide.scene.flatten import FlatInstance


def garden(smooth: bool = False) -> rt.Scene:
    """A prototype that is seen itself, and four instances of other materials, in the light of a lamp and a sky."""
    scene = rt.Scene(rt.Camera(origin=(0, 3, 12), target=(0, 0, 0), fov=45, size=(40, 28)))
    scene.add(rt.sky(0.7), name="sky")
    scene.add(rt.plane((0, -1.5, 0)), rt.Diffuse(0.6), name="floor")
    scene.add(rt.rect((0, 6, 0), (1, 0, 0), (0, 0, 1)), rt.Emit(10), name="lamp")
    scene.add(ball(9, 12, smooth), rt.Diffuse((0.8, 0.4, 0.3)), name="a")
    scene.add(rt.instance("a").scale((1, 0.5, 2)).rotate((1, 1, 0), 40).translate(3, 0, 0), name="b")
    scene.add(rt.instance("a").scale((-1, 1, 1)).rotate("x", 70).translate(-3, 0, 0), rt.Mirror(0.9), name="c")
    scene.add(rt.instance("a").scale(0.3).translate(0, 0, 3), rt.Glossy(0.5, specular=0.5), name="d")
    scene.add(rt.instance("a").scale(0.8).translate(1, 1.5, -3), rt.Dielectric(1.5), name="e")
    return scene


class Copied(rt.Scene):
    """A scene that never shares a mesh."""

    def flatten(self, *, share: bool = True) -> rt.scene.flatten.FlatScene:  # type: ignore[name-defined]
        return super().flatten(share=False)


def picture(device: Device, scene: rt.Scene, **settings: object) -> np.ndarray:
    with rt.Renderer(scene, device, spp=4, max_depth=5, **settings) as renderer:
        film = renderer.render()
        assert renderer.health() == {"non_finite": 0, "negative": 0}
        return film.rgb


@pytest.mark.parametrize("smooth", [False, True])
def test_instances_give_the_picture_of_their_copies_whatever_the_traversal(device: Device, smooth: bool) -> None:
    """The same random numbers lead along the same paths, but for a few that rounding parts at an edge."""
    shared = garden(smooth)
    copied = Copied(shared.camera)
    copied.materials, copied.objects, copied.lights = shared.materials, shared.objects, shared.lights
    single = picture(device, shared, traversal="single")
    ways = [{"traversal": "packet"}, {"bvh": "lbvh"}, {"memory": 60_000}]
    for how in ways + ([] if smooth else [{"bvh": "none"}, {"everything": True}]):
        assert np.array_equal(picture(device, shared, **how), single), how
    other = picture(device, copied)
    parted = np.abs(other - single).max(axis=-1) > 1e-4 * (1 + single.max(axis=-1))
    assert parted.mean() < 0.01
    assert other.mean() == pytest.approx(single.mean(), rel=2e-3)


def sheets(path: Path) -> rt.Scene:
    """Instances of a wavy sheet with texture coordinates: bumps on a stretched one, brushed metal on a mirrored one."""
    x, z = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9))
    corner = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    halves = [(corner, corner + 9, corner + 1), (corner + 9, corner + 10, corner + 1)]
    faces = np.concatenate([np.stack(half, 1) for half in halves])
    points = np.stack([x, 0.1 * np.sin(3 * x + z), z], axis=-1).reshape(-1, 3)
    u, v = (np.arange(16) + 0.5) / 16, (np.arange(16)[:, None] + 0.5) / 16
    heights = (0.5 + 0.25 * np.sin(2 * np.pi * (u + 2 * v)) * np.cos(2 * np.pi * v)).astype(np.float32)
    write_exr(path / "h.exr", {"beauty": np.repeat(heights[..., None], 3, axis=2)})
    scene = rt.Scene(rt.Camera(origin=(0, 5, 7), target=(0, 0, 0), fov=40, size=(32, 24)))
    scene.add(rt.bitmap(str(path / "h.exr")), name="heights")
    scene.add(rt.sky(0.5), name="sky")
    scene.add(rt.point((1, 4, -1), 40), name="lamp")
    scene.add(rt.mesh(vertices=points, faces=faces, uv=(points[:, [0, 2]] + 1) / 2), rt.Diffuse(0.5), name="a")
    place = rt.instance("a").scale((2, 0.7, 0.8)).rotate((1, 1, 0), 35).translate(-1.6, 0.4, 0)
    scene.add(place, rt.Diffuse(0.8, bump_map="heights", bump_scale=0.4), name="bumps")
    place = rt.instance("a").scale((-1, 1, 1.5)).rotate("y", 25).translate(1.8, 0.6, 0)
    scene.add(place, rt.RoughConductor("silver", roughness_u=0.08, roughness_v=0.4), name="brushed")
    return scene


def test_relief_and_stretched_facets_follow_an_instance_as_they_do_its_copy(device: Device, tmp_path: Path) -> None:
    shared = sheets(tmp_path)
    copied = Copied(shared.camera)
    for part in ("textures", "materials", "objects", "lights"):
        setattr(copied, part, getattr(shared, part))
    assert len(shared.flatten().instances) > 1 and not copied.flatten().instances
    one, other = picture(device, shared), picture(device, copied)
    parted = np.abs(one - other).max(axis=-1) > 2e-3 * (1 + one.max(axis=-1))
    assert parted.mean() < 0.01
    assert other.mean() == pytest.approx(one.mean(), rel=2e-3)
    for name, key, value in (("bumps", "bump_scale", 0.0), ("brushed", "roughness_u", 0.4)):
        setattr(shared[name].material, key, value)
        plain = picture(device, shared)
        assert np.abs(one - plain).max() > 0.1, name  # it shows
        one = plain


def test_layers_name_the_instance_not_its_object(device: Device) -> None:
    with rt.Renderer(garden(), device, spp=1) as renderer:
        layers = renderer.render().layers()
    ids = np.unique(layers["object_id"])
    names = [list(garden().objects)[number - 1] for number in ids if number]
    assert {"a", "b", "c", "d", "e", "floor"} <= {*names}


def test_moving_an_instance_keeps_the_tree_of_its_mesh_and_all_programs(device: Device) -> None:
    scene = garden()
    with rt.Renderer(scene, device, spp=2) as renderer:
        renderer.render()
        forest, programs = renderer.forest, renderer.programs
        scene["b"].transform = [{"translate": [2, 1, 0]}]
        renderer.update()
        moved = renderer.render().rgb
        assert renderer.forest.meshes[0] is forest.meshes[0]
        assert renderer.forest.world is not forest.world
        assert all(renderer.programs[name] is program for name, program in programs.items())
    with rt.Renderer(scene, device, spp=2) as renderer:
        assert np.array_equal(renderer.render().rgb, moved)


def test_a_hundred_thousand_instances_take_the_memory_of_their_records(device: Device) -> None:
    """A mesh of 10 thousand triangles: 300 bytes an instance, against half a gigabyte for 1000 copies."""
    scene = rt.Scene(rt.Camera(origin=(0, 0, 900), target=(0, 0, 0)))
    scene.add(ball(70, 72), rt.Diffuse(), name="a")
    scene.add(rt.instance("a"), name="b")
    flat = scene.flatten()
    triangles = len(flat.meshes[0].triangles)
    assert triangles > 9_900
    rng = np.random.default_rng(1)

    def size(count: int) -> int:
        places = []
        for place in rng.normal(size=(count, 3)) * 100:
            matrix = np.diag((0.3, 0.5, 0.4, 1.0))
            matrix[:3, 3] = place
            places.append(FlatInstance(1, 0, matrix))
        many = replace(flat, instances=places)
        packed = pack(many, features_of(many))
        trees = [build_tree(part, "lbvh", device) for part in (packed.geometry, packed.meshes[0].geometry)]
        return packed.nbytes + Forest(trees[0], trees[1:]).stats.bytes

    one, many = size(1), size(100_000)
    assert one < 120 * triangles
    assert many - one < 300 * 100_000
    assert RECORDS["Shape"].size == 128


def test_ids_beyond_32_bits_are_refused_with_both_numbers() -> None:
    scene = rt.Scene(rt.Camera(origin=(0, 0, 9), target=(0, 0, 0)))
    scene.add(ball(70, 72), rt.Diffuse(), name="a")
    scene.add(rt.instance("a"), name="b")
    flat = scene.flatten()
    many = replace(flat, instances=[flat.instances[0]] * 440_000)
    with pytest.raises(rt.UsageError, match=r"instances show 4\d{9} triangles; at most 4294\d{6} can be told apart"):
        pack(many, features_of(many))
