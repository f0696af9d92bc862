"""Laws of the benchmark's rules: what takes a run out of its class or its score, what is said of noise and drift."""

from __future__ import annotations

import base64
import copy
import hashlib
import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from bench_cases import RESULTS, parts
from raytide.bench import record, runner, shipped
from raytide.bench.compare import compare
from raytide.bench.doubts import CLOSE
from raytide.bench.model import json_schema
from raytide.bench.pictures import difference, pictures_of
from raytide.bench.plan import FULL, QUICK, drifting, enough, repeat
from raytide.bench.references import load_references
from raytide.bench.roofline import add_limiters
from raytide.bench.runner import Findings, Job, result_of, run_job
from raytide.bench.sections import parts_of, values_plot
from raytide.bench.show import tables
from raytide.bench.soak import soak
from raytide.bench.workloads import VERIFY_SIZE, WORKLOADS
from raytide.device.renamed import other_name, renamed
from raytide.kernels import Features, assemble
from raytide.kernels.paths import kernel_dir
from raytide.report.page import Quantity, table
from raytide.report.ray_scaling import spread
from raytide.report.ray_sets import RaySet
from raytide.report.summary import ratio_of_medians, summarise


@pytest.fixture(autouse=True)
def as_shipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests may run on edited files."""
    monkeypatch.setattr(runner, "edited_reasons", list)


def result(**job: Any) -> dict[str, Any]:
    found = Findings(parts=parts())
    words = Job("x/cpu0", "renders", **job)
    return json.loads(json.dumps(result_of(words, found, record.host_record(), "2026-11-23T00:00:00Z", 1.0, [])))


def test_edited_files_are_of_the_open_class_and_have_no_plain_score(monkeypatch: pytest.MonkeyPatch) -> None:
    assert result()["class"] == "closed" and "\nScore: " in tables(result())
    monkeypatch.setattr(runner, "edited_reasons", lambda: ["edited: cl/wave/shade.cl"])
    found = result()
    assert found["class"] == "open" and "edited: cl/wave/shade.cl" in found["class_reasons"]
    assert "\nScore: " not in tables(found) and "\nOpen score: " in tables(found)


def git(folder: Path, *words: str) -> None:
    who = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    subprocess.run(["git", "-C", str(folder), *who, *words], check=True, capture_output=True)


def test_git_tells_edited_and_new_files_of_kernels_and_host_only(tmp_path: Path) -> None:
    assert shipped.against_git(tmp_path) is None, "no repository"
    for name in ("cl/a.cl", "host/raytide/b.py", "docs/c.md"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("1")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "all")
    assert shipped.against_git(tmp_path) == []
    (tmp_path / "docs/c.md").write_text("2")
    assert shipped.against_git(tmp_path) == []
    (tmp_path / "cl/a.cl").write_text("2")
    (tmp_path / "cl/new.cl").write_text("")
    assert shipped.against_git(tmp_path) == ["cl/a.cl", "cl/new.cl"]


def test_an_installed_package_is_held_against_its_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package, info = tmp_path / "raytide", tmp_path / "raytide-1.0.dist-info"
    package.mkdir()
    info.mkdir()
    kept = []
    for name in ("__init__.py", "kernel.cl", "page.png"):
        (package / name).write_bytes(b"as shipped")
        digest = base64.urlsafe_b64encode(hashlib.sha256(b"as shipped").digest()).rstrip(b"=").decode()
        kept.append(f"raytide/{name},sha256={digest},10")
    (info / "RECORD").write_text("\n".join([*kept, "raytide-1.0.dist-info/RECORD,,"]))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: raytide\nVersion: 1.0\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert shipped.against_record("raytide") is None, "another raytide is running"
    monkeypatch.setattr(shipped.raytide, "__file__", str(package / "__init__.py"))
    assert shipped.against_record("raytide") == []
    (package / "kernel.cl").write_bytes(b"edited")
    (package / "page.png").write_bytes(b"no code")
    assert shipped.against_record("raytide") == ["raytide/kernel.cl"]


def test_other_traversals_are_open_and_soaked_or_scrambled_runs_have_no_score() -> None:
    assert result(traversal="packet")["class_reasons"] == ["--traversal"]
    assert result(soak_s=5.0)["score"] is None and result(scramble=3)["score"] is None
    assert result()["score"]["value"] > 0


def test_a_long_soak_is_no_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter(np.arange(0.0, 400.0, 1.0))
    monkeypatch.setattr("raytide.bench.soak.time", SimpleNamespace(perf_counter=lambda: float(next(clock))))
    said: list[str] = []
    found = soak(lambda: 0.0, 1000, 120.0, said.append)
    assert len(said) >= 9 and said[0] == "10 of 120 s" and found["t_offset_s"] == sorted(found["t_offset_s"])


def test_a_soak_tells_that_a_device_slows_down(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("raytide.bench.soak.time", SimpleNamespace(perf_counter=lambda: now[0]))

    def once() -> float:
        now[0] += 1.0 if now[0] < 30 else 1.25
        return 0.0

    found = soak(once, 1000, 60.0, lambda text: None)
    assert found["steady_over_first"] == pytest.approx(0.8) and found["steady"]["median"] == pytest.approx(800.0)


def test_a_median_that_is_not_known_to_3_per_cent_is_unstable() -> None:
    rng = np.random.default_rng(8)
    for spread_of in (0.001, 0.02, 0.05, 0.08):
        values = list(100 * (1 + spread_of * rng.normal(size=6)))
        found = summarise(values)
        again = np.median(100 * (1 + spread_of * rng.normal(size=(4000, 6))), axis=1)
        assert found.median_cv == pytest.approx(again.std() / again.mean(), rel=0.7)
        assert found.unstable == (found.median_cv > 0.03 or found.cv >= 0.1)
    assert not summarise([100.0, 100.5, 99.5, 100.2, 99.8, 100.0]).unstable
    assert summarise([100.0, 108.0, 92.0, 106.0, 93.0, 101.0]).unstable, "their CV is 7 %, their median's 4 %"


@pytest.mark.parametrize("plan", [FULL, QUICK], ids=lambda plan: plan.name)
def test_each_plan_has_values_enough_to_see_drift_and_bounds_its_time(plan: Any) -> None:
    falling = list(np.linspace(100, 90, plan.values))
    assert drifting(falling) and not drifting([100.0] * plan.values)

    def ends(values: list[float], seconds: float) -> bool:
        return enough(values, [None] * len(values), seconds, plan)

    assert not ends([1.0] * (plan.values - 1), 1e9), "never fewer"
    noisy = [1.0, 1.5] * plan.values
    assert not ends(noisy[: plan.values], 0.0) and ends(noisy[: plan.values], plan.repeat_s + 1)
    assert ends([1.0] * plan.values, 0.0) and ends([1.0, 1.5] * plan.most_values, 0.0)


@pytest.mark.parametrize(("seconds", "warming", "values"), [
    ([1.0] * 50, 2, 3), ([2.0, 1.0, 1.0] + [1.0] * 50, 3, 3), ([1.0, 1.0] + [1.0, 1.5] * 30, 2, 8),
    ([1.0, 1.5] * 30, 10, 8), ([1.0, 1.0, 1.0, 1.5, 1.0, 1.0] + [1.0] * 300, 2, 8),
])  # fmt: skip
def test_values_come_until_they_are_steady(
    seconds: list[float], warming: int, values: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, ahead = [0.0], iter(seconds)
    clock = SimpleNamespace(perf_counter=lambda: now[0], perf_counter_ns=lambda: round(1e9 * now[0]))
    monkeypatch.setattr("raytide.bench.plan.time", clock)

    def work() -> float:
        now[0] += next(ahead)
        return 0.0

    found = repeat(work, replace(QUICK, warmup_s=0.0, values=3, most_values=8, repeat_s=60.0))
    assert (len(found.warmup_s), len(found.values_s)) == (warming, values)
    assert found.offsets_s == pytest.approx([sum(found.values_s[:i]) for i in range(values)])


def test_a_ratio_of_medians_holds_the_truth_in_its_interval() -> None:
    rng = np.random.default_rng(9)
    inside = 0
    for _ in range(200):
        old, new = 10 * (1 + 0.02 * rng.normal(size=8)), 9.5 * (1 + 0.02 * rng.normal(size=8))
        ratio, low, high = ratio_of_medians(old, new)
        assert low <= ratio <= high
        inside += low <= 0.95 <= high
    assert inside >= 170
    assert ratio_of_medians([2.0, 2.0], [1.0, 1.0]) == (0.5, 0.5, 0.5)


def test_the_published_schema_takes_results_and_refuses_wrong_ones() -> None:
    """By a reader of JSON schemas that knows nothing of the models behind it."""
    schema = json_schema()
    Draft202012Validator.check_schema(schema)
    reader = Draft202012Validator(schema)
    found = result()
    reader.validate(found)
    for path in RESULTS:
        assert list(reader.iter_errors(json.loads(path.read_text(encoding="utf-8")))) == [], path.name
    assert RESULTS
    for key, value in (("schema", "other/1"), ("class", "secret"), ("tool", {}), ("duration_s", "long"),
                       ("class_reasons", [1]), ("workloads", [{"id": "x", "status": "fine"}])):  # fmt: skip
        assert not reader.is_valid({**found, key: value}), key
    for key in ("schema", "integrity", "command"):
        assert not reader.is_valid({name: one for name, one in found.items() if name != key}), key
    wrong = copy.deepcopy(found)
    wrong["workloads"][0]["summary"]["ci95"] = [1.0]
    assert not reader.is_valid(wrong)


def test_rays_of_other_inputs_are_not_compared() -> None:
    one = {"rays_per_s": {"host": {**summarise([1e6, 1.01e6, 0.99e6]).as_dict(), "values": [1e6, 1.01e6, 0.99e6]}},
           "workload_sha256": "a"}  # fmt: skip
    old = {**result(), "workloads": [], "rays": {"scenes": {"blob": {"status": "ok", "sets": {"prim": one}}}}}
    new = copy.deepcopy(old)
    assert [row.name for row in compare(old, new).rows] == ["blob prim"]
    new["rays"]["scenes"]["blob"]["sets"]["prim"]["workload_sha256"] = "b"
    found = compare(old, new)
    assert not found.rows and found.left_out[0][0] == "rays blob prim"


@pytest.mark.parametrize(("tree", "limit"), [(1 << 20, "gather"), (1 << 30, "latency or divergence")])
def test_a_tree_in_the_caches_is_held_against_reads_from_caches(tree: int, limit: str) -> None:
    kernel = {"name": "primary", "event_s": 1.0, "launches": 1, "bytes_modelled": 5e9, "flop_modelled": 1e9}
    workload = {"scene": {"bvh_bytes": tree}, "kernels": [kernel]}
    peaks = {"fp32_flop_per_s": 1e12, "read_byte_per_s": 1e11, "gather_nodes_byte_per_s": 1e11,
             "gather_near_byte_per_s": 1e10, "launch_s": 1e-5}  # fmt: skip
    add_limiters(workload, peaks, 32 << 20)
    assert kernel["limiter"] == limit
    assert kernel["frac_of_peak"]["gather"] == pytest.approx(0.5 if limit == "gather" else 0.05)
    assert ("bandwidth" in kernel["frac_of_peak"]) == (tree > 32 << 20)


def test_in_disguise_kernels_have_other_names_and_nothing_else_changes() -> None:
    source = assemble("wave/extend.cl", Features(tree=True, shapes=("sphere",)))
    once, again = renamed(source, "1"), renamed(source, "2")
    name = other_name("extend", "1")
    assert once.text == f"#define extend {name}\n" + source.text and name != other_name("extend", "2")
    assert len({source.sha256, once.sha256, again.sha256}) == 3
    two = renamed(assemble("", Features(), "kernel void a() {}\nkernel void b() {}"), "1").text
    assert two.startswith("#define a k") and two.count("\n#define b k") == 1


def test_a_rate_that_needs_the_order_of_triangles_shows(capsys: pytest.CaptureFixture[str]) -> None:
    found = result(scramble=3)
    found["workloads"][0]["scramble"] = {"ratio": 0.8, "ci95": [0.79, 0.81], "same": False}
    assert "0.790 to 0.810          NO" in tables(found) and CLOSE == 0.03
    for ends, word in (([0.9, 1.1], "not certain"), ([0.96, 1.0], "not certain"), ([0.98, 1.02], "yes")):
        found["workloads"][0]["scramble"] = {"ratio": 1.0, "ci95": ends, "same": True}
        assert f"{ends[0]:.3f} to {ends[1]:.3f}" in tables(found)
        assert re.search(rf"{ends[1]:.3f} +{word}\n", tables(found))
    assert any("In disguise" in part for part in parts_of(found))


def test_pictures_show_where_and_which_way_a_device_is_off() -> None:
    reference = load_references()["cornell"]
    image = reference.image.copy()
    assert np.allclose(difference(image, reference.image), 0.2)
    image[3, 4] *= 1.5
    image[5, 6] *= 0.5
    image[7, 8] = np.nan
    off = difference(image, reference.image)
    assert off[3, 4, 0] > 2 * off[3, 4, 2] and off[5, 6, 2] > 2 * off[5, 6, 0] and tuple(off[7, 8]) == pytest.approx(
        (0.9, 0.8, 0.0)
    )
    found = pictures_of(image, reference)
    for name in ("image_png", "reference_png", "difference_png"):
        png = base64.b64decode(found[name], validate=True)
        width, height = (int.from_bytes(png[at : at + 4], "big") for at in (16, 20))
        assert png.startswith(b"\x89PNG") and (width, height) == VERIFY_SIZE
    assert pictures_of(None, reference) == {}


def test_fewer_rays_come_from_all_over_the_picture() -> None:
    rays = RaySet("x", np.arange(64 * 100), False)
    found = spread(rays, 64 * 4).rays
    assert found.tolist() == [64 * tile + i for tile in (0, 25, 50, 75) for i in range(64)]
    assert np.array_equal(spread(rays, 6400).rays, rays.rays)


def test_a_cell_with_a_unit_sorts_by_its_value() -> None:
    text = table(["rate"], [[Quantity("1.2 Mrays/s", 1.2e6)], [Quantity("-", None)]])
    assert 'data-value="1200000.0">1.2 Mrays/s<' in text and '<td class="number">-<' in text


def test_references_know_the_work_of_both_layouts() -> None:
    for name in WORKLOADS:
        one = load_references()[name]
        assert set(one.visits) == {"wide", "compact"}
        wide, compact = one.visits["wide"], one.visits["compact"]
        assert set(wide) == set(compact) and {"primary", "shadow", "reflection"} >= set(wide) >= {"primary", "shadow"}
        for wave, found in wide.items():
            assert found["hits"] == compact[wave]["hits"] and 0 < found["hits"] and found["nodes"] > 0
            assert found["leaves"] > 0


def test_a_child_is_told_to_rename_where_scrambled(monkeypatch: pytest.MonkeyPatch) -> None:
    """run_job hands the seed on; the child opens a device that renames."""
    import sys

    child = "import json,sys; job=json.loads(sys.stdin.readline()); print(json.dumps({'event':'failed','reason':" \
            "str(job['scramble'])}),flush=True)"  # fmt: skip
    monkeypatch.setattr(runner, "child_command", lambda module: [sys.executable, "-c", child])
    assert run_job(Job("x", "peaks", scramble=77), lambda line: None)["problems"] == ["77"]


def test_every_fault_still_finds_its_place_in_the_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault that changes nothing would be caught by nothing, and would say nothing."""
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[2] / "tools"))
    import bench_faults

    assert len(bench_faults.FAULTS) >= 12
    for fault in bench_faults.FAULTS:
        assert fault.workload in WORKLOADS and (fault.options or fault.places), fault.name
        for file, find, put in fault.places:
            text = (kernel_dir() / file).read_text(encoding="utf-8")
            assert text.count(find) == 1 and find != put, f"{fault.name}: {file}"


def test_lines_of_the_plot_of_values_end_with_each_visit() -> None:
    timing = {"values_s": [1.0, 1.0, 1.1, 0.9], "t_offset_s": [0.0, 1.0, 50.0, 51.0], "visits": [2, 2]}
    drawn = str(values_plot([{"id": "cornell", "timing": timing}]))
    lines = re.findall(r'<path d="(M[^"]*)"', drawn)
    assert any((line.count("M"), line.count("L")) == (2, 2) for line in lines) and drawn.count("<circle") == 4
