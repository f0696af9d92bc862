"""A render ends by samples, time or error, whichever comes first, and says which; how it ends shows in no pixel."""

from __future__ import annotations

from itertools import count

import numpy as np
import pytest

import raytide as rt
from fake_clock import WaveClock
from raytide.device import Device
from raytide.errors import SceneError


def scene(size: tuple[int, int] = (24, 16)) -> rt.Scene:
    made = rt.Scene(camera=rt.Camera(origin=(0, 2, 6), target=(0, 1, 0), fov=40, size=size))
    made.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    made.add(rt.sphere((0, 1, 0), 1.0), rt.Diffuse((0.7, 0.3, 0.2)), name="ball")
    made.add(rt.rect(center=(0, 4, 0), u=(1, 0, 0), v=(0, 0, 1)), rt.Emit(6.0), name="lamp")
    return made


def test_samples_time_and_error_each_end_a_render_and_are_named(device: Device) -> None:
    with rt.Renderer(scene(), device) as renderer:
        assert renderer.render(8, time=1e5, error=1e-6).spp == 8 and renderer.stopped_by == "spp"
        film = renderer.render(2**24, time=1e5, error=0.3)
        assert renderer.stopped_by == "error" and film.error.error <= 0.3 and film.spp >= 16
        before = renderer.history.rows[-1].wall_s
        film = renderer.render(2**24, time=before + 0.2, error=1e-6)
        assert renderer.stopped_by == "time"
        report = renderer.report()
    assert report["stopped_by"] == "time" and report["limits"] == {"spp": None, "time": before + 0.2, "error": 1e-6}


def test_time_is_kept_to_a_wave_and_the_rest_of_the_pass_is_not_lost(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    WaveClock(monkeypatch, device)
    with rt.Renderer(scene((64, 48)), device, memory=2_000_000) as renderer:
        whole = renderer.render(64)
        before, end = (row.wall_s for row in renderer.history.rows[-2:])
        limit = before + 0.6 * (end - before)  # inside the last pass
        renderer.restart()
        part = renderer.render(64, time=limit)
        assert renderer.stopped_by == "time" and part.spp == 32
        assert renderer.history.rows[-2].wall_s == before  # to there it was the same render
        assert 0 <= renderer.history.rows[-1].wall_s - limit < 1  # s, a wave
        assert set(np.unique(part.samples)) == {32, 64}
        film = renderer.render(64)
        assert np.array_equal(film.rgb, whole.rgb) and film.error.relmse == whole.error.relmse


def test_a_picture_beyond_its_limits_renders_no_more(device: Device) -> None:
    with rt.Renderer(scene(), device) as renderer:
        rgb = renderer.render(32).rgb
        for limits in ({"error": 0.9}, {"time": 1e-6}):
            assert list(renderer.passes(64, **limits)) == []
            assert renderer.stopped_by == next(iter(limits)) and np.array_equal(renderer.film.rgb, rgb)


def test_samples_that_nobody_set_end_no_render_that_has_another_end(device: Device) -> None:
    made = scene()
    made.render = rt.RenderSettings(error=0.02)
    with rt.Renderer(made, device) as renderer:
        film = renderer.render()
        assert renderer.stopped_by == "error" and film.spp > 64
    with rt.Renderer(made, device, spp=8) as renderer:
        assert renderer.render().spp == 8 and renderer.stopped_by == "spp"


@pytest.mark.parametrize("limit", [{"error": 0.0}, {"error": 1.0}, {"time": -1.0}, {"time": float("nan")}])
def test_a_limit_that_a_scene_could_not_have_is_refused(device: Device, limit: dict[str, float]) -> None:
    with rt.Renderer(scene(), device) as renderer, pytest.raises(SceneError, match=next(iter(limit))):
        next(renderer.passes(4, **limit))


def test_series_tells_the_history_and_ends_with_the_report(device: Device) -> None:
    with rt.Renderer(scene(), device) as renderer:
        for _ in renderer.passes(128, watch=True):
            pass
        report = renderer.report()
    rows = report["series"]
    assert [row["spp"] for row in rows] == [1, 2, 4, 8, 16, 32, 64, 128]
    for key in ("wall_s", "device_s", "rays"):
        values = [row[key] for row in rows]
        assert values == sorted(values) and values[0] > 0
    assert all(row["device_s"] <= row["wall_s"] * 1.01 for row in rows)
    assert rows[-1]["rays"] == report["rays"]["total"]
    assert rows[-1]["relmse"] == report["error"]["relmse"]
    assert rows[-1]["relmse_low"] < rows[-1]["relmse"] < rows[-1]["relmse_high"]
    assert rows[0]["relmse"] is None


def test_nobody_pays_for_an_error_that_nobody_asked_for(device: Device) -> None:
    with rt.Renderer(scene(), device) as renderer:
        renderer.render(64)
        assert renderer.history.error is None and renderer.history.cost_s == 0.0
        assert renderer.report()["series"][-1]["relmse"] is not None


def test_error_of_a_stopped_pass_counts_the_samples_that_each_pixel_has(device: Device) -> None:
    """Pixels that went on to the next power of four keep the error that they had there."""
    with rt.Renderer(scene((64, 64)), device, memory=100_000) as renderer:
        shared = {32: renderer.render(32).error.variance}
        polls = count()
        renderer._stop.is_set = lambda: next(polls) < 0  # type: ignore[method-assign]
        shared[64] = renderer.render(64).error.variance
        most = 3 * next(polls) // 4
        renderer.restart()
        renderer.render(32)
        polls = count()
        renderer._stop.is_set = lambda: next(polls) >= most  # type: ignore[method-assign]
        part = renderer.render(64)
    done = part.samples == 64
    assert part.spp == 32 and 0 < done.sum() < done.size
    inner = np.zeros_like(done)
    inner[1:-1, 1:-1] = np.all([done[1 + y : 63 + y, 1 + x : 63 + x] for y in (-1, 0, 1) for x in (-1, 0, 1)], axis=0)
    lit = inner & (shared[64].min(axis=2) > 0)
    ratio = part.error.variance[lit] / shared[64][lit]
    assert np.median(ratio) == pytest.approx(1.0, rel=0.3)
    assert part.error.relmse < 1.05 * float(renderer_mean(shared[32], part))


def renderer_mean(variance: np.ndarray, film: rt.Film) -> float:
    rgb = film.rgb.astype(np.float64)
    return float(np.mean(variance / (rgb**2 + (0.01 * rgb.mean()) ** 2)))
