"""Deliberate bugs that the tests must catch: puts each in, runs the tests that should fail, prints a table.

    python3 tools/run.py python tools/mutants.py [--only WORD] [--part K/N] [--unchecked] [--list] [--json FILE]

Every entry of tools/mutants.toml changes one place of a copy of the project, never the project itself. A mutant is
killed when a named test fails, alive when they all pass, stale when its place is not there exactly once, and broken
when a test ends by something else than an assertion (a kernel that no longer compiles proves nothing about the laws).
First all named tests must pass without any bug.
Exit code 0: all killed; 4 otherwise. About twenty seconds each; not part of CI.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PARTS = (".ci", "cl", "host", "scenes", "tests", "tools", "docs", "pyproject.toml", "README.md", "LICENSE",
         "CHANGELOG.md")  # fmt: skip
LIMIT = 600  # seconds for the tests of one mutant
BUILD_FAULTS = ("DeviceError", "SyntaxError", "ImportError", "ModuleNotFoundError", "CL_BUILD", "error: ")


@dataclass(frozen=True)
class Mutant:
    """One bug: `find` in `file` becomes `replace`; the pytest arguments `tests` should fail then."""

    name: str
    file: str
    find: str
    replace: str
    tests: list[str]


@dataclass(frozen=True)
class Verdict:
    """What came of it: "killed", "alive", "stale" or "broken", by which test, after how many seconds."""

    name: str
    state: str
    by: str
    seconds: float


def main() -> int:
    """Exit code: 0 where every mutant is killed, else 4."""
    wanted = options()
    mutants = [one for one in load_mutants() if wanted.only in one.name or wanted.only in one.tests]
    mutants = part_of(mutants, wanted.part)
    if wanted.list:
        for one in mutants:
            print(f"{one.name}  ({one.file})")
        return 0
    verdicts = []
    with tempfile.TemporaryDirectory(prefix="raytide-mutants-") as folder:
        sound = "" if wanted.unchecked else check_unchanged(mutants, Path(folder))
        if sound:
            print(f"mutants: without any bug, these fail: {sound}", file=sys.stderr)
            return 4
        for one in mutants:
            verdicts.append(judge(one, Path(folder)))
            print(f"{verdicts[-1].state:>7}  {one.name}  {verdicts[-1].seconds:.0f} s", file=sys.stderr, flush=True)
    print_table(mutants, verdicts)
    if wanted.json:
        wanted.json.write_text(json.dumps([asdict(one) for one in verdicts], indent=1) + "\n", encoding="utf-8")
    return 0 if all(one.state == "killed" for one in verdicts) else 4


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="names that hold this word, or those of this test file")
    parser.add_argument("--part", default="1/1", help="the K-th of N parts of them, K/N")
    parser.add_argument("--unchecked", action="store_true", help="do not run the tests without any bug first")
    parser.add_argument("--list", action="store_true", help="print the names and stop")
    parser.add_argument("--json", type=Path, help="write the verdicts to this file")
    return parser.parse_args()


def part_of(mutants: list[Mutant], part: str) -> list[Mutant]:
    """Every N-th from the K-th on, for machines on which commands must end soon."""
    k, n = (int(word) for word in part.split("/"))
    return mutants[k - 1 :: n]


def load_mutants() -> list[Mutant]:
    """All entries of mutants.toml, in order."""
    rows = tomllib.loads((ROOT / "tools" / "mutants.toml").read_text(encoding="utf-8"))["mutant"]
    return [Mutant(**row) for row in rows]


def fresh_copy(folder: Path) -> Path:
    """The project as it is, in folder/copy."""
    copy = folder / "copy"
    shutil.rmtree(copy, ignore_errors=True)
    copy.mkdir()
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            shutil.copytree(source, copy / part, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, copy / part)
    return copy


def check_unchanged(mutants: list[Mutant], folder: Path) -> str:
    """The first failure of all named tests on the project as it is; empty where they pass."""
    copy = fresh_copy(folder)
    for tests in joined_tests(mutants):
        state, by = run_tests(copy, tests, folder / "cache")
        if state != "alive":
            return by
    return ""


def joined_tests(mutants: list[Mutant]) -> list[list[str]]:
    """All named tests as few pytest commands: those of whole files, then each file whose tests are picked by -k."""
    whole = {test for one in mutants if not one.tests[-1].startswith("-k") for test in one.tests}
    picked: dict[str, list[str]] = {}
    for one in mutants:
        if one.tests[-1].startswith("-k"):
            picked.setdefault(one.tests[0], []).append(one.tests[-1][2:])
    found = [sorted(whole)] if whole else []
    picked = {file: words for file, words in picked.items() if file not in whole}
    found += [[file, "-k" + " or ".join(f"({word})" for word in sorted(set(words)))] for file, words in picked.items()]
    return found


def judge(mutant: Mutant, folder: Path) -> Verdict:
    """Copy, change, test. The copies share one cache, which holds programs by the digest of their source."""
    start = time.perf_counter()
    copy = fresh_copy(folder)
    target = copy / mutant.file
    text = target.read_text(encoding="utf-8")
    if text.count(mutant.find) != 1:
        return Verdict(mutant.name, "stale", f"found {text.count(mutant.find)} times", time.perf_counter() - start)
    target.write_text(text.replace(mutant.find, mutant.replace), encoding="utf-8")
    state, by = run_tests(copy, mutant.tests, folder / "cache")
    return Verdict(mutant.name, state, by, time.perf_counter() - start)


def run_tests(copy: Path, tests: list[str], cache: Path) -> tuple[str, str]:
    """Verdict of the tests in `copy` on the default device, and the first test that failed."""
    environment = {**os.environ, "PYTHONPATH": str(copy / "host"), "RAYTIDE_TEST_CACHE": str(cache)}
    environment.setdefault("RAYTIDE_TEST_DEVICES", default_device())
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--tb=short", *tests]
    try:
        done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return "broken", f"no end within {LIMIT} s"
    if done.returncode == 0:
        return "alive", ""
    failed = re.search(r"^FAILED (.+?)(?: - |$)", done.stdout, re.MULTILINE)
    if done.returncode != 1 or not failed:
        return "broken", (done.stdout + done.stderr).strip().splitlines()[-1]
    reasons = [line for line in done.stdout.splitlines() if line.startswith("E ")]
    faults = [line for line in reasons if any(fault in line for fault in BUILD_FAULTS)]
    return ("broken", faults[0]) if faults else ("killed", failed[1].replace("tests/", ""))


def default_device() -> str:
    """Id of the device that a render takes where none is named."""
    sys.path.insert(0, str(ROOT / "host"))
    from raytide.device import pick

    return pick().id


def print_table(mutants: list[Mutant], verdicts: list[Verdict]) -> None:
    """Markdown, one row a mutant."""
    print("| bug | where | verdict | test that failed first |\n| --- | --- | --- | --- |")
    for mutant, verdict in zip(mutants, verdicts, strict=True):
        print(f"| {mutant.name} | `{mutant.file}` | {verdict.state} | {verdict.by} |")
    killed = sum(one.state == "killed" for one in verdicts)
    print(f"\n{killed} of {len(verdicts)} killed")


if __name__ == "__main__":
    sys.exit(main())
