"""The development set's Mitsuba scenes load or name what raytide lacks; broken ones are refused in words."""

from __future__ import annotations

import json
import random
import re
import time
from pathlib import Path

import pytest

from mitsuba_scenes import scene_text
from raytide.errors import SceneError
from raytide.scene import load

SECONDS = 10.0  # of processor time, for a file: of the clock, other programs take what they like


def test_crafted_scenes_load_or_are_refused_as_listed(shared_data: Path) -> None:
    root = shared_data / "malformed"
    rows = [row for row in json.loads((root / "expected.json").read_text()) if row["file"].endswith(".xml")]
    assert len(rows) > 20
    wrong = []
    for row in rows:
        began = time.process_time()
        try:
            load(root / row["file"]).flatten()
        except SceneError as error:
            fits = row["verdict"] != "load" and all(len(str(found).splitlines()) == 1 for found in error.problems)
            fits = fits and error.exit_code == 2 and all(found.line for found in error.problems)
        else:
            fits = row["verdict"] != "reject"
        if not fits or time.process_time() - began > SECONDS:
            wrong.append(row["file"])
    assert wrong == []


def test_shared_scenes_load(shared_data: Path) -> None:
    files = [path for folder in ("mitsuba", "references-mitsuba391") for path in (shared_data / folder).rglob("*.xml")]
    files = [path for path in files if path.parent.name not in ("fragments", "include")]
    assert len(files) > 20
    for path in sorted(files):
        load(path, allow_outside=True).flatten()


WORDS = ("shape", "bsdf", "value", "name", "type", "sphere", "1", "-1", "nan", "1e999", "<", ">", '"', "&", "$x", "/")


VALUES = (*WORDS[2:8], "2", "0.5", "0", "true", "m", "g", "ggx", "water", "1, 2, 3", "1e30", "-0", "radius", "$r", "")


def mutated(text: bytes, generator: random.Random) -> bytes:
    data = bytearray(text)
    well_formed = generator.random() < 0.7
    for _ in range(generator.randint(1, 3 if well_formed else 6)):
        place = generator.randrange(len(data))
        action = 4 if well_formed else generator.randrange(5)
        if action == 0:
            data[place] = generator.randrange(256)
        elif action == 1:
            del data[place : place + generator.randint(1, 30)]
        elif action == 2:
            data[place:place] = generator.choice(WORDS).encode()
        elif action == 3:
            data[place:place] = data[max(0, place - 60) : place]
        else:
            found = list(re.finditer(rb'"[^"<>]*"', bytes(data)))
            if found:
                match = generator.choice(found)
                data[match.start() + 1 : match.end() - 1] = generator.choice(VALUES).encode()
        if not data:
            return b"<"
    return bytes(data)


RICH = scene_text(
    '<default name="r" value="1"/>',
    '<bsdf type="twosided" id="m"><bsdf type="roughconductor"><string name="material" value="Au"/>'
    '<string name="distribution" value="ggx"/><float name="alpha" value="0.2"/></bsdf></bsdf>',
    '<bsdf type="dielectric" id="g"><string name="int_ior" value="water"/></bsdf><alias id="m" as="n"/>',
    '<shape type="sphere"><point name="center" x="1" y="2" z="3"/><float name="radius" value="$r"/>'
    '<ref id="m"/></shape>',
    '<shape type="cube"><transform name="to_world"><scale x="2"/><rotate y="1" angle="30"/>'
    '<matrix value="1 0 0 0 1 0 0 0 1"/></transform><ref id="g"/></shape>',
    '<shape type="shapegroup" id="group"><shape type="disk"/></shape>',
    '<shape type="rectangle"><emitter type="area"><spectrum name="radiance" value="400:1, 700:2"/></emitter></shape>',
    '<emitter type="spot"><transform name="to_world"><lookat origin="0,1,0" target="0,0,0" up="1,0,0"/></transform>'
    '</emitter>',
    sensor='<sensor type="thinlens"><float name="aperture_radius" value="0.1"/><film type="hdrfilm">'
    '<integer name="width" value="8"/><rfilter type="box"/></film><sampler type="independent"/></sensor>',
).encode()  # fmt: skip


def test_mutated_scenes_load_or_are_refused_in_words(tmp_path: Path) -> None:
    generator = random.Random(4)
    path = tmp_path / "scene.xml"
    path.write_bytes(RICH)
    load(path)
    fates = {"loaded": 0, "refused": 0}
    for _ in range(2500):
        path.write_bytes(mutated(RICH, generator))
        try:
            load(path)
            fates["loaded"] += 1
        except SceneError as error:
            fates["refused"] += 1
            assert error.problems and error.exit_code == 2
            assert all(len(str(found).splitlines()) == 1 for found in error.problems)
    assert min(fates.values()) > 100, fates


@pytest.mark.parametrize("repeat", [1, 40])
def test_exponential_parameters_stay_bounded(repeat: int, tmp_path: Path) -> None:
    """A parameter may name others only where it is used, so that text does not grow from use to use."""
    defaults = [f'<default name="p{i}" value="{("$p" + str(i - 1)) * 10 if i else "1"}"/>' for i in range(repeat)]
    path = tmp_path / "scene.xml"
    ball = f'<shape type="sphere"><float name="radius" value="$p{repeat - 1}"/></shape>'
    path.write_text(scene_text(*defaults, ball))
    if repeat == 1:
        assert load(path).objects["sphere"].radius == 1  # type: ignore[attr-defined]
    else:
        with pytest.raises(SceneError):
            load(path)
