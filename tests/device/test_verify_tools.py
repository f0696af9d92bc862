"""Fuzzed scenes end and stay finite; other arithmetic is told from one's own; the cost of stability has two sides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from raytide.device import Device
from raytide.render.film import Film, FilmData
from raytide.render.film_sums import Sums
from raytide.verify import CASES
from raytide.verify.against import compare, scenes
from raytide.verify.cost import measure
from raytide.verify.fuzz import RandomDraw, fault_of, render_fuzzed, scene_of
from raytide.verify.lab import Lab
from raytide.verify.variants import Variant

EXAMPLES = 40


class HypothesisDraw:
    """Choices that hypothesis makes, and makes smaller where a scene fails."""

    def __init__(self, data: st.DataObject) -> None:
        self.data = data

    def one_of(self, things: Sequence[Any]) -> Any:
        return things[self.data.draw(st.integers(0, len(things) - 1))]

    def number(self, low: float, high: float) -> float:
        return self.data.draw(st.floats(low, high))

    def count(self, low: int, high: int) -> int:
        return self.data.draw(st.integers(low, high))


@pytest.fixture(scope="module")
def lab(device: Device) -> Lab:
    return Lab(device)


def test_scenes_of_extremes_end_finite_with_no_sample_left_out(lab: Lab) -> None:
    checks = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example]

    @settings(max_examples=EXAMPLES, suppress_health_check=checks)
    @given(st.data())
    def trial(data: st.DataObject) -> None:
        assert render_fuzzed(lab, HypothesisDraw(data)) == ""

    trial()


def test_light_beyond_float32_is_left_out_and_is_no_fault_but_what_no_dimming_mends_is(lab: Lab) -> None:
    assert lab.render(scene_of(RandomDraw(523))[0], spp=2).health["non_finite"] > 0  # 1e12 W/sr at 1e-15 m
    assert render_fuzzed(lab, RandomDraw(523)) == ""
    broken = lab.with_variant(Variant("nan", "light that is no number", with_nan))
    assert "samples left out" in render_fuzzed(broken, RandomDraw(523))


def test_t_of_needles_seen_edge_on_does_not_hang_on_how_well_a_device_divides(device: Device) -> None:
    bench = Lab(device, full=True).variant("worse")  # 2 of these 100,000 were 3.5 times beyond the bar
    (trial,) = (trial for trial in CASES["T6"].trials(bench) if trial.name == "1:100")
    assert trial.judge(trial.inputs).excess.max() <= 1
    bench.device.close()


def with_nan(text: str) -> str:
    return text.replace("out.light = xyz(v->state) * bsdf.value", "out.light = float_of(0x7fc00000u) * bsdf.value")


def film_of(value: float, **health: int) -> Film:
    rows = np.zeros((8, 8, 4), np.float32)
    rows[..., :3], rows[..., 3] = value, np.full((8, 8), 1, np.uint32).view(np.float32)
    sums = Sums.of_buffers(rows, np.zeros_like(rows))
    data = FilmData(sums, np.zeros((8, 8, 3, 4), np.float32), {"negative": 0} | health)
    return Film(1, {}, {}, lambda: data)


def test_a_faulty_picture_is_told() -> None:
    assert fault_of(film_of(0.5), True) == ""
    assert "furnace of 1.1" in fault_of(film_of(1.1), True) and fault_of(film_of(1.1), False) == ""
    assert "not finite" in fault_of(film_of(np.nan), False)
    assert "negative" in fault_of(film_of(0.5, negative=2), False)


class OtherSamples(Lab):
    """A bench whose camera rays are others: stands for a device that errs."""

    def renderer(self, scene: Any, **settings: Any) -> Any:
        return super().renderer(scene, **settings, seed=1)


def test_a_device_agrees_with_itself_and_one_that_errs_is_found_at_its_first_wave(lab: Lab, device: Device) -> None:
    scene = scenes()["furnace"]
    same = compare(lab, Lab(device), "furnace", scene, spp=2)
    assert (same.other_bits, same.diverged, same.energy_ratio, same.wave) == (0, 0, 1, "") and same.same_programs
    other = compare(lab, OtherSamples(device), "furnace", scene, spp=2)
    assert other.wave == "primary" and "primary" in other.kernel and other.rays > 0.9
    assert other.other_bits > 0.5 and other.diverged > 0 and abs(other.energy_ratio - 1) < 0.2


def test_the_form_that_renders_use_leaks_nothing_and_the_usual_one_does(lab: Lab) -> None:
    own, usual = measure(lab, "own", False), measure(lab, "usual", True)
    assert own.leaks == (0, 0, 0, 0) and own.ns_per_ray > 0 and own.t_error < 1e-6
    assert min(usual.leaks[:3]) > own.rays // 100
