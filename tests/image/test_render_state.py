"""A picture is a function of its samples alone: stops, continuations, older films and odd sizes must not show."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.errors import SceneError, UsageError


def scene(size: tuple[int, int] = (24, 16)) -> rt.Scene:
    made = rt.Scene(camera=rt.Camera(origin=(0, 2, 6), target=(0, 1, 0), fov=40, size=size))
    made.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    made.add(rt.sphere((0, 1, 0), 1.0), rt.Diffuse((0.7, 0.3, 0.2)), name="ball")
    made.add(rt.rect(center=(0, 4, 0), u=(1, 0, 0), v=(0, 0, 1)), rt.Emit(6.0), name="lamp")
    made.add(rt.point((3, 5, 4), intensity=20.0), name="bulb")
    return made


@pytest.mark.parametrize("first", [1, 3, 33])
def test_rendering_in_two_steps_gives_the_bits_of_one(device: Device, first: int) -> None:
    with rt.Renderer(scene(), device) as renderer:
        whole = renderer.render(64).rgb
        renderer.restart()
        renderer.render(first)
        film = renderer.render(64)
        assert film.spp == 64 and np.all(film.samples == 64)
        assert np.array_equal(film.rgb, whole)


def test_a_stopped_render_goes_on_where_it_was(device: Device) -> None:
    with rt.Renderer(scene(), device, memory=40_000) as renderer:
        whole = renderer.render(32)
        renderer.restart()
        waves = iter(range(10**6))
        renderer._stop.is_set = lambda: next(waves) == 150  # type: ignore[method-assign]
        partial = renderer.render(32)
        assert renderer.stopped_by == "interrupt"
        assert partial.samples.min() < partial.samples.max() or partial.spp < 32
        film = renderer.render(32)
        assert renderer.stopped_by == "spp"
        assert np.array_equal(film.rgb, whole.rgb)
        assert film.error.as_dict() == whole.error.as_dict()


def test_a_stop_before_the_first_wave_is_not_lost(device: Device) -> None:
    with rt.Renderer(scene(), device) as renderer:
        renderer.stop()
        assert renderer.render(4).spp == 0 and renderer.stopped_by == "interrupt"


def test_an_older_film_stays_as_it_was(device: Device) -> None:
    with rt.Renderer(scene(), device) as renderer:
        films = list(renderer.passes(8))
        clean = {}
        for spp in (1, 2, 4, 8):
            renderer.restart()
            clean[spp] = renderer.render(spp).rgb
    assert [film.spp for film in films] == [1, 2, 4, 8]
    for film in films:
        assert np.array_equal(film.rgb, clean[film.spp])
        assert film.header()["raytide"]["spp"] == film.spp


def test_a_film_outlives_its_renderer_and_shows_itself(device: Device) -> None:
    with rt.Renderer(scene(), device, spp=4) as renderer:
        film = renderer.render()
    assert film.rgb.shape == (16, 24, 3) and film.rgb.max() > 0
    assert film._repr_png_().startswith(b"\x89PNG")
    assert film.layers(["object_id"])["object_id"].max() == 2
    with pytest.raises(UsageError, match="closed"):
        renderer.render(8)


def test_the_hash_names_the_scene_that_was_rendered_not_its_later_edits(device: Device) -> None:
    edited = scene()
    with rt.Renderer(edited, device, spp=1) as renderer:
        before = renderer.report()["scene_sha256"]
        edited["ball"].material.reflectance = 0.1
        renderer.restart()
        assert renderer.report()["scene_sha256"] == before
        renderer.update()
        assert renderer.report()["scene_sha256"] != before


def test_layers_of_a_film_from_before_an_update_are_refused(device: Device) -> None:
    edited = scene()
    with rt.Renderer(edited, device, spp=1) as renderer:
        film = renderer.render()
        edited["ball"].material.reflectance = 0.1
        renderer.update()
        with pytest.raises(UsageError, match="updated"):
            film.layers(["albedo"])


@pytest.mark.parametrize("size", [(1, 1), (3, 5), (9, 8)])
def test_rays_are_counted_without_the_padding_of_tiles(device: Device, size: tuple[int, int]) -> None:
    with rt.Renderer(scene(size), device, spp=4) as renderer:
        film = renderer.render()
        assert renderer.report()["rays"]["primary"] == 4 * size[0] * size[1]
        assert film.rgb.shape == (size[1], size[0], 3)


def test_report_before_the_first_sample_is_whole(device: Device) -> None:
    with rt.Renderer(scene(), device) as renderer:
        report = renderer.report()
        assert report["spp"] == 0 and report["rays"]["total"] == 0 and report["error"] is None


def test_wave_times_add_up_to_the_rays_they_traced(device: Device) -> None:
    with rt.Renderer(scene(), device, spp=16, memory=200_000) as renderer:
        renderer.render()
        report = renderer.report()
    for wave in ("reflection", "shadow"):
        rows = [row for name, row in report["waves"].items() if name.startswith(wave)]
        assert sum(row["rays"] for row in rows) == report["rays"][wave]
        assert all(row["s"] > 0 and row["launches"] > 0 for row in rows)


def test_a_host_that_waits_for_the_number_of_shadow_rays_gets_the_same(device: Device) -> None:
    """Launches of shadow rays that the host sizes by what the device counted, and by what there may be at most."""
    films, rays = [], []
    for observe in (None, lambda *_: None):
        with rt.Renderer(scene((64, 64)), device, spp=4, traversal="single") as renderer:
            renderer.waves.observe = observe
            films.append(renderer.render().rgb)
            rays.append({name: row["rays"] for name, row in renderer.report()["waves"].items() if "rays" in row})
    assert np.array_equal(*films)
    assert rays[0] == rays[1] and any(name.startswith("shadow") for name in rays[0])


@pytest.mark.parametrize("bad", [{"size": (0, 4)}, {"size": (2.5, 3)}, {"spp": 0}, {"spp": 2.5}, {"max_depth": "a"}])
def test_settings_are_checked_as_in_a_scene_file(device: Device, bad: dict[str, object]) -> None:
    with pytest.raises(SceneError):
        rt.Renderer(scene(), device, **bad)


def test_unknown_setting_lists_the_known_ones(device: Device) -> None:
    with pytest.raises(UsageError, match="max_depth"):
        rt.Renderer(scene(), device, max_deth=3)


def test_a_second_environment_is_refused() -> None:
    made = scene()
    made.add(rt.sky(1.0), name="day")
    made.add(rt.sky(2.0), name="night")
    with pytest.raises(SceneError, match="night.*at most one environment"):
        made.flatten()


def test_cost_of_two_renders_is_not_mixed(device: Device) -> None:
    with rt.Renderer(scene(), device) as renderer:
        first = renderer.render(16).stats
        second = renderer.render(32).stats
        assert second["seconds"] > first["seconds"] and second["rays"] > first["rays"]
        np.testing.assert_allclose(second["mrays_per_s"], second["rays"] / second["seconds"] / 1e6)
