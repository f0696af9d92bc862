"""Every shipped scene loads, and what is expected of it belongs to it."""

from __future__ import annotations

import importlib.util
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted(path for path in (ROOT / "scenes").glob("*/*.toml") if path.name != "expected.toml")


def module_of(path: Path, name: str) -> ModuleType:
    """A script of the tree as a module."""
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", SCENES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_shipped_scene_loads_without_a_warning(path: Path) -> None:
    import raytide as rt

    flat = rt.load(path).flatten()
    assert not flat.warnings
    assert len(flat.triangles) + len(flat.shapes) + len(flat.instances) > 0


@pytest.mark.parametrize("path", SCENES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_shipped_scene_has_checks_inside_its_picture(path: Path) -> None:
    expected = tomllib.loads((path.parent / "expected.toml").read_text(encoding="utf-8"))
    width, height = tomllib.loads(path.read_text(encoding="utf-8"))["camera"]["size"]
    assert expected[path.stem]
    for check in expected[path.stem]:
        x0, y0, x1, y1 = check.get("pixels", (0, 0, width, height))
        assert 0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height
        assert len(check["value"]) == 3
        if "standard_error" in check:
            assert check["source"] and any(check["value"])  # measured, not left empty
        else:
            assert 0 < check.get("relative", 0) + check.get("absolute", 0) <= 0.01


def test_every_kind_of_material_light_and_shape_has_a_scene() -> None:
    from raytide.scene.lights import LIGHTS
    from raytide.scene.materials import MATERIALS
    from raytide.scene.shapes import SHAPES

    used: set[str] = set()
    for path in SCENES:
        scene = tomllib.loads(path.read_text(encoding="utf-8"))
        used |= {table.get("type", "instance" if "of" in table else "mesh")
                 for group in ("materials", "lights", "objects") for table in scene.get(group, {}).values()}
    assert {*LIGHTS, *MATERIALS, *SHAPES} <= used


def test_expected_closed_forms_follow_from_the_scene_files() -> None:
    forms = module_of(ROOT / "tools" / "closed_forms.py", "closed_forms")
    for folder, make in (("lights", forms.light_checks), ("materials", forms.material_checks),
                         ("furnace", forms.furnace_checks)):
        stored = (ROOT / "scenes" / folder / "expected.toml").read_text(encoding="utf-8")
        derived = tomllib.loads(forms.text_of(make()))
        for name, checks in tomllib.loads(stored).items():
            if name == "format":
                continue
            assert len(checks) == len(derived[name])
            for check, again in zip(checks, derived[name], strict=True):
                assert check["pixels"] == again["pixels"]
                assert check["value"] == pytest.approx(again["value"], rel=1e-6)


def test_rough_albedo_tends_to_the_mirror_s_and_is_right_at_alpha_1() -> None:
    forms = module_of(ROOT / "tools" / "closed_forms.py", "closed_forms")
    white = forms.schlick(np.ones(3))
    assert forms.ggx_albedo(1e-3, white) == pytest.approx(np.ones(3), abs=1e-4)
    assert forms.ggx_albedo(1.0, white) == pytest.approx(np.full(3, 1 - np.log(2)), abs=1e-6)  # by hand
    losses = [1 - forms.ggx_albedo(alpha, white)[0] for alpha in (0.1, 0.3, 0.6, 1.0)]
    assert losses == sorted(losses) and losses[0] > 1e-3


@pytest.mark.parametrize(("folder", "triangles", "file"), [("blob", 5000, "blob_5k.ply"),
                                                           ("terrain", 10_000, "terrain_10k.ply")])
def test_generator_makes_the_mesh_that_is_shipped(folder: str, triangles: int, file: str) -> None:
    from raytide.importers.geometry import load_mesh

    module = module_of(ROOT / "scenes" / folder / "generate.py", f"generate_{folder}")
    vertices, faces = getattr(module, folder)(triangles)
    path = ROOT / "scenes" / folder / file
    shipped = load_mesh(path)
    assert path.stat().st_size < 200_000
    np.testing.assert_allclose(shipped.vertices, vertices, atol=1e-5)
    np.testing.assert_array_equal(shipped.triangles, faces)


def test_blob_is_closed_and_points_outward() -> None:
    module = module_of(ROOT / "scenes" / "blob" / "generate.py", "generate_blob")
    vertices, faces = module.blob(20_000)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    directed = {tuple(edge) for edge in edges.tolist()}
    assert len(directed) == len(edges) and all((b, a) in directed for a, b in directed)
    corners = vertices[faces].astype(np.float64)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert 0.3 < volume < 1.2
    assert 19_000 < len(faces) < 21_000


def test_terrain_is_the_same_land_at_every_size() -> None:
    module = module_of(ROOT / "scenes" / "terrain" / "generate.py", "generate_terrain")
    coarse, fine = module.heights(65), module.heights(257)
    np.testing.assert_allclose(coarse, fine[::4, ::4], atol=1e-5)
    vertices, faces = module.terrain(2000)
    corners = vertices[faces]
    up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1]
    assert (up > 0).all()
