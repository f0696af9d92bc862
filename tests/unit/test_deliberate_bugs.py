"""The lists of deliberate bugs keep up with the code: a bug whose place is gone proves nothing about the tests."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import bench_faults  # noqa: E402
import mutants  # noqa: E402

FAULTS = [fault for fault in bench_faults.FAULTS if fault.places]


@pytest.mark.parametrize("bug", mutants.load_mutants(), ids=lambda bug: bug.name)
def test_every_deliberate_bug_has_one_place_and_tests_that_exist(bug: mutants.Mutant) -> None:
    assert (ROOT / bug.file).read_text(encoding="utf-8").count(bug.find) == 1
    assert bug.find != bug.replace
    assert all((ROOT / test).is_file() for test in bug.tests if not test.startswith("-k"))


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_every_fault_of_a_device_has_one_place(fault: bench_faults.Fault) -> None:
    for file, find, put in fault.places:
        assert (ROOT / "cl" / file).read_text(encoding="utf-8").count(find) == 1, file
        assert find != put
