"""The audit, small: bands of renders hold the error against a converged reference, and a lie is found."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

import raytide as rt
from raytide.cli.main import main
from raytide.device import Device
from raytide.render import tile_error
from raytide.report.audit import Tally, audit_scene
from raytide.report.convergence import Truth
from raytide.report.experiment import Budget, Plan, variants_of
from raytide.report.reference import make_reference

ROOT = Path(__file__).resolve().parents[2]
SIZE = (32, 32)


@pytest.fixture(scope="module")
def renderer(device: Device, tmp_path_factory: pytest.TempPathFactory):  # noqa: ANN201
    """Cornell, small, and its reference."""
    scene = rt.load(ROOT / "scenes" / "cornell" / "cornell.toml")
    scene.camera.size, scene.render.spp = SIZE, 1024
    with rt.Renderer(scene, device) as opened:
        truth = make_reference(opened, tmp_path_factory.mktemp("audit") / "r.exr", 1024, 4).truth("cornell")
        yield opened, truth


def test_bands_hold_pooled_over_tiles_and_seeds(renderer: tuple[rt.Renderer, Truth]) -> None:
    plan = Plan(Path("cornell.toml"), variants_of([]), (Budget(16), Budget(64)), 8)
    for one in audit_scene(*((renderer[0], plan, renderer[1])), lambda: False):
        assert one.seeds == 8 and one.tiles == 16
        assert one.coverage is not None and one.coverage >= 0.9  # of 128; the long audit has 64 seeds
        assert one.picture_coverage is not None and one.picture_coverage >= 7 / 8  # a band of 95 % may miss one
        assert one.ratio is not None and 0.5 < one.ratio < 2.0


def test_an_audit_finds_bands_that_are_too_low_and_too_narrow(
    renderer: tuple[rt.Renderer, Truth], monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = Plan(Path("cornell.toml"), variants_of([]), (Budget(16),), 4)
    for name in ("SPREAD_UP", "SPREAD_UP_SETTLED", "SPREAD_RELATIVE", "LEAST", "LEAST_SETTLED"):
        monkeypatch.setattr(tile_error, name, 1e-3)
    for name in ("FREEDOM", "FREEDOM_SETTLED"):
        monkeypatch.setattr(tile_error, name, 1e3)
    (narrow,) = audit_scene(renderer[0], plan, renderer[1], lambda: False)
    assert narrow.words in ("too low", "too high") and narrow.coverage is not None and narrow.coverage < 0.8
    brighter = dataclasses.replace(renderer[1], rgb=renderer[1].rgb * 2)
    (wrong,) = audit_scene(renderer[0], plan, brighter, lambda: False)
    assert wrong.ratio is not None and wrong.ratio < 0.6 and wrong.too_low > 0.5


def test_where_nothing_is_noisy_nothing_is_counted() -> None:
    one = Tally.empty()
    one.truths, one.estimates, one.pictures = [0.0, 0.0], [0.0, 0.0], [True, True]
    assert one.verdict("still", 16, 4).words == "no noise"


def test_the_command_writes_its_table(device: Device, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = ROOT / "scenes" / "cornell" / "cornell.toml"
    words = ["--seeds", "2", "--spp", "16", "--size", "16x16", "--device", device.info.id, "-o", str(tmp_path)]
    assert main(["audit", str(scene), *words, "--quiet"]) == 0
    assert "cornell | 16 |" in capsys.readouterr().out
    (found,) = json.loads((tmp_path / "audit.json").read_text())["verdicts"]
    assert found["scene"] == "cornell" and found["seeds"] == 2 and "<svg" in (tmp_path / "audit.html").read_text()
    assert main(["audit", str(scene), "--spp", "8", "-o", str(tmp_path)]) == 2
    assert "at least 16" in capsys.readouterr().err
