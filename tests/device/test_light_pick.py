"""One light of many is picked in one look-up, exactly as often as its probability says (stability cases Q7, Q10)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raytide.kernels.records import RECORDS
from shading_programs import F4, LOCAL, every_feature, program, rows4

_PICK = """
#include "light/pick.cl"
kernel void probe_pick(const uint count, global const Light *lights, const uint light_count,
                       global const float4 *u, global float4 *picked)
{
    const uint i = (uint)get_global_id(0);
    if (i >= count) {
        return;
    }
    float probability;
    const LightPlace anywhere = light_place((float3)(0.0f), 0u);
    const uint index = pick_light(lights_of(lights, light_count), anywhere, u[i].xy, &probability);
    picked[i] = (float4)((float)index, probability, 0.0f, 0.0f);
}
"""


def alias_table(weights: np.ndarray) -> np.ndarray:
    """Light records with alias, threshold and probability of the table as stored (Vose 1991)."""
    n = len(weights)
    lights = np.zeros(n, RECORDS["Light"].dtype)
    scaled, alias = weights / weights.sum() * n, np.arange(n)
    threshold = np.ones(n)
    small, large = list(np.nonzero(scaled < 1)[0]), list(np.nonzero(scaled >= 1)[0])
    while small and large:
        low, high = small.pop(), large[-1]
        threshold[low], alias[low] = scaled[low], high
        scaled[high] -= 1 - scaled[low]
        if scaled[high] < 1:
            small.append(large.pop())
    lights["alias"], lights["threshold"] = alias, threshold
    kept = lights["threshold"].astype(float)
    probability = kept / n
    np.add.at(probability, alias, (1 - kept) / n)
    lights["position"][:, 3] = probability
    return lights


def pick(device: Any, lights: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lights and probabilities for places in [0,1) given to 40 bits."""
    bits = (places * 2.0**40).astype(np.uint64)
    u = np.stack([(bits >> np.uint64(16)) * 2.0**-24, (bits & np.uint64(0xFFFF)) * 2.0**-16], 1)
    built, n = program(device, "probe_pick", _PICK, every_feature()), len(u)
    out = device.empty(16 * n)
    arguments = [np.uint32(n), device.upload(lights), np.uint32(len(lights)), device.upload(rows4(u, n)), out]
    device.launch(built, "probe_pick", n, LOCAL, *arguments)
    got = device.read(out, F4, 4 * n).reshape(n, 4)
    return got[:, 0].astype(int), got[:, 1]


@pytest.mark.parametrize("count", [1, 2, 3, 1000, 100_000])
def test_lights_are_picked_exactly_as_often_as_claimed(device, count):  # Q7, Q10
    rng = np.random.default_rng(count)
    weights = rng.exponential(size=count)
    weights[:: max(count // 7, 2)] *= 1e-6
    lights = alias_table(weights)
    total = 2**22
    places = (np.arange(total) + 0.5) / total
    index, probability = pick(device, lights, places)
    assert index.min() >= 0 and index.max() < count
    assert np.array_equal(probability, lights["position"][index, 3])
    counts = np.bincount(index, minlength=count)
    pieces = 2 + np.bincount(lights["alias"], minlength=count)  # intervals of [0,1) that lead to each light
    assert (np.abs(counts - total * lights["position"][:, 3].astype(float)) <= pieces).all()
    assert np.allclose(lights["position"][:, 3], weights / weights.sum(), rtol=1e-4, atol=1e-9)


def test_a_light_of_no_power_is_never_picked_and_the_last_step_stays_inside(device):
    lights = alias_table(np.array([0.0, 1.0, 0.0, 2.0]))
    places = np.concatenate([np.linspace(0, 1, 65_536, endpoint=False), [1 - 2.0**-40, 1 - 2.0**-24, 0.25, 0.5, 0.75]])
    index, probability = pick(device, lights, places)
    assert set(index) == {1, 3} and (probability > 0).all()


def test_the_share_of_a_slot_is_exact_among_many_lights(device):
    """65 536 places within one slot of 100 000: 24 bits have 168 steps there, and would miss the threshold by 0.3 %."""
    count, n = 100_000, 2**16
    lights = alias_table(np.random.default_rng(1).exponential(size=count))
    for slot in (0, 12_345, 77_777, count - 1):
        index, _ = pick(device, lights, (slot + (np.arange(n) + 0.5) / n) / count)
        kept = (index == slot).mean()
        assert abs(kept - lights["threshold"][slot]) < 4 / n
        assert set(index) <= {slot, lights["alias"][slot]}
