"""Laws of what a process gets before its first driver: threads that there are, and a working folder with room."""

from __future__ import annotations

import logging
import shutil
from collections import namedtuple
from pathlib import Path

import pytest

from raytide.cli.main import main
from raytide.device import environment, open_device, rundir
from raytide.device.doctor import caches_check
from raytide.errors import UsageError

Usage = namedtuple("Usage", "total used free")


@pytest.mark.parametrize("threads", [0, -1, 1.5, True, "2"])
def test_threads_below_one_are_refused_before_a_driver_is_asked(threads: object) -> None:
    with pytest.raises(UsageError, match="wanted a whole number from 1 to"):
        open_device("no such device", threads=threads)  # type: ignore[arg-type]
    assert main(["verify", "--case", "T2", "--threads", "0"]) == 2


def test_more_threads_than_processors_are_as_many_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    most = environment.processors()
    with caplog.at_level(logging.WARNING, "raytide.device"):
        assert environment.checked_threads(most) == most and environment.checked_threads(None) is None
        assert not caplog.records
        assert environment.checked_threads(100_000) == most
    assert "came 100000" in caplog.text


@pytest.fixture
def full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that does not exist yet, on a disk with 1,000 bytes left; the temporary folder has room."""
    folder = tmp_path / "full"
    folder.mkdir()

    def usage(path: Path) -> Usage:
        return Usage(2**40, 0, 1000 if Path(path).is_relative_to(folder) else 2**39)

    monkeypatch.setattr(shutil, "disk_usage", usage)
    monkeypatch.setattr(rundir.tempfile, "gettempdir", lambda: str(tmp_path))
    return folder / "cache"


def test_a_full_disk_gives_the_working_folder_away(
    full: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("POCL_CACHE_DIR", str(full))
    with caplog.at_level(logging.WARNING, "raytide.device"):
        assert rundir.private_folder().parent == tmp_path
    assert str(full) in caplog.text and not full.exists()
    caplog.clear()
    monkeypatch.setattr(rundir.tempfile, "gettempdir", lambda: str(full.parent))
    with caplog.at_level(logging.WARNING, "raytide.device"):
        assert rundir.private_folder().parent == full  # no disk has room: one of them may do nevertheless
    assert "may not build" in caplog.text


def test_a_quota_that_the_free_space_does_not_show_counts_as_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**options: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(shutil, "disk_usage", lambda place: Usage(2**40, 0, 2**39))
    assert rundir.has_room(tmp_path / "not" / "there")
    monkeypatch.setattr(rundir.tempfile, "TemporaryFile", refuse)
    assert not rundir.has_room(tmp_path / "not" / "there")


def test_doctor_warns_of_a_full_disk(full: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYTIDE_CACHE_DIR", str(full))
    check = caches_check()
    assert check.state == "warn" and "full" in check.detail and check.fix
