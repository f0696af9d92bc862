"""A scene as arrays in world space, float64: what a renderer packs for its device."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from raytide.errors import SceneError
from raytide.importers.limits import LARGEST, SMALLEST
from raytide.importers.measured import Measurement
from raytide.importers.meshdata import MeshData, longest_edges
from raytide.scene.camera import Camera
from raytide.scene.check import scene_problems, scene_warnings
from raytide.scene.instances import shown_objects
from raytide.scene.lights import Light
from raytide.scene.material_parts import Material
from raytide.scene.measured import flat_measurements
from raytide.scene.normals import smooth_normals
from raytide.scene.painted import FlatTextures, Painted, flat_textures
from raytide.scene.settings import RenderSettings
from raytide.scene.shapes import Mesh, Shape
from raytide.scene.shared import FlatInstance, FlatMesh, shared_meshes
from raytide.scene.transform import is_mirror, move_normals, move_points
from raytide.scene.values import RAY_KINDS

if TYPE_CHECKING:
    from raytide.scene.scene import Scene


@dataclass(frozen=True)
class FlatShape:
    """An analytic shape. axes (3, 3): rows u, v, w [m].

    sphere: radius times a rotation; box: half axes; rectangle: half edges u, v and the unit normal w; disk: half axes
    of the ellipse u, v (perpendicular) and the unit normal w; plane: unit tangents u, v and the unit normal w. u, v, w
    are right-handed.
    """

    kind: str
    object: int
    center: np.ndarray
    axes: np.ndarray


@dataclass(frozen=True)
class FlatObject:
    """One object of the scene: its material, and its triangles, its shape or its instance (-1 where it has none).

    `flipped`: its transform mirrors; normals and winding of its triangles here are already right. `visible_to`: the
    kinds of ray that meet it; an object that none meets has nothing here but its name.
    """

    name: str
    material: int
    first_triangle: int
    triangle_count: int
    shape: int
    flipped: bool
    instance: int = -1
    visible_to: tuple[str, ...] = RAY_KINDS


@dataclass(frozen=True)
class FlatScene:
    """Everything that is seen, in world space.

    vertices (V, 3) float64 [m]; triangles (T, 3) uint32, counter-clockwise seen from the front; triangle_object (T,)
    uint32; normals (V, 3) float64, unit or zero (the geometric normal stands in), or None where no mesh is smooth.
    Objects are in file order, an object's triangles are contiguous. The id of triangle i is i, of shape j it is T + j.
    Instances are in the order of their meshes; their triangles have the ids after all shapes, one after the other.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    triangle_object: np.ndarray
    normals: np.ndarray | None
    shapes: list[FlatShape]
    objects: list[FlatObject]
    materials: list[Material]
    material_names: list[str]
    lights: list[Light]
    light_names: list[str]
    camera: Camera
    render: RenderSettings
    warnings: list[str]
    textures: FlatTextures = field(default_factory=FlatTextures)
    meshes: list[FlatMesh] = field(default_factory=list)
    instances: list[FlatInstance] = field(default_factory=list)
    measurements: dict[int, Measurement] = field(default_factory=dict)  # of measured materials, by index

    @property
    def window(self) -> tuple[int, int, int, int]:
        """x, y, width and height of the part of the picture that is rendered [pixels]."""
        return self.render.crop or (0, 0, *self.camera.size)

    @property
    def stored_vertices(self) -> int:
        """Vertices of the world and of all shared meshes."""
        return len(self.vertices) + sum(len(mesh.vertices) for mesh in self.meshes)

    @property
    def stored_triangles(self) -> int:
        """Triangles of the world and of all shared meshes."""
        return len(self.triangles) + sum(len(mesh.triangles) for mesh in self.meshes)


@dataclass(frozen=True)
class _Piece:
    """A mesh in the world: vertices (V, 3), triangles (T, 3), normals (V, 3) or None; what textures read of it."""

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray | None
    painted: Painted


def flatten_scene(scene: Scene, share: bool = True) -> FlatScene:
    """All objects in world space; without `share` every instance gets triangles of its own. Raises SceneError with all
    problems of the scene."""
    found = shown_objects(scene.objects) if all(isinstance(item, Shape) for item in scene.objects.values()) else None
    problems = scene_problems(scene, found)
    if problems or found is None:
        raise SceneError(problems)
    shown = found.by_name
    places = {name: place for place, name in enumerate(scene.materials)}
    shapes: list[FlatShape] = []
    objects: list[FlatObject] = []
    pieces: list[_Piece] = []
    warnings = scene_warnings(scene, found)
    meshes, instances = shared_meshes(scene, shown, warnings) if share else ([], [])
    instance_of = {instance.object: place for place, instance in enumerate(instances)}
    first = 0
    for index, (name, shape) in enumerate(scene.objects.items()):
        bare, matrix = shown[name].shape, shown[name].matrix
        count, place = 0, -1
        if shape.visible_to and index not in instance_of:
            if isinstance(bare, Mesh):
                piece = _placed_mesh(scene.mesh_data(bare), matrix, bare.smooth, name, warnings)
                pieces.append(piece)
                count = len(piece.triangles)
            else:
                place = len(shapes)
                shapes.append(FlatShape(bare.type, index, *bare.placed(matrix)))
        objects.append(
            FlatObject(
                name, places[shown[name].material or ""], first, count, place, is_mirror(matrix),
                instance_of.get(index, -1), shape.visible_to,
            )
        )  # fmt: skip
        first += count
    warnings += _too_near(scene, shapes, list(scene.objects))
    vertices, triangles, normals = _joined(pieces)
    used = {shown[name].material for name in scene.objects}
    counts = [thing.triangle_count for thing in objects]
    return FlatScene(
        vertices=vertices,
        triangles=triangles,
        triangle_object=np.repeat(np.arange(len(objects), dtype=np.uint32), counts),
        normals=normals,
        shapes=shapes,
        objects=objects,
        materials=list(scene.materials.values()),
        material_names=list(places),
        lights=[part for light in scene.lights.values() for part in light.parts()],
        light_names=[name for name, light in scene.lights.items() for _ in light.parts()],
        camera=scene.camera,
        render=scene.render,
        warnings=warnings,
        textures=flat_textures(scene, used, [*(piece.painted for piece in pieces), *(mesh.painted for mesh in meshes)]),
        meshes=meshes,
        instances=instances,
        measurements=flat_measurements(scene, used),
    )


def _too_near(scene: Scene, shapes: list[FlatShape], names: list[str]) -> list[str]:
    """Words about spheres to whose surface the camera is nearer than the digits of their centre, as seen from it."""
    out = []
    for shape in shapes:
        if shape.kind != "sphere":
            continue
        radius = float(np.linalg.norm(shape.axes[0]))
        height = abs(float(np.linalg.norm(shape.center - np.asarray(scene.camera.origin))) - radius)
        if height < radius * 2.0**-20:
            out.append(
                f"objects.{names[shape.object]}: the camera is {height:.3g} from the surface of a sphere of radius "
                f"{radius:.3g}, less than float32 tells apart there; what is near will not be where it should"
            )
    return out


def _placed_mesh(mesh: MeshData, matrix: np.ndarray, smooth: bool, name: str, warnings: list[str]) -> _Piece:
    """The mesh moved; triangles that leave float32's range on the way are dropped and told."""
    vertices = move_points(matrix, mesh.vertices)
    triangles = mesh.triangles
    painted = Painted.of(mesh)
    normals = None
    if smooth:
        own = mesh.normals if mesh.normals is not None else smooth_normals(mesh.vertices, mesh.triangles)
        normals = move_normals(matrix, own)
    sound = (np.abs(vertices) <= LARGEST).all(axis=1)
    if not sound.all():
        kept = sound[triangles].all(axis=1)
        warnings.append(f"objects.{name}: dropped {np.count_nonzero(~kept)} triangles moved beyond {LARGEST:g}")
        triangles, vertices = triangles[kept], np.where(sound[:, None], vertices, 0.0)
        painted = painted.faces(kept)
    lost = longest_edges(vertices, triangles) < SMALLEST  # an invertible map makes no new slivers
    if lost.any():
        warnings.append(f"objects.{name}: dropped {np.count_nonzero(lost)} triangles that its transform makes vanish")
        triangles = triangles[~lost]
        painted = painted.faces(~lost)
    if is_mirror(matrix):
        triangles = triangles[:, [0, 2, 1]]  # the front stays on the side of the moved normals
    return _Piece(vertices, triangles, normals, painted)


def _joined(pieces: list[_Piece]) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """All pieces in one set of arrays; zero normals for those that are not smooth."""
    if not pieces:
        return np.zeros((0, 3)), np.zeros((0, 3), np.uint32), None
    firsts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    triangles = [piece.triangles.astype(np.int64) + first for piece, first in zip(pieces, firsts, strict=False)]
    normals = None
    if any(piece.normals is not None for piece in pieces):
        normals = np.concatenate(
            [np.zeros_like(piece.vertices) if piece.normals is None else piece.normals for piece in pieces]
        )
    vertices = np.concatenate([piece.vertices for piece in pieces])
    return vertices, np.concatenate(triangles).astype(np.uint32), normals
