"""Files of measured surfaces: what is read is what was written; damaged ones are refused in words."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

import raytide.scene as rt
from measured_files import (
    BRUSHED,
    EVEN,
    PAINT,
    ROUGH,
    WAVES,
    adaptive_fields,
    half_directions,
    measured_file,
    merl_bytes,
    tensor_bytes,
    text_bytes,
)
from raytide.cli.main import main
from raytide.errors import SceneError
from raytide.importers.measured import Adaptive, HalfAngles, load_measurement
from raytide.render.measured import distributions, half_angle_value, table_of

SIZES = (8, 6, 4)
SCENE = '[camera]\norigin=[0,0,5]\ntarget=[0,0,0]\n[materials.m]\ntype="measured"\nfile="{}"\n'
BALL = '[objects.b]\ntype="sphere"\nmaterial="m"\n'


def read(tmp_path: Path, name: str, data: bytes) -> HalfAngles | Adaptive:
    path = tmp_path / name
    path.write_bytes(data)
    return load_measurement(path)


def test_a_merl_table_has_the_files_values_at_the_middles_of_its_cells(tmp_path: Path) -> None:
    measured = read(tmp_path, "a.binary", merl_bytes(ROUGH, SIZES))
    assert isinstance(measured, HalfAngles) and measured.cells.shape == (*SIZES, 3)
    wo, wi = half_directions(SIZES)
    above = (wo[:, 2] > 0) & (wi[:, 2] > 0)
    expected = ROUGH(wo[above], wi[above])
    np.testing.assert_allclose(measured.cells.reshape(-1, 3)[above], expected, rtol=1e-6)
    np.testing.assert_allclose(half_angle_value(measured.cells, wo[above], wi[above]), expected, rtol=1e-5)


def test_cells_that_were_not_measured_take_the_value_of_one_that_was(tmp_path: Path) -> None:
    planes = np.full((3, *SIZES), 1500.0)
    planes[:, :, 3:, 1] = -1.0  # from some difference angle on
    planes[:, 5] = -2.0  # a whole angle of h
    planes[0, 0, 0, 0] = -1e-9  # one colour alone
    planes[:, 2, 1] = 4500.0
    cells = read(tmp_path, "a.binary", np.array(SIZES, "<i4").tobytes() + planes.astype("<f8").tobytes()).cells
    np.testing.assert_allclose(cells[0, 0, 0], [1, 1.15, 1.66], rtol=1e-6)
    np.testing.assert_allclose(cells[2, 1:, 1, 0], [3, 1, 1, 1, 1], rtol=1e-6)
    assert (cells > 0).all() and np.array_equal(cells[5], cells[4])


def test_a_text_list_of_a_flat_spectrum_is_grey_and_keeps_its_measurements(tmp_path: Path) -> None:
    cells = read(tmp_path, "a.brdf", text_bytes(PAINT)).cells
    assert np.ptp(cells, axis=-1).max() < 1e-6 * cells.max()
    wo, wi = half_directions(cells.shape[:3])
    above = (wo[:, 2] > 0.2) & (wi[:, 2] > 0.2)
    expected = PAINT(wo[above], wi[above])[:, 1]
    assert np.abs(cells.reshape(-1, 3)[above, 1] / expected - 1).max() < 0.06


def test_spectra_become_the_colours_that_were_put_in(tmp_path: Path) -> None:
    """The same table with colours and with spectra that are flat: equal channels, equal numbers."""
    fields = adaptive_fields(EVEN, np.zeros(1))
    grey = fields["rgb"][:, :, 1:2]
    spectra = {"wavelengths": WAVES.astype("<f4"), "spectra": np.repeat(grey, len(WAVES), axis=2)}
    plain = fields | {"rgb": np.repeat(grey, 3, axis=2)}
    one = read(tmp_path, "a.bsdf", tensor_bytes(plain))
    other = read(tmp_path, "b.bsdf", tensor_bytes({k: v for k, v in fields.items() if k != "rgb"} | spectra))
    np.testing.assert_allclose(other.colours, one.colours, rtol=2e-6)
    assert one.isotropic and one.parts == 1 and one.divided


def test_turns_of_a_half_or_a_quarter_are_known_as_such(tmp_path: Path) -> None:
    for parts in (1, 2, 4):
        fields = adaptive_fields(BRUSHED, np.linspace(-np.pi, -np.pi + 2 * np.pi / parts, 5), (5, 6), 4)
        assert read(tmp_path, "a.bsdf", tensor_bytes(fields)).parts == parts


def test_densities_have_integral_one_and_grids_of_zeros_become_even() -> None:
    values = np.zeros((2, 5, 7))
    values[0] = np.random.default_rng(3).random((5, 7))
    density, marginal, conditional = distributions(values)
    weight = np.outer([0.5, 1, 1, 1, 0.5], [0.5, 1, 1, 1, 1, 1, 0.5]) / 24
    np.testing.assert_allclose((density * weight).sum(axis=(1, 2)), 1)
    np.testing.assert_allclose(marginal[:, -1], 1)
    assert (density[1] == 1).all() and (np.diff(conditional, axis=-1) >= 0).all()


def crippled() -> list[tuple[str, bytes, str]]:
    merl, text = merl_bytes(ROUGH, SIZES), text_bytes(PAINT, 20)
    fields = adaptive_fields(EVEN, np.zeros(1), (5, 6), 4)
    tensor = tensor_bytes(fields)
    nan = bytearray(merl)
    nan[12 + 8 * 7 : 12 + 8 * 8] = struct.pack("<d", np.nan)
    less = {name: array for name, array in fields.items() if name != "sigma"}
    turned = fields | {"theta_i": fields["theta_i"][::-1]}
    other = fields | {"vndf": fields["vndf"][:, :3]}
    return [
        ("a.binary", merl[:-1], "whole file"),
        ("a.binary", merl + b"\0", "whole file"),
        ("a.binary", b"", "MERL table"),
        ("a.binary", struct.pack("<3i", 2**31 - 1, 2**31 - 1, 2), "from 2 to 1024"),
        ("a.binary", struct.pack("<3i", -90, 90, 180), "from 2 to 1024"),
        ("a.binary", bytes(nan), "not finite"),
        ("a.binary", np.array(SIZES, "<i4").tobytes() + np.full(576, -1.0).tobytes(), "without a measured cell"),
        ("a.brdf", b"", "no numbers"),
        ("a.brdf", text.replace(b"13\n", b"14\n", 1), "numbers after"),
        ("a.brdf", text[: len(text) // 2].rsplit(b" ", 3)[0], "numbers after"),
        ("a.brdf", text + b" one", "no number"),
        ("a.brdf", text.replace(b"425", b"325", 1), "rise"),
        ("a.brdf", b"1e9\n", "wavelengths"),
        ("a.bsdf", tensor[: len(tensor) // 2], "whole tensor file"),
        ("a.bsdf", tensor[:40], "ends early"),
        ("a.bsdf", b"Tensor" + tensor[6:], "header"),
        ("a.bsdf", tensor_bytes(less), "'sigma'"),
        ("a.bsdf", tensor_bytes(turned), "rise"),
        ("a.bsdf", tensor_bytes(other), "vndf"),
        ("a.bsdf", tensor_bytes(fields | {"ndf": fields["ndf"] * np.float32(np.inf)}), "not finite"),
    ]


@pytest.mark.parametrize(("name", "data", "word"), crippled(), ids=lambda x: x if isinstance(x, str) else "")
def test_damaged_files_are_refused_in_one_line(tmp_path: Path, name: str, data: bytes, word: str) -> None:
    with pytest.raises(SceneError) as caught:
        read(tmp_path, name, data)
    text = str(caught.value)
    assert word in text and str(tmp_path) in text and len(text.splitlines()) == 1 and caught.value.exit_code == 2


def test_a_scene_names_key_line_and_file_of_a_damaged_measurement(tmp_path: Path, capsys) -> None:
    scene = tmp_path / "scene.toml"
    (tmp_path / "a.binary").write_bytes(merl_bytes(ROUGH, SIZES)[:-8])
    cases = (("a.binary", "whole file", 6), ("b.binary", "does not exist", 6), ("a.png", ".bsdf", 4))
    for file, word, line in cases:
        scene.write_text(SCENE.format(file) + BALL)
        assert main(["scene", "check", str(scene)]) == 2
        told = capsys.readouterr().err
        assert f"scene.toml:{line}" in told and "materials.m" in told and word in told


def test_the_development_sets_files_are_read_or_refused(shared_data: Path) -> None:
    for path in sorted((shared_data / "malformed" / "brdf").iterdir()):
        with pytest.raises(SceneError):
            load_measurement(path)
    for path in sorted((shared_data / "pbrt2" / "brdfs").glob("*.brdf")):
        parameters, rows = table_of(load_measurement(path))
        assert 0.02 < parameters["albedo"].max() < 0.9 and parameters["albedo"].min() > 0 and len(rows) > 100


def test_a_scene_keeps_its_file_and_its_hash_follows_the_contents(tmp_path: Path) -> None:
    data = Path(measured_file("rough.binary")).read_bytes()
    (tmp_path / "a.binary").write_bytes(data)
    (tmp_path / "scene.toml").write_text(SCENE.format("a.binary") + BALL)
    scene = rt.load(tmp_path / "scene.toml")
    before = scene.sha256()
    (tmp_path / "sub").mkdir()
    moved = scene.save(tmp_path / "sub" / "again.toml")
    again = rt.load(moved, allow_outside=True)
    assert again.materials["m"].file == "../a.binary" and again.sha256() == before
    (tmp_path / "a.binary").write_bytes(data[:12] + struct.pack("<d", 7.0) + data[20:])
    assert rt.load(tmp_path / "scene.toml").sha256() != before


def test_mitsubas_plugin_names_the_same_file(tmp_path: Path) -> None:
    (tmp_path / "even.bsdf").write_bytes(Path(measured_file("even.bsdf")).read_bytes())
    text = """<scene version="3.0.0"><sensor type="perspective"/><shape type="sphere"><bsdf type="measured">
    <string name="filename" value="{}"/></bsdf></shape></scene>"""
    (tmp_path / "scene.xml").write_text(text.format("even.bsdf"))
    (material,) = rt.load(tmp_path / "scene.xml").materials.values()
    assert isinstance(material, rt.Measured) and material.file == "even.bsdf" and not material.two_sided
    (tmp_path / "scene.xml").write_text(text.format("missing.bsdf"))
    with pytest.raises(SceneError, match="missing.bsdf"):
        rt.load(tmp_path / "scene.xml")
