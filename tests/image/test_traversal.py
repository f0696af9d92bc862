"""One answer: rays traced by packets of 64 or one by one give the same picture, and the report says which it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.errors import UsageError

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SHOWN = ("cornell/cornell", "terrain/terrain", "whitted/whitted", "blob/blob", "lights/sphere", "materials/dielectric")


@pytest.mark.parametrize("name", SHOWN)
@pytest.mark.parametrize("memory", [None, 60_000])
def test_packets_change_no_bit_of_a_picture(device: Device, name: str, memory: int | None) -> None:
    """37x21 pixels leave tiles ragged; little memory makes launches refill slots in the middle of paths."""
    scene = rt.load(SCENES / f"{name}.toml")
    images, ran = {}, {}
    for traversal in ("single", "packet"):
        with rt.Renderer(scene, device, traversal=traversal, memory=memory, size=(37, 21), spp=3) as renderer:
            images[traversal] = renderer.render().rgb
            ran[traversal] = renderer.report()["traversal"]
    assert np.array_equal(images["single"], images["packet"])
    assert set(ran["single"]["ran"].values()) == {"single"}
    assert ran["packet"]["asked"] == "packet" and ran["packet"]["ran"]["primary"] == "packet"
    onward = {label: how for label, how in ran["packet"]["ran"].items() if label not in ("primary", "shadow[1]")}
    assert set(onward.values()) <= {"single"}


def test_auto_means_packets_on_processors_and_never_without_a_tree(device: Device) -> None:
    scene = rt.load(SCENES / "cornell" / "cornell.toml")
    for bvh, wanted in (("sah", "single" if device.kind == "gpu" else "packet"), ("none", "single")):
        with rt.Renderer(scene, device, size=(16, 16), spp=1, bvh=bvh) as renderer:
            renderer.render()
            assert renderer.report()["traversal"]["ran"]["primary"] == wanted


def test_an_unknown_traversal_lists_the_known_ones(device: Device) -> None:
    with pytest.raises(UsageError, match="psychic.*auto, single, packet"):
        rt.Renderer(rt.load(SCENES / "cornell" / "cornell.toml"), device, traversal="psychic")
