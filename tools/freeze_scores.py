"""Freezes the benchmark's table of scores: what the embedded PoCL does here and now becomes 1000 points.

    python3 tools/run.py python tools/freeze_scores.py                       # measures first: a quarter of an hour
    python3 tools/run.py python tools/freeze_scores.py FULL.json QUICK.json  # from runs that `raytide bench -o` wrote

Needed after every change of a workload or of SUITE_VERSION, on an idle machine of two cores, from a clean checkout.
Refuses runs that are not whole, not right, not of the closed class, or that others disturbed; --nevertheless takes
those of the latter two. Commit what it wrote before anything is scored by it: an edited table makes a run `open`.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "host"))

from raytide.bench.files import load_result  # noqa: E402
from raytide.bench.record import SUITE_VERSION  # noqa: E402
from raytide.bench.score import FILE, reference_table  # noqa: E402
from raytide.bench.workloads import WORKLOADS  # noqa: E402

DEVICE = "pocl-3.0rc"
DIGITS = 4  # of a rate


def main(words: list[str] | None = None) -> int:
    """Exit code: 4 where a run will not do."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, help="results of suites full, quick or renders")
    parser.add_argument("--nevertheless", action="store_true", help="take open, disturbed and unstable runs too")
    wanted = parser.parse_args(words)
    with tempfile.TemporaryDirectory(prefix="raytide-freeze-") as folder:
        results = [load_result(file) for file in wanted.files or measured(Path(folder))]
    bad = [f"{one['suite']}: {reason}" for one in results for reason in refusals(one, wanted.nevertheless)]
    for line in bad:
        print(f"refused: {line}", file=sys.stderr)
    if bad:
        return 4
    before, table = reference_table(), frozen(results, reference_table())
    FILE.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    for one in results:
        plan = one["plan"]["name"]
        for name, rate in table[plan].items():
            print(f"{plan} {name}: {before[plan][name]:.4g} -> {rate:.4g} rays/s")
    print(f"wrote {FILE.relative_to(ROOT)}, version {table['version']}: commit it")
    return 0


def measured(folder: Path) -> list[Path]:
    """Files of both suites, on the embedded PoCL."""
    files = []
    for suite in ("full", "quick"):
        files.append(folder / f"{suite}.bench.json")
        words = ["bench", "--suite", suite, "--device", DEVICE, "-o", str(files[-1])]
        subprocess.run([sys.executable, "-m", "raytide", *words], cwd=ROOT)
    return files


def refusals(result: dict[str, Any], nevertheless: bool = False) -> list[str]:
    """Why the table cannot come from this run; empty where it can."""
    found = {one["id"]: one for one in result["workloads"]}
    out = [f"{name} is {found[name]['status'] if name in found else 'missing'}" for name in WORKLOADS
           if found.get(name, {}).get("status") != "ok"]  # fmt: skip
    if DEVICE not in result["device_id"]:
        out.append(f"came device {result['device_id']}; wanted the embedded PoCL ({DEVICE})")
    if result["tool"]["suite_version"] != SUITE_VERSION:
        out.append(f"came suite {result['tool']['suite_version']}; wanted {SUITE_VERSION}")
    if not nevertheless:
        out += [f"{name} is {word}" for name, one in found.items() for word in ("disturbed", "unstable")
                if (one.get("summary") or {}).get(word)]  # fmt: skip
        out += [f"the run is open: {reason}" for reason in result["class_reasons"]]
    return out


def frozen(results: list[dict[str, Any]], before: dict[str, Any]) -> dict[str, Any]:
    """The new table; a plan that nobody measured keeps its rates."""
    made_on = f"embedded PoCL 3.0-rc2, two cores of an AMD EPYC, {results[-1]['created_utc'][:10]}"
    rates = {one["plan"]["name"]: {row["id"]: float(f"{row['summary']['median']:.{DIGITS}g}")
                                   for row in one["workloads"]} for one in results}  # fmt: skip
    return {**before, "version": SUITE_VERSION, "made_on": made_on, **rates}


if __name__ == "__main__":
    sys.exit(main())
