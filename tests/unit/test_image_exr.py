"""EXR: layers, headers and numbers survive a round trip; damaged files become one-line errors."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from raytide.errors import ImageInvalid, RaytideError, UsageError
from raytide.image import read_exr, write_exr
from raytide.image.exr import capture_date

HEIGHT, WIDTH = 5, 7


def layers() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    colour = rng.random((HEIGHT, WIDTH, 3), dtype=np.float32)
    return {
        "albedo": colour / 2,
        "beauty": colour * np.float32(1e5),  # beyond half's range: float32 must be the default
        "normal": colour - 1,
        "position": colour * 100,
        "depth": colour[..., 0] * 1e30,
        "variance": colour**2,
        "samples": np.full((HEIGHT, WIDTH), 2**24 + 1, dtype=np.uint32),  # not a float32
        "object_id": np.arange(HEIGHT * WIDTH, dtype=np.uint32).reshape(HEIGHT, WIDTH) + np.uint32(0xffff_0000),
    }


def test_every_layer_reads_back_bit_for_bit(tmp_path: Path) -> None:
    wanted = layers()
    write_exr(tmp_path / "a.exr", wanted)
    came = read_exr(tmp_path / "a.exr")
    assert set(came.layers) == set(wanted)
    for name, array in wanted.items():
        assert came.layers[name].dtype == array.dtype, name
        np.testing.assert_array_equal(came.layers[name], array, err_msg=name)
    np.testing.assert_array_equal(came.rgb, wanted["beauty"])


def test_parts_have_the_conventional_names_and_colour_spaces(tmp_path: Path) -> None:
    import OpenEXR

    write_exr(tmp_path / "a.exr", layers())
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        headers = [dict(file.header(i)) for i in range(len(file.parts))]  # closing clears the originals
        channels = {header["name"]: sorted(file.channels(i)) for i, header in enumerate(headers)}
    assert headers[0]["name"] == "beauty"
    assert channels["beauty"] == ["B", "G", "R"]
    assert channels["normal"] == ["normal.X", "normal.Y", "normal.Z"]
    assert channels["albedo"] == ["albedo.B", "albedo.G", "albedo.R"]
    assert channels["depth"] == ["depth.Z"]
    assert channels["object_id"] == ["object_id"]
    spaces = {header["name"]: header["colorInteropID"] for header in headers}
    assert {name for name, space in spaces.items() if space == "lin_rec709_scene"} == {"beauty", "albedo"}
    assert {space for name, space in spaces.items() if name not in ("beauty", "albedo")} == {"data"}
    for i, header in enumerate(headers):
        assert header["compression"] == OpenEXR.ZIP_COMPRESSION
        assert not OpenEXR.checkColorMetadata({"colorInteropID": header["colorInteropID"]},
                                              {"colorInteropID": spaces["beauty"]} if i else None)


def test_row_zero_is_the_top_row(tmp_path: Path) -> None:
    picture = np.zeros((2, 3, 3), dtype=np.float32)
    picture[0] = 1
    write_exr(tmp_path / "a.exr", {"beauty": picture})
    assert read_exr(tmp_path / "a.exr").rgb[0].all() and not read_exr(tmp_path / "a.exr").rgb[1].any()


def test_alpha_is_kept_beside_the_colour(tmp_path: Path) -> None:
    picture = np.random.default_rng(2).random((2, 3, 4), dtype=np.float32)
    write_exr(tmp_path / "a.exr", {"beauty": picture})
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr").layers["beauty"], picture)


def test_half_saturates_and_counts_only_colours(tmp_path: Path) -> None:
    beauty = np.array([[[1.0, 65504.0, 1e5], [-1e9, np.inf, 65505.0]]], dtype=np.float32)
    depth = np.array([[1e5, 1e30]], dtype=np.float32)
    done = write_exr(tmp_path / "a.exr", {"beauty": beauty, "depth": depth}, half=True)
    came = read_exr(tmp_path / "a.exr").layers
    assert done.saturated == 4
    assert came["beauty"].dtype == np.float16
    np.testing.assert_array_equal(came["beauty"], [[[1, 65504, 65504], [-65504, 65504, 65504]]])
    np.testing.assert_array_equal(came["depth"], depth)
    assert write_exr(tmp_path / "b.exr", {"beauty": beauty}).saturated == 0


def test_half_keeps_nan_visible(tmp_path: Path) -> None:
    beauty = np.full((1, 1, 3), np.nan, dtype=np.float32)
    assert write_exr(tmp_path / "a.exr", {"beauty": beauty}, half=True).saturated == 0
    assert np.isnan(read_exr(tmp_path / "a.exr").layers["beauty"]).all()


def test_provenance_reads_back(tmp_path: Path) -> None:
    matrix = np.arange(16, dtype=np.float32).reshape(4, 4)
    header = {"software": "raytide 1", "comments": "größer", "worldToCamera": matrix, "frames": 3, "absent": None,
              "raytide": {"seed": 2**63, "spp": 64, "device": "a: b", "settings": {"depth": 8}, "error": 0.5}}
    write_exr(tmp_path / "a.exr", {"depth": np.ones((2, 2)), "beauty": np.ones((2, 2, 3))},
              header | capture_date(0.0))
    came = read_exr(tmp_path / "a.exr").header
    assert (came["software"], came["comments"], came["frames"]) == ("raytide 1", "größer", 3)
    assert (came["raytide.seed"], came["raytide.spp"]) == (str(2**63), "64")
    assert (came["raytide.settings"], came["raytide.error"]) == ('{"depth": 8}', "0.5")
    assert (came["capDate"], came["utcOffset"]) == ("1970:01:01 00:00:00", 0.0)
    np.testing.assert_array_equal(came["worldToCamera"], matrix)
    assert "absent" not in came and "chromaticities" not in came


def test_same_input_gives_the_same_file(tmp_path: Path) -> None:
    for name in ("a.exr", "b.exr"):
        write_exr(tmp_path / name, layers(), {"raytide": {"spp": 1}})
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.parametrize(("parts", "word"), [
    ({"beauty": np.ones((2, 2, 3)), "depth": np.ones((2, 3))}, "share one size"),
    ({"beauty": np.ones((0, 2, 3))}, "shape"),
    ({"depth": np.ones((2, 2, 3))}, "channels"),
    ({"object_id": np.full((2, 2), -1)}, "uint32"),
])
def test_wrong_arrays_are_refused_by_name(tmp_path: Path, parts: dict, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        write_exr(tmp_path / "a.exr", parts)
    assert not list(tmp_path.iterdir())


def test_reserved_attributes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="dataWindow"):
        write_exr(tmp_path / "a.exr", {"beauty": np.ones((2, 2, 3))}, {"dataWindow": 3})


def test_pixels_over_the_cap_are_refused_before_reading(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {"beauty": np.ones((10, 10, 3)), "depth": np.ones((10, 10))})
    assert read_exr(tmp_path / "a.exr", max_bytes=1600).rgb.shape == (10, 10, 3)
    with pytest.raises(ImageInvalid, match="1600 bytes; the limit is 1599"):
        read_exr(tmp_path / "a.exr", max_bytes=1599)


def test_missing_file_and_folder_are_usage_errors(tmp_path: Path) -> None:
    for path in (tmp_path / "none.exr", tmp_path):
        with pytest.raises(UsageError, match=path.name):
            read_exr(path)


def test_truncation_anywhere_is_an_error(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    write_exr(tmp_path / "a.exr", layers())
    data = (tmp_path / "a.exr").read_bytes()
    for size in list(range(0, 400, 7)) + list(range(400, len(data), 131)) + [len(data) - 1]:
        (tmp_path / "cut.exr").write_bytes(data[:size])
        with pytest.raises(ImageInvalid, match=r"cut\.exr"):
            read_exr(tmp_path / "cut.exr")
    assert capfd.readouterr().out == ""  # stdout is data: the library's own reports must not reach it


def test_stated_verdicts_of_malformed_files(shared_data: Path) -> None:
    folder = shared_data / "malformed" / "exr"
    for name in ("truncated_half", "truncated_header", "zero_bytes", "bad_magic", "absurd_data_window",
                 "inverted_data_window", "unknown_compression", "corrupt_zip"):
        with pytest.raises(ImageInvalid, match=name):
            read_exr(folder / f"{name}.exr")
    with pytest.raises(ImageInvalid, match="wanted R G B or Y"):
        read_exr(folder / "depth_only.exr").rgb  # noqa: B018
    ramp = np.arange(256, dtype=np.float32).reshape(16, 16) / 255
    np.testing.assert_allclose(read_exr(folder / "valid_16x16.exr").rgb,
                               np.stack([ramp, ramp / 2, ramp / 4], axis=-1), rtol=1e-6)
    grey = read_exr(folder / "luminance_only.exr").rgb
    assert grey.shape == (16, 16, 3) and (grey[..., 0] == grey[..., 2]).all()
    assert not np.isfinite(read_exr(folder / "nan_inf_negative.exr").rgb).all()
    assert read_exr(folder / "half_uint_mixed.exr").rgb.dtype == np.float32


def test_files_of_others_read_or_are_refused(shared_data: Path) -> None:
    for folder in ("openexr", "oiio-corrupt"):
        for path in sorted((shared_data / folder).rglob("*.exr")):
            try:
                image = read_exr(path)
            except RaytideError as error:
                assert path.name in str(error)
                assert path.parent.name == "invalid" or "subsampled" in str(error), error
            else:
                assert image.rgb.size, path


MUTANT_RUN = """
import random, resource, sys
from raytide.errors import RaytideError
from raytide.image import read_exr
resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))
data = open(sys.argv[1], "rb").read()
rng = random.Random(int(sys.argv[3]))
refused = 0
for _ in range(int(sys.argv[4])):
    mutant = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
        place = min(int(rng.expovariate(1 / 600)), len(data) - 1)
        mutant[place] = rng.choice((0, 1, 127, 128, 255, rng.randrange(256)))
    with open(sys.argv[2], "wb") as file:
        file.write(mutant)
    try:
        read_exr(sys.argv[2])
    except RaytideError:
        refused += 1
print(refused)
"""


def test_mutants_never_escape_as_another_error(tmp_path: Path) -> None:
    pytest.importorskip("resource")
    write_exr(tmp_path / "a.exr", layers(), {"raytide": {"spp": 1}})
    done = subprocess.run([sys.executable, "-c", MUTANT_RUN, tmp_path / "a.exr", tmp_path / "m.exr",
                           str(random.Random(5).randrange(2**32)), "400"], capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout) > 100  # else the mutations test nothing
