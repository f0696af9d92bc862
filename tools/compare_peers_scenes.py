"""The five scenes of compare_peers.py, described for any renderer.

World right-handed, y up, metres. Radiance linear Rec. 709. `fov` is vertical, in degrees. Triangles are flat; their
front is where they are seen counter-clockwise. Lamps shine to the front only and reflect nothing; everything but glass
is alike on both sides. `max_depth` counts path edges: 1 = lamps seen directly, 2 = and direct light.

A Picture file (.npz) holds one scene: every mesh's arrays and, as JSON, the rest. Needs numpy only.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

Point = tuple[float, float, float]
Geometry = tuple[np.ndarray, np.ndarray]  # vertices (V, 3) float [m], faces (F, 3) int


@dataclass
class PeerScene:
    """Materials and lights are dictionaries with a "type":

    diffuse, mirror (reflectance); rough_conductor (eta, k, alpha; GGX); dielectric (ior, normals outwards); emitter
    (radiance); point (position, intensity [W/sr]); sun (direction of its light, irradiance [W/m^2] across it).
    """

    name: str
    origin: Point
    target: Point
    fov: float
    max_depth: int
    sky: Point | None = None  # constant radiance from everywhere
    materials: dict[str, dict[str, Any]] = field(default_factory=dict)
    lights: list[dict[str, Any]] = field(default_factory=list)
    meshes: dict[str, tuple[str, np.ndarray, np.ndarray]] = field(default_factory=dict)  # material, vertices, faces

    def add(self, name: str, material: str, geometry: Geometry) -> None:
        """A mesh; vertices become float32, faces int32."""
        vertices, faces = geometry
        self.meshes[name] = material, np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.int32)

    @property
    def triangles(self) -> int:
        return sum(len(faces) for _, _, faces in self.meshes.values())

    def save(self, path: Path) -> None:
        """Write a Picture file."""
        rest = {key: value for key, value in vars(self).items() if key != "meshes"}
        rest["meshes"] = [(name, material) for name, (material, _, _) in self.meshes.items()]
        arrays = {f"{part}{i}": mesh[1 + j] for i, mesh in enumerate(self.meshes.values())
                  for j, part in enumerate(("v", "f"))}  # fmt: skip
        np.savez(path, rest=np.array(json.dumps(rest)), **arrays)

    def digest(self) -> str:
        """SHA-256 of all that a picture of it depends on."""
        out = hashlib.sha256(repr([(key, value) for key, value in vars(self).items() if key != "meshes"]).encode())
        for name, (material, vertices, faces) in self.meshes.items():
            out.update(f"{name} {material}".encode() + vertices.tobytes() + faces.tobytes())
        return out.hexdigest()

    @staticmethod
    def load(path: Path) -> PeerScene:
        """Read a Picture file."""
        with np.load(path) as file:
            rest = json.loads(str(file["rest"]))
            meshes = rest.pop("meshes")
            scene = PeerScene(**rest)
            for i, (name, material) in enumerate(meshes):
                scene.meshes[name] = material, file[f"v{i}"], file[f"f{i}"]
        return scene


def quads(*corners: Sequence[Point]) -> Geometry:
    """Each of four corners, counter-clockwise from the front."""
    first = 4 * np.arange(len(corners))[:, None]
    return np.array(corners, np.float64).reshape(-1, 3), np.concatenate([first + (0, 1, 2), first + (0, 2, 3)])


def flat(half: float, height: float = 0.0) -> Geometry:
    """Horizontal square of side 2 half whose front is up."""
    return quads([(-half, height, half), (half, height, half), (half, height, -half), (-half, height, -half)])


def box(low: Point, high: Point, turn: float = 0.0) -> Geometry:
    """Box seen from outside, turned by `turn` radians about the upright line through its middle."""
    sides = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))
    corners = np.array([[(low, high)[corner >> axis & 1][axis] for axis in range(3)] for corner in range(8)])
    vertices, faces = quads(*(corners[list(side)] for side in sides))
    middle = (np.add(low, high) / 2) * (1, 0, 1)
    c, s = np.cos(turn), np.sin(turn)
    return (vertices - middle) @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) + middle, faces


def cylinder(base: Point, radius: float, height: float, sides: int = 48) -> Geometry:
    """Closed upright prism on `base`, seen from outside."""
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([radius * np.cos(turn), np.zeros(sides), -radius * np.sin(turn)])
    up = np.array([0.0, height, 0.0])
    vertices = np.concatenate([ring, ring + up, [[0, 0, 0]], [up]]) + base
    here, after = np.arange(sides), np.roll(np.arange(sides), -1)
    bottom, top = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    rows = [(here, after, after + sides), (here, after + sides, here + sides),
            (after, here, bottom), (here + sides, after + sides, top)]  # fmt: skip
    return vertices, np.concatenate([np.column_stack(row) for row in rows])


def globe(centre: Point, radius: float, halvings: int = 6) -> Geometry:
    """Sphere of 20 * 4^halvings flat triangles seen from outside: an icosahedron with its edges halved and halved."""
    golden = (1 + 5**0.5) / 2
    points = np.array([np.roll((0.0, a, b * golden), turn) for turn in range(3) for a in (-1, 1) for b in (-1, 1)])
    near = np.linalg.norm(points[:, None] - points, axis=-1) < 2.1  # edges are 2 long
    faces = np.array([(i, j, k) for i in range(12) for j in range(i) for k in range(j)
                      if near[i, j] and near[j, k] and near[k, i]])  # fmt: skip
    outwards = np.linalg.det(points[faces]) > 0
    faces[~outwards] = faces[~outwards][:, ::-1]
    points /= np.linalg.norm(points[0])
    for _ in range(halvings):
        edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
        unique, number = np.unique(edges, axis=0, return_inverse=True)
        middles = points[unique].sum(axis=1)
        middle = number.reshape(-1, 3) + len(points)
        points = np.concatenate([points, middles / np.linalg.norm(middles, axis=1, keepdims=True)])
        corners = [np.column_stack([faces[:, i], middle[:, i], middle[:, i - 1]]) for i in range(3)]
        faces = np.concatenate([*corners, middle])
    return points * radius + centre, faces


def cornell(mesh: Geometry | None = None) -> PeerScene:
    """The Cornell box as measured at Cornell University, 1 m = 100 of its units."""
    scene = PeerScene("cornell", (2.78, 2.73, -8.0), (2.78, 2.73, 0.0), 39.3077, 8)
    colours = {"white": (0.725, 0.71, 0.68), "red": (0.63, 0.065, 0.05), "green": (0.14, 0.45, 0.091)}
    scene.materials = {name: {"type": "diffuse", "reflectance": colour} for name, colour in colours.items()}
    scene.materials["lamp"] = {"type": "emitter", "radiance": (17.0, 12.0, 4.0)}

    def add(name: str, material: str, *sides: Sequence[Point]) -> None:
        vertices, faces = quads(*sides)
        scene.add(name, material, (vertices / 100, faces))

    def block(name: str, height: float, a: tuple, b: tuple, c: tuple, d: tuple) -> None:
        low, high = [[(x, y, z) for x, z in (a, b, c, d)] for y in (0.0, height)]
        walls = [(low[i], low[i - 3], high[i - 3], high[i]) for i in range(4)]
        add(name, "white", high, *walls)

    add("floor", "white", [(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)])
    add("ceiling", "white", [(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)])
    add("back", "white", [(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)])
    add("right", "green", [(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)])
    add("left", "red", [(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)])
    add("lamp", "lamp", [(343, 548.3, 227), (343, 548.3, 332), (213, 548.3, 332), (213, 548.3, 227)])
    block("short", 165.0, (130, 65), (82, 225), (240, 272), (290, 114))
    block("tall", 330.0, (423, 247), (265, 296), (314, 456), (472, 406))
    return scene


def spheres(mesh: Geometry | None = None) -> PeerScene:
    """A plane with a matte, a mirror and a glass sphere, under a point light and a sky."""
    scene = PeerScene("spheres", (0.0, 2.6, 9.0), (0.0, 0.9, 0.0), 46.0, 8, sky=(0.2, 0.27, 0.38))
    scene.materials = {
        "ground": {"type": "diffuse", "reflectance": (0.5, 0.5, 0.5)},
        "matte": {"type": "diffuse", "reflectance": (0.7, 0.25, 0.2)},
        "mirror": {"type": "mirror", "reflectance": (0.9, 0.9, 0.9)},
        "glass": {"type": "dielectric", "ior": 1.5},
    }
    scene.add("ground", "ground", flat(30.0))
    for name, centre in (("matte", (-2.3, 1.0, 0.0)), ("mirror", (0.0, 1.0, -0.8)), ("glass", (2.2, 1.001, 0.6))):
        scene.add(name, name, globe(centre, 1.0))
    scene.lights = [{"type": "point", "position": (3.0, 6.0, 5.0), "intensity": (260.0, 245.0, 210.0)}]
    return scene


def bunny(mesh: Geometry | None = None) -> PeerScene:
    """A mesh, 1.6 m tall, on a plane under a slanting lamp and a dim sky."""
    if mesh is None:
        raise ValueError("scene bunny needs a mesh")
    scene = PeerScene("bunny", (0.4, 1.6, 4.2), (0.0, 0.75, 0.0), 36.0, 6, sky=(0.2, 0.25, 0.3))
    scene.materials = {
        "ground": {"type": "diffuse", "reflectance": (0.5, 0.5, 0.5)},
        "bunny": {"type": "diffuse", "reflectance": (0.7, 0.55, 0.4)},
        "lamp": {"type": "emitter", "radiance": (20.0, 18.0, 15.0)},
    }
    vertices, faces = np.asarray(mesh[0], np.float64), mesh[1]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    vertices = (vertices - (low + high) / 2) * (1.6 / (high[1] - low[1]))
    scene.add("bunny", "bunny", (vertices - (0.0, vertices[:, 1].min(), 0.0), faces))
    scene.add("ground", "ground", flat(20.0))
    slope = 0.7 * 0.5**0.5  # 45 degrees: faces down and towards -x
    corners = [(-slope, slope, -0.7), (slope, -slope, -0.7), (slope, -slope, 0.7), (-slope, slope, 0.7)]
    scene.add("lamp", "lamp", quads([(x + 2.6, y + 3.6, z + 1.0) for x, y, z in corners]))
    return scene


def terrain(mesh: Geometry | None = None, cells: int = 708) -> PeerScene:
    """2 cells^2 triangles of fractal ground under a sun and a sky."""
    scene = PeerScene("terrain", (0.0, 4.6, 9.6), (0.0, 0.7, 0.0), 42.0, 4, sky=(0.18, 0.25, 0.38))
    scene.materials = {"ground": {"type": "diffuse", "reflectance": (0.45, 0.38, 0.28)}}
    size = 1024
    waves = np.fft.fftfreq(size, 1 / size)
    frequency = np.hypot(waves[:, None], waves)
    frequency[0, 0] = 1.0
    spectrum = np.fft.fft2(np.random.default_rng(7).standard_normal((size, size))) * frequency**-2.05
    spectrum[0, 0] = 0.0
    heights = np.fft.ifft2(spectrum).real[:cells + 1, :cells + 1]
    heights = 5.0 * (heights - heights.min()) / np.ptp(heights) - 2.0
    place = np.linspace(-8.0, 8.0, cells + 1)
    vertices = np.stack([np.tile(place, (cells + 1, 1)), heights, np.tile(place[:, None], cells + 1)], axis=-1)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    below, beside = first + cells + 1, first + 1
    faces = np.concatenate([np.column_stack([first, below, below + 1]), np.column_stack([first, below + 1, beside])])
    scene.add("ground", "ground", (vertices.reshape(-1, 3), faces))
    scene.lights = [{"type": "sun", "direction": (-0.8, -0.45, -0.1), "irradiance": (4.0, 3.7, 3.2)}]
    return scene


def room(mesh: Geometry | None = None) -> PeerScene:
    """A closed room with 160 places for boxes and cylinders, many of rough metal, lit by one small bright lamp."""
    scene = PeerScene("room", (-4.2, 2.2, 3.4), (1.0, 0.9, -0.6), 60.0, 12)
    matte = {"wall": (0.75, 0.73, 0.7), "floor": (0.5, 0.42, 0.35), "blue": (0.2, 0.3, 0.6),
             "orange": (0.7, 0.35, 0.12)}  # fmt: skip
    scene.materials = {name: {"type": "diffuse", "reflectance": colour} for name, colour in matte.items()}
    metals = {"gold": ((0.143, 0.375, 1.442), (3.983, 2.386, 1.603), 0.2),
              "alu": ((1.657, 0.880, 0.521), (9.224, 6.270, 4.837), 0.1)}  # fmt: skip
    for name, (eta, k, alpha) in metals.items():
        scene.materials[name] = {"type": "rough_conductor", "eta": eta, "k": k, "alpha": alpha}
    scene.materials["lamp"] = {"type": "emitter", "radiance": (160.0, 150.0, 130.0)}
    inside, faces = box((-5.0, 0.0, -4.0), (5.0, 4.0, 4.0))
    scene.add("walls", "wall", (inside, faces[:, ::-1]))
    x, z = 4.9, 3.9
    scene.add("carpet", "floor", quads([(-x, 0.01, z), (x, 0.01, z), (x, 0.01, -z), (-x, 0.01, -z)]))
    scene.add("lamp", "lamp", quads([(0.3, z, -0.2), (0.7, z, -0.2), (0.7, z, 0.2), (0.3, z, 0.2)]))
    random = np.random.default_rng(11)
    names = ("wall", "blue", "orange", "gold", "alu")
    for i in range(160):
        x, z = random.uniform(-4.6, 4.6), random.uniform(-3.6, 3.6)
        radius, height, turn = random.uniform(0.08, 0.28), random.uniform(0.1, 1.5) ** 1.5, random.uniform(0, 3)
        material = names[random.integers(len(names))]
        if np.hypot(x + 4.2, z - 3.4) < 1.6:
            continue  # where the camera is
        upright = (box((x - radius, 0.0, z - radius), (x + radius, height, z + radius), turn) if i % 2 else
                   cylinder((x, 0.0, z), radius, height))  # fmt: skip
        scene.add(f"thing{i}", material, upright)
    return scene


SCENES: dict[str, Callable[[Geometry | None], PeerScene]] = {
    "cornell": cornell, "spheres": spheres, "bunny": bunny, "terrain": terrain, "room": room,
}  # fmt: skip
