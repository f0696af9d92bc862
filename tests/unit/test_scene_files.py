"""Hostile files and paths: refused in words, quickly, without opening anything outside the scene's folder."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from raytide.errors import SceneError
from raytide.scene import load
from raytide.scene.parse import LIMITS

MOST_MODULES = 500  # with Python's own and numpy's; 316 when this was written
SCENE = '[camera]\norigin = [0, 0, 4]\ntarget = [0, 0, 0]\n[materials.m]\ntype = "diffuse"\n'
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def mesh_scene(folder: Path, name: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(SCENE + f"[objects.o]\nmesh = '''{name}'''\nmaterial = \"m\"\n")
    return path


def refusal(path: object) -> str:
    began = time.process_time()  # of the clock, other programs on the machine take what they like
    with pytest.raises(SceneError) as caught:
        load(path)  # type: ignore[arg-type]
    assert time.process_time() - began < 10
    assert caught.value.exit_code == 2
    str(caught.value).encode()
    return str(caught.value)


def test_unreadable_files_are_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "folder.toml").mkdir()
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "latin.toml").write_bytes(b"# ok\na = '\xe9'\n")
    (tmp_path / "scene.txt").write_text(SCENE)
    assert "does not exist" in refusal(tmp_path / "none.toml")
    assert "a folder" in refusal(tmp_path / "folder.toml")
    assert "a pipe" in refusal(tmp_path / "pipe.toml")
    assert "latin.toml:2" in refusal(tmp_path / "latin.toml")
    assert ".toml, .json or .xml" in refusal(tmp_path / "scene.txt")
    assert "cannot be read" in refusal(str(tmp_path / "a\0b.toml"))
    assert "cannot be read" in refusal(str(tmp_path / ("a" * 5000 + ".toml")))


def test_a_missing_file_suggests_its_neighbour(tmp_path: Path) -> None:
    mesh_scene(tmp_path, "x.obj")
    assert "did you mean 'scene.toml'?" in refusal(tmp_path / "scenes.toml")


@pytest.mark.parametrize("suffix", [".toml", ".json"])
@pytest.mark.parametrize("pair", ["[]", "{}"])
def test_deep_nesting_is_refused_without_recursion_error(suffix: str, pair: str, tmp_path: Path) -> None:
    opening = pair[0] if pair == "[]" else ('{"a":' if suffix == ".json" else "{a=")
    text = opening * 100_000
    path = tmp_path / f"deep{suffix}"
    path.write_text(text if suffix == ".json" else f"a = {text}")
    assert "nested too deeply" in refusal(path)


@pytest.mark.parametrize("depth", [60, 300, 900])
def test_nesting_that_parses_is_still_refused_in_words(depth: int, tmp_path: Path) -> None:
    deep = "[" * depth + "]" * depth
    path = tmp_path / "deep.json"
    camera = f'{{"origin": {deep}, "target": [0, 0, 0]}}'
    path.write_text(f'{{"camera": {camera}, "materials": {deep}, "lights": {{"a": {deep}}}}}')
    assert "camera.origin" in refusal(path)


def test_large_files_are_refused_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "large.toml"
    with open(path, "wb") as stream:
        stream.truncate(LIMITS[".toml"] + 1)
    assert "at most" in refusal(path)


def test_absurd_numbers_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "digits.json"
    path.write_text('{"format": ' + "9" * 100_000 + "}")
    assert "not JSON" in refusal(path)
    path.write_text('{"format": ' + "9" * 4000 + "}")
    assert "newer" in refusal(path)


@pytest.mark.parametrize(
    "name",
    [
        "../out.obj",
        "sub/../../out.obj",
        "sub/../in.obj",
        "/etc/passwd.obj",
        "..\\\\out.obj",
        "\\\\\\\\server\\\\out.obj",
        "C:/out.obj",
        "link.obj",
        "linked/out.obj",
        "pipe.obj",
        "/dev/zero",
        "sub",
        "loop.obj",
        ".",
        "",
    ],
)
def test_no_file_outside_the_folder_is_opened(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "scene"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "out.obj").write_text(TRIANGLE)
    (folder / "in.obj").write_text(TRIANGLE)
    (folder / "link.obj").symlink_to(tmp_path / "out.obj")
    (folder / "linked").symlink_to(tmp_path)
    (folder / "loop.obj").symlink_to(folder / "loop.obj")
    os.mkfifo(folder / "pipe.obj")
    path = mesh_scene(folder, name.replace("\\\\", "\\"))
    opened: list[str] = []
    real = os.open

    def traced(target: object, *rest: object, **more: object) -> int:
        opened.append(os.path.realpath(target))  # type: ignore[arg-type]
        return real(target, *rest, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(os, "open", traced)
    assert "objects.o.mesh" in refusal(path)
    assert opened == [str(path.resolve())]


def test_allow_outside_opens_what_is_asked_for(tmp_path: Path) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    (tmp_path / "out.obj").write_text(TRIANGLE)
    path = mesh_scene(folder, "../out.obj")
    assert len(load(path, allow_outside=True).flatten().triangles) == 1
    path = mesh_scene(folder, str(tmp_path / "out.obj"))
    assert len(load(path, allow_outside=True).flatten().triangles) == 1


def test_links_that_stay_inside_are_followed(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "real.obj").write_text(TRIANGLE)
    (tmp_path / "link.obj").symlink_to("sub/real.obj")
    assert len(load(mesh_scene(tmp_path, "link.obj")).flatten().triangles) == 1


def test_a_bom_and_crlf_do_not_matter(tmp_path: Path) -> None:
    text = SCENE + '[objects.o]\ntype = "box"\nmaterial = "m"\n'
    plain, marked = tmp_path / "a.toml", tmp_path / "b.toml"
    plain.write_text(text)
    marked.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert load(plain) == load(marked)


def test_importing_scenes_is_light() -> None:
    """Start-up: no device, no mesh library, no schema tools; what an import takes is told by how much it loads."""
    code = (
        "import sys; import raytide.scene;"
        "bad = {'trimesh', 'pyopencl', 'OpenEXR', 'tomlkit', 'raytide.device', 'raytide.kernels', 'scipy'};"
        "print(len(sys.modules), sorted(bad & set(sys.modules)))"
    )
    host = str(Path(__file__).resolve().parents[2] / "host")
    env = {**os.environ, "PYTHONPATH": host}
    run = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
    loaded, modules = run.stdout.split(" ", 1)
    assert modules.strip() == "[]"
    assert int(loaded) < MOST_MODULES


def test_shipped_scenes_load(tmp_path: Path) -> None:
    root = Path(__file__).resolve().parents[2] / "scenes"
    files = sorted(path for path in root.glob("*/*.toml") if "[camera]" in path.read_text())
    assert files
    for path in files:
        folder = shutil.copytree(path.parent, tmp_path / path.parent.name, dirs_exist_ok=True)
        scene = load(folder / path.name)
        again = load(scene.save(folder / "again.json"))
        assert again == scene
        assert again.sha256() == scene.sha256()
