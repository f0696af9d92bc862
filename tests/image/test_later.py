"""Short renders do without variants of the traversal that are not compiled yet, and nobody sees it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.device.cache import FileCache
from raytide.render import later

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SIZE = (24, 16)


@pytest.fixture
def cold(device: Device, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Device:
    """A device whose cache tells of no kernel that can wait, and that rendered nothing yet."""
    if device.kind == "gpu":
        pytest.skip("there is one variant")
    monkeypatch.setattr(device, "load", lambda sources: {})
    monkeypatch.setattr(later, "FileCache", lambda kind: FileCache(kind, tmp_path))
    monkeypatch.setattr(later, "ENOUGH", 3 * SIZE[0] * SIZE[1])
    return device


@pytest.mark.parametrize(("name", "first"), [("cornell", "list"), ("whitted", "single")])
def test_a_short_render_compiles_one_variant_and_gives_the_same_picture(cold: Device, name: str, first: str) -> None:
    scene = rt.load(SCENES / name / f"{name}.toml")
    with rt.Renderer(scene, cold, size=SIZE, spp=2) as renderer:
        image = renderer.render().rgb
        short = renderer.report()
        kinds = set(short["traversal"]["ran"])
        assert {one["runs"] for one in short["traversal"]["choice"].values()} == {first}
        assert "extend_packet" not in short["kernels"] and not {"extend", "shadow"} & set(short["left_out"]["waves"])
        renderer.complete()
        renderer.restart()
        assert np.array_equal(renderer.render().rgb, image)
        whole = renderer.report()
    assert "extend_packet" in whole["kernels"] and set(whole["traversal"]["ran"]) == kinds
    assert whole["kernels_sha256"] == short["kernels_sha256"]  # checkpoints of one go on in the other


def test_samples_of_several_renders_come_to_enough(cold: Device) -> None:
    """Two samples a pixel, and two more: the second render has all variants. Two renderers stand for two processes."""
    scene, had = rt.load(SCENES / "cornell" / "cornell.toml"), []
    for _ in range(2):
        with rt.Renderer(scene, cold, size=SIZE, spp=2) as renderer:
            renderer.render()
            had.append("extend_packet" in renderer.programs)
    assert had == [False, True]


def test_a_long_render_and_one_whose_way_is_told_have_what_they_want_at_once(cold: Device) -> None:
    scene = rt.load(SCENES / "cornell" / "cornell.toml")
    with rt.Renderer(scene, cold, size=SIZE, spp=3) as renderer:
        renderer.render()
        assert "extend_packet" in renderer.programs
    with rt.Renderer(scene, cold, size=SIZE, spp=1, traversal="packet") as renderer:
        renderer.render()
        assert renderer.report()["traversal"]["ran"]["primary"] == "packet"


@pytest.mark.parametrize(("limits", "wanted"), [
    (later.Limits(4), 300),
    (later.Limits(1 << 24, time=2.0), 4_000_000),
    (later.Limits(1 << 24, error=0.01), 100 << 24),
])  # fmt: skip
def test_what_a_render_will_take_is_foretold_by_its_limits(limits: later.Limits, wanted: int) -> None:
    """Of 100 pixels on 2 units; a render that has one sample counts what is left."""
    planned = later.planned_samples(limits, 1 if limits.counted else 0, 100, 2)
    assert planned == wanted
