"""A checkpoint file is whole or not there: whatever moment a writer dies at, whatever is done to the bytes."""

from __future__ import annotations

import os
import resource
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from raytide.errors import RaytideError, UsageError
from raytide.render import checkpoint_file
from raytide.render.checkpoint_file import Content, old_of, read, write

CALLS = ("write", "fsync", "link", "replace")


def content(number: int) -> Content:
    """Three pieces of arrays, so that a writer can die between them."""
    values = np.random.default_rng(number).standard_normal((600, 500)).astype(np.float32)
    arrays = {"sums": values, "none": np.zeros((0, 4), np.uint32)}
    return Content({"number": number, "nested": {"a": [1.5, None]}}, arrays)


def number_of(path: Path) -> int:
    found, _ = read(path)
    number = int(found.facts["number"])
    assert np.array_equal(found.arrays["sums"], content(number).arrays["sums"])
    assert found.arrays["none"].shape == (0, 4)
    return number


def test_what_was_written_comes_back_and_one_generation_before_stays(tmp_path: Path) -> None:
    path = tmp_path / "a.ck"
    for number in range(3):
        write(path, content(number))
        assert number_of(path) == number
    path.unlink()
    assert number_of(path) == 1 and sorted(p.name for p in tmp_path.iterdir()) == ["a.ck.old"]


class Dies:
    """Kills the process at the `last`th of the calls that a writer makes, half of a write done."""

    def __init__(self, last: int) -> None:
        self.left = last

    def before(self, call: Callable[..., object]) -> Callable[..., object]:
        def counted(*arguments: object) -> object:
            self.left -= 1
            if self.left == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return call(*arguments)

        return counted


def write_and_die(path: Path, number: int, at: int) -> bool:
    """Writes in a child that is killed at its `at`th call; whether it was."""
    child = os.fork()
    if child == 0:
        dies = Dies(at)
        for name in ("fsync", "link", "replace"):
            setattr(os, name, dies.before(getattr(os, name)))
        checkpoint_file.write_all = dies.before(checkpoint_file.write_all)  # type: ignore[assignment, attr-defined]
        write(path, content(number))
        os._exit(0)
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="POSIX processes")
def test_a_writer_killed_at_any_call_leaves_a_whole_generation(tmp_path: Path) -> None:
    path = tmp_path / "a.ck"
    write(path, content(0))
    before, at, kills = 0, 1, 0
    while True:
        killed = write_and_die(path, at, at)
        assert number_of(path) in (before, at)
        before = number_of(path)
        if not killed:
            break
        kills, at = kills + 1, at + 1
    assert kills >= 7  # pieces, fsync of the file, link, both names, fsync of the folder
    assert before == at
    checkpoint_file.clear_away(path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.ck", "a.ck.old"]


@pytest.mark.parametrize("harm", ["truncated", "flipped", "emptied", "head", "foreign"])
def test_a_damaged_file_is_passed_over_for_the_generation_before(tmp_path: Path, harm: str) -> None:
    path = tmp_path / "a.ck"
    write(path, content(1))
    write(path, content(2))
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 1
    spoilt = {"truncated": whole[:-1], "flipped": bytes(flipped), "emptied": b"", "head": whole[:60],
              "foreign": b"\x76\x2f\x31\x01" + whole}  # fmt: skip
    path.write_bytes(spoilt[harm])
    found, problem = read(path)
    assert found.facts["number"] == 1 and str(path) in str(problem)
    old_of(path).write_bytes(spoilt[harm])
    with pytest.raises(UsageError) as error:
        read(path)
    assert str(path) in str(error.value) and str(old_of(path)) in str(error.value)


def test_every_truncation_is_seen(tmp_path: Path) -> None:
    path = tmp_path / "a.ck"
    write(path, Content({"number": 7}, {"sums": np.arange(40, dtype=np.float32)}))
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(UsageError):
            read(path)


def test_a_full_disk_is_told_and_costs_no_generation(tmp_path: Path) -> None:
    path = tmp_path / "a.ck"
    write(path, content(1))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (700_000, hard))
    try:
        with pytest.raises(RaytideError, match="cannot be written"):
            write(path, content(2))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert number_of(path) == 1 and [p.name for p in tmp_path.iterdir()] == ["a.ck"]
