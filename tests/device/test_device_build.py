"""Laws of building: caches that heal, compilers that crash, processes side by side."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from raytide.device import Device, open_device
from raytide.device.children import Children
from raytide.device.compile import binary_key
from raytide.device.worker import Worker, WorkerDied
from raytide.errors import DeviceError
from raytide.kernels.source import Source

TEXT = "kernel void number(global uint *out) { out[get_global_id(0)] = 42u; }"
SOURCE = Source("number", TEXT, hashlib.sha256(TEXT.encode()).hexdigest(), (), "")


@pytest.fixture
def fresh(device: Device, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Device]:
    """The same device with caches of its own; the probe's result is taken along to spare its build."""
    monkeypatch.setenv("RAYTIDE_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("RAYTIDE_BUILD_WORKERS", "0")  # each child costs half a second to start
    probes = device.probes
    opened = open_device(device.info)
    opened._probes = probes
    yield opened
    opened.close()


def again(device: Device) -> Device:
    """The same device as a later process would open it."""
    opened = open_device(device.info)
    opened._probes = device._probes
    return opened


def result_of(device: Device) -> tuple[str, int]:
    program = device.build({"number": SOURCE})["number"]
    out = device.empty(4)
    device.launch(program, "number", 1, 1, out)
    return program.cache, int(device.read(out, np.uint32, 1)[0])


def entry_of(device: Device) -> Path:
    key = binary_key(device.info, device.options, SOURCE.sha256)
    return device._builder._cache.path(key)


def test_the_second_build_comes_from_the_cache_and_does_the_same(
    fresh: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert result_of(fresh) == ("miss", 42)
    monkeypatch.setattr("raytide.device.build.compile_text", None)  # nothing is compiled again
    with again(fresh) as later:
        assert result_of(later) == ("hit", 42)
        program = later.build({"number": SOURCE})["number"]
        assert program.sha256 == SOURCE.sha256


def test_damaged_entries_recover_unattended_with_one_warning(fresh: Device, caplog: pytest.LogCaptureFixture) -> None:
    result_of(fresh)
    path = entry_of(fresh)
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 4
    for damage in (whole[: len(whole) // 2], flipped):
        path.write_bytes(damage)
        caplog.clear()
        with caplog.at_level(logging.WARNING), again(fresh) as later:
            assert result_of(later) == ("miss", 42)
        assert len(caplog.records) == 1 and "1 damaged entry" in caplog.text


def test_a_sound_entry_that_the_driver_refuses_is_built_anew(fresh: Device) -> None:
    result_of(fresh)
    fresh._builder._cache.put(binary_key(fresh.info, fresh.options, SOURCE.sha256), {}, b"not a program at all")
    with again(fresh) as later:
        assert result_of(later) == ("miss", 42)


def test_two_builds_of_one_batch_keep_their_order_and_are_told_as_they_are_done(fresh: Device) -> None:
    told: list[str] = []
    texts = {name: TEXT.replace("42u", f"{number}u") for number, name in enumerate("ab")}
    sources = {
        name: Source(name, text, hashlib.sha256(text.encode()).hexdigest(), (), "") for name, text in texts.items()
    }
    programs = fresh.build(sources, lambda program: told.append(program.name))
    assert list(programs) == ["a", "b"] and sorted(told) == ["a", "b"]


def test_damage_in_an_old_cache_of_pocl_cannot_reach_a_render(device: Device, tmp_path: Path) -> None:
    """PoCL trusts what lies in its cache and dies of it; raytide gives it an empty one."""
    if device.kind != "pocl":
        pytest.skip("PoCL only")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "RAYTIDE_CACHE_DIR": str(tmp_path / "ours")}
    environment |= {"POCL_CACHE_DIR": str(tmp_path / "pocl"), "RAYTIDE_BUILD_WORKERS": "0"}
    (tmp_path / "pocl").mkdir()
    plain = (
        "import sys, numpy as np, pyopencl as cl\n"
        "p = [p for p in cl.get_platforms() if sys.argv[1] in p.version][0]\n"
        "c = cl.Context(p.get_devices()); q = cl.CommandQueue(c); b = cl.Buffer(c, 1, 4)\n"
        f"k = cl.Kernel(cl.Program(c, {TEXT!r}).build(['-cl-std=CL1.2']), 'number')\n"
        "k.set_arg(0, b); cl.enqueue_nd_range_kernel(q, k, (1,), (1,)).wait()"
    )
    version = device.info.driver
    assert subprocess.run([sys.executable, "-c", plain, version], env=environment, check=False).returncode == 0
    libraries = list((tmp_path / "pocl").rglob("*.so"))
    assert libraries
    for library in libraries:
        library.write_bytes(library.read_bytes()[:64])
    broken = subprocess.run([sys.executable, "-c", plain, version], env=environment, check=False, capture_output=True)
    assert broken.returncode < 0, "the damage of this test does no harm: it proves nothing"
    ours = (
        "import sys; sys.path[:0] = sys.argv[2:]\n"
        "from test_device_build import *\n"
        "with open_device(sys.argv[1]) as d: print(result_of(d)[1])"
    )
    here = str(Path(__file__).parent)
    done = subprocess.run(
        [sys.executable, "-c", ours, device.info.id, here], env=environment, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "42", done.stderr


def test_processes_share_one_cache(device: Device, tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "RAYTIDE_CACHE_DIR": str(tmp_path)}
    environment.pop("POCL_CACHE_DIR", None)
    environment["RAYTIDE_BUILD_WORKERS"] = "0"
    code = (
        "import sys; sys.path[:0] = sys.argv[2:]\n"
        "from test_device_build import *\n"
        "with open_device(sys.argv[1]) as d: print(result_of(d)[1])"
    )
    command = [sys.executable, "-c", code, device.info.id, str(Path(__file__).parent)]
    running = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE) for _ in range(3)]
    assert [process.communicate()[0].decode().strip() for process in running] == ["42"] * 3
    left = [path for path in (tmp_path / "kernels").rglob("*") if path.name.startswith(".")]
    assert left == [] and not list((tmp_path / "pocl").glob("raytide-run-*"))


def stop(worker: Worker) -> None:
    """Makes a compiler slower than any limit, however slow its parent is."""
    worker._process.send_signal(signal.SIGSTOP)


def test_a_compiler_that_is_too_slow_or_crashes_is_told(device: Device) -> None:
    if device.kind != "pocl":
        pytest.skip("only PoCL compiles in children")
    worker = Worker(device.info)
    stop(worker)
    with pytest.raises(WorkerDied, match="crashed on program 'number'.*signal 9"):
        worker.compile("number", TEXT, device.options, limit_s=0.1)
    assert not worker.alive
    worker.close()


def test_one_crash_is_tried_again_and_two_are_an_error(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    if device.kind != "pocl":
        pytest.skip("only PoCL compiles in children")
    compile_once = Worker.compile
    crashes = [1]

    def crash_first(self: Worker, *job: object) -> object:
        if crashes[0]:
            crashes[0] -= 1
            stop(self)
            return compile_once(self, *job, limit_s=0.1)  # type: ignore[arg-type]
        return compile_once(self, *job)  # type: ignore[arg-type]

    monkeypatch.setattr(Worker, "compile", crash_first)
    children = Children(device.info)
    assert children.compile("number", TEXT, device.options).binary
    crashes[0] = 2
    with pytest.raises(DeviceError, match="try another --device"):
        children.compile("number", TEXT, device.options)
    children.close()


def test_children_that_leave_after_a_rest_cost_no_build(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """All idle ones leave at the same time, which is between a look at them and the next program for once."""
    if device.kind != "pocl":
        pytest.skip("only PoCL compiles in children")
    children = Children(device.info)
    idle = [Worker(device.info) for _ in range(2)]
    for worker in idle:
        children._idle.put(worker)
        worker._process.kill()
        worker._process.wait()
    monkeypatch.setattr(Worker, "stays", True)
    assert children.compile("number", TEXT, device.options).binary
    monkeypatch.undo()
    rested = Worker(device.info)
    assert rested.stays
    monkeypatch.setattr("raytide.device.worker._IDLE_S", 0.0)
    assert rested.alive and not rested.stays
    rested.close()
    children.close()


SLOW = """
import sys, time, hashlib
from raytide.device import open_device
from raytide.kernels.source import Source
lines = "\\n".join(f"x = sin(x + {n}.5f) * cos(x - y); y = exp(-x * y) + log(fabs(y) + {n}.25f);" for n in range(3000))
text = "kernel void slow(global float *a) { float x = a[0], y = a[1];" + lines + " a[0] = x + y; }"
device = open_device(sys.argv[1])
print("compiling", flush=True)
try:
    device.build({"slow": Source("slow", text, hashlib.sha256(text.encode()).hexdigest(), (), "")})
    print("built", flush=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


def test_an_interrupt_ends_compiling_at_once(device: Device, tmp_path: Path) -> None:
    if device.kind != "pocl" or not Path("/proc/self/task").exists():
        pytest.skip("only PoCL compiles in children, and only Linux tells whose they are")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "RAYTIDE_CACHE_DIR": str(tmp_path)}
    environment.pop("POCL_CACHE_DIR", None)
    process = subprocess.Popen([sys.executable, "-c", SLOW, device.info.id], env=environment, stdout=subprocess.PIPE)
    assert process.stdout
    assert process.stdout.readline() == b"compiling\n"
    try:
        os.kill(child_of(process), signal.SIGSTOP)  # it never ends by itself, however slow the machine is
        time.sleep(2)  # until the parent waits for it: a signal just before a wait is seen after it
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=120)[0] == b"interrupted\n"  # after 0.2 s on an idle machine
    finally:
        process.kill()


def child_of(process: subprocess.Popen[bytes]) -> int:
    """The number of a process's first child, once it has one."""
    while True:
        assert process.poll() is None
        for listed in Path(f"/proc/{process.pid}/task").glob("*/children"):
            with contextlib.suppress(OSError):  # of a thread that ended
                if found := listed.read_text().split():
                    return int(found[0])
        time.sleep(0.01)


def test_a_child_that_is_made_while_all_are_ended_is_ended_too(
    device: Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    children, killed = Children(device.info), []

    class Late:
        """A child whose start is still going on when Ctrl-C comes."""

        def __init__(self, info: object) -> None:
            children.stop()

        def kill(self) -> None:
            killed.append(self)

        def compile(self, *job: object) -> None:
            raise WorkerDied("killed" if killed else "it goes on")

        def close(self) -> None:
            """Nothing."""

    monkeypatch.setattr("raytide.device.children.Worker", Late)
    with pytest.raises(WorkerDied, match="killed"):
        children.compile("number", TEXT, ())
    assert len(killed) == 1


def test_children_and_the_process_itself_build_the_same(fresh: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    assert result_of(fresh) == ("miss", 42) and fresh._builder._children is None
    entry_of(fresh).unlink()
    monkeypatch.delenv("RAYTIDE_BUILD_WORKERS")
    with again(fresh) as later:
        assert result_of(later) == ("miss", 42)
        assert (later._builder._children is not None) == (fresh.kind == "pocl")
