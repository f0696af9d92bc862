"""Shipped scenes show what their closed forms say: whole renders on every device found."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FAMILIES = ("furnace", "lights", "materials")
NAMES = sorted(f"{path.parent.name}/{path.stem}" for family in FAMILIES
               for path in (ROOT / "scenes" / family).glob("*.toml") if path.name != "expected.toml")


def tool():
    spec = importlib.util.spec_from_file_location("measure_expected", ROOT / "tools" / "measure_expected.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["measure_expected"] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", NAMES)
def test_shipped_scene_shows_its_closed_form(device, name: str) -> None:
    # One build of all features serves every scene: the kernels of each alone are tested elsewhere.
    results = list(tool().results(name, device, everything=True))
    assert results
    wrong = [str(result) for result in results if not result.holds]
    assert not wrong, "\n".join(wrong)
