"""Trials of the traversal's variants, with launches that take as long as the test says."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from raytide.device.cache import FileCache
from raytide.render import trial
from raytide.render.schedule import Variant

RAYS = 10_000
SECONDS = {"quick": 1e-3, "slow": 1.1e-3}


class Clock:
    """Seconds that pass only in launches."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Clock:
    clock = Clock()
    monkeypatch.setattr(trial, "time", clock)
    monkeypatch.setattr(trial, "binary_key", lambda info, options, kernels: kernels)
    monkeypatch.setattr(trial, "FileCache", lambda kind: FileCache(kind, tmp_path))
    return clock


def new_trial() -> trial.Trial:
    variants = tuple(Variant(name, "", False, lambda kind, features: True, trial.KINDS) for name in SECONDS)
    info = SimpleNamespace(id="fake", driver="1", compute_units=2)
    device = SimpleNamespace(finish=lambda: None, info=info, options=())
    return trial.Trial(device, variants, {"extend": "0"}, False, 1000)  # type: ignore[arg-type]


@pytest.mark.parametrize("factor", [100.0, 0.1])
@pytest.mark.parametrize("odd", range(2 * trial.ROUNDS))
def test_one_odd_launch_changes_no_choice(clock: Clock, odd: int, factor: float) -> None:
    """Another program takes the processor for a hundred times a launch's own time, or rays are easy, in whichever."""
    judged, count = new_trial(), 0

    def launch(variant: Variant) -> None:
        nonlocal count
        clock.now += SECONDS[variant.name] * (factor if count == odd else 1.0)
        count += 1

    for _ in range(2 * trial.ROUNDS):
        assert not judged.is_settled("shadow")
        judged.trace("shadow", RAYS, launch)
    assert judged.is_settled("shadow") and judged.trace("shadow", RAYS, launch).name == "quick"
    assert new_trial().as_dict()["shadow"]["runs"] == "quick"  # as remembered
