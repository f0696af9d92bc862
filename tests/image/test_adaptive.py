"""Adaptive pictures: pixels are those of plain renders with their numbers of samples, unbiased, nearer to the truth."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.errors import UsageError

SIZE = (40, 28)
WINDOW = (3, 5, 30, 21)  # of the picture: no tile of it begins or ends where one of the whole picture does
Pair = tuple[rt.Renderer, rt.Renderer]  # plain, adaptive


def scene() -> rt.Scene:
    """Sky and an open floor with little noise, and a corner under a small lamp with much."""
    made = rt.Scene(camera=rt.Camera(origin=(0, 2, 7), target=(0, 1, 0), fov=40, size=SIZE))
    made.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    made.add(rt.box((0.5, 0, -1), (2.5, 2, 1)), rt.Diffuse((0.7, 0.3, 0.2)), name="block")
    made.add(rt.sphere((2.2, 2.4, 1.6), 0.1), rt.Emit(60.0), name="lamp")
    made.add(rt.sky((0.4, 0.5, 0.6)), name="sky")
    return made


@pytest.fixture(scope="module")
def opened(device: Device) -> Iterator[Pair]:
    with rt.Renderer(scene(), device) as plain, rt.Renderer(scene(), device, adaptive=True, memory=300_000) as adaptive:
        yield plain, adaptive


def test_every_pixel_is_that_of_a_plain_render_with_its_number_of_samples(opened: Pair) -> None:
    plain, adaptive = opened
    adaptive.restart(seed=0)
    plain.restart(seed=0)
    film = adaptive.render(128)
    counts, many = np.unique(film.samples, return_counts=True)
    assert counts.min() >= 32 and counts.max() > 160 and film.samples.mean() == pytest.approx(128, rel=0.01)
    for count in sorted(counts[np.argsort(many)[-5:]]):
        one, here = plain.render(int(count)), film.samples == count
        assert np.array_equal(one.rgb[here], film.rgb[here])
        assert np.array_equal(one.data.differences[here], film.data.differences[here])
    report = adaptive.report()
    assert report["adaptive"]["least"] == counts.min() and report["adaptive"]["gain"] > 1.2
    assert report["rays"]["primary"] == film.samples.sum()


def test_a_stopped_adaptive_render_goes_on_from_its_checkpoint(device: Device, tmp_path: Path) -> None:
    with rt.Renderer(scene(), device, adaptive=True, memory=300_000) as renderer:
        whole = renderer.render(100)
        renderer.restart()
        renderer.render(40)
        left = iter(range(10**6))
        renderer._stop.is_set = lambda: next(left) == 12  # type: ignore[method-assign]
        list(renderer.passes(100, checkpoints=rt.Checkpoints(tmp_path / "a.ck")))
        assert renderer.stopped_by == "interrupt"
    with rt.Renderer(scene(), device, adaptive=True, memory=100_000) as renderer:
        renderer.resume(tmp_path / "a.ck")
        film = renderer.render(100)
        assert np.array_equal(film.rgb, whole.rgb) and np.array_equal(film.samples, whole.samples)
        assert film.error.as_dict() == whole.error.as_dict()


def test_adaptive_means_are_unbiased_and_nearer_to_the_truth(opened: Pair) -> None:
    """Differences from plain renders of the same seeds, whose first samples are the same: means over blocks of the
    picture within 4.5 standard errors of 0, their squares together as noise of long tails has them (about 1.6 of
    40 seeds; 1 for a Gaussian), the picture's mean within 3.5. Then the gain and the estimate.
    """
    seeds, spp = 40, 64
    plain, adaptive = opened
    plain.restart(seed=10**6)
    truth = plain.render(2048).rgb.astype(np.float64)
    images = np.empty((2, seeds, SIZE[1], SIZE[0], 3))
    relmse = []
    for k in range(seeds):
        for which, renderer in enumerate(opened):
            renderer.restart(seed=k)
            film = renderer.render(spp)
            images[which, k] = film.rgb
        relmse.append(film.error.relmse)
    blocks = (images[1] - images[0]).reshape(seeds, 7, 4, 10, 4, 3).mean(axis=(2, 4)).reshape(seeds, -1)
    noisy = blocks.std(axis=0) > 0
    z = blocks.mean(axis=0)[noisy] / (blocks.std(axis=0, ddof=1)[noisy] / np.sqrt(seeds))
    assert noisy.sum() > 100 and np.abs(z).max() < 4.5
    assert np.mean(z**2) < 2.0
    whole = (images[1] - images[0]).mean(axis=(1, 2, 3))
    assert abs(whole.mean()) < 3.5 * whole.std(ddof=1) / np.sqrt(seeds)
    true = np.mean((images - truth) ** 2 / (truth**2 + (0.01 * truth.mean()) ** 2), axis=(1, 2, 3, 4))
    assert true[1] < true[0]  # little at 64 spp, where plain pixels are whole nets and adaptive ones are not
    assert 0.65 < np.mean(relmse) / true[1] < 2.0  # cautious between powers of four


@pytest.mark.parametrize("kernel", ["mitchell", "catmull_rom", "lanczos"])
def test_windows_and_filters_with_negative_lobes_have_the_pixels_of_plain_renders(device: Device, kernel: str) -> None:
    x, y, width, height = WINDOW
    options = {"filter": kernel, "memory": 300_000}
    with rt.Renderer(scene(), device, adaptive=True, crop=WINDOW, **options) as adaptive:
        film = adaptive.render(96)  # between two decisions
        report = adaptive.report()
    counts, many = np.unique(film.samples, return_counts=True)
    assert counts.min() < 90 and counts.max() > 105 and film.samples.mean() == pytest.approx(96, rel=0.02)
    assert report["rays"]["primary"] == film.samples.sum()
    with rt.Renderer(scene(), device, **options) as plain:
        for count in sorted(counts[np.argsort(many)[-5:]]):
            one, here = plain.render(int(count)), film.samples == count
            whole = (one.rgb, one.data.differences)
            for ours, theirs in zip((film.rgb, film.data.differences), whole, strict=True):
                assert np.array_equal(theirs[y : y + height, x : x + width][here], ours[here])


def test_blue_noise_whose_pixels_are_not_independent_is_refused(device: Device) -> None:
    with pytest.raises(UsageError, match="blue_noise"):
        rt.Renderer(scene(), device, adaptive=True, sampler="blue_noise")
