"""Where lamps send the light that mirrors and clear glass gather: all of these lie within what is aimed at."""

from __future__ import annotations

import numpy as np
import pytest

import raytide as rt
from raytide.render.emission import MOST_AIMS
from raytide.render.pack import features_of, pack

SHEAR = np.array([(1, 2, 0, 5), (0, 0.5, 1.5, 3), (0.3, 0, 1, -4), (0, 0, 0, 1)], float)
SIGNS = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], float)


def moved(matrix: np.ndarray, corners: np.ndarray) -> np.ndarray:
    return corners @ matrix[:3, :3].T + matrix[:3, 3]


def with_lamp() -> rt.Scene:
    camera = rt.Camera(origin=(0.5, 2, 9), target=(0, 0, 0), fov=40, size=(8, 8))
    scene = rt.Scene(camera=camera, render={"caustics": True})
    scene.add(rt.point((0, 50, 0), 1.0), name="bulb")
    return scene


def of_all_kinds() -> tuple[rt.Scene, list[np.ndarray]]:
    """Glass of every shape, askew where that can be, and the corners (n, 3) of each."""
    scene, glass = with_lamp(), rt.Dielectric(1.5)
    u, v = np.array((1.0, 0.2, 0.0)), np.array((0.9, 0.3, 0.1))
    scene.add(rt.rect((-9, 1, 0), u=tuple(u), v=tuple(v)), rt.Mirror(), name="askew")
    scene.add(rt.box((-1, -2, -3), (1, 2, 3)).moved({"matrix": tuple(SHEAR.ravel())}), glass, name="block")
    scene.add(rt.sphere((0, 0, 20), 2.0), glass, name="ball")
    scene.add(rt.disk((0, 0, -20), (1, 2, 3), 1.5), rt.Plastic(0.5), name="disk")
    vertices = np.array([(0, 0, 0), (3, 0.1, 0), (0.2, 1, 0), (0, 0, 2)], float)
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    scene.add(rt.mesh(vertices=vertices + (30, 0, 0), faces=faces), glass, name="mesh")
    scene.add(rt.mesh(vertices=vertices, faces=faces), glass, name="shared")
    scene.add(rt.instance("shared").moved({"matrix": tuple(SHEAR.ravel())}).translate(0, 0, 60), name="second")
    scene.add(rt.rect((0, -5, 0), u=(0, 0, 99), v=(99, 0, 0)), rt.Diffuse(0.5), name="floor")
    axes = np.linalg.qr(np.array([(1, 2, 3), (1, 0, 0), (0, 1, 0)], float).T)[0].T
    turns = np.linspace(0, 2 * np.pi, 64)[:, None]
    return scene, [
        np.array([(-9, 1, 0) + a * u + b * v for a in (-1, 1) for b in (-1, 1)]),
        moved(SHEAR, SIGNS * (1, 2, 3)),
        (0, 0, 20) + 2.0 * np.concatenate([np.eye(3), -np.eye(3)]),
        (0, 0, -20) + 1.5 * (np.cos(turns) * axes[1] + np.sin(turns) * axes[2]),
        vertices + (30, 0, 0),
        vertices,
        moved(SHEAR, vertices) + (0, 0, 60),
    ]


def too_many() -> tuple[rt.Scene, list[np.ndarray]]:
    """More rectangles askew than there can be aims, most within each other's reach."""
    scene, rng = with_lamp(), np.random.default_rng(7)
    corners = []
    for i in range(3 * MOST_AIMS + 5):
        center, u, other = rng.uniform(-9, 9, 3), rng.normal(size=3), rng.normal(size=3)
        v = 0.9 * u + 0.2 * other
        scene.add(rt.rect(tuple(center), u=tuple(u), v=tuple(v)), rt.Mirror(), name=f"mirror{i}")
        corners.append(np.array([center + a * u + b * v for a in (-1, 1) for b in (-1, 1)]))
    return scene, corners


@pytest.mark.parametrize("made", [of_all_kinds, too_many])
def test_everything_that_gathers_light_lies_within_an_aim(made: object) -> None:
    scene, things = made()  # type: ignore[operator]
    flat = scene.flatten()
    packed = pack(flat, features_of(flat))
    assert packed.sending is not None
    head, aims = packed.sending.aims[0], packed.sending.aims[1:].astype(float)
    assert head[0] == len(aims) == min(len(things), MOST_AIMS)
    assert head[1] == pytest.approx(np.sum(aims[:, 3] ** 2), rel=1e-5)
    for corners in things:  # a sphere that holds all corners holds all between them
        far = np.linalg.norm((corners - packed.origin)[:, None] - aims[None, :, :3], axis=2)
        assert (far <= aims[:, 3]).all(axis=0).any()
