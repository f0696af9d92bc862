"""The records table, the feature switches and the assembly of sources, without any device."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from raytide.kernels import NONE, RECORDS, Features, assemble
from raytide.kernels.features import kind_number, kinds
from raytide.kernels.records import Member, Record
from raytide.kernels.widen import of_eight
from raytide.render.schedule import AOV, WAVES

FEATURES = Features(
    materials=(("diffuse", (("reflectance", 3),)), ("rough_conductor", (("eta", 3), ("k", 3), ("roughness", 1)))),
    shapes=("sphere",),
    lights=("point",),
)
ENTRIES = tuple(wave.entry for wave in (*WAVES, AOV))


@pytest.mark.parametrize("record", RECORDS.values(), ids=lambda record: record.name)
def test_numpy_layout_has_the_offsets_of_the_table(record: Record) -> None:
    assert record.dtype.itemsize == record.size == record.size // 16 * 16
    for member in record.members:
        assert record.dtype.fields[member.name][1] == record.offsets[member.name]


def test_misaligned_member_is_refused() -> None:
    bad = Record("Bad", "", (Member("float", "a", "", ""), Member("float4", "b", "", "")))
    with pytest.raises(ValueError, match="Bad.b"):
        _ = bad.offsets


def test_documented_sizes_of_tree_and_trace_records() -> None:
    sizes = {name: RECORDS[name].size for name in ("Ray", "Hit", "Node", "Block", "Shape")}
    assert sizes == {"Ray": 32, "Hit": 16, "Node": 256, "Block": 320, "Shape": 128}


def test_a_program_defines_the_switches_that_it_mentions_as_0_or_1() -> None:
    values = {f"HAS_{name.upper()}": str(int(on)) for name, on in FEATURES.switches().items()}
    for entry in ENTRIES:
        text = assemble(entry, FEATURES).text
        defined = dict(re.findall(r"^#define (HAS_\w+) (\d)$", text, re.MULTILINE))
        assert defined == {name: values[name] for name in re.findall(r"\bHAS_\w+", text)}


def test_source_has_only_the_files_a_scene_needs() -> None:
    files = assemble("wave/shade.cl", FEATURES).files
    assert "material/diffuse.cl" in files and "shape/sphere.cl" in files and "light/point.cl" in files
    assert not any(name in files for name in ("material/glossy.cl", "shape/box.cl", "light/spot.cl"))
    assert len(files) == len(set(files))


def sources(features: Features) -> tuple[str, ...]:
    return tuple(assemble(entry, features).sha256 for entry in ENTRIES)


def test_every_switch_changes_a_source_in_its_own_way() -> None:
    switches = [field.name for field in fields(Features) if field.type == "bool"]
    flipped = [sources(replace(FEATURES, **{name: not getattr(FEATURES, name)})) for name in switches]
    assert len({sources(FEATURES), *flipped}) == len(switches) + 1


def test_a_material_changes_no_program_that_looks_at_none() -> None:
    without = replace(FEATURES, materials=())
    changed = {entry for entry in ENTRIES if assemble(entry, FEATURES) != assemble(entry, without)}
    assert changed == {f"wave/{name}.cl" for name in ("shade", "connect", "aov")}


def test_line_marks_name_every_file() -> None:
    source = assemble("wave/film.cl", FEATURES)
    for name in source.files:
        assert f'#line 1 "{name}"' in source.text


def test_missing_file_and_include_cycle_are_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(FileNotFoundError):
        assemble("", FEATURES, '#include "base/nowhere.cl"\n')
    (tmp_path / "a.cl").write_text('#include "b.cl"\n')
    (tmp_path / "b.cl").write_text('#include "a.cl"\n')
    monkeypatch.setattr("raytide.kernels.source.kernel_dir", lambda: tmp_path)
    with pytest.raises(ValueError, match="cycle: a.cl -> b.cl -> a.cl"):
        assemble("a.cl", FEATURES)


def test_functions_of_eight_words_are_those_of_one_word_by_word() -> None:
    text = """
static uint twice(const uint x)
{
    return x + x;
}
static uint four_times(const uint x) { return twice(twice(x)); }
"""
    wide = of_eight(text, {})
    assert "static uint8 four_times8(const uint8 x) { return twice8(twice8(x)); }" in wide
    assert not re.search(r"\b(uint|twice|four_times)\b", wide)


def test_functions_of_eight_vectors_call_those_of_eight() -> None:
    text = """
#include "base/vector.cl"
#define HALF 0.5f
typedef struct {
    float3 way;
    uint flags;
} Bounce;
static Bounce halved(const float3 a, const int which, float *size)
{
    Bounce out;
    out.way = choose3(which, scale3(a, HALF), (float3)(0.0f, 0.0f, size[0]));
    return out;
}
"""
    wide = of_eight(text, {}, "DEVICE_CPU && HAS_IT", "base/halved.cl")
    assert wide.split("\n")[1:4] == ['#include "base/halved.cl"', '#include "base/wide.cl"', "#if DEVICE_CPU && HAS_IT"]
    assert "static Bounce8 halved8(const Vector8 a, const int8 which, float8 *size)" in wide
    assert "out.way = choose8(which, scale8(a, HALF), vector8(0.0f, 0.0f, size[0]));" in wide
    assert "    Vector8 way;\n    uint8 flags;\n} Bounce8;" in wide
    assert "#define" not in wide  # the text of one has it


def test_kind_numbers_are_places_in_the_folder_listing() -> None:
    for group in ("material", "shape", "light"):
        assert [kind_number(group, kind) for kind in kinds(group)] == list(range(len(kinds(group))))
    assert "pick" not in kinds("light")
    assert NONE == np.uint32(-1 & 0xFFFFFFFF)


def test_parameters_are_loaded_in_packing_order() -> None:
    text = assemble("", FEATURES, '#include "dispatch/material.cl"').text
    assert "out.k = (float3)(m->p0.s3, m->p1.s0, m->p1.s1);" in text
    assert "out.roughness = m->p1.s2;" in text


def test_kinds_of_ray_are_those_that_scenes_name() -> None:
    from raytide.kernels.constants import RAY_KINDS
    from raytide.scene.values import RAY_KINDS as NAMED

    assert RAY_KINDS == NAMED
