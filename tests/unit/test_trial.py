"""Trials of the traversal's variants, with launches that take as long as the test says."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from raytide.device.cache import FileCache
from raytide.render import trial
from raytide.render.schedule import Variant

RAYS = 40_000
SECONDS = {"quick": 1e-7, "slow": 1.1e-7}  # a ray


class Clock:
    """Seconds that pass only in launches."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now

    def process_time(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Clock:
    clock = Clock()
    monkeypatch.setattr(trial, "time", clock)
    monkeypatch.setattr(trial, "binary_key", lambda info, options, kernels: kernels)
    monkeypatch.setattr(trial, "FileCache", lambda kind: FileCache(kind, tmp_path))
    return clock


def new_trial(names: tuple[str, ...] = tuple(SECONDS)) -> trial.Trial:
    variants = tuple(Variant(name, "", False, lambda kind, features: True, trial.KINDS) for name in names)
    info = SimpleNamespace(id="fake", driver="1", compute_units=2)
    device = SimpleNamespace(finish=lambda: None, info=info, options=(), kind="cpu")
    return trial.Trial(device, variants, {"extend": "0"}, False, 1000)  # type: ignore[arg-type]


def settle(judged: trial.Trial, clock: Clock, factor: Callable[[int, int], float]) -> None:
    """Launches until the trial of shadow rays ends; rays take `factor(launch, part of all)` times as long as usual."""
    parts = 0

    def launch(variant: Variant, begin: int, end: int) -> None:
        nonlocal parts
        assert begin == traced[-1]
        traced.append(end)
        clock.now += (end - begin) * SECONDS[variant.name] * factor(launches, parts)
        parts += 1

    for launches in range(8):
        traced = [0]
        judged.trace("shadow", RAYS, launch)
        assert traced[-1] == RAYS  # every ray, once
        if judged.is_settled("shadow"):
            assert launches > 1 and judged.trace("shadow", RAYS, lambda *one: None).name == "quick"
            return
    raise AssertionError("the trial does not end")


@pytest.mark.parametrize("factor", [100.0, 0.1])
@pytest.mark.parametrize("odd", range(9))
def test_one_odd_part_changes_no_choice(clock: Clock, odd: int, factor: float) -> None:
    """Something takes a hundred times a part's own time, or rays are easy, in whichever."""
    settle(new_trial(), clock, lambda launch, part: factor if part == odd else 1.0)
    assert new_trial().as_dict()["shadow"]["runs"] == "quick"  # as remembered


@pytest.mark.parametrize("names", [("quick", "slow"), ("slow", "quick")])
def test_launches_that_differ_more_than_variants_do_not_decide(clock: Clock, names: tuple[str, ...]) -> None:
    """Rays of some launches are ten times as costly as those of others, as are those to the horizon and to the sky."""
    settle(new_trial(names), clock, lambda launch, part: 10.0 if launch % 2 else 1.0)


def test_passes_of_few_samples_a_pixel_decide_nothing(clock: Clock) -> None:
    judged, parts = new_trial(), []
    judged.samples = trial.FEWEST_SAMPLES - 1
    judged.trace("primary", RAYS, lambda variant, begin, end: parts.append((begin, end)))
    assert parts == [(0, RAYS)]
