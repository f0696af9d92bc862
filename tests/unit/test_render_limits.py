"""Ends of a render and the time to them: laws on made-up histories, without a device."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from raytide.errors import SceneError
from raytide.render.error import ErrorEstimate
from raytide.render.limits import ESTIMATE_SHARE, MOST_SPP, History, Limits, Row, limits_of
from raytide.scene.settings import RenderSettings


def estimate_of(relmse: float, slope: float = 1.0) -> ErrorEstimate:
    return ErrorEstimate(relmse, 0.65 * relmse, 1.35 * relmse, 0.1, slope, lambda: np.zeros((1, 1, 3)))


def history(last: int, relmse: float = 1.0, slope: float = 1.0, pace: float = 0.5, start: float = 3.0) -> History:
    """Passes to 1, 2, 4, ... `last`; relMSE = relmse / spp^believed slope; `pace` seconds a sample after `start`."""
    made = History()
    for spp in [2**k for k in range(30) if 2**k <= last]:
        made.add(Row(start + pace * spp, pace * spp, spp, 100 * spp))
        if spp >= 4:
            made.complete(estimate_of(relmse / spp ** estimate_of(1, slope).believed_slope, slope))
    return made


@pytest.mark.parametrize("slope", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("last", [16, 64, 256])
def test_prediction_finds_the_time_of_a_known_law(last: int, slope: float) -> None:
    made = history(last, slope=slope)
    predicted = made.prediction(0.02)
    assert predicted is not None
    samples = 0.02 ** (-2 / (1 + 0.25 * (slope - 1)))
    assert predicted.left_s == pytest.approx(0.5 * (samples - last), rel=1e-6)
    assert predicted.low_s < predicted.left_s < predicted.high_s


def test_prediction_counts_the_time_since_the_estimate_that_it_stands_on() -> None:
    made = history(16)
    before = made.prediction(0.02)
    made.add(Row(3.0 + 0.5 * 32, 16.0, 32, 3200))
    after = made.prediction(0.02)
    assert before and after and after.left_s == pytest.approx(before.left_s - 8.0)


def test_nothing_is_predicted_from_too_few_samples_and_nothing_is_left_at_the_target() -> None:
    assert history(8).prediction(0.02) is None and History().prediction(0.02) is None
    assert history(64).prediction(None) is None
    reached = history(64).prediction(0.5)
    assert reached is not None and (reached.left_s, reached.high_s) == (0.0, 0.0)


def test_error_is_the_root_of_relmse() -> None:
    found = estimate_of(1e-4).as_dict()
    assert found["error"] == pytest.approx(0.01)
    assert found["error_low"] < 0.01 < found["error_high"]


@pytest.mark.parametrize(
    ("limits", "ended"),
    [
        (Limits(64), "spp"),
        (Limits(65), None),
        (Limits(MOST_SPP, time=35.0), "time"),
        (Limits(MOST_SPP, time=35.1), None),
        (Limits(MOST_SPP, error=0.125), "error"),
        (Limits(MOST_SPP, error=0.124), None),
        (Limits(64, 1.0, 0.9), "spp"),
    ],
)
def test_the_first_limit_that_is_reached_ends_the_render(limits: Limits, ended: str | None) -> None:
    assert history(64).reached(limits) == ended


def test_no_render_ends_by_an_error_that_is_not_known() -> None:
    assert history(8).reached(Limits(MOST_SPP, error=0.9)) is None  # fewer samples than the estimate needs
    made = history(64)
    made.add(Row(67.0, 64.0, 128, 12800))
    assert made.reached(Limits(MOST_SPP, error=0.9)) is None  # nobody looked at this pass


@pytest.mark.parametrize("target", [None, 1e-4])
def test_looks_at_the_error_stay_within_their_share_of_the_time(target: float | None) -> None:
    """The last one too, which a render that no look ends has at its end."""
    made, looked, last = History(guess_s=0.03), 0, 0.02 if target is None else -0.02  # there its first one is free
    for spp in range(4, 1001):
        made.add(Row(spp * 0.01 + made.cost_s, 0.0, spp, 0))
        if made.affordable(target):
            made.complete(estimate_of(1.0), 0.02)
            looked += 1
        if looked:
            assert made.cost_s + last <= ESTIMATE_SHARE * made.rows[-1].wall_s + 1e-12
    assert looked > 5


def test_nobody_looks_before_there_is_anything_to_see() -> None:
    for first, target in ((4, None), (16, 0.01)):
        made = History(guess_s=0.1)
        made.add(Row(100.0, 100.0, first - 1, 0))
        assert not made.affordable(target)
        made.add(Row(101.0, 101.0, first, 0))
        assert made.affordable(target)


def test_the_first_look_waits_for_its_guess_but_not_where_it_may_end_the_render() -> None:
    made = History(guess_s=0.1)
    made.add(Row(6.6, 6.6, 64, 0))
    assert not made.affordable() and made.affordable(0.01)
    made.add(Row(6.7, 6.7, 65, 0))
    assert made.affordable()


@pytest.mark.parametrize("first_s", [0.02, 1.0])
@pytest.mark.parametrize("later_s", [0.001, 0.03, 0.06])
@pytest.mark.parametrize("start", [1.0, 0.2])
def test_a_render_ends_by_error_within_a_few_passes_of_it(first_s: float, later_s: float, start: float) -> None:
    """In pictures so small that a pass of 64 samples takes no longer than a look too. `start`: by how much the look at
    16 samples errs."""
    target, spp, wall = 0.01, 0, 0.0
    made, passes = History(guess_s=0.0011), [1, 1, 2, 4, 8, 16, 32, *([64] * 400)]
    for more in passes:
        spp, wall = spp + more, wall + 0.001 * more
        made.add(Row(wall, wall, spp, 0))
        if made.affordable(target):
            cost = later_s if made.costs else first_s
            made.complete(estimate_of(0.018 / spp * (start if spp == 16 else 1.0)), cost)
            wall += cost
        if made.reached(Limits(MOST_SPP, error=target)):
            break
    assert made.error is not None and made.error.error <= target
    assert spp <= 192 + (64 if later_s <= 0.03 else 2 * later_s / 0.001)


def test_a_look_imports_nothing() -> None:
    """Else the first one costs many times what the later ones do."""
    lines = (
        "import sys, numpy",
        "from raytide.render.error import estimate",
        "before, picture = set(sys.modules), numpy.ones((16, 16, 3), numpy.float32)",
        "estimate(picture, picture, picture, 64)",
        "sys.exit(', '.join(set(sys.modules) - before) or 0)",
    )
    run = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (0, "")


def test_samples_that_nobody_set_are_no_limit_beside_another() -> None:
    assert limits_of(RenderSettings()) == Limits(64)
    assert limits_of(RenderSettings(time="2min")) == Limits(MOST_SPP, 120.0)
    assert limits_of(RenderSettings(spp=64, time=1)) == Limits(64, 1.0)
    assert limits_of(RenderSettings(), error=0.01) == Limits(MOST_SPP, None, 0.01)
    assert limits_of(RenderSettings(spp=5), spp=7, error=None) == Limits(7)
    with pytest.raises(SceneError, match="time"):
        limits_of(RenderSettings(), time=-1)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("30s", 30), ("4min", 240), ("1h 30min", 5400), ("1h30m", 5400), ("250ms", 0.25), (" 30 ", 30), (2, 2)],
)
def test_times_read_as_people_write_them(text: object, seconds: float) -> None:
    assert RenderSettings(time=text).time == pytest.approx(seconds)


@pytest.mark.parametrize("wrong", ["4mins", "-3s", "", "s", 0, "1e3", "1.5.2s", True, "1%"])
def test_wrong_times_are_refused_with_the_right_form(wrong: object) -> None:
    with pytest.raises(SceneError, match="30s"):
        RenderSettings(time=wrong)


@pytest.mark.parametrize(("text", "share"), [("1%", 0.01), ("0.5 %", 0.005), (0.02, 0.02)])
def test_errors_read_as_per_cent_or_share(text: object, share: float) -> None:
    assert RenderSettings(error=text).error == pytest.approx(share)


@pytest.mark.parametrize("wrong", [1, "1", "100%", "0%", "x", -0.1])
def test_wrong_errors_are_refused_with_the_right_form(wrong: object) -> None:
    with pytest.raises(SceneError, match="1%"):
        RenderSettings(error=wrong)
