"""The benchmark on every device: right work is measured, wrong work is invalid, and faults of a driver are results."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from raytide.bench import peaks, renders, scramble, validity
from raytide.bench.builds import measure_builds
from raytide.bench.ledger import ledger
from raytide.bench.peaks import measure_peaks
from raytide.bench.plan import QUICK
from raytide.bench.sections import ledger_rows
from raytide.bench.show import ledger_table
from raytide.bench.workloads import WORKLOADS
from raytide.device import Device, open_renamed
from raytide.kernels import source
from raytide.render import Renderer

sys.path.append(str(Path(__file__).resolve().parents[2] / "tools"))

TINY = replace(QUICK, values=2, most_values=2, value_s=0.01, peak_s=0.005, warmup_s=0.0, size=(80, 48),
               triangles=(3000,), buffer_bytes=4 << 20, buffer_caches=0)  # fmt: skip


def hush(line: str) -> None:
    """Progress that nobody reads."""


def settle(put: Callable[[object, str, object], None]) -> None:
    """Takes chance and time out of what a verdict is about: seeds, and how many samples the timed picture gets."""
    seeds = count(20261123)
    put(validity, "secrets", SimpleNamespace(randbits=lambda bits: next(seeds)))
    put(renders, "samples_for", lambda renderer, seconds: 4)


@pytest.fixture(autouse=True)
def settled(monkeypatch: pytest.MonkeyPatch) -> None:
    settle(monkeypatch.setattr)


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


def test_a_round_trip_waits_for_each_launch_and_a_launch_for_a_hundred(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits, finish = [], device.finish
    for together in (100, 1):
        work = peaks.launches(device, together)
        begun = len(waits)
        monkeypatch.setattr(device, "finish", lambda: (waits.append(0), finish()))
        work.run(3)
        monkeypatch.setattr(device, "finish", finish)
        work.check()
        assert work.amount == together and 3 <= len(waits) - begun <= 4  # and one before a kernel's first launch


WRONG = {
    "fp32x1": ("bench/arithmetic.cl", "n < CHAIN", "n < CHAIN - 4u"),
    "read": ("bench/memory.cl", "for (uint i = item; i < count; i += items)",
             "for (uint i = item; i < count / 2u; i += items)"),
    "gather": ("bench/memory.cl", "rows[scattered(item * reads + k) & mask]",
               "rows[scattered(item + k) & (mask >> 1)]"),
    "gather_nodes": ("bench/memory.cl", "(row[6] + row[7])", "(row[6] + row[6])"),
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
def test_the_ledger_tells_what_kernels_of_the_scene_save(device: Device, tmp_path: Path) -> None:
    """Mission row U9: kernels with everything in them are larger, take longer to build and never need less memory; each
    figure is that of everything over that of the scene's own."""
    workload = WORKLOADS["spheres"]
    found = ledger(device, workload.make(tmp_path, None), workload, TINY)
    needed, everything, gains = found["needed"], found["everything"], found["everything_over_needed"]
    assert set(gains) == {"build_s", "binary_bytes", "run_s", "device_bytes"} and found["left_out"] > 5
    for key, gain in gains.items():
        assert gain == pytest.approx(everything[key] / needed[key]) and needed[key] > 0
    assert gains["binary_bytes"] > 1.2 and gains["build_s"] > 1.0 and gains["device_bytes"] >= 1.0
    assert len(needed["values_s"]) == len(everything["values_s"]) == 3
    rows = [{"id": "spheres", "ledger": found}]
    assert f"{gains['binary_bytes']:.2f}" in ledger_table(rows) and ledger_rows(rows)[0][1:] == list(gains.values())


def test_a_workload_in_disguise_is_right_and_another_rate_is_told(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pictures take a second by a clock of the test's own, and twice as long in disguise."""
    rate_of = scramble.rate_of

    def rate(renderer: Renderer, spp: int, seed: int) -> float:
        assert rate_of(renderer, spp, seed) > 0
        return renderer.rays.total / (2 if renderer.device is disguised else 1)

    monkeypatch.setattr(scramble, "rate_of", rate)
    disguised = open_renamed(device.info, "some word")
    found = renders.measure_render(disguised, "cornell", TINY, hush, scramble=5)
    assert "same_samples" not in found["validity"] and len(found["scramble"]["plain_rays_per_s"]) >= TINY.values
    assert found["status"] == "invalid" and found["reason"].startswith("in disguise its rate is"), "and nothing else"
    assert ";" not in found["reason"] and found["scramble"]["ratio"] == pytest.approx(0.5, rel=0.01)
    disguised.close()


def test_kernels_under_other_names_show_the_same_picture(device: Device) -> None:
    disguised = open_renamed(device.info, "some word")
    images = []
    for one in (device, disguised):
        with Renderer(WORKLOADS["cornell"].make(Path(), None), one, max_depth=3, size=(24, 16)) as renderer:
            images.append(renderer.render(spp=2).rgb.tobytes())
            raw = renderer.programs["film"].raw
    known = raw.get_info(disguised._cl.program_info.KERNEL_NAMES).split(";")
    assert images[0] == images[1] and known and "film" not in known and all(one.startswith("k") for one in known)
    disguised.close()


ONE_UNIT = """
import sys; sys.path[:0] = sys.argv[2:]
from raytide.device import open_device
from test_bench import *
settle(setattr)
with open_device(sys.argv[1], threads=1) as slow:
    found = renders.measure_render(slow, "spheres", TINY, hush)
print(found["status"], found["reason"])
"""


def test_one_unit_is_no_fault(device: Device) -> None:
    """tools/bench_faults.py has it at the lowest priority too, which a busy machine lets wait for ever."""
    command = [sys.executable, "-c", ONE_UNIT, device.info.id, str(Path(__file__).parent)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    environment.pop("POCL_CACHE_DIR", None)
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.stdout.strip().splitlines()[-1:] == ["ok None"], done.stdout + done.stderr[-2000:]


@pytest.mark.one_driver
@pytest.mark.parametrize("name", ["reflectance at glass a tenth too high", "last row of pixels lost",
                                  "what lies behind a hit is visited too"])  # fmt: skip
def test_a_wrong_kernel_is_invalid_and_says_why(
    device: Device, name: str, mutated: Callable[[str, str, str], None]
) -> None:
    """Some of the faults of tools/bench_faults.py."""
    import bench_faults

    fault: Any = next(one for one in bench_faults.FAULTS if one.name == name)
    mutated(fault.file, fault.find, fault.put)
    found = renders.measure_render(device, fault.workload, TINY, hush)
    assert found["status"] == "invalid" and found["reason"], found
    assert name != "what lies behind a hit is visited too" or "visits and hits of rays differ" in found["reason"]
