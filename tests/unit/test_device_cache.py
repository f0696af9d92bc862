"""Laws of the checked cache and of PoCL's private folder. No device."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from raytide.device import rundir
from raytide.device.cache import FileCache, digest
from raytide.device.storage import cache_facts, clear_cache

KEY = digest("a key")
PAYLOAD = bytes(range(256)) * 8


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FileCache:
    monkeypatch.setenv("RAYTIDE_CACHE_DIR", str(tmp_path))
    return FileCache("kernels")


def test_what_was_put_comes_back(cache: FileCache) -> None:
    cache.put(KEY, {"name": "shade"}, PAYLOAD)
    entry = cache.get(KEY)
    assert entry is not None and entry.payload == PAYLOAD and entry.facts == {"name": "shade"}
    assert cache.get(digest("another key")) is None


def test_no_flipped_byte_passes_the_digest(cache: FileCache) -> None:
    cache.put(KEY, {"name": "shade"}, PAYLOAD)
    whole = cache.path(KEY).read_bytes()
    for place in [*range(120), *range(120, len(whole), 97), len(whole) - 1]:
        damaged = bytearray(whole)
        damaged[place] ^= 1
        cache.path(KEY).write_bytes(damaged)
        assert cache.get(KEY) is None, f"a flip of byte {place} went unnoticed"
        assert not cache.path(KEY).exists(), "a damaged entry stays for the next run"


@pytest.mark.parametrize("damage", ["truncate", "empty", "zero", "garbage", "longer"])
def test_damaged_entries_are_dropped(cache: FileCache, damage: str) -> None:
    cache.put(KEY, {}, PAYLOAD)
    path = cache.path(KEY)
    whole = path.read_bytes()
    contents = {"truncate": whole[:-1], "empty": b"", "zero": bytes(len(whole)), "garbage": os.urandom(len(whole)),
                "longer": whole + b"x"}  # fmt: skip
    path.write_bytes(contents[damage])
    assert cache.get(KEY) is None and not path.exists()


def test_damage_is_told_once_for_all_entries(cache: FileCache, caplog: pytest.LogCaptureFixture) -> None:
    for name in "abc":
        cache.put(digest(name), {}, PAYLOAD)
        cache.path(digest(name)).write_bytes(b"junk")
        cache.get(digest(name))
    with caplog.at_level(logging.WARNING):
        cache.report_damage()
        cache.report_damage()
    assert len(caplog.records) == 1 and "3 damaged entries" in caplog.text


def test_borders_between_parts_count() -> None:
    assert digest("ab", "c") != digest("a", "bc") != digest("abc")


def test_readers_beside_writers_never_see_a_torn_entry(cache: FileCache) -> None:
    cache.put(KEY, {}, PAYLOAD)

    def work(number: int) -> bool:
        other = FileCache("kernels")
        for turn in range(40):
            other.put(KEY, {"writer": number}, PAYLOAD * (1 + turn % 3))
            entry = other.get(KEY)
            if entry is None or entry.payload[: len(PAYLOAD)] != PAYLOAD:
                return False
        return True

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(work, range(8)))
    assert len(cache.files()) == 1, "temporary files were left behind"


def test_least_recently_used_entries_leave_first(cache: FileCache) -> None:
    for age, name in enumerate("abcde"):
        cache.put(digest(name), {}, bytes(1000))
        stamp = time.time() - 100 + age
        os.utime(cache.path(digest(name)), (stamp, stamp))
    cache.get(digest("a"))  # used now: the oldest becomes the youngest
    cache.evict(4500)
    left = [name for name in "abcde" if cache.path(digest(name)).exists()]
    assert left == ["a", "d", "e"]


def test_cap_holds_however_much_is_put(cache: FileCache, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYTIDE_CACHE_MB", "0.02")
    for number in range(30):
        cache.put(digest(str(number)), {}, bytes(2000))
    assert 0 < sum(facts.st_size for _, facts in cache.files()) <= 20_000


def test_a_cache_that_cannot_be_written_warns_once_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("RAYTIDE_CACHE_DIR", str(tmp_path / "file" / "below"))
    cache = FileCache("kernels")
    with caplog.at_level(logging.WARNING):
        cache.put(KEY, {}, PAYLOAD)
        cache.put(KEY, {}, PAYLOAD)
    assert cache.get(KEY) is None and len(caplog.records) == 1


def test_clear_leaves_nothing_and_tells_how_much(cache: FileCache) -> None:
    cache.put(KEY, {}, PAYLOAD)
    cache.path(KEY).write_bytes(b"junk")
    facts = cache_facts(verify=True)
    assert facts.damaged == 1 and facts.parts[0].entries == 1
    assert clear_cache() == 4
    assert cache_facts().parts[0].entries == 0


def _folder_maker(base: Path) -> subprocess.Popen[bytes]:
    """A process that holds a private folder below `base` until it is ended."""
    code = "import time; from raytide.device.rundir import private_folder as f; print(f(), flush=True); time.sleep(9e2)"
    environment = {**os.environ, "POCL_CACHE_DIR": str(base), "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE)


def test_folders_of_killed_processes_are_swept_and_those_of_living_ones_stay(tmp_path: Path) -> None:
    living, dead = _folder_maker(tmp_path), _folder_maker(tmp_path)
    assert living.stdout and dead.stdout
    kept, lost = (Path(process.stdout.readline().decode().strip()) for process in (living, dead))  # type: ignore
    dead.send_signal(signal.SIGKILL)
    dead.wait()
    dead.stdout.close()
    try:
        assert rundir.abandoned_folders(tmp_path) == [lost]
        rundir._sweep(tmp_path)
        assert kept.exists() and not lost.exists()
    finally:
        living.kill()
        living.wait()
        living.stdout.close()


def test_a_process_that_ends_takes_its_folder_with_it(tmp_path: Path) -> None:
    code = "from raytide.device.rundir import private_folder as f; p = f(); (p / 'x').write_text('y')"
    environment = {**os.environ, "POCL_CACHE_DIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)
    assert list(tmp_path.iterdir()) == []
