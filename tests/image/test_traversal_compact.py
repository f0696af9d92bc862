"""The compact layout, and classes of devices that are not at hand: the same picture, bit for bit, and less memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device, open_device
from raytide.kernels import RECORDS, Features, Source, assemble
from raytide.render import renderer as rendering

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SHIPPED = sorted(path.relative_to(SCENES).as_posix() for path in SCENES.glob("*/*.toml") if path.stem != "expected")
VARIED = ("cornell/cornell.toml", "terrain/terrain.toml")
NO_CLANG_BUILTINS = "#define __has_builtin(name) 0\n"


def picture(scene: rt.Scene, device: Device, traversal: str, everything: bool = False) -> np.ndarray:
    with rt.Renderer(scene, device, traversal=traversal, everything=everything, size=(37, 21), spp=3) as renderer:
        return renderer.render().rgb


@pytest.fixture(scope="module")
def as_gpu(device: Device) -> Iterator[Device]:
    """The device of the test, taken for a GPU: its kernels, its launches and its defaults are those of that class."""
    opened = open_device(replace(device.info, kind="gpu"))
    yield opened
    opened.close()


@pytest.mark.parametrize("name", SHIPPED)
def test_the_compact_layout_changes_no_bit_of_a_picture(device: Device, name: str) -> None:
    """With kernels for every scene, which are built once."""
    scene = rt.load(SCENES / name)
    assert picture(scene, device, "compact", True).tobytes() == picture(scene, device, "single", True).tobytes()


@pytest.mark.parametrize("name", VARIED)
def test_the_class_of_gpus_traces_through_compact_trees_and_gives_the_same_hits(as_gpu: Device, name: str) -> None:
    """Within the class, layouts agree bit for bit; between classes only how functions such as sqrt round may differ."""
    scene = rt.load(SCENES / name)
    with rt.Renderer(scene, as_gpu, everything=True, size=(37, 21), spp=3) as renderer:
        image = renderer.render()
        report = renderer.report()
        ids = image.layers()["object_id"]
    assert set(report["traversal"]["ran"].values()) == {"compact"} and report["tree"]["layout"] == "compact"
    assert image.rgb.tobytes() == picture(scene, as_gpu, "single", True).tobytes()
    assert (ids > 0).any()


def test_layers_are_the_same_through_a_compact_tree(device: Device) -> None:
    layers = {}
    for traversal in ("single", "compact"):
        with rt.Renderer(rt.load(SCENES / VARIED[1]), device, traversal=traversal, size=(37, 21), spp=1) as renderer:
            layers[traversal] = renderer.render().layers()
    assert all(layers["single"][name].tobytes() == layers["compact"][name].tobytes() for name in layers["single"])


def without_built_ins(entry: str, features: Features, extra: str = "") -> Source:
    """The same program for a compiler that has none of clang's own functions, x86's among them."""
    plain = assemble(entry, features, extra)
    return replace(plain, text=NO_CLANG_BUILTINS + plain.text, sha256="plain" + plain.sha256)


@pytest.mark.parametrize("traversal", ["single", "packet", "compact"])
def test_kernels_in_plain_opencl_give_the_same_picture(
    device: Device, traversal: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No movemask, no vector of a certain width: what processors other than x86 run."""
    scene = rt.load(SCENES / VARIED[1])
    usual = picture(scene, device, traversal)
    monkeypatch.setattr(rendering, "assemble", without_built_ins)
    with rt.Renderer(scene, device, traversal=traversal, size=(37, 21), spp=3) as renderer:
        assert all(source.text.startswith(NO_CLANG_BUILTINS) for source in renderer.sources.values()
                   if source.entry.startswith("wave/"))  # fmt: skip
        assert renderer.render().rgb.tobytes() == usual.tobytes()


def test_a_compact_tree_is_all_of_the_tree_that_the_device_holds(device: Device) -> None:
    """At most 64 bytes a triangle, nodes included, and the report counts what is there."""
    scene = rt.load(SCENES / VARIED[1])
    held, trees = {}, {}
    for traversal in ("single", "compact"):
        with rt.Renderer(scene, device, traversal=traversal, size=(37, 21), spp=1) as renderer:
            renderer.render()
            held[traversal] = device.allocated_bytes
            trees[traversal] = renderer.report()["tree"]
            blocks, nodes = renderer.forest.world.block_count, len(renderer.forest.world.nodes)
    wide, compact = trees["single"], trees["compact"]
    assert held["single"] - held["compact"] == wide["bytes"] - compact["bytes"] > 0
    assert compact["bytes"] == nodes * RECORDS["CompactNode"].size + blocks * RECORDS["CompactTriangle"].size
    assert 48 < compact["bytes_per_triangle"] <= 64


def test_a_tree_is_packed_again_only_when_it_changed(device: Device) -> None:
    scene = rt.load(SCENES / VARIED[1])
    with rt.Renderer(scene, device, traversal="compact", size=(16, 16), spp=1) as renderer:
        tree = renderer.forest.world
        renderer.update()
        assert renderer.forest.world is tree
        renderer.traversal = "single"
        renderer.update()
        assert renderer.forest.world is not tree and renderer.forest.world.stats.layout == "wide"
        renderer.render()
