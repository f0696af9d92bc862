"""Laws of `raytide devices`, `doctor` and `cache`: stdout is data, exit codes tell, every fault has its command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from raytide.cli.main import main
from raytide.device import examine, list_devices
from raytide.device.cache import FileCache, digest


def test_devices_lists_every_id_with_the_default_first(capsys: pytest.CaptureFixture[str]) -> None:
    ids = [device.id for device in list_devices()]
    assert main(["devices"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == ids
    assert main(["devices", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert [device["id"] for device in content["devices"]] == ids
    assert all(device["icd_file"] for device in content["devices"])


def test_doctor_builds_runs_and_probes_every_device(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(examine, "_DEVICE_LIMIT_S", 1800.0)  # 3 s on an idle machine
    code = main(["doctor", "--json"])
    content = json.loads(capsys.readouterr().out)
    checks = {check["name"]: check for check in content["checks"]}
    for device in list_devices():
        check = checks[f"device {device.id}"]
        assert check["state"] == "ok", check
        assert check["facts"]["probes"]["contracted"] == 0 and check["facts"]["build_s"] > 0.0
    assert all(check["fix"] for check in content["checks"] if check["state"] != "ok")
    assert checks["exr"]["state"] == "ok"
    assert code == (0 if content["ok"] else 1)


def test_without_any_device_the_exit_code_is_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path / "nowhere"))
    assert main(["doctor"]) == 3  # doctor asks fresh processes: this one has its drivers already
    out = capsys.readouterr().out
    assert "no OpenCL device found" in out and "run: unset OCL_ICD_VENDORS" in out


def test_cache_tells_its_size_and_clears(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RAYTIDE_CACHE_DIR", str(tmp_path))
    FileCache("kernels").put(digest("x"), {}, bytes(5000))
    assert main(["cache", "info", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["folder"] == str(tmp_path) and content["parts"][0]["entries"] == 1
    assert main(["cache", "clear"]) == 0
    assert "removed 5.0 KiB" in capsys.readouterr().out
    assert main(["cache", "info"]) == 0
    assert not list((tmp_path / "kernels").glob("??/*"))
