"""The benchmark on every device: right work is measured, wrong work is invalid, and faults of a driver are results."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from raytide.bench import peaks, renders
from raytide.bench.builds import measure_builds
from raytide.bench.peaks import measure_peaks
from raytide.bench.plan import QUICK
from raytide.device import Device
from raytide.kernels import source

sys.path.append(str(Path(__file__).resolve().parents[2] / "tools"))

TINY = replace(QUICK, values=2, most_values=2, value_s=0.01, warmup_s=0.0, size=(80, 48), triangles=(3000,),
               buffer_bytes=4 << 20)  # fmt: skip


def hush(line: str) -> None:
    """Progress that nobody reads."""


@pytest.fixture
def mutated(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str, str], None]:
    """Call with a file of cl/, what stands there once, and what shall stand there instead."""
    read = source._read

    def change(file: str, find: str, put: str) -> None:
        text = read(file)
        assert text.count(find) == 1, f"{file}: {find!r} is there {text.count(find)} times"
        changed = text.replace(find, put)
        monkeypatch.setattr(source, "_read", lambda name: changed if name == file else read(name))

    return change


def test_every_peak_is_measured_and_right(device: Device) -> None:
    found = measure_peaks(device, TINY, hush)
    assert {row["status"] for row in found["rows"]} <= {"ok", "unsupported"}
    assert all(row["reason"] for row in found["rows"] if row["status"] == "unsupported")
    for name in ("fp32_flop_per_s", "read_byte_per_s", "gather_byte_per_s", "local_byte_per_s", "h2d_byte_per_s",
                 "launch_s", "round_trip_s", "atomic_one_per_s"):  # fmt: skip
        assert found[name] > 0
    assert found["launch_s"] < found["round_trip_s"] * 1.5


WRONG = {
    "fp32x1": ("bench/arithmetic.cl", "n < CHAIN", "n < CHAIN - 4u"),
    "read": ("bench/memory.cl", "for (uint i = item; i < count; i += items)",
             "for (uint i = item; i < count / 2u; i += items)"),
    "gather": ("bench/memory.cl", "item * reads + k) & mask", "item + k) & (mask >> 1)"),
    "local": ("bench/memory.cl", "(item + k) & 255u] ^ k", "item & 255u] ^ k"),
    "atomic_one": ("bench/overhead.cl", "k++) {\n        atomic_inc(&counters[0]);",
                   "k += 2u) {\n        atomic_inc(&counters[0]);"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_peak_that_leaves_work_out_is_invalid(
    device: Device, name: str, mutated: Callable[[str, str, str], None]
) -> None:
    mutated(*WRONG[name])
    make = {row: make for row, _, make in peaks.rows_of(device, TINY)}[name]
    row = peaks.measured(device, TINY, name, "", make)
    assert row["status"] == "invalid" and row["reason"] and "summary" not in row


def test_trees_are_timed_and_their_cost_told(device: Device) -> None:
    rows = {row["builder"]: row for row in measure_builds(device, TINY, hush)["rows"]}
    assert {row["status"] for row in rows.values()} == {"ok"} and set(rows) == {"sah", "sah-hq", "lbvh"}
    assert 1 < rows["sah-hq"]["sah_cost"] <= rows["sah"]["sah_cost"] < rows["lbvh"]["sah_cost"]


def test_a_right_workload_is_ok_with_all_its_figures(device: Device) -> None:
    found = renders.measure_render(device, "spheres", TINY, hush)
    assert found["status"] == "ok" and found["reason"] is None, found["reason"]
    assert found["validity"]["same_samples"]["diverged_frac"] <= 0.01 and found["validity"]["unbiased"]["passed"]
    assert found["timing"]["work_per_value"]["rays"] > 0 and found["summary"]["median"] > 0
    traced = {one["name"]: one for one in found["kernels"]}
    assert traced["primary"]["nodes_per_ray"] >= 1 and traced["shadow"]["bytes_modelled"] > 0
    assert sum(one["share"] for one in found["kernels"]) == pytest.approx(1.0)


@pytest.mark.one_driver
def test_another_order_of_triangles_is_no_fault(device: Device) -> None:
    found = renders.measure_render(device, "cornell", TINY, hush, scramble=5)
    assert found["status"] == "ok" and "same_samples" not in found["validity"], found["reason"]


@pytest.mark.one_driver
@pytest.mark.parametrize("name", ["reflectance at glass a tenth too high", "last row of pixels lost"])
def test_a_wrong_kernel_is_invalid_and_says_why(
    device: Device, name: str, mutated: Callable[[str, str, str], None]
) -> None:
    """Two of the faults of tools/bench_faults.py."""
    import bench_faults

    fault: Any = next(one for one in bench_faults.FAULTS if one.name == name)
    mutated(fault.file, fault.find, fault.put)
    found = renders.measure_render(device, fault.workload, TINY, hush)
    assert found["status"] == "invalid" and found["reason"], found
