"""Freezes the benchmark's table of scores: what the embedded PoCL does here and now becomes 1000 points.

    python3 tools/run.py python tools/freeze_scores.py            # measures first: a quarter of an hour
    python3 tools/run.py python tools/freeze_scores.py FILE ...   # from runs that `raytide bench -o` wrote

Needed after every change of a workload or of SUITE_VERSION, on an idle machine of two cores, from a clean checkout.
A rate is the median of those of all runs of its suite. Refuses runs that are not whole, not right, not of the
closed class, or edited since they were written. One run or two must be known to 3 % each, and undisturbed; of three or
more the median must be known to 3 % by how the runs differ. --nevertheless takes what is not known so well. Commit what
it wrote before anything is scored by it: an edited table makes a run `open`.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "host"))

from raytide.bench.doubts import ADVICE, flags_of  # noqa: E402
from raytide.bench.files import load_result  # noqa: E402
from raytide.bench.record import SUITE_VERSION  # noqa: E402
from raytide.bench.score import FILE, reference_table  # noqa: E402
from raytide.bench.workloads import WORKLOADS  # noqa: E402

DEVICE = "pocl-3.0rc"
DIGITS = 4  # of a rate
ENOUGH = 3  # runs of a suite, from which how they differ tells how well the median is known
KNOWN = 0.03  # relative standard error of a rate


def main(words: list[str] | None = None) -> int:
    """Exit code: 4 where a run will not do."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, help="results of suites full, quick or renders")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="of each plan, where no files are given")
    parser.add_argument("--nevertheless", action="store_true", help="take open, disturbed and unstable runs too")
    wanted = parser.parse_args(words)
    with tempfile.TemporaryDirectory(prefix="raytide-freeze-") as folder:
        results = [load_result(file) for file in wanted.files or measured(Path(folder), wanted.runs)]
    suites: dict[str, list[dict[str, Any]]] = {}
    for one in results:
        suites.setdefault(one["plan"]["name"], []).append(one)
    bad = [f"{one['suite']}: {reason}" for one in results for reason in refusals(one)]
    if not bad and not wanted.nevertheless:
        bad = [f"{name}: {reason}" for name, runs in suites.items() for reason in unknown(runs)]
    for line in bad:
        print(f"refused: {line}", file=sys.stderr)
    if bad:
        return 4
    before, table = reference_table(), frozen(suites, reference_table())
    FILE.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    for plan, runs in suites.items():
        for name, rate in table[plan].items():
            rates = ", ".join(f"{one:.4g}" for one in rates_of(runs, name))
            print(f"{plan} {name}: {before[plan][name]:.4g} -> {rate:.4g} rays/s, of {rates}")
    print(f"wrote {FILE.relative_to(ROOT)}, version {table['version']}: commit it")
    return 0


def measured(folder: Path, runs: int) -> list[Path]:
    """Files of the workloads by both plans in turn, on the embedded PoCL."""
    files = []
    for k in range(runs):
        for plan, options in (("full", []), ("quick", ["--quick"])):
            files.append(folder / f"{plan}-{k}.bench.json")
            words = ["bench", "--suite", "renders", *options, "--device", DEVICE, "-o", str(files[-1])]
            subprocess.run([sys.executable, "-m", "raytide", *words], cwd=ROOT)
    return files


def refusals(result: dict[str, Any]) -> list[str]:
    """Why no table can come from this run; empty where it can."""
    found = {one["id"]: one for one in result["workloads"]}
    out = [f"{name} is {found[name]['status'] if name in found else 'missing'}" for name in WORKLOADS
           if found.get(name, {}).get("status") != "ok"]  # fmt: skip
    if DEVICE not in result["device_id"]:
        out.append(f"came device {result['device_id']}; wanted the embedded PoCL ({DEVICE})")
    if result["tool"]["suite_version"] != SUITE_VERSION:
        out.append(f"came suite {result['tool']['suite_version']}; wanted {SUITE_VERSION}")
    out += ["the file was edited since it was written"] if result.get("edited") else []
    return out + [f"the run is open: {reason}" for reason in result["class_reasons"]]


def unknown(runs: list[dict[str, Any]]) -> list[str]:
    """Which rates these runs of one suite do not tell to 3 %, and why."""
    if len(runs) < ENOUGH:
        return [f"{row['id']} is {flag}; run it again, or {ENOUGH} times" for one in runs for row in one["workloads"]
                for flag in flags_of(row) if flag in ADVICE]  # fmt: skip
    errors = {name: median_error(rates_of(runs, name)) for name in WORKLOADS}
    return [f"{name} is known to {100 * error:.1f} % from {len(runs)} runs; wanted {100 * KNOWN:.0f} %"
            for name, error in errors.items() if error > KNOWN]  # fmt: skip


def rates_of(runs: list[dict[str, Any]], name: str) -> list[float]:
    """Rays per second of one workload, a value a run."""
    return [row["summary"]["median"] for one in runs for row in one["workloads"] if row["id"] == name]


def median_error(values: list[float]) -> float:
    """Standard error of the median of a few values, relative to it: sqrt(pi / 2) s / sqrt(n), with s from the median
    absolute deviation, so that one value far off decides nothing."""
    middle = statistics.median(values)
    deviation = 1.4826 * statistics.median(abs(value - middle) for value in values)
    return math.sqrt(math.pi / (2 * len(values))) * deviation / middle


def frozen(suites: dict[str, list[dict[str, Any]]], before: dict[str, Any]) -> dict[str, Any]:
    """The new table from the runs of each plan; a plan that nobody measured keeps its rates."""
    day = max(one["created_utc"] for runs in suites.values() for one in runs)[:10]
    made_on = f"embedded PoCL 3.0-rc2, two cores of an AMD EPYC, {day}"
    rates = {plan: {name: float(f"{statistics.median(rates_of(runs, name)):.{DIGITS}g}") for name in WORKLOADS}
             for plan, runs in suites.items()}  # fmt: skip
    return {**before, "version": SUITE_VERSION, "made_on": made_on, **rates}


if __name__ == "__main__":
    sys.exit(main())
