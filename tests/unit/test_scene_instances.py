"""Instances and visibility as people write them: what they show, what they inherit, and what is wrong with them."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

import raytide.scene as rt
from raytide.errors import SceneError
from raytide.scene.flatten import FlatScene

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
GOOD = """format = 1
[camera]
origin = [0, 1, 4]
target = [0, 1, 0]
[materials.white]
type = "diffuse"
[materials.lamp]
type = "emissive"
radiance = 10
[lights.sky]
type = "environment"
radiance = 1
[objects.floor]
type = "plane"
material = "white"
[objects.tree]
vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
faces = [[0, 1, 2]]
material = "white"
transform = [{scale = 2}]
[objects.copy]
of = "tree"
"""


def scene_of(text: str, tmp_path: Path) -> rt.Scene:
    (tmp_path / "scene.toml").write_text(text)
    return rt.load(tmp_path / "scene.toml")


def made(**shapes: rt.Mesh | rt.Instance) -> rt.Scene:
    scene = rt.Scene(rt.Camera(origin=(0, 0, 40), target=(0, 0, 0)))
    scene.add(rt.sky(1.0), name="sky")
    for name, shape in shapes.items():
        scene.add(shape, None if isinstance(shape, rt.Instance) else rt.Diffuse(), name=name)
    return scene


def tetrahedron(smooth: bool = False) -> rt.Mesh:
    return rt.mesh(vertices=CORNERS, faces=FACES, smooth=smooth)


def world_corners(flat: FlatScene, name: str) -> np.ndarray:
    """(T, 3, 3) corners of an object's triangles in the world, whichever way they are stored."""
    thing = next(thing for thing in flat.objects if thing.name == name)
    if thing.instance < 0:
        rows = flat.triangles[thing.first_triangle : thing.first_triangle + thing.triangle_count]
        return flat.vertices[rows]
    placed = flat.instances[thing.instance]
    mesh = flat.meshes[placed.mesh]
    return (mesh.vertices @ placed.matrix[:3, :3].T + placed.matrix[:3, 3])[mesh.triangles]


def test_an_instance_shows_its_object_moved_by_both_transforms_the_object_s_first() -> None:
    scene = made(a=tetrahedron().scale(2), b=rt.instance("a").translate(1, 0, 0))
    scene.add(rt.instance(scene["b"]).rotate("z", 90), name="c")
    shared, copied = scene.flatten(), scene.flatten(share=False)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for name, wanted in (("a", 2 * CORNERS), ("b", 2 * CORNERS + [1, 0, 0]), ("c", (2 * CORNERS + [1, 0, 0]) @ turn.T)):
        assert np.allclose(world_corners(copied, name), wanted[FACES], atol=1e-15)
        assert np.allclose(world_corners(shared, name), wanted[FACES], atol=1e-15)
    assert len(shared.meshes) == 1 and len(shared.instances) == 3 and len(shared.triangles) == 0
    assert not copied.meshes and len(copied.triangles) == 12


def test_a_mesh_without_instances_is_not_shared() -> None:
    flat = made(a=tetrahedron(), b=tetrahedron()).flatten()
    assert not flat.meshes and len(flat.triangles) == 8


def test_instances_stand_mesh_by_mesh_and_objects_in_file_order() -> None:
    scene = made(a=tetrahedron(), b=tetrahedron(True), a2=rt.instance("a"), b2=rt.instance("b"), a3=rt.instance("a2"))
    flat = scene.flatten()
    assert [thing.name for thing in flat.objects] == ["a", "b", "a2", "b2", "a3"]
    assert [(item.mesh, item.object) for item in flat.instances] == [(0, 0), (0, 2), (0, 4), (1, 1), (1, 3)]
    assert all(flat.instances[thing.instance].object == place for place, thing in enumerate(flat.objects))
    assert flat.meshes[0].normals is None and flat.meshes[1].normals is not None


def test_instances_of_analytic_shapes_are_shapes_of_their_own() -> None:
    scene = made(ball=rt.sphere((1, 0, 0), 2.0), more=rt.instance("ball").scale(3))
    flat = scene.flatten()
    assert not flat.meshes and [shape.kind for shape in flat.shapes] == ["sphere", "sphere"]
    assert np.allclose(flat.shapes[1].center, [3, 0, 0]) and np.linalg.norm(flat.shapes[1].axes[0]) == pytest.approx(6)
    scene["more"].transform = [{"scale": [1, 2, 1]}]
    with pytest.raises(SceneError, match=r"objects\.more\.transform.*stretches a sphere"):
        scene.flatten()


def test_an_instance_takes_its_object_s_material_or_its_own() -> None:
    scene = made(a=tetrahedron(), b=rt.instance("a"))
    scene.add(rt.instance("b"), rt.Mirror(), name="c")
    scene.add(rt.instance("c"), name="d")
    flat = scene.flatten()
    used = [flat.materials[thing.material].type for thing in flat.objects]
    assert used == ["diffuse", "diffuse", "mirror", "mirror"]
    assert scene["d"].material is scene["c"].material
    scene["d"].material = rt.Diffuse(0.1)
    assert scene["d"].material.reflectance == (0.1, 0.1, 0.1)


def test_a_hidden_object_is_only_a_prototype() -> None:
    scene = made(a=tetrahedron(), b=rt.instance("a"))
    scene["a"].visible_to = []
    flat = scene.flatten()
    assert [item.object for item in flat.instances] == [1]
    assert [thing.visible_to for thing in flat.objects] == [(), ("camera", "shadow", "indirect")]
    assert not flat.warnings
    del scene.objects["b"]
    flat = scene.flatten()
    assert not flat.instances and len(flat.triangles) == 0
    assert flat.warnings == ["objects.a: it is visible to no ray, and no instance shows it"]


def test_shining_instances_are_copied_and_told() -> None:
    scene = made(a=tetrahedron(), b=rt.instance("a"))
    scene.add(rt.instance("a"), rt.Emit(3), name="lamp")
    flat = scene.flatten()
    assert [item.object for item in flat.instances] == [0, 1] and len(flat.triangles) == 4
    assert flat.warnings == ["objects.lamp: it shines: its 4 triangles are stored once more"]


def test_instances_out_of_range_are_copied_so_that_each_lost_triangle_is_told() -> None:
    flat = made(a=tetrahedron(), far=rt.instance("a").scale(1e18).translate(1e18, 0, 0)).flatten()
    assert [item.object for item in flat.instances] == [0]
    assert any("far: it leaves the range" in words for words in flat.warnings)
    assert any("far: dropped 3 triangles moved beyond" in words for words in flat.warnings)


def test_instances_come_back_from_a_file_as_the_same_scene(tmp_path: Path) -> None:
    scene = made(a=tetrahedron(), b=rt.instance("a").rotate("y", 30).translate(1, 2, 3))
    scene["a"].visible_to = []
    scene["b"].visible_to = ["shadow", "camera"]
    for suffix in ("toml", "json"):
        again = rt.load(scene.save(tmp_path / f"scene.{suffix}"))
        assert again == scene and again.sha256() == scene.sha256()
        assert again["b"].visible_to == ("camera", "shadow")


def test_visibility_and_the_object_shown_count_in_the_hash() -> None:
    hashes = set()
    for change in ({}, {"visible_to": ["shadow"]}, {"of": "b"}, {"transform": [{"scale": 2}]}):
        scene = made(a=tetrahedron(), b=tetrahedron(), c=rt.instance("a"))
        for key, value in change.items():
            setattr(scene["c"], key, value)
        hashes.add(scene.sha256())
    assert len(hashes) == 4


WRONG = {
    "unknown object": ('of = "tree"', 'of = "tre"', "objects.copy.of", "did you mean 'tree'"),
    "of itself": ('of = "tree"', 'of = "copy"', "objects.copy.of", "a circle of instances: 'copy' -> 'copy'"),
    "of no name": ('of = "tree"', 'type = "instance"\nof = 3', "objects.copy.of", "the name of an object"),
    "nothing to show": ('of = "tree"', 'type = "instance"', "objects.copy.of", "missing"),
    "circle": ('of = "tree"', 'of = "next"\n[objects.next]\nof = "copy"', "objects.copy.of", "a circle"),
    "emitting plane": ('of = "tree"', 'of = "floor"\nmaterial = "lamp"', "objects.copy.material", "plane"),
    "unknown material": ('of = "tree"', 'of = "tree"\nmaterial = "whit"', "objects.copy.material", "mean 'white'"),
    "singular": ('of = "tree"', 'of = "tree"\ntransform = [{scale = [1, 0, 1]}]', "objects.copy.transform", "singular"),
    "together singular": (
        'of = "tree"',
        'of = "thin"\ntransform = [{scale = [1e-7, 1, 1]}]\n[objects.thin]\nof = "tree"\n'
        "transform = [{scale = [1e-7, 1, 1]}]",
        "objects.copy.transform",
        "singular",
    ),
    "key of a mesh": ('of = "tree"', 'of = "tree"\nsmooth = true', "objects.copy.smooth", "an unknown key"),
    "unknown kind of ray": ('of = "tree"', 'of = "tree"\nvisible_to = ["eye"]', "objects.copy.visible_to", '"camera"'),
    "kind of ray twice": (
        'of = "tree"',
        'of = "tree"\nvisible_to = ["camera", "camera"]',
        "objects.copy.visible_to",
        "each at most once",
    ),
    "kind of ray as text": ('of = "tree"', 'of = "tree"\nvisible_to = "camera"', "objects.copy.visible_to", "a list"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_instances_are_refused_with_key_and_reason(case: str, tmp_path: Path) -> None:
    old, new, key, words = WRONG[case]
    assert scene_of(GOOD, tmp_path).flatten().instances
    with pytest.raises(SceneError) as caught:
        scene_of(GOOD.replace(old, new), tmp_path)
    assert [problem.key for problem in caught.value.problems] == [key], caught.value
    assert words in str(caught.value)


def test_a_refused_object_is_still_known_to_its_instances(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        scene_of(GOOD.replace("[{scale = 2}]", "[{scal = 2}]"), tmp_path)
    assert [problem.key for problem in caught.value.problems] == ["objects.tree.transform[0].scal"]


@pytest.mark.parametrize("last", ["tree", "nothing", "i0"])
def test_long_chains_of_instances_end_soon(last: str, tmp_path: Path) -> None:
    count = 3000
    links = "".join(f'[objects.i{n}]\nof = "i{n + 1}"\n' for n in range(count - 1))
    text = GOOD + links + f'[objects.i{count - 1}]\nof = "{last}"\n'
    begun = time.process_time()  # of the clock, other programs on the machine take what they like
    if last == "tree":
        assert len(scene_of(text, tmp_path).flatten().instances) == count + 2
    else:
        with pytest.raises(SceneError) as caught:
            scene_of(text, tmp_path)
        assert len(caught.value.problems) == 1
    assert time.process_time() - begun < 20
