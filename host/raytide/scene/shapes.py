"""Shapes: one class is one row of the registry. World space, metres; the normal side is the front.

`placed(matrix)` gives an analytic shape its place in the world: center (3,) and axes (3, 3), rows u, v, w, float64.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field, PlainSerializer, WithJsonSchema, model_validator

from raytide.errors import Problem, SceneError
from raytide.scene.arrays import as_faces, as_uv, as_vertices
from raytide.scene.model import Table
from raytide.scene.transform import Step, is_mirror, move_normals, move_points, tangents_of
from raytide.scene.values import RAY_KINDS, SMALLEST, Count, Direction, Flag, Kind, Number, Point, RayKinds, key

SIMILAR = 1e-9  # relative spread of stretches up to which a transform keeps spheres round

Placed = tuple[np.ndarray, np.ndarray]


class Shape(Table):
    """An object: a shape with a material, moved by a transform."""

    NESTED: ClassVar[dict[str, type[BaseModel]]] = {"transform": Step}
    EMITS: ClassVar[bool] = True  # whether an emissive material is allowed on it
    type: str
    material: str | None = key(None, doc="name of its material; every object of a file needs one")
    transform: Annotated[list[Step], Kind("a list of steps: scale, rotate, translate, matrix")] = Field(
        default_factory=list, description="steps applied in order"
    )

    visible_to: RayKinds = key(
        RAY_KINDS, doc="rays that meet it: the camera's, those that look for a light, those that scatter; [] hides it"
    )

    def scale(self, factor: float | tuple[float, float, float]) -> Self:
        """A copy scaled about the origin after its other steps. Raises SceneError."""
        return self.moved({"scale": factor})

    def rotate(self, axis: str | tuple[float, float, float], degrees: float) -> Self:
        """A copy turned about an axis through the origin [degrees]. Raises SceneError."""
        return self.moved({"rotate": {"axis": axis, "degrees": degrees}})

    def translate(self, *by: Any) -> Self:
        """A copy shifted by (x, y, z) [m]. Raises SceneError."""
        return self.moved({"translate": by[0] if len(by) == 1 else by})

    def moved(self, step: dict[str, Any]) -> Self:
        """A copy with one more step of transform, as in a scene file. Raises SceneError."""
        return self.changed(transform=[*self.transform, step])

    def placed(self, matrix: np.ndarray) -> Placed:
        """Center and axes in the world. Raises SceneError where the transform does not suit the shape."""
        raise NotImplementedError(self.type)


class Sphere(Shape):
    """A sphere; the front is outside."""

    FIRST: ClassVar[str] = "center"
    type: Literal["sphere"] = "sphere"
    center: Point = key((0.0, 0.0, 0.0), unit="m", doc="center")
    radius: Number = key(1.0, low=SMALLEST, unit="m", doc="radius")

    def placed(self, matrix: np.ndarray) -> Placed:
        stretch = np.linalg.svd(matrix[:3, :3], compute_uv=False)
        if not stretch[0] - stretch[2] <= SIMILAR * stretch[0]:
            came = f"a transform that stretches a sphere by {stretch[0]:.6g} and by {stretch[2]:.6g}"
            raise SceneError([Problem("transform", came, "the same factor in all directions (or a mesh)")])
        axes = matrix[:3, :3].T * (-self.radius if is_mirror(matrix) else self.radius)
        return move_points(matrix, np.array([self.center]))[0], axes


class Plane(Shape):
    """An infinite plane."""

    EMITS: ClassVar[bool] = False
    FIRST: ClassVar[str] = "origin"
    type: Literal["plane"] = "plane"
    origin: Point = key((0.0, 0.0, 0.0), unit="m", doc="any point of the plane")
    normal: Direction = key((0.0, 1.0, 0.0), doc="direction of its front")

    def placed(self, matrix: np.ndarray) -> Placed:
        normal = move_normals(matrix, np.array([self.normal]))[0]
        return move_points(matrix, np.array([self.origin]))[0], np.array([*tangents_of(normal), normal])


class Box(Shape):
    """A box along the axes, before its transform; the front is outside."""

    FIRST: ClassVar[str] = "min"
    type: Literal["box"] = "box"
    min: Point = key((-1.0, -1.0, -1.0), unit="m", doc="lowest corner")
    max: Point = key((1.0, 1.0, 1.0), unit="m", doc="highest corner")

    @model_validator(mode="after")
    def _has_inside(self) -> Self:
        if not all(high - low >= SMALLEST for low, high in zip(self.min, self.max, strict=True)):
            raise ValueError(f"came min = {list(self.min)}, max = {list(self.max)}; wanted min below max on each axis")
        return self

    def placed(self, matrix: np.ndarray) -> Placed:
        half = np.subtract(self.max, self.min) / 2
        axes = (matrix[:3, :3] * half).T
        if is_mirror(matrix):
            axes[2] = -axes[2]  # the box is symmetric: keep u, v, w right-handed
        return move_points(matrix, np.add(self.min, half)[None])[0], axes


class Rectangle(Shape):
    """A parallelogram of half edges u and v about its center; the front is the side of u x v."""

    FIRST: ClassVar[str] = "center"
    type: Literal["rectangle"] = "rectangle"
    center: Point = key((0.0, 0.0, 0.0), unit="m", doc="center")
    u: Direction = key((1.0, 0.0, 0.0), unit="m", doc="half edge")
    v: Direction = key((0.0, 1.0, 0.0), unit="m", doc="half edge")

    @model_validator(mode="after")
    def _has_area(self) -> Self:
        u, v = (np.divide(edge, math.hypot(*edge)) for edge in (self.u, self.v))
        if not math.hypot(*np.cross(u, v)) > 1e-9:
            raise ValueError(f"came u = {list(self.u)}, v = {list(self.v)}; wanted edges that are not parallel")
        return self

    def placed(self, matrix: np.ndarray) -> Placed:
        u, v = (matrix[:3, :3] @ np.array(edge) for edge in (self.u, self.v))
        if is_mirror(matrix):
            v = -v  # keeps u x v on the side of the moved normal
        return move_points(matrix, np.array([self.center]))[0], _flat_axes(u, v)


class Disk(Shape):
    """A disk; a transform may make it an ellipse."""

    FIRST: ClassVar[str] = "center"
    type: Literal["disk"] = "disk"
    center: Point = key((0.0, 0.0, 0.0), unit="m", doc="center")
    normal: Direction = key((0.0, 1.0, 0.0), doc="direction of its front")
    radius: Number = key(1.0, low=SMALLEST, unit="m", doc="radius")

    def placed(self, matrix: np.ndarray) -> Placed:
        tangents = np.array(tangents_of(np.divide(self.normal, math.hypot(*self.normal))))
        conjugate = (matrix[:3, :3] @ tangents.T) * self.radius
        basis, lengths, _ = np.linalg.svd(conjugate, full_matrices=False)
        u, v = (basis * lengths).T  # principal half axes of the ellipse
        normal = move_normals(matrix, np.array([self.normal]))[0]
        if np.cross(u, v) @ normal < 0:
            v = -v
        return move_points(matrix, np.array([self.center]))[0], _flat_axes(u, v)


def _flat_axes(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    normal = np.cross(u / math.hypot(*u), v / math.hypot(*v))
    return np.array([u, v, normal / math.hypot(*normal)])


def _listed(array: np.ndarray) -> list[list[float]]:
    return array.tolist()


Vertices = Annotated[
    np.ndarray,
    BeforeValidator(as_vertices),
    PlainSerializer(_listed),
    Kind("a list of [x, y, z]"),
    WithJsonSchema({"type": "array", "items": {"type": "array", "items": {"type": "number"}}}),
]
Faces = Annotated[
    np.ndarray,
    BeforeValidator(as_faces),
    PlainSerializer(_listed),
    Kind("a list of [a, b, c], indices of vertices"),
    WithJsonSchema({"type": "array", "items": {"type": "array", "items": {"type": "integer", "minimum": 0}}}),
]
TextureCoordinates = Annotated[
    np.ndarray,
    BeforeValidator(as_uv),
    PlainSerializer(_listed),
    Kind("a list of [u, v], one for each vertex"),
    WithJsonSchema({"type": "array", "items": {"type": "array", "items": {"type": "number"}}}),
]


class Mesh(Shape):
    """Triangles from a file (OBJ, PLY, STL, glTF, GLB, .serialized), or vertices and faces in the scene itself."""

    FIRST: ClassVar[str] = "mesh"
    type: Literal["mesh"] = "mesh"
    mesh: str | None = key(None, doc="geometry file, relative to the scene file")
    vertices: Vertices | None = key(None, unit="m", doc="points of an inline mesh")
    faces: Faces | None = key(None, doc="triangles of an inline mesh; the front is where they run counter-clockwise")
    uv: TextureCoordinates | None = key(None, doc="texture coordinates of an inline mesh")
    smooth: Flag = key(False, doc="interpolate normals: the file's, else angle-weighted ones")
    part: Count = key(0, low=0, doc="which mesh of a .serialized file")
    flip: Flag = key(False, doc="front and back exchanged, normals turned round")
    flip_v: Flag = key(False, doc="texture coordinates counted from the other side: 1 - v")

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        given = [name for name in ("mesh", "vertices", "faces") if getattr(self, name) is not None]
        if given not in (["mesh"], ["vertices", "faces"]):
            raise ValueError(f"came {' and '.join(given) or 'no geometry'}; wanted mesh, or both vertices and faces")
        if self.uv is not None and (self.vertices is None or len(self.uv) != len(self.vertices)):
            count = "no vertices" if self.vertices is None else f"{len(self.vertices)} vertices"
            raise ValueError(f"came {len(self.uv)} texture coordinates beside {count}; wanted uv for each vertex")
        if self.faces is None or self.vertices is None or not len(self.faces):
            return self
        wrong = np.flatnonzero((self.faces >= len(self.vertices)).any(axis=1))
        if len(wrong):
            came, first = self.faces[wrong[0]].tolist(), int(wrong[0])
            raise ValueError(f"came faces[{first}] = {came}; wanted indices from 0 to {len(self.vertices) - 1}")
        return self

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        pairs = ((getattr(self, name), getattr(other, name)) for name in type(self).model_fields)
        return all(np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b for a, b in pairs)

    __hash__ = None  # type: ignore[assignment]


class Instance(Shape):
    """Another object once more, at another place: its transform acts after that object's."""

    FIRST: ClassVar[str] = "of"
    type: Literal["instance"] = "instance"
    of: Annotated[str, Kind("the name of an object")] = key(doc="name of the object to show; a mesh is stored once")


SHAPES: dict[str, type[Shape]] = {kind.model_fields["type"].default: kind for kind in Shape.__subclasses__()}
ANALYTIC_KINDS = tuple(kind for kind in SHAPES if kind not in ("mesh", "instance"))
