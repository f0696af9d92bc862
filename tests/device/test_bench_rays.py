"""The ray suite on every device: it agrees with itself and with Embree, and its report tells everything."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from oracles_geometry import ring_sphere
from raytide.accel import FlatGeometry
from raytide.bench.show import rays_tables
from raytide.cli.main import main
from raytide.device import Device
from raytide.kernels.records import NONE
from raytide.report import ray_suite
from raytide.report.ray_room import room_scene
from raytide.report.ray_scenes import RayScene, blob_scene, terrain_scene
from raytide.report.ray_sets import SETS, RaySet, make_ray_sets, ray_records
from raytide.report.ray_suite import Plan
from raytide.report.ray_tracer import RayTracer, geometry_of

SMALL = {
    "blob": lambda: blob_scene(15),
    "terrain": lambda: terrain_scene(3000, spheres=5, splits=3),
    "room": lambda: room_scene(0.01),
}
TINY = Plan(
    size=64, values=2, value_s=0.01, limit_s=1e9, scaling_sizes=(10, 1000, 3000), scaling_pixels=64, forced_most=1000
)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_suite, "SCENES", SMALL)
    monkeypatch.setattr(ray_suite, "QUICK", TINY)


@pytest.mark.parametrize("name", SMALL)
def test_the_shadow_kernel_and_the_closest_hit_agree_on_what_is_in_between(device: Device, name: str) -> None:
    scene: RayScene = SMALL[name]()
    tracer = RayTracer(device, geometry_of(scene))
    sets = make_ray_sets(scene, 128, tracer.closest)
    rays = sets["shadt"].rays
    tracer.load(sets["shadt"])
    occluded = tracer.occluded()
    assert 0.0 < occluded.mean() < 1.0
    assert np.array_equal(occluded, tracer.closest(rays)["prim"] != NONE)
    assert np.array_equal(occluded, tracer.occluded()), "the same rays again, now as a set of closest hits"


def test_the_plain_test_meets_what_the_watertight_one_meets_but_leaks(device: Device) -> None:
    """Plain traversal exists to be compared with: nearly the same answers on a scene, holes at aimed vertices."""
    scene = SMALL["blob"]()
    sound, plain = (RayTracer(device, geometry_of(scene), traversal=name) for name in ("single", "plain"))
    rays = make_ray_sets(scene, 128, sound.closest)["diff"].rays
    ours, theirs = sound.closest(rays), plain.closest(rays)
    assert np.mean(ours["prim"] != theirs["prim"]) < 1e-3 and np.mean(ours["prim"] != NONE) > 0.5
    same = (ours["prim"] == theirs["prim"]) & (ours["prim"] != NONE)
    assert np.median(np.abs(theirs["t"][same] / ours["t"][same] - 1)) < 1e-6
    ball = ring_sphere(60, 40)
    rng = np.random.default_rng(61)
    origin = np.float32(rng.normal(size=(50_000, 3)) * 0.2)
    aimed = ray_records(origin, ball.corners[rng.integers(len(ball.triangles), size=50_000), 0] - origin, 1e30)
    geometry = FlatGeometry(ball.vertices, ball.triangles)
    missed = {
        name: np.count_nonzero(RayTracer(device, geometry, traversal=name).closest(aimed)["prim"] == NONE)
        for name in ("single", "plain")
    }
    assert missed["single"] == 0 and missed["plain"] > 100


def test_brute_force_gives_the_same_bits(device: Device) -> None:
    scene = SMALL["room"]()
    *trees, by_force = (RayTracer(device, geometry_of(scene), name) for name in ("sah", "sah-hq", "lbvh", "none"))
    rays = make_ray_sets(scene, 64, by_force.closest)["difft"].rays
    for by_tree in trees:
        assert by_tree.closest(rays).tobytes() == by_force.closest(rays).tobytes(), by_tree.tree.stats.builder


def test_mirrored_rays_leave_as_steeply_as_camera_rays_came_and_on_the_same_side(device: Device) -> None:
    """The law of reflection by facts of its own: with the normal n of the triangle that was met, incoming i and
    outgoing o, o + i lies in the surface, o - i along n, and o points away from it."""
    scene = SMALL["blob"]()
    tracer = RayTracer(device, geometry_of(scene))
    sets = make_ray_sets(scene, 64, tracer.closest)
    for first, second in (("prim", "refl"), ("primt", "reflt")):
        camera, mirror = sets[first].rays, sets[second].rays
        hits = tracer.closest(camera)
        assert (hits["prim"] != NONE).all(), "a closed box"
        corners = scene.vertices[scene.triangles[hits["prim"]]].astype(np.float64)
        edges = corners[:, 1:] - corners[:, :1]
        incoming, outgoing = (rays["direction"][:, :3].astype(np.float64) for rays in (camera, mirror))
        inside = np.linalg.det(np.stack((outgoing + incoming, edges[:, 0], edges[:, 1]), axis=1))
        size = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        assert np.abs(inside / size).max() < 1e-5, "no part of the sum leaves the surface"
        across = ((outgoing - incoming)[:, None] * edges).sum(axis=2) / np.linalg.norm(edges, axis=2)
        assert np.abs(across).max() < 1e-5, "no part of the difference lies in it"
        moved = mirror["origin"][:, :3] - (camera["origin"][:, :3] + hits["t"][:, None] * incoming)
        assert ((moved * outgoing).sum(axis=1) > -2e-6).all() and np.linalg.norm(moved, axis=1).max() < 1e-3
        assert not sets[second].any_hit and np.mean(tracer.closest(mirror)["prim"] != NONE) > 0.99


def test_the_suite_reports_every_set_with_clocks_hashes_and_spread(device: Device, small: None) -> None:
    result = ray_suite.run_suite(device, TINY, lambda line: None)
    text = rays_tables(result)
    assert result["device"]["id"] == device.info.id and result["device"]["options"] and result["device"]["probes"]
    for name, scene in result["scenes"].items():
        assert scene["status"] == "ok" and tuple(scene["sets"]) == SETS and name in text
        for one in scene["sets"].values():
            assert one["rays"] == 64 * 64 and len(one["workload_sha256"]) == 64
            assert ("processor" in one["rays_per_s"]) == (device.info.type == "cpu")
            for rate in one["rays_per_s"].values():
                assert 0 < rate["min"] <= rate["median"] <= rate["max"] and len(rate["values"]) == rate["n"] >= 2
    assert len({one["workload_sha256"] for scene in result["scenes"].values() for one in scene["sets"].values()}) == 24
    assert [row["triangles"] for row in result["scaling"]["rows"]] == [8, 968, 3042]
    assert result["brute_force"]["same_bits"] and len(result["brute_force"]["rows"]) == 2


def test_a_suite_out_of_time_says_what_it_left_out(device: Device, small: None) -> None:
    late = Plan(**{**vars(TINY), "limit_s": -1.0})
    result = ray_suite.run_suite(device, late, lambda line: None)
    assert all(scene["status"] == "skipped" for scene in result["scenes"].values())
    assert len(result["scaling"]["skipped"]) == 3 and not result["scaling"]["rows"]


def test_an_unknown_traversal_lists_the_known_ones(device: Device, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--traversal", "psychic", "--device", device.info.id]) == 2
    assert "'psychic'; wanted one of single" in capsys.readouterr().err


@pytest.mark.parametrize("name", SMALL)
def test_hits_agree_with_embree_where_it_is_installed(
    device: Device, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from raytide.errors import UsageError

    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[2] / "tools"))
    monkeypatch.delitem(sys.modules, "embree_library", raising=False)
    import embree_library

    try:
        library = embree_library.load_embree()
    except UsageError as missing:
        pytest.skip(str(missing))
    scene = SMALL[name]()
    geometry = geometry_of(scene)
    tracer = RayTracer(device, geometry)
    world = embree_library.EmbreeScene(library, geometry.vertices, geometry.triangles, threads=1)
    world.build("MEDIUM", robust=True)
    for rays in make_ray_sets(scene, 256, tracer.closest).values():
        for width, coherent in ((1, False), (16, False), (16, True)):
            hits = embree_library.hit_records(len(rays.rays))
            world.trace(rays.rays, hits, width, rays.any_hit, coherent)
            check_agreement(tracer, rays, hits)
    world.close()


def check_agreement(tracer: RayTracer, rays: RaySet, hits: np.ndarray) -> None:
    """The limits of tools/compare_embree.py, with two rays' grace since there are few."""
    count = len(hits)
    tracer.load(rays)
    if rays.any_hit:
        assert np.count_nonzero((hits["t"] < 0) != tracer.occluded()) <= 2 + 2e-5 * count
        return
    ours = tracer.closest(rays.rays)
    met = ours["prim"] != NONE
    assert np.count_nonzero(met != (hits["prim"] != NONE)) <= 2 + 2e-5 * count
    far = met & (np.abs(ours["t"] - hits["t"]) > 1e-4 * np.abs(hits["t"]))
    assert np.count_nonzero(far) <= 2 + 5e-4 * count
