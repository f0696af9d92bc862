"""Every switch builds: all on, all off, and each alone. A kernel that only compiles in company is a defect."""

from __future__ import annotations

from dataclasses import fields, replace

import pytest

from raytide.device import Device
from raytide.kernels import Features, assemble
from raytide.kernels.features import kinds
from raytide.render.schedule import AOV, VARIANTS, WAVES
from raytide.scene.materials import MATERIALS

LIGHT = ("emit", "connect", "splat")  # waves of light that is traced from the lights
NONE_ON = Features(triangles=False, tree=False, sobol=False)
EITHER_OR = ("regularised",)  # no scene has it with caustics: both mark paths by one bit
ALL_ON = Features(
    materials=tuple((kind, MATERIALS[kind].PARAMETERS) for kind in sorted(MATERIALS)),
    shapes=kinds("shape"),
    lights=kinds("light"),
    textures=kinds("texture"),
    **{field.name: field.name not in EITHER_OR for field in fields(Features) if field.type == "bool"},
)


def each_alone() -> dict[str, Features]:
    alone = {field.name: replace(NONE_ON, **{field.name: True}) for field in fields(Features) if field.type == "bool"}
    alone |= {kind: replace(NONE_ON, materials=((kind, MATERIALS[kind].PARAMETERS),)) for kind in MATERIALS}
    alone |= {kind: replace(NONE_ON, shapes=(kind,)) for kind in kinds("shape")}
    alone |= {kind: replace(NONE_ON, lights=(kind,)) for kind in kinds("light")}
    alone |= {kind: replace(NONE_ON, textures=(kind,)) for kind in kinds("texture")}
    alone |= {f"{kind}, photon": replace(NONE_ON, lights=(kind,), photon=True) for kind in kinds("light")}
    return alone


def assert_no_warnings(device: Device, cases: dict[str, Features]) -> None:
    sources = {}
    for name, features in cases.items():
        tracing = [wave for variant in VARIANTS if variant.fits(device.kind, features) for wave in variant.waves]
        waves = [one for one in (*WAVES, *tracing, AOV) if features.emits or one.name not in LIGHT]
        for wave in {one.name: one for one in waves}.values():
            source = assemble(wave.entry, wave.features(features))
            sources.setdefault(source.sha256, (f"{wave.name}, {name}", source))
    numbered = enumerate(sources.values())
    programs = device.build({label: replace(source, name=f"f{i}") for i, (label, source) in numbered})
    assert not {label: program.log for label, program in programs.items() if "warning" in program.log.lower()}


def test_all_and_none_build_without_a_warning(device: Device) -> None:
    other = replace(ALL_ON, compact=False, caustics=False, **dict.fromkeys(EITHER_OR, True))
    compact = replace(NONE_ON, tree=True, compact=True)
    assert_no_warnings(device, {"none": NONE_ON, "all": ALL_ON, "all, wide": other, "compact": compact})


def test_kernels_of_lists_build_without_a_warning(device: Device) -> None:
    """With all that they can be combined with; neither of the two above has triangles and a tree and nothing else."""
    features = replace(NONE_ON, tree=True, triangles=True, visibility=True, opacity=True)
    lists = next(variant for variant in VARIANTS if variant.listed)
    assert lists.fits("cpu", features) and not lists.fits("gpu", features) and not lists.fits("cpu", ALL_ON)
    programs = device.build({wave.name: assemble(wave.entry, wave.features(features)) for wave in lists.waves})
    assert not {name: program.log for name, program in programs.items() if "warning" in program.log.lower()}


@pytest.mark.one_driver
def test_each_switch_alone_builds_without_a_warning(device: Device) -> None:
    """Words that are missing without company are missing on every driver."""
    assert_no_warnings(device, {"none": NONE_ON, **each_alone()})


def test_none_leaves_out_every_kind_and_all_leaves_out_nothing() -> None:
    assert ALL_ON.left_out() == list(EITHER_OR)
    assert set(NONE_ON.left_out()) == set(NONE_ON.switches())
    assert "compact" in replace(NONE_ON, compact=True).left_out()  # a layout of the tree is nothing without one
