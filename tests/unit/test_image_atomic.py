"""A file is replaced by a finished one or not at all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from raytide.errors import RaytideError, UsageError
from raytide.image import replacing, write_exr, write_png


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_missing_folders_are_made(tmp_path: Path) -> None:
    with replacing(tmp_path / "x" / "y" / "a.bin") as file:
        file.write(b"new")
    assert (tmp_path / "x" / "y" / "a.bin").read_bytes() == b"new"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_any_interruption_leaves_the_old_file_and_no_other(tmp_path: Path, error: type[BaseException]) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with pytest.raises(error), replacing(path) as file:
        file.write(b"half of the n")
        assert path.read_bytes() == b"old"
        raise error
    assert path.read_bytes() == b"old" and names(tmp_path) == ["a.bin"]


def test_no_clobber_is_a_usage_error_and_keeps_the_file(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    with replacing(path, no_clobber=True) as file:
        file.write(b"old")
    with pytest.raises(UsageError, match="no_clobber") as caught, replacing(path, no_clobber=True) as file:
        file.write(b"new")
    assert caught.value.exit_code == 2
    assert path.read_bytes() == b"old" and names(tmp_path) == ["a.bin"]


def test_no_clobber_holds_when_another_writer_is_faster(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    with pytest.raises(UsageError), replacing(path, no_clobber=True) as file:
        file.write(b"slow")
        path.write_bytes(b"fast")
    assert path.read_bytes() == b"fast" and names(tmp_path) == ["a.bin"]


def test_folders_and_devices_are_never_replaced(tmp_path: Path) -> None:
    for path in (tmp_path, Path(os.devnull)):
        with pytest.raises(UsageError, match="wanted the path of a file"), replacing(path):
            pass
    assert Path(os.devnull).is_char_device()


def test_a_file_in_the_way_of_a_folder_is_an_error_with_the_path(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"")
    with pytest.raises(RaytideError, match=r"a/b\.exr"):
        write_exr(tmp_path / "a" / "b.exr", {"beauty": np.ones((2, 2, 3))})


def test_a_symbolic_link_keeps_pointing(tmp_path: Path) -> None:
    (tmp_path / "real.bin").write_bytes(b"old")
    (tmp_path / "link.bin").symlink_to("real.bin")
    with replacing(tmp_path / "link.bin") as file:
        file.write(b"new")
    assert (tmp_path / "link.bin").is_symlink() and (tmp_path / "real.bin").read_bytes() == b"new"


def test_the_umask_decides_the_mode(tmp_path: Path) -> None:
    old = os.umask(0o027)
    try:
        with replacing(tmp_path / "a.bin") as file:
            file.write(b"new")
    finally:
        os.umask(old)
    assert (tmp_path / "a.bin").stat().st_mode & 0o777 == 0o640


FULL_DISK = """
import resource, sys
import numpy as np
from raytide.errors import RaytideError
from raytide.image import write_exr, write_png
write = write_exr if sys.argv[1].endswith("exr") else write_png
picture = np.random.default_rng(0).random((64, 64, 3))
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    write(sys.argv[1], {"beauty": picture} if write is write_exr else picture)
except RaytideError as error:
    print(error)
    sys.exit(7)
"""


@pytest.mark.parametrize("name", ["a.exr", "a.png"])
@pytest.mark.parametrize("limit", [0, 1, 300, 5000, 1 << 30])
def test_a_full_disk_at_any_write_keeps_the_old_file(tmp_path: Path, name: str, limit: int) -> None:
    pytest.importorskip("resource")
    (tmp_path / name).write_bytes(b"old")
    done = subprocess.run([sys.executable, "-c", FULL_DISK, tmp_path / name, str(limit)],
                          capture_output=True, text=True)
    if limit == 1 << 30:
        assert done.returncode == 0, done.stderr
        assert (tmp_path / name).stat().st_size > 5000  # so that every smaller limit does cut
    else:
        assert done.returncode == 7, done.stderr
        assert "intact" in done.stdout and name in done.stdout
        assert (tmp_path / name).read_bytes() == b"old"
    assert names(tmp_path) == [name]


def test_importing_the_package_loads_no_codec() -> None:
    code = "import sys, raytide.image; sys.exit(any(m in sys.modules for m in ('OpenEXR', 'PIL', 'PIL.Image')))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_png_holds_the_expected_bytes(tmp_path: Path) -> None:
    from PIL import Image

    picture = np.array([[[0.0, 0.5, 1.0], [2.0, -1.0, 0.0031308]], [[np.nan, 0, 0], [0.18, 0.18, np.inf]]])
    write_png(tmp_path / "a.png", picture, text={"raytide.spp": 4})
    with Image.open(tmp_path / "a.png") as image:
        came, text = np.asarray(image), image.text
    np.testing.assert_array_equal(came, [[[0, 188, 255], [255, 0, 10]], [[255, 0, 255], [255, 0, 255]]])
    assert text == {"raytide.spp": "4"}
