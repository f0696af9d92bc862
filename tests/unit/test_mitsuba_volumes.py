"""Signed distance fields: the surface closes, fronts are outside, its volume is that of the field; bad files."""

from __future__ import annotations

import struct
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from mitsuba_scenes import loaded, problems_of
from raytide.importers.mitsuba.volumes import refined, zero_level


def volume(path: Path, field: np.ndarray, version: int = 3, kind: int = 1, channels: int = 1) -> str:
    """Writes a field (z, y, x); the shape that shows it."""
    sizes = field.shape[::-1]
    head = b"VOL" + struct.pack("<Biiiii6f", version, kind, *sizes, channels, 0, 0, 0, 1, 1, 1)
    path.write_bytes(head + field.astype("<f4").tobytes())
    return f'<shape type="sdfgrid"><string name="filename" value="{path.name}"/></shape>'


def ball(points: int) -> np.ndarray:
    z, y, x = np.meshgrid(*[np.linspace(0, 1, points)] * 3, indexing="ij")
    return np.sqrt((x - 0.5) ** 2 + (y - 0.45) ** 2 + (z - 0.6) ** 2) - 0.3


def test_the_zero_level_closes_with_fronts_outside() -> None:
    patch = zero_level(refined(ball(25)))
    edges = Counter((a, b) for face in patch.faces.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True))
    assert all(count == 1 and edges[b, a] == 1 for (a, b), count in edges.items())
    corners = patch.vertices[patch.faces]
    assert (np.cross(corners[:, 1], corners[:, 2]) * corners[:, 0]).sum() / 6 == pytest.approx(0.113097, rel=0.02)
    assert np.allclose(np.linalg.norm(patch.vertices - (0.5, 0.45, 0.6), axis=1), 0.3, atol=2e-3)


def test_a_plane_stays_one_between_few_points() -> None:
    """Linear fields are met exactly, however coarse."""
    z, y, x = np.meshgrid([0.0, 1.0], [0.0, 0.5, 1.0], [0.0, 1.0], indexing="ij")
    patch = zero_level(refined(x + 2 * y + 3 * z - 2.2))
    assert np.allclose(patch.vertices @ (1, 2, 3), 2.2)
    corners = patch.vertices[patch.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals @ (1, 2, 3) > 0).all()


def test_a_field_becomes_a_smooth_mesh(tmp_path: Path) -> None:
    (thing,) = loaded(tmp_path, volume(tmp_path / "a.vol", ball(9))).objects.values()
    assert thing.type == "mesh" and thing.smooth and len(thing.faces) > 1000  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("options", "words"),
    [({"version": 2}, "version 2"), ({"kind": 2}, "kind 2"), ({"channels": 3}, "3 channels")],
)
def test_other_volumes_are_refused(options: dict[str, int], words: str, tmp_path: Path) -> None:
    (found,) = problems_of(tmp_path, volume(tmp_path / "a.vol", ball(4), **options))
    assert found.line == 5 and words in found.came


def test_broken_volumes_are_refused(tmp_path: Path) -> None:
    shape = volume(tmp_path / "a.vol", ball(4))
    whole = (tmp_path / "a.vol").read_bytes()
    nowhere = volume(tmp_path / "b.vol", ball(4) + 2)
    noise = volume(tmp_path / "d.vol", np.random.default_rng(1).normal(size=(70, 70, 70)))
    nan = volume(tmp_path / "c.vol", ball(4) * np.nan)
    for data, words in ((whole[:-4], "bytes"), (whole[:20], "another file"), (b"PK" + whole[2:], "another file")):
        (tmp_path / "a.vol").write_bytes(data)
        assert words in problems_of(tmp_path, shape)[0].came
    assert "nowhere" in problems_of(tmp_path, nowhere)[0].came
    (found,) = problems_of(tmp_path, noise)
    assert "a surface through 326," in found.came and "at most 262,144" in found.wanted
    assert "finite" in problems_of(tmp_path, nan)[0].came
