"""World space: transforms, winding, normals and sizes against the geometry they stand for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import raytide.scene as rt
from raytide.accel import build_tree
from raytide.errors import SceneError
from raytide.render.pack import features_of, pack
from raytide.scene.flatten import FlatScene
from raytide.scene.normals import smooth_normals
from raytide.scene.shapes import Shape
from raytide.scene.transform import Step, matrix_of, rotation, tangents_of

CUBE_CORNERS = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
CUBE_FACES = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
]  # fmt: skip

angles = st.floats(-360, 360)
sizes = st.floats(0.05, 20)


def flat_of(*shapes: Shape, material: object = None) -> FlatScene:
    scene = rt.Scene(rt.Camera(origin=(0, 0, 40), target=(0, 0, 0)))
    for shape in shapes:
        scene.add(shape, material or rt.Diffuse())  # type: ignore[arg-type]
    return scene.flatten()


def face_normals(flat: FlatScene) -> np.ndarray:
    a, b, c = (flat.vertices[flat.triangles[:, corner]] for corner in range(3))
    cross = np.cross(b - a, c - a)
    return cross / np.linalg.norm(cross, axis=1, keepdims=True)


def signed_volume(flat: FlatScene) -> float:
    a, b, c = (flat.vertices[flat.triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def cube(smooth: bool = False) -> rt.Mesh:
    return rt.mesh(vertices=CUBE_CORNERS, faces=CUBE_FACES, smooth=smooth)


@settings(max_examples=50)
@given(st.tuples(sizes, sizes, sizes), angles, st.sampled_from([1, -1]), st.sampled_from([1, -1]))
def test_faces_of_a_closed_mesh_look_outward_under_any_transform(scale, degrees, sign_x, sign_y) -> None:  # type: ignore[no-untyped-def]
    """Divergence theorem: the volume by outward faces is positive and is |det| times the cube's, mirrored or not."""
    factors = (scale[0] * sign_x, scale[1] * sign_y, scale[2])
    flat = flat_of(cube(True).rotate((1, 2, 3), degrees).scale(factors).translate(5, -3, 2))
    assert signed_volume(flat) == pytest.approx(np.prod(scale), rel=1e-9)
    assert flat.objects[0].flipped == (sign_x * sign_y < 0)
    assert flat.normals is not None
    centre = flat.vertices.mean(axis=0)
    from_centre = flat.vertices[flat.triangles[:, 0]] - centre
    assert (np.einsum("ij,ij->i", face_normals(flat), from_centre) > 0).all()
    assert (np.einsum("ij,ij->i", flat.normals, flat.vertices - centre) > 0).all()


def test_steps_apply_in_order() -> None:
    matrix = matrix_of([Step(scale=2.0), Step(translate=(1, 0, 0)), Step(rotate={"axis": "z", "degrees": 90.0})])
    assert np.allclose(matrix @ [1, 0, 0, 1], [0, 3, 0, 1], atol=0)
    whole = matrix_of([Step(matrix=tuple(matrix.ravel()))])
    assert np.array_equal(whole, matrix)


@settings(max_examples=50)
@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3), angles)
def test_rotations_are_proper_and_keep_their_axis(axis: tuple[float, ...], degrees: float) -> None:
    turn = rotation(axis, degrees)
    assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(turn) == pytest.approx(1)
    assert np.allclose(turn @ axis, axis, atol=1e-14)
    assert np.trace(turn) == pytest.approx(1 + 2 * np.cos(np.radians(degrees)), abs=1e-12)


def test_quarter_turns_are_exact() -> None:
    assert np.array_equal(rotation((0, 1, 0), 90) @ [0, 0, 1], [1, 0, 0])
    assert np.array_equal(rotation((0, 0, 1), -270) @ [1, 0, 0], [0, 1, 0])
    assert np.array_equal(rotation((1, 0, 0), 180), np.diag([1.0, -1, -1]))


@settings(max_examples=50)
@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3))
def test_tangents_make_a_right_handed_frame(direction: tuple[float, ...]) -> None:
    normal = np.array(direction) / np.linalg.norm(direction)
    u, v = tangents_of(normal)
    assert np.allclose(np.cross(u, v), normal, atol=1e-14)


@pytest.mark.parametrize("scale", [2.5, (-2.5, 2.5, 2.5), (2.5, -2.5, -2.5), -2.5])
def test_a_sphere_keeps_its_radius_times_a_proper_rotation(scale: object) -> None:
    shape = flat_of(rt.sphere((1, 2, 3), 2).rotate("y", 35).scale(scale).translate(1, 1, 1)).shapes[0]  # type: ignore[arg-type]
    assert np.allclose(shape.axes @ shape.axes.T, 25 * np.eye(3))
    assert np.linalg.det(shape.axes) == pytest.approx(125)
    centre = rotation((0, 1, 0), 35) @ [1, 2, 3] * np.broadcast_to(scale, 3) + 1
    assert np.allclose(shape.center, centre)


@settings(max_examples=40)
@given(st.tuples(sizes, sizes, sizes), angles, st.booleans())
def test_flat_shapes_lie_in_the_moved_plane_with_the_moved_front(scale, degrees, mirror) -> None:  # type: ignore[no-untyped-def]
    """A rectangle, a disk and a plane of one front move as a triangle of that front does."""
    factors = (scale[0], -scale[1] if mirror else scale[1], scale[2])
    u, v = np.array([1.0, 0.5, 0]), np.array([0.0, 1, 1])
    n = np.cross(u, v)
    made = [
        shape.rotate((3, 1, 2), degrees).scale(factors).translate(1, 2, 3)
        for shape in (
            rt.rect((1, 1, 0), u, v),
            rt.disk((1, 1, 0), n, 2),
            rt.plane((1, 1, 0), n),
            rt.mesh(vertices=np.array([[1, 1, 0], [1, 1, 0] + u, [1, 1, 0] + v]), faces=[[0, 1, 2]]),
        )
    ]
    flat = flat_of(*made)
    front = face_normals(flat)[0]
    for shape in flat.shapes:
        assert np.allclose(shape.axes[2], front, atol=1e-9)
        assert np.allclose(shape.center, flat.vertices[0])
        assert np.linalg.det(shape.axes) > 0
        assert np.allclose(shape.axes[:2] @ front, 0, atol=1e-9 * np.abs(shape.axes).max())


def test_a_disk_becomes_the_ellipse_of_its_rim() -> None:
    disk = rt.disk((0, 0, 0), (0, 0, 1), 1).rotate("z", 20).scale((3, 0.5, 1)).rotate("x", 50)
    shape = flat_of(disk).shapes[0]
    u, v, _ = shape.axes
    assert abs(u @ v) < 1e-12
    matrix = matrix_of(disk.transform)[:3, :3]
    angle = np.linspace(0, 2 * np.pi, 50)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1) @ matrix.T
    local = np.stack([rim @ u / (u @ u), rim @ v / (v @ v)], 1)
    assert np.allclose((local**2).sum(1), 1)


def test_a_box_keeps_its_corners_under_shear_and_mirror() -> None:
    shear = {"matrix": [1, 0.5, 0, 0, 0, 1, 0, 0, 0, 0, -1, 2, 0, 0, 0, 1]}
    box = rt.box((0, 0, 0), (2, 4, 6)).moved(shear)
    shape = flat_of(box).shapes[0]
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = {tuple(np.round(shape.center + sign @ shape.axes, 9)) for sign in signs}
    matrix = matrix_of(box.transform)
    wanted = (CUBE_CORNERS * (2, 4, 6)) @ matrix[:3, :3].T + matrix[:3, 3]
    assert corners == {tuple(np.round(corner, 9)) for corner in wanted}
    assert np.linalg.det(shape.axes) > 0


def test_smooth_normals_weigh_faces_by_angle_and_not_by_number() -> None:
    """A cube's corner has three faces of 90 degrees each, however they are cut into triangles."""
    normals = smooth_normals(CUBE_CORNERS, np.array(CUBE_FACES))
    assert np.allclose(normals, (CUBE_CORNERS - 0.5) * 2 / np.sqrt(3))


def test_smooth_normals_join_vertices_at_one_place_and_zero_out_opposite_faces() -> None:
    soup = CUBE_CORNERS[np.array(CUBE_FACES)].reshape(-1, 3)
    normals = smooth_normals(soup, np.arange(36).reshape(-1, 3))
    assert np.allclose(normals, (soup - 0.5) * 2 / np.sqrt(3))
    doubled = smooth_normals(np.eye(3), np.array([[0, 1, 2], [0, 2, 1]]))
    assert np.array_equal(doubled, np.zeros((3, 3)))
    unused = smooth_normals(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]]), np.array([[0, 1, 2]]))
    assert np.array_equal(unused[3], [0, 0, 0])


def test_objects_keep_file_order_and_their_triangles_stay_together() -> None:
    flat = flat_of(cube(), rt.sphere(), cube(True), rt.plane(), rt.disk())
    assert [thing.name for thing in flat.objects] == ["mesh1", "sphere1", "mesh2", "plane1", "disk1"]
    assert [thing.shape for thing in flat.objects] == [-1, 0, -1, 1, 2]
    assert [shape.object for shape in flat.shapes] == [1, 3, 4]
    assert [(thing.first_triangle, thing.triangle_count) for thing in flat.objects][:3] == [(0, 12), (12, 0), (12, 12)]
    assert flat.triangle_object.tolist() == [0] * 12 + [2] * 12
    assert flat.triangles.dtype == flat.triangle_object.dtype == np.uint32
    assert flat.vertices.dtype == np.float64
    assert flat.normals is not None
    assert np.array_equal(flat.normals[:8], np.zeros((8, 3)))
    assert np.allclose(np.linalg.norm(flat.normals[8:], axis=1), 1)


def test_without_smooth_meshes_there_are_no_normals() -> None:
    assert flat_of(cube(), rt.sphere()).normals is None
    empty = flat_of(rt.sphere())
    assert empty.vertices.shape == (0, 3)
    assert empty.triangles.shape == (0, 3)


def test_file_normals_win_over_computed_ones(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0.6 0 0.8\nvn 0 0 0\nf 1//1 2//1 3//2\n"
    (tmp_path / "m.obj").write_text(text)
    scene = rt.Scene(rt.Camera(origin=(0, 0, 4), target=(0, 0, 0)), folder=tmp_path)
    scene.add(rt.mesh("m.obj", smooth=True).scale((1, 1, 2)), rt.Diffuse())
    normals = scene.flatten().normals
    assert normals is not None
    tilted = np.array([0.6, 0, 0.4]) / np.hypot(0.6, 0.4)
    assert np.allclose(normals, [tilted, tilted, [0, 0, 0]])


def test_what_vanishes_or_leaves_the_range_is_dropped_and_told() -> None:
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [1e17, 0, 0]]
    flat = flat_of(rt.mesh(vertices=corners, faces=[[0, 1, 2], [0, 1, 3], [0, 4, 2]]).scale(100))
    assert len(flat.triangles) == 1
    assert "objects.mesh1: dropped 1 triangles of zero area" in flat.warnings
    assert any("dropped 1 triangles moved beyond 1.8e+18" in words for words in flat.warnings)
    assert np.isfinite(flat.vertices).all()
    assert np.abs(flat.vertices).max() <= 1.8e18
    tiny = flat_of(rt.mesh(vertices=CUBE_CORNERS * 0.01, faces=CUBE_FACES).scale(1e-17))
    assert len(tiny.triangles) == 0
    assert any("vanish" in words for words in tiny.warnings)


def test_shapes_moved_out_of_range_are_refused() -> None:
    far, large = rt.sphere((1e18, 0, 0)).translate(1e18, 0, 0), rt.sphere().scale(1e17).scale(1e2)
    for shape in (far, large, rt.box().scale(1e-17).scale(1e-2)):
        with pytest.raises(SceneError, match="objects.(sphere|box)1.transform"):
            flat_of(shape)


def test_an_unknown_material_stops_flattening() -> None:
    scene = rt.Scene(rt.Camera(origin=(0, 0, 4), target=(0, 0, 0)))
    scene.add(rt.sphere(), rt.Diffuse(), name="a")
    scene.objects["a"].material = "b"
    with pytest.raises(SceneError, match="unknown material 'b'"):
        scene.flatten()


@pytest.mark.parametrize(
    ("origin", "target", "up"), [((1, 2, 3), (4, -2, 0), (0, 1, 0)), ((0, 9, 0), (0, 0, 0), (0, 0, -3))]
)
def test_camera_frame_is_orthonormal_and_looks_at_the_target(origin, target, up) -> None:  # type: ignore[no-untyped-def]
    right, above, forward = rt.Camera(origin=origin, target=target, up=up).frame()
    view = np.subtract(target, origin)
    assert np.allclose(forward, view / np.linalg.norm(view))
    assert np.allclose(np.cross(right, above), -forward)
    assert above @ up > 0
    assert abs(right @ up) < 1e-12


def test_thin_lens_focuses_on_the_target_by_default() -> None:
    lens = rt.ThinLens(origin=(0, 0, 5), target=(0, 3, 1), aperture=0.1)
    assert lens.focus_distance == 5
    lens.focus = 2
    assert lens.focus_distance == 2


def test_what_a_file_has_that_cannot_be_used_changes_no_bit_of_the_rest(tmp_path: Path) -> None:
    """Stability case U5: not the numbers of a vertex, and not the tree."""
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE_CORNERS * 0.3]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in CUBE_FACES]
    bad = ["v nan 0 0", "v 0 inf 0", "v 0 0 -1e30", "f 1 2 9", "f 10 2 3", "f 3 11 4", "f 1 1 2", "f 9 9 9"]
    trees = []
    for name, text in (("good.obj", lines), ("bad.obj", [*lines[:8], *bad[:3], *bad[3:6], *lines[8:], *bad[6:]])):
        (tmp_path / name).write_text("\n".join(text) + "\n")
        flat = flat_of(rt.mesh(str(tmp_path / name)))
        assert len(flat.triangles) == len(CUBE_FACES)
        geometry = pack(flat, features_of(flat)).geometry
        tree = build_tree(geometry, "sah", None)
        corners = geometry.vertices[geometry.triangles[:, :3]]
        trees.append((corners.tobytes(), tree.nodes.tobytes(), tree.blocks.tobytes()))
    assert trees[0] == trees[1]
