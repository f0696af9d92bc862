"""Laws of the comparison with other renderers: its scenes are what they say, its errors are unbiased."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import pytest

TOOLS = Path(__file__).resolve().parents[2] / "tools"
sys.path.insert(0, str(TOOLS))

import compare_peers as peers  # noqa: E402
import compare_peers_report as report  # noqa: E402
import compare_peers_scenes as scenes  # noqa: E402
import compare_peers_worker as worker  # noqa: E402
from raytide.errors import UsageError  # noqa: E402


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Signed volume of a closed mesh: positive where faces are seen from outside (divergence theorem)."""
    return float(np.linalg.det(vertices[faces].astype(np.float64)).sum() / 6)


def test_solids_face_outwards_and_have_their_volume():
    box = scenes.box((1.0, 0.0, -2.0), (3.0, 1.5, 2.0), turn=0.7)
    assert volume(*box) == pytest.approx(2.0 * 1.5 * 4.0)
    sides = 48
    prism = scenes.cylinder((2.0, 0.0, -1.0), 0.5, 3.0, sides)
    assert volume(*prism) == pytest.approx(3.0 * sides / 2 * 0.25 * np.sin(2 * np.pi / sides))
    ball = scenes.globe((5.0, 1.0, 0.0), 2.0, halvings=3)
    assert len(ball[1]) == 20 * 4**3
    assert 0.97 * 4 / 3 * np.pi * 8 < volume(*ball) < 4 / 3 * np.pi * 8


def test_the_cornell_box_is_seen_from_inside_and_its_blocks_from_outside():
    scene = scenes.cornell()
    for name in ("short", "tall"):  # without bottoms, which lie in y = 0 and add nothing
        _, vertices, faces = scene.meshes[name]
        assert volume(vertices, faces) > 0
    middle = np.array((2.78, 2.73, 2.8))
    for name in ("floor", "ceiling", "back", "left", "right", "lamp"):
        _, vertices, faces = scene.meshes[name]
        a, b, c = vertices[faces].astype(np.float64).transpose(1, 0, 2)
        assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), middle - a) > 0).all(), name


def test_a_scene_survives_its_file(tmp_path):
    scene = scenes.spheres()
    scene.save(tmp_path / "scene.npz")
    again = scenes.PeerScene.load(tmp_path / "scene.npz")
    assert again.triangles == scene.triangles == 2 + 3 * 20 * 4**6
    assert list(again.meshes) == list(scene.meshes)
    for mesh in scene.meshes:
        assert all(np.array_equal(a, b) for a, b in zip(again.meshes[mesh][1:], scene.meshes[mesh][1:], strict=True))
    assert again.materials["glass"] == scene.materials["glass"] and again.max_depth == 8
    moved = scenes.spheres()
    moved.meshes["glass"][1][0, 0] += 1e-3
    assert moved.digest() != scene.digest()


def noisy(random: np.random.Generator, count: int, deviation: float, level: float = 1.0) -> np.ndarray:
    """Replicates of a picture of constant radiance 1 x level with noise of that deviation."""
    return (level + deviation * random.standard_normal((count, 64, 64, 3))).astype(np.float32)


def test_errors_are_those_of_the_picture_and_not_of_the_reference():
    random = np.random.default_rng(3)
    reference = report.Reference(noisy(random, 8, 0.1))
    measured = {"times": [{"wanted_s": 1.0, "seconds": 2.0, "spp": 4}]}
    found = report.figures(measured, {"1.0": noisy(random, 4, 0.1)}, reference)
    truth = 0.1**2 / (1 + report.EPSILON**2)
    assert found["times"][0]["relmse"] == pytest.approx(truth, rel=0.05)
    assert found["efficiency"] == pytest.approx(1 / (truth * 2.0), rel=0.05)


def test_a_darker_picture_differs_and_an_equal_one_agrees():
    random = np.random.default_rng(4)
    reference = report.Reference(noisy(random, 8, 0.1))
    assert report.agreement(noisy(random, 4, 0.1), reference)["agrees"]
    dark = report.agreement(noisy(random, 4, 0.1, level=0.99), reference)
    assert not dark["agrees"]
    assert dark["tile_difference"] > 2 * dark["tile_noise"]


def test_results_of_several_runs_are_one_table():
    about = {"size": 8, "threads": 2, "seconds": [1.0], "reference_spp": 64}

    def one(scene: str, renderer: str, words: str) -> dict:
        return {"about": about, "rows": [{"scene": scene, "renderer": renderer, "failed": words}]}

    rows = peers.joined([one("room", "cycles", "a"), one("room", "raytide", "b"), one("room", "cycles", "c")])["rows"]
    assert [(row["renderer"], row["failed"]) for row in rows] == [("cycles", "c"), ("raytide", "b")]
    other = one("room", "luxcore", "d") | {"about": about | {"size": 16}}
    with pytest.raises(UsageError, match="different size"):
        peers.joined([one("room", "cycles", "a"), other])


def test_the_renderer_that_is_named_makes_the_references():
    there = {"raytide": "python", "mitsuba_mj": "python", "cycles": "python"}
    assert peers.referee(there, argparse.Namespace(reference_by=None)) == "mitsuba"
    assert peers.referee(there, argparse.Namespace(reference_by="cycles")) == "cycles"
    with pytest.raises(UsageError, match="luxcore"):
        peers.referee(there, argparse.Namespace(reference_by="luxcore"))


class Compiler:
    """A renderer that takes 0.01 s a sample, and two seconds more for the first picture of more than one."""

    def __init__(self) -> None:
        self.now, self.begun, self.taken = 0.0, False, []

    def whole(self, spp: int) -> int:
        return spp

    def render(self, spp: int, seed: int) -> tuple[None, int]:
        self.now += 0.01 * spp + (2.0 if spp > 1 and not self.begun else 0.0)
        self.begun |= spp > 1
        self.taken.append(spp)
        return None, spp


def test_what_compiles_is_not_taken_for_rendering(monkeypatch: pytest.MonkeyPatch):
    peer = Compiler()
    monkeypatch.setattr(worker, "time", argparse.Namespace(perf_counter=lambda: peer.now))
    found = worker.rates(peer, pixels=100, repeats=3)
    assert found["samples_per_s"] == pytest.approx(100 / 0.01)
    assert 0.01 * max(peer.taken[-2:]) >= worker.LONG_S
