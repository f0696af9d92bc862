"""What is shipped: the wheel carries the kernels, the sdist everything that makes and tests it."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """(sdist, wheel made from it), built without network by the tools of this environment."""
    pytest.importorskip("build")
    pytest.importorskip("hatchling")
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(ROOT)]
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout[-2000:] + ran.stderr[-2000:]
    return next(out.glob("*.tar.gz")), next(out.glob("*.whl"))


def kernels() -> set[str]:
    return {path.relative_to(ROOT).as_posix() for path in (ROOT / "cl").rglob("*.cl")}


def test_wheel_carries_every_kernel_and_module(built: tuple[Path, Path]) -> None:
    with zipfile.ZipFile(built[1]) as wheel:
        names = set(wheel.namelist())
    assert {f"raytide/{name}" for name in kernels()} <= names
    modules = {path.relative_to(ROOT / "host").as_posix() for path in (ROOT / "host").rglob("*.py")}
    assert modules | {"raytide/py.typed"} <= names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not [name for name in names if name.startswith(("tests", "cl/", "tools"))]


def test_sdist_carries_what_makes_and_tests_it(built: tuple[Path, Path]) -> None:
    with tarfile.open(built[0]) as sdist:
        names = {name.split("/", 1)[1] for name in sdist.getnames() if "/" in name}
    assert kernels() <= names
    wanted = {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "tools/run.py", "tests/conftest.py"}
    assert wanted <= names
    assert not [name for name in names if name.startswith(".venv")]


def test_installed_package_finds_its_kernels(built: tuple[Path, Path], tmp_path: Path) -> None:
    with zipfile.ZipFile(built[1]) as wheel:
        wheel.extractall(tmp_path)
    code = "from raytide.kernels.paths import kernel_dir; print(kernel_dir())"
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert Path(ran.stdout.strip()) == tmp_path / "raytide" / "cl"
    assert list(Path(ran.stdout.strip()).glob("wave/*.cl"))


def test_checkout_finds_its_kernels() -> None:
    from raytide.kernels.paths import kernel_dir

    assert kernel_dir() == ROOT / "cl"


def test_project_table_says_what_it_must() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["license"] == "Apache-2.0"
    assert "Apache License" in (ROOT / "LICENSE").read_text()[:200]
    assert project["requires-python"] == ">=3.11"
    (driver,) = [name for name in project["dependencies"] if name.startswith("pocl")]
    assert "sys_platform == 'linux' and platform_machine == 'x86_64'" in driver  # the only wheel that there is
    module, _, function = project["scripts"]["raytide"].partition(":")
    assert callable(getattr(import_module(module), function))
    assert "## [Unreleased]" in (ROOT / "CHANGELOG.md").read_text()
