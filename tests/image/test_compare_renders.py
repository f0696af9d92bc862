"""Two renders of one scene agree whatever their seeds and samples, and a scene that was changed does not."""

from __future__ import annotations

from pathlib import Path

import pytest

import raytide as rt
from raytide.cli.main import main
from raytide.device import Device


def scene(reflectance: float = 0.5) -> rt.Scene:
    made = rt.Scene(camera=rt.Camera(origin=(0, 2, 6), target=(0, 1, 0), fov=40, size=(48, 32)))
    made.add(rt.plane(), rt.Diffuse(reflectance), name="floor")
    made.add(rt.sphere((0, 1, 0), 1.0), rt.Diffuse((0.7, 0.3, 0.2)), name="ball")
    made.add(rt.rect(center=(0, 4, 0), u=(1, 0, 0), v=(0, 0, 1)), rt.Emit(6.0), name="lamp")
    return made


def test_seeds_and_samples_agree_and_another_floor_differs(
    device: Device, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with rt.Renderer(scene(), device) as renderer:
        for seed, spp in ((0, 16), (1, 16), (2, 64), (3, 40)):
            renderer.restart(seed=seed)
            renderer.render(spp).save(tmp_path / f"{seed}.exr", aovs=("variance",))
    with rt.Renderer(scene(0.53), device, seed=9) as renderer:
        renderer.render(64).save(tmp_path / "other.exr", aovs=("variance",))
    for seed in (1, 2, 3):
        assert main(["compare", str(tmp_path / "0.exr"), str(tmp_path / f"{seed}.exr")]) == 0, capsys.readouterr().out
    assert main(["compare", str(tmp_path / "2.exr"), str(tmp_path / "other.exr")]) == 4
    assert "different scenes" in capsys.readouterr().out
