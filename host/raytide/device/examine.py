"""What doctor asks of drivers, in timed child processes: a driver may crash or hang, and doctor must not.

A child is this module with "list" or with "device ID"; it prints one line of JSON.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from typing import Any

from raytide.device.find import rank
from raytide.device.info import DeviceInfo
from raytide.device.worker import child_command
from raytide.errors import DeviceError

_LIST_LIMIT_S = 60.0
_DEVICE_LIMIT_S = 180.0
_TEXT = """
kernel void doctor_sum(global const uint *numbers, global uint *result, const uint count)
{
    uint sum = 0u;
    for (uint i = 0u; i < count; i++)
    {
        sum += numbers[i] * (i + 1u);
    }
    result[get_global_id(0)] = sum;
}
"""


def list_in_child(icd_file: str | None) -> tuple[list[dict[str, Any]], str | None]:
    """The platforms that a fresh process finds, with one .icd file alone if told; and why there is no answer."""
    answer, problem = _ask(["list"], _LIST_LIMIT_S, icd_file)
    return (answer or {}).get("platforms", []), problem


def devices_in_child() -> list[DeviceInfo]:
    """All devices, the default first, without loading a driver in this process. DeviceError where listing fails."""
    platforms, problem = list_in_child(None)
    if problem:
        raise DeviceError(f"the drivers cannot be listed: {problem}; run: raytide doctor")
    devices = [{**device, "extensions": tuple(device["extensions"])}
               for platform in platforms for device in platform["devices"]]  # fmt: skip
    return sorted((DeviceInfo(**device, place=(0, place)) for place, device in enumerate(devices)), key=rank)


def test_in_child(device_id: str, icd_file: str | None) -> tuple[dict[str, Any], str | None]:
    """Build and run a small kernel and the probe on a device, without caches; the facts, and why it failed."""
    answer, problem = _ask(["device", device_id], _DEVICE_LIMIT_S, icd_file)
    return answer or {}, problem or (answer or {}).get("problem")


def _ask(arguments: list[str], limit_s: float, icd_file: str | None) -> tuple[dict[str, Any] | None, str | None]:
    with tempfile.TemporaryDirectory(prefix="raytide-doctor-") as folder:
        environment = {**os.environ, "RAYTIDE_CACHE_DIR": folder, "RAYTIDE_BUILD_WORKERS": "0"}
        environment.pop("RAYTIDE_DEVICE", None)
        environment.pop("POCL_CACHE_DIR", None)
        if icd_file:
            environment["OCL_ICD_VENDORS"] = icd_file
        try:
            done = subprocess.run(
                [*child_command("raytide.device.examine"), *arguments],
                env=environment,
                capture_output=True,
                timeout=limit_s,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return None, f"no answer within {limit_s:.0f} s"
    return _answer(done)


def _answer(done: subprocess.CompletedProcess[bytes]) -> tuple[dict[str, Any] | None, str | None]:
    lines = done.stdout.decode(errors="replace").strip().splitlines()
    if done.returncode == 0 and lines:
        return json.loads(lines[-1]), None
    said = done.stderr.decode(errors="replace").strip().splitlines()
    cause = f"crashed with signal {-done.returncode}" if done.returncode < 0 else f"ended with code {done.returncode}"
    return None, cause + (f": {said[-1]}" if said else "")


def main() -> None:
    """A child's work."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # drivers print what they like
    answer = _list() if sys.argv[1] == "list" else _test(sys.argv[2])
    answers.write(json.dumps(answer) + "\n")
    answers.flush()


def _list() -> dict[str, Any]:
    from raytide.device.find import list_platforms

    return {"platforms": [platform.as_dict() for platform in list_platforms()]}


def _test(device_id: str) -> dict[str, Any]:
    import time

    import numpy as np

    from raytide.device.device import open_device
    from raytide.kernels.source import Source

    start = time.perf_counter()
    facts: dict[str, Any] = {}
    try:
        with open_device(device_id) as device:
            facts["open_s"] = round(time.perf_counter() - start, 4)
            facts["probes"] = device.probes.as_dict()
            program = device.build({"doctor": Source("doctor", _TEXT, "doctor", (), "")})["doctor"]
            numbers = np.arange(1000, dtype=np.uint32)
            result = device.empty(4)
            device.launch(program, "doctor_sum", 1, 1, device.upload(numbers), result, np.uint32(1000))
            found, wanted = int(device.read(result, np.uint32, 1)[0]), int(np.sum(numbers * (numbers + 1)))
            facts.update(build_s=round(program.build_s, 4), first_launch_s=round(program.first_launch_s, 4))
            if found != wanted:
                facts["problem"] = f"a small kernel gave {found} instead of {wanted}"
    except DeviceError as error:
        facts["problem"] = str(error)
    return facts
