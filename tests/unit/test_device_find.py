"""Laws of ids, choice, loader pitfalls and doctor. No device is opened."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from raytide.device import doctor, examine, icd, intel
from raytide.device.compile import binary_key, build_options
from raytide.device.failure import failure, human
from raytide.device.find import by_preference, choose, pick, short_version, vendor_word
from raytide.device.info import DeviceInfo, PlatformInfo
from raytide.device.probe import _expected_layout, layout_differences
from raytide.errors import DeviceError


def info(name: str, type_: str, kind: str, **changes: object) -> DeviceInfo:
    base = DeviceInfo(
        id=name, name=name, type=type_, kind=kind, platform="", platform_version="", vendor="", vendor_id=0, driver="1",
        device_version="", c_version="", compute_units=2, max_clock_mhz=0, global_mem_bytes=1 << 32,
        max_alloc_bytes=1 << 30, local_mem_bytes=1 << 15, cache_bytes=0, max_group_size=1024, simd_width=8,
        profiling_resolution_ns=1, unified_memory=type_ == "cpu", extensions=(),
    )  # fmt: skip
    return replace(base, **changes)  # type: ignore[arg-type]


WHEEL = info("pocl-3.0rc2/cpu0", "cpu", "pocl", bundled=True, place=(1, 0))
DEBIAN = info("pocl-3.1/cpu0", "cpu", "pocl", place=(0, 0))
CARD = info("nvidia-580/gpu0", "gpu", "gpu", place=(2, 0))
SHARED = info("intel-25.18/gpu0", "gpu", "gpu", unified_memory=True, place=(3, 0))
CHECKER = info("oclgrind-21.10/cpu0", "cpu", "cpu", place=(4, 0))


def ordered(*devices: DeviceInfo) -> list[DeviceInfo]:
    return by_preference([PlatformInfo("p", "", "", None, tuple(devices))])


def test_default_is_a_card_then_any_gpu_then_the_embedded_device() -> None:
    everything = ordered(CHECKER, DEBIAN, WHEEL, SHARED, CARD)
    assert [device.id for device in everything] == [d.id for d in (CARD, SHARED, WHEEL, DEBIAN, CHECKER)]
    assert choose(ordered(DEBIAN, WHEEL), []) is WHEEL


@pytest.mark.parametrize(
    "wishes, found",
    [
        (["nvidia"], CARD),
        (["pocl-3.1/cpu0"], DEBIAN),
        (["3.1"], DEBIAN),
        (["pocl"], WHEEL),
        (["cpu"], WHEEL),
        (["gpu"], CARD),
        (["amd", "gpu"], CARD),
        (["POCL-3.1"], DEBIAN),
        ([], CARD),
    ],
)
def test_a_wish_is_an_id_a_part_of_one_or_a_class(wishes: list[str], found: DeviceInfo) -> None:
    assert choose(ordered(DEBIAN, WHEEL, CARD, SHARED), wishes) is found


def test_a_wrong_id_lists_the_candidates() -> None:
    with pytest.raises(DeviceError) as caught:
        choose([WHEEL, CARD], ["radeon"])
    assert "'radeon'" in str(caught.value) and WHEEL.id in str(caught.value) and CARD.id in str(caught.value)
    assert caught.value.exit_code == 3


def test_the_environment_overrides_every_wish(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raytide.device.find.list_devices", lambda: [CARD, WHEEL])
    assert pick("gpu") is CARD
    monkeypatch.setenv("RAYTIDE_DEVICE", "pocl")
    assert pick("gpu") is WHEEL
    monkeypatch.setenv("RAYTIDE_DEVICE", "radeon")
    with pytest.raises(DeviceError, match="RAYTIDE_DEVICE asks for 'radeon'"):
        pick()


@pytest.mark.parametrize(
    "said, driver, word, version",
    [
        (("Portable Computing Language", "OpenCL 3.0 PoCL 3.0-rc2  Linux, LLVM 14", "The pocl project", "0x8086"),
         "3.0-rc2", "pocl", "3.0rc2"),
        (("Portable Computing Language", "OpenCL 3.0 PoCL 3.1+debian  Linux", "The pocl project", "GenuineIntel"),
         "3.1+debian", "pocl", "3.1"),
        (("NVIDIA CUDA", "OpenCL 3.0 CUDA 13.0.84", "NVIDIA Corporation", "NVIDIA Corporation"),
         "580.95.05", "nvidia", "580"),
        (("Intel(R) OpenCL", "OpenCL 3.0 LINUX", "Intel(R) Corporation", "Intel(R) Corporation"),
         "2026.22.1.0.17_160000", "intel", "2026.22"),
        (("Intel(R) OpenCL Graphics", "OpenCL 3.0 ", "Intel(R) Corporation", "Intel(R) Corporation"),
         "25.18.33578", "intel", "25.18"),
        (("AMD Accelerated Parallel Processing", "OpenCL 2.1 AMD-APP (3635.0)", "Advanced Micro Devices, Inc.", "AMD"),
         "3635.0 (HSA1.1,LC)", "amd", "3635.0"),
        (("rusticl", "OpenCL 3.0 ", "Mesa/X.org", "AMD"), "24.2.1", "rusticl", "24.2"),
        (("Oclgrind", "OpenCL 1.2 (Oclgrind 21.10)", "University of Bristol", "University of Bristol"),
         "Oclgrind 21.10", "oclgrind", "21.10"),
        (("Apple", "OpenCL 1.2 (Apr 18 2025)", "Apple", "Apple"), "1.2 1.0", "apple", "1.2"),
        (("Weird Thing!", "OpenCL 1.2", "Nobody", "Nobody"), "unversioned", "weirdthing", "0"),
    ],
)  # fmt: skip
def test_ids_follow_the_driver_and_not_the_vendor_number(
    said: tuple[str, str, str, str], driver: str, word: str, version: str
) -> None:
    assert vendor_word(*said) == word
    assert short_version(word, driver, said[1]) == version


def test_a_missing_vendors_folder_is_told_with_its_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path / "nowhere"))
    assert "hides every driver" in str(icd.pitfall()) and "unset OCL_ICD_VENDORS" in str(icd.pitfall())
    assert icd.icd_files() == []
    with pytest.raises(DeviceError, match="unset OCL_ICD_VENDORS"):
        choose([], [])


def test_a_single_icd_file_hides_all_others_and_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "only.icd"
    path.write_text("libonly.so\n")
    monkeypatch.setenv("OCL_ICD_VENDORS", str(path))
    assert [file.path for file in icd.icd_files()] == [path]
    assert "hides every other driver" in str(icd.pitfall())


def test_without_overrides_nothing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OCL_ICD_VENDORS", raising=False)
    monkeypatch.delenv("OPENCL_VENDOR_PATH", raising=False)
    assert icd.pitfall() is None


@pytest.mark.parametrize(
    "text, told",
    [("/nowhere/libdriver.so\n", "missing library /nowhere/libdriver.so"), ("libnothere.so.9\n", "libnothere.so.9"),
     ("", "empty"), (f"{__file__}\n", "refused")],
)  # fmt: skip
def test_a_driver_that_cannot_load_says_why(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "x.icd"
    path.write_text(text)
    assert told in str(icd.load_problem(icd.IcdFile(path, text.strip(), False)))


def test_platforms_of_unknown_memory_do_not_crash_the_search() -> None:
    assert icd.library_of(8) is None


@pytest.mark.parametrize(
    "change", [{"driver": "2"}, {"name": "other"}, {"platform_version": "x"}, {"device_version": "y"}]
)
def test_a_cached_binary_belongs_to_one_driver_and_device(change: dict[str, str]) -> None:
    options = build_options(WHEEL)
    assert binary_key(WHEEL, options, "abc") != binary_key(replace(WHEEL, **change), options, "abc")  # type: ignore


def test_a_cached_binary_belongs_to_source_options_and_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    options = build_options(WHEEL)
    key = binary_key(WHEEL, options, "abc")
    assert key == binary_key(WHEEL, options, "abc")
    assert key != binary_key(WHEEL, options, "abd")
    assert key != binary_key(WHEEL, (*options, "-DX=1"), "abc")
    monkeypatch.setenv("POCL_EXTRA_BUILD_FLAGS", "-O0")
    assert key != binary_key(WHEEL, options, "abc")


def test_builds_say_the_device_class_and_use_no_mathematics_flags() -> None:
    assert build_options(CARD) == (
        "-cl-std=CL1.2",
        "-DDEVICE_POCL=0",
        "-DDEVICE_INTEL=0",
        "-DDEVICE_CPU=0",
        "-DDEVICE_GPU=1",
    )
    assert "-DDEVICE_POCL=1" in build_options(WHEEL) and "-DDEVICE_CPU=1" in build_options(WHEEL)
    assert not [option for option in build_options(CARD) if "math" in option or "mad" in option]


def test_every_shifted_member_is_noticed() -> None:
    right = np.array([value for _, value in _expected_layout()])
    assert layout_differences(right) == ()
    for row in range(len(right)):
        wrong = right.copy()
        wrong[row] += 4
        assert len(layout_differences(wrong)) == 1


def test_importing_the_package_loads_no_driver() -> None:
    code = "import sys, raytide.device, raytide.cli.devices, raytide.cli.doctor; sys.exit('pyopencl' in sys.modules)"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    assert subprocess.run([sys.executable, "-c", code], env=environment, check=False).returncode == 0


def test_bytes_read_well() -> None:
    assert [human(n) for n in (0, 1023, 1024, 3 << 29, 5 << 40)] == ["0 B", "1023 B", "1.0 KiB", "1.5 GiB", "5.0 TiB"]


def test_running_out_of_memory_is_marked_as_worth_another_try() -> None:
    class Fault(Exception):
        code = -4

    raised = failure(Fault("clEnqueueNDRangeKernel failed: MEM_OBJECT_ALLOCATION_FAILURE"), "launching shade", WHEEL)
    assert raised.retryable and "no memory left" in str(raised) and WHEEL.id in str(raised)
    Fault.code = -11
    assert not failure(Fault("x"), "building", WHEEL).retryable


def test_a_driver_that_crashes_is_told_and_not_suffered() -> None:
    done = subprocess.run([sys.executable, "-c", "import os; os.abort()"], capture_output=True, check=False)
    answer, problem = examine._answer(done)
    assert answer is None and "signal 6" in str(problem)


def test_a_driver_that_hangs_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examine, "_LIST_LIMIT_S", -1.0)  # over before the driver can answer
    assert "no answer within" in str(examine.list_in_child(None)[1])


def test_doctor_names_the_missing_library_and_one_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "broken.icd"
    path.write_text("/nowhere/libbroken.so\n")
    monkeypatch.setenv("OCL_ICD_VENDORS", str(path))
    (check,) = doctor.icd_checks()
    assert check.state != doctor.OK and "missing library /nowhere/libbroken.so" in check.detail
    assert check.fix == f"sudo rm {path}"
    (none,) = doctor.device_checks()
    assert none.state == doctor.FAIL and none.fix == "unset OCL_ICD_VENDORS"


def test_intel_runtime_is_enabled_by_one_absolute_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = tmp_path / "libintelocl.so.2026"
    monkeypatch.setattr(intel, "runtime_library", lambda: library)
    monkeypatch.setattr(icd, "wheel_folder", lambda: tmp_path)
    path = intel.enable_intel()
    assert path == tmp_path / "intel.icd" and path.read_text().strip() == str(library)


def test_intel_runtime_is_the_library_and_no_file_of_like_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("lib/cache/libintelocl.so-gdb.pyc", "lib/libintelocl.so-gdb.py", "lib/libintelocl.so.2026")
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    listed = [SimpleNamespace(locate=lambda name=name: tmp_path / name) for name in names]
    monkeypatch.setattr(metadata, "files", lambda package: listed)
    assert intel.runtime_library() == tmp_path / names[-1]


def test_intel_runtime_that_is_not_there_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(intel, "runtime_library", lambda: None)
    with pytest.raises(DeviceError, match="pip install intel-opencl-rt"):
        intel.enable_intel()
