"""Laws of buffers, launches, times and errors on every device."""

from __future__ import annotations

import gc
import hashlib
import mmap
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from raytide.device import BuildFailure, Device, OpenCLFailure, Program
from raytide.device.probe import probe_source, run_probe
from raytide.errors import DeviceError
from raytide.kernels.source import Source

TEXT = """#line 1 "extra/numbers.cl"
kernel void count_up(global uint *numbers, const uint count, const float unused)
{
    const uint i = get_global_id(0);
    if (i >= count) return;
    numbers[i] += i;
}

kernel void group_sum(global const uint *numbers, global uint *sums)
{
    local uint shared_sum;
    if (get_local_id(0) == 0u) shared_sum = 0u;
    barrier(CLK_LOCAL_MEM_FENCE);
    atomic_add(&shared_sum, numbers[get_global_id(0)]);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0u) sums[get_group_id(0)] = shared_sum;
}
"""


def source(name: str, text: str) -> Source:
    return Source(name, text, hashlib.sha256(text.encode()).hexdigest(), (), "")


@pytest.fixture(scope="session")
def program(device: Device) -> Program:
    return device.build({"numbers": source("numbers", TEXT)})["numbers"]


def test_what_goes_in_comes_out(device: Device) -> None:
    numbers = np.arange(1000, dtype=np.float32).reshape(10, 100)
    buffer = device.upload(numbers)
    assert buffer.nbytes == 4000
    assert np.array_equal(device.read(buffer, np.float32, 1000), numbers.ravel())
    device.write(buffer, np.full(3, -1.0, np.float32), offset=8)
    assert device.read(buffer, np.float32, 4, offset=4).tolist() == [1.0, -1.0, -1.0, -1.0]
    device.write(buffer, numbers.T[:2])  # not contiguous
    assert device.read(buffer, np.float32, 20).tolist() == numbers.T[:2].ravel().tolist()


def test_a_read_for_later_knows_nothing_of_later_launches(device: Device, program: Program) -> None:
    buffer = device.upload(np.zeros(64, np.uint32))
    device.launch(program, "count_up", 64, 64, buffer, np.uint32(64), np.float32(0))
    once = device.read_later(buffer, np.uint32, 64)
    device.launch(program, "count_up", 64, 64, buffer, np.uint32(64), np.float32(0))
    assert device.read(buffer, np.uint32, 64).tolist() == [2 * i for i in range(64)]
    assert once().tolist() == list(range(64)) and once().tolist() == list(range(64))


def marked_for_large_pages(address: int) -> bool:
    """Whether the mapping around `address` of this process carries Linux' mark "hg"."""
    for begin, end, flags in re.findall(
        r"^([0-9a-f]+)-([0-9a-f]+) .*\n(?:[A-Z].*\n)*?VmFlags:(.*)", Path("/proc/self/smaps").read_text(), re.MULTILINE
    ):
        if int(begin, 16) <= address < int(end, 16):
            return " hg" in flags
    return False


def test_big_buffers_of_cpus_lie_where_large_pages_were_asked_for(device: Device) -> None:
    if device.info.type != "cpu" or not hasattr(mmap, "MADV_HUGEPAGE") or not Path("/proc/self/smaps").exists():
        pytest.skip("no such pages here")
    with mmap.mmap(-1, 8 << 20) as known:  # containers take the wish without a word and without a mark
        known.madvise(mmap.MADV_HUGEPAGE)
        address = np.frombuffer(known, np.uint8).ctypes.data
        if not marked_for_large_pages(address + (4 << 20)):
            pytest.skip("this system does not show which memory large pages were asked for")
    cl = device._cl
    nbytes = 48 << 20
    buffer = device.empty(nbytes)
    view, _ = cl.enqueue_map_buffer(device._aside, buffer.handle, cl.map_flags.READ, 0, (nbytes,), "u1")
    taken = marked_for_large_pages(view.ctypes.data + nbytes // 2)
    view.base.release(device._aside)
    device.finish()
    assert taken
    numbers = np.arange(12 << 20, dtype=np.uint32)
    assert np.array_equal(device.read(device.upload(numbers), np.uint32, len(numbers)), numbers)


def test_fill_writes_its_pattern_and_nothing_beside_it(device: Device) -> None:
    buffer = device.upload(np.zeros(8, np.uint32))
    device.fill(buffer, 0xDEADBEEF, nbytes=8, offset=4)
    assert device.read(buffer, np.uint32, 8).tolist() == [0, 0xDEADBEEF, 0xDEADBEEF, 0, 0, 0, 0, 0]
    device.fill(buffer, 7)
    assert set(device.read(buffer, np.uint32, 8).tolist()) == {7}


def test_empty_arrays_are_valid_buffers(device: Device, program: Program) -> None:
    buffer = device.upload(np.empty(0, np.uint32))
    assert buffer.nbytes == 0 and device.read(buffer, np.uint32, 0).size == 0
    device.launch(program, "count_up", 64, 64, buffer, np.uint32(0), np.float32(0))
    device.launch(program, "count_up", 0, 64, buffer, np.uint32(0), np.float32(0))
    device.finish()


def test_accesses_outside_a_buffer_are_refused(device: Device) -> None:
    buffer = device.empty(64)
    for wrong in (
        lambda: device.read(buffer, np.uint32, 17),
        lambda: device.read(buffer, np.uint32, 1, offset=64),
        lambda: device.write(buffer, np.zeros(2, np.uint32), offset=60),
        lambda: device.fill(buffer, 0, 128),
        lambda: device.read(buffer, np.uint32, 1, offset=-4),
    ):
        with pytest.raises(ValueError, match="in a buffer of 64"):
            wrong()


def test_allocations_are_counted_and_given_back(device: Device) -> None:
    gc.collect()
    before = device.allocated_bytes
    device.reset_peak()
    first, second = device.empty(1000), device.empty(2000)
    assert device.allocated_bytes == before + 3000
    first.release()
    first.release()
    del second
    gc.collect()
    assert device.allocated_bytes == before and device.peak_bytes == before + 3000
    with pytest.raises(ValueError, match="released"):
        device.read(first, np.uint32, 1)


def test_too_large_a_buffer_is_refused_with_both_numbers(device: Device) -> None:
    limit = device.info.max_alloc_bytes
    with pytest.raises(OpenCLFailure) as caught:
        device.empty(limit + 1)
    assert str(limit) in str(caught.value) and str(limit + 1) in str(caught.value)
    assert caught.value.exit_code == 3


def test_more_than_all_memory_is_refused_before_it_is_asked_for(device: Device) -> None:
    held = device.info.global_mem_bytes - device.allocated_bytes
    device._ledger.allocated += held
    try:
        with pytest.raises(OpenCLFailure, match="are in use") as caught:
            device.empty(1024)
        assert caught.value.retryable
    finally:
        device._ledger.allocated -= held


@pytest.mark.parametrize("local", [1, 3, 16, 64])
def test_local_size_changes_no_bit_and_any_count_is_covered(device: Device, program: Program, local: int) -> None:
    for count in (1, 63, 64, 65, 1000, 70001):
        numbers = device.upload(np.ones(count, np.uint32))
        device.launch(program, "count_up", count, local, numbers, np.uint32(count), np.float32(0))
        assert np.array_equal(device.read(numbers, np.uint32, count), np.arange(count, dtype=np.uint32) + 1)


def test_groups_share_local_memory(device: Device, program: Program) -> None:
    numbers = np.arange(256, dtype=np.uint32)
    sums = device.empty(16)
    device.launch(program, "group_sum", 256, 64, device.upload(numbers), sums)
    assert device.read(sums, np.uint32, 4).tolist() == numbers.reshape(4, 64).sum(1).tolist()


def test_device_time_is_counted_by_label(device: Device, program: Program) -> None:
    device.take_times()
    numbers = device.empty(4 * 4096)
    for label in ("a", "b", "a", None):
        device.launch(program, "count_up", 4096, 64, numbers, np.uint32(4096), np.float32(0), label=label)
    times = device.take_times()
    assert {label: launches for label, (launches, _) in times.items()} == {"a": 2, "b": 1, "count_up": 1}
    assert all(0.0 < seconds < 600.0 for _, seconds in times.values())  # a busy machine's too, and no nanoseconds
    assert device.take_times() == {}


def test_thousands_of_launches_keep_no_thousands_of_events(device: Device, program: Program) -> None:
    device.take_times()
    numbers = device.empty(256)
    for turn in range(3000):
        device.launch(program, "count_up", 64, 64, numbers, np.uint32(64), np.float32(0), label="many")
        if turn % 500 == 0:
            device.finish()
    assert len(device._clock._waiting) < 3000
    assert device.take_times()["many"][0] == 3000


def test_a_kernel_that_is_not_there_lists_those_that_are(device: Device, program: Program) -> None:
    with pytest.raises(DeviceError, match="no kernel 'count_down'.*count_up"):
        device.launch(program, "count_down", 64, 64)


def test_a_refused_launch_names_kernel_and_sizes(device: Device, program: Program) -> None:
    size = 2 * device.info.max_group_size
    with pytest.raises(OpenCLFailure, match=f"numbers.count_up.*{size}"):
        device.launch(program, "count_up", size, size, device.empty(64), np.uint32(0), np.float32(0))


def test_a_refused_program_names_file_line_and_the_saved_log(device: Device) -> None:
    wrong = '#line 1 "wave/wrong.cl"\nkernel void wrong(global uint *x)\n{\n    x[0] = missing_name;\n}\n'
    with pytest.raises(BuildFailure) as caught:
        device.build({"wrong": source("wrong", wrong)})
    text = str(caught.value)
    assert "'wrong' does not build" in text and "missing_name" in text and device.info.id in text
    saved = text.rpartition(": ")[2]
    assert os.path.isfile(saved) and open(saved).read() == wrong
    if device.kind == "pocl":
        assert "wave/wrong.cl:3" in text


def test_the_device_keeps_its_promises(device: Device) -> None:
    probes = device.probes
    assert probes.unfit == () and probes.contracted == 0
    assert probes.nan_bits and probes.divide_ulp <= 2.5 and probes.sqrt_ulp <= 3.0
    if device.info.type == "gpu":
        assert probes.fma_once == 1.0


def test_the_probe_notices_contraction(device: Device) -> None:
    """The same probe with the pragma turned round must fail where the compiler fuses: the probe can fail."""
    if device.kind != "pocl":
        pytest.skip("whether other compilers fuse is theirs to choose")
    text = probe_source().text.replace("FP_CONTRACT OFF", "FP_CONTRACT ON")
    result = run_probe(device, device.build({"probe": source("probe", text)})["probe"], keep=False)
    assert result.contracted > 1000 and any("fuses" in text for text in result.warnings)


def test_an_unfit_device_is_refused(device: Device) -> None:
    from dataclasses import replace

    with pytest.raises(DeviceError, match="NaN cannot be told"):
        replace(device.probes, nan_bits=False).refuse_if_unfit(device.info)
    with pytest.raises(DeviceError, match="record layout differs: Ray"):
        replace(device.probes, layout_differences=("Ray.t: 4 here, 0 in the table",)).refuse_if_unfit(device.info)


def test_threads_limit_a_processor(device: Device) -> None:
    if device.info.type != "cpu" or device.info.compute_units < 2 or device.info.id.startswith("oclgrind"):
        pytest.skip("only for processors with several units")
    code = (
        "import sys; from raytide.device import open_device\n"
        "with open_device(sys.argv[1], threads=1) as d: print(d.info.compute_units)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    environment.pop("POCL_CACHE_DIR", None)
    done = subprocess.run([sys.executable, "-c", code, device.info.id], env=environment, capture_output=True, text=True)
    assert done.stdout.strip() == "1", done.stderr
