"""Transforms of Mitsuba scenes against matrices made by hand; the first step acts first."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from mitsuba_scenes import loaded, problems_of
from raytide.importers.mitsuba.transforms import camel_to_snake, matrix_of, rotation
from raytide.scene.transform import matrix_of as steps_matrix

HALF = math.sqrt(0.5)
# Step, and its matrix worked out on paper
STEPS = [
    ("translate", {"x": "1", "z": "-2"}, [[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, -2], [0, 0, 0, 1]]),
    ("translate", {"value": "1, 2, 3"}, [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]),
    ("scale", {"x": "2"}, np.diag([2, 1, 1, 1])),
    ("scale", {"value": "3"}, np.diag([3, 3, 3, 1])),
    ("scale", {"value": "1 -2 3"}, np.diag([1, -2, 3, 1])),
    ("rotate", {"z": "1", "angle": "90"}, [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
    ("rotate", {"y": "1", "angle": "45"}, [[HALF, 0, HALF, 0], [0, 1, 0, 0], [-HALF, 0, HALF, 0], [0, 0, 0, 1]]),
    ("rotate", {"value": ".57735,.57735,.57735", "angle": "120"},
     [[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]),
    # looks along +x from (1, 2, 3), z up: left is z cross x = y, up is z
    ("lookat", {"origin": "1,2,3", "target": "5,2,3", "up": "0,0,1"},
     [[0, 0, 1, 1], [1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]]),
    # without up: of Mitsuba 3.9.1, with left (0.0918, -0.9082, -0.4082)
    ("lookat", {"origin": "1,2,3", "target": "0,1,5"},
     [[0.0917517, 0.9082483, -0.4082483, 1], [-0.9082483, -0.0917517, -0.4082483, 2],
      [-0.4082483, 0.4082483, 0.8164966, 3], [0, 0, 0, 1]]),
    # an axis that is not of length 1 goes into Rodrigues' formula as it is: of Mitsuba 3.9.1
    ("rotate", {"value": "1 1 0", "angle": "33"},
     [[1, 0.1613294, 0.5446390, 0], [0.1613294, 1, -0.5446390, 0], [-0.5446390, 0.5446390, 0.8386706, 0],
      [0, 0, 0, 1]]),
    ("matrix", {"value": "1 2 3  4 5 6  7 8 9"}, [[1, 2, 3, 0], [4, 5, 6, 0], [7, 8, 9, 0], [0, 0, 0, 1]]),
    ("matrix", {"value": "1 2 3 4 5 6 7 8 9 10 11 12 0 0 0 1"},
     [[1, 2, 3, 4], [5, 6, 7, 8], [9, 10, 11, 12], [0, 0, 0, 1]]),
]  # fmt: skip


@pytest.mark.parametrize(("tag", "attributes", "expected"), STEPS)
def test_steps_are_the_matrices_of_the_documentation(tag: str, attributes: dict[str, str], expected: object) -> None:
    assert np.allclose(matrix_of(tag, attributes), expected, rtol=1e-6, atol=1e-7)


def test_first_step_acts_first(tmp_path: Path) -> None:
    steps = '<scale value="2"/><rotate z="1" angle="90"/><translate x="10"/>'
    scene = loaded(tmp_path, f'<shape type="sphere"><transform name="to_world">{steps}</transform></shape>')
    matrix = steps_matrix(scene.objects["sphere"].transform)
    # the point (1, 0, 0): doubled (2, 0, 0), turned (0, 2, 0), shifted (10, 2, 0)
    assert np.allclose(matrix @ (1, 0, 0, 1), (10, 2, 0, 1))
    assert np.allclose(matrix, [[0, -2, 0, 10], [2, 0, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]])


def test_turns_are_rotations() -> None:
    generator = np.random.default_rng(1)
    for axis, degrees in zip(generator.normal(size=(50, 3)), generator.uniform(-720, 720, 50), strict=True):
        matrix = rotation(axis, degrees)[:3, :3]
        assert np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
        assert np.isclose(np.linalg.det(matrix), 1)
        assert np.allclose(matrix @ axis, axis)
        assert np.isclose(np.trace(matrix), 1 + 2 * math.cos(math.radians(degrees)))


@pytest.mark.parametrize(
    ("step", "wanted"),
    [
        ('<rotate angle="30"/>', "axis"),
        ('<rotate x="1"/>', "angle"),
        ('<lookat origin="0,0,0" target="0,0,0" up="0,1,0"/>', "target"),
        ('<lookat origin="0,0,0" target="0,1,0" up="0,1,0"/>', "parallel"),
        ('<matrix value="1 2 3 4"/>', "9 or 16"),
        ('<matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1"/>', "0 0 0 1"),
        ('<scale value="1" x="2"/>', "either"),
        ('<translate x="nan"/>', "finite"),
        ('<shear x="1"/>', "one of translate"),
        ('<scale value="1e400"/>', "finite"),
    ],
)
def test_wrong_steps_are_refused_with_their_line(step: str, wanted: str, tmp_path: Path) -> None:
    shape = ['<shape type="sphere">', '<transform name="to_world">', step, "</transform></shape>"]
    problems = problems_of(tmp_path, *shape)
    assert [found.line for found in problems] == [7]
    assert wanted in str(problems[0])


@pytest.mark.parametrize(
    ("old", "new"),
    [("toWorld", "to_world"), ("intIOR", "int_ior"), ("maxDepth", "max_depth"), ("alpha", "alpha"), ("to_uv", "to_uv"),
     ("specularReflectance", "specular_reflectance"), ("bsdfSamples", "bsdf_samples")],
)  # fmt: skip
def test_old_names_become_new_ones(old: str, new: str) -> None:
    assert camel_to_snake(old) == new
