"""The house's rules for Python: who imports whom, no work at import, sizes, types on public names."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "host" / "raytide"
MOST_LINES, MOST_FUNCTION_LINES = 400, 60

# Which packages each one may import. `errors` is everybody's; only `cli` and the lazy public API know all.
ARROWS = {
    "errors": set(),
    "importers": {"image"},
    "scene": {"importers"},
    "kernels": set(),
    "device": {"kernels"},
    "image": set(),
    "accel": {"kernels", "device"},
    "render": {"scene", "importers", "kernels", "device", "image", "accel"},
    "report": {"scene", "importers", "kernels", "device", "image", "accel", "render"},
    "bench": {"__init__", "scene", "kernels", "device", "image", "accel", "render", "report"},
    "verify": {"scene", "importers", "kernels", "device", "image", "accel", "render"},
    "cli": {"scene", "importers", "kernels", "device", "image", "accel", "render", "report", "verify", "bench"},
    "__init__": {"scene", "device", "image", "render"},
    "__main__": {"cli"},
}
ONLY_IMPORTER = {"pyopencl": "device", "OpenEXR": "image", "cyclopts": "cli", "rich": "cli", "trimesh": "importers"}
# Reference data, not code: rows of measured constants.
TABLES = {
    "host/raytide/importers/mitsuba/cie.py",
    "host/raytide/importers/mitsuba/metals.py",
    "host/raytide/scene/presets.py",
}

MODULES = sorted(PACKAGE.rglob("*.py"))
SOURCES = [*MODULES, *sorted((ROOT / "tools").rglob("*.py")), *sorted((ROOT / "tests").rglob("*.py"))]


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def package_of(path: Path) -> str:
    """`scene` for host/raytide/scene/load.py, `errors` for host/raytide/errors.py."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports_of(path: Path) -> Iterator[str]:
    """Every module that a file imports, also inside functions and for types alone; relative ones made absolute."""
    place = ["raytide", *path.relative_to(PACKAGE).parts[:-1]]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join([*place[: len(place) - node.level + 1], node.module or ""]) if node.level else node.module
            assert base is not None
            yield from (f"{base}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_no_import_arrow_points_backwards(path: Path) -> None:
    package = package_of(path)
    assert package in ARROWS, f"{package}: a new package needs its arrows in this test"
    used = {name.split(".")[1] for name in imports_of(path) if name.startswith("raytide.")}
    assert used <= ARROWS[package] | {package, "errors"}


@pytest.mark.parametrize(("library", "package"), ONLY_IMPORTER.items())
def test_each_library_has_one_importer(library: str, package: str) -> None:
    importers = {package_of(path) for path in MODULES if any(n.split(".")[0] == library for n in imports_of(path))}
    assert importers <= {package}


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_module_level_only_declares(path: Path) -> None:
    """No statement of a module does work: imports, definitions, constants, and type-only or main guards."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    allowed = (ast.Import, ast.ImportFrom, ast.FunctionDef, ast.ClassDef, ast.Assign, ast.AnnAssign)
    for node in tree.body:
        if isinstance(node, ast.Expr):
            assert isinstance(node.value, ast.Constant), f"line {node.lineno}: an expression is evaluated at import"
        elif isinstance(node, ast.If):
            test = ast.unparse(node.test)
            assert test in ("TYPE_CHECKING", "__name__ == '__main__'"), f"line {node.lineno}: a branch at import"
        else:
            assert isinstance(node, allowed), f"line {node.lineno}: {type(node).__name__} at import"


IMPORT_ALL = """
import importlib, os, sys, threading
for name in sys.argv[1].split():
    importlib.import_module(name)
assert threading.active_count() == 1, "a thread was started"
maps = open("/proc/self/maps").read() if os.path.exists("/proc/self/maps") else ""
assert "libpocl" not in maps, "an OpenCL driver was loaded"
assert not os.listdir(os.environ["HOME"]), "a file was written"
"""


def test_importing_everything_touches_no_device_file_or_thread(tmp_path: Path) -> None:
    names = [".".join(("raytide", *path.relative_to(PACKAGE).with_suffix("").parts)) for path in MODULES]
    wanted = [name.removesuffix(".__init__") for name in names if not name.endswith("__main__")]
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("XDG_", "RAYTIDE_"))}
    environment |= {"HOME": str(tmp_path), "PYTHONPATH": str(ROOT / "host"), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", IMPORT_ALL, " ".join(wanted)]
    ran = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_files_and_functions_fit_the_head(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert name_of(path) in TABLES or len(text.splitlines()) <= MOST_LINES
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            length = (node.end_lineno or node.lineno) - node.lineno + 1
            assert length <= MOST_FUNCTION_LINES, f"{node.name}: {length} lines"


def public_functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """Functions and methods that other modules may call: not private, not nested in a function."""
    scopes: list[ast.Module | ast.ClassDef] = [tree]
    while scopes:
        for node in scopes.pop().body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                scopes.append(node)
            elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                yield node


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_public_names_are_typed_and_modules_say_what_they_are(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), "the module has no docstring"
    for node in public_functions(tree):
        arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        untyped = [one.arg for one in arguments if one.annotation is None and one.arg not in ("self", "cls")]
        assert not untyped, f"{node.name}: no type on {untyped}"
        assert node.returns is not None, f"{node.name}: no return type"


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_fast_math_is_asked_for_nowhere(path: Path) -> None:
    # That no builder would lose a triangle under it, nor a ray leak (verify's D5), that the benchmark finds it.
    tries_it = path.name in ("test_build_structure.py", "bench_faults.py", "test_bench_results.py", "variants.py")
    if path != Path(__file__) and not path.name.startswith("test_house_rules") and not tries_it:
        text = path.read_text(encoding="utf-8")
        assert not [flag for flag in ("-cl-fast-relaxed-math", "-cl-unsafe-math", "-cl-finite-math") if flag in text]
