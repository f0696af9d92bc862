"""One answer: rays traced by packets of 64 or one by one give the same picture, and the report says which it was."""

from __future__ import annotations

from itertools import accumulate, count
from pathlib import Path
from random import Random
from types import SimpleNamespace

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.device.cache import FileCache
from raytide.errors import UsageError
from raytide.kernels.constants import LIST_TRIANGLES
from raytide.render import later, trial

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SHOWN = ("cornell/cornell", "terrain/terrain", "whitted/whitted", "blob/blob", "lights/sphere", "materials/dielectric")


@pytest.mark.parametrize("name", SHOWN)
@pytest.mark.parametrize("memory", [None, 60_000])
def test_packets_change_no_bit_of_a_picture(device: Device, name: str, memory: int | None) -> None:
    """37x21 pixels leave tiles ragged; little memory makes launches refill slots in the middle of paths."""
    scene = rt.load(SCENES / f"{name}.toml")
    images, ran = {}, {}
    for traversal in ("single", "packet"):
        with rt.Renderer(scene, device, traversal=traversal, memory=memory, size=(37, 21), spp=3) as renderer:
            images[traversal] = renderer.render().rgb
            ran[traversal] = renderer.report()["traversal"]
    assert np.array_equal(images["single"], images["packet"])
    assert set(ran["single"]["ran"].values()) == {"single"}
    assert ran["packet"]["asked"] == "packet" and ran["packet"]["ran"]["primary"] == "packet"
    onward = {label: how for label, how in ran["packet"]["ran"].items() if label not in ("primary", "shadow[1]")}
    assert set(onward.values()) <= {"single"}


def test_packets_leave_rays_alone_that_stand_still_along_an_axis(device: Device) -> None:
    """Rays through the middle column of an odd number, whose x is exactly 0: they take no part in their packet, but see
    a thin black pole, where the others see the wall behind it."""

    def upright(width: float, z: float) -> rt.Mesh:
        corners = [(-width, -9, z), (width, -9, z), (width, 9, z), (-width, 9, z)]
        return rt.mesh(vertices=corners, faces=[(0, 1, 2), (0, 2, 3)])

    scene = rt.Scene(rt.Camera(origin=(0, 2, 15), target=(0, 1, 0), size=(33, 33)), rt.RenderSettings(filter="centre"))
    scene.add(upright(0.01, 8.0), rt.Diffuse(0.0), name="pole")
    scene.add(upright(9.0, 3.0), rt.Diffuse(0.8), name="wall")
    scene.add(rt.sky(1.0), name="sky")
    images = {}
    for traversal in ("single", "packet"):
        with rt.Renderer(scene, device, traversal=traversal, spp=1) as renderer:
            images[traversal] = renderer.render().rgb
    assert images["single"][:, 16].max() == 0 and images["single"][:, 15].min() > 0
    assert np.array_equal(images["single"], images["packet"])


CORNELL = SCENES / "cornell" / "cornell.toml"


@pytest.mark.parametrize("memory", [None, 60_000])
def test_a_list_of_triangles_changes_no_bit_of_a_picture(device: Device, memory: int | None) -> None:
    images, ran = {}, {}
    for traversal in ("single", "list"):
        settings = {"traversal": traversal, "memory": memory, "size": (37, 21), "spp": 3}
        with rt.Renderer(rt.load(CORNELL), device, **settings) as renderer:
            images[traversal] = renderer.render().rgb
            ran[traversal] = set(renderer.report()["traversal"]["ran"].values())
    assert np.array_equal(images["single"], images["list"])
    assert ran == {"single": {"single"}, "list": {"single" if device.kind == "gpu" else "list"}}


def test_a_list_knows_hidden_objects_and_sheets(device: Device) -> None:
    """A lamp above a floor; between them a sheet that half of the light passes, a block that shadow rays do not meet
    and one that is there for them alone."""

    def square(height: float, at: tuple[float, float], size: float) -> rt.Mesh:
        x, z = at
        points = [[x - size, height, z - size], [x - size, height, z + size], [x + size, height, z + size]]
        return rt.mesh(vertices=[*points, [x + size, height, z - size]], faces=[[0, 1, 2], [0, 2, 3]])

    scene = rt.Scene(rt.Camera(origin=(0, 3, 5), target=(0, 0.5, 0), size=(24, 24)))
    scene.add(square(0, (0, 0), 3), rt.Diffuse(0.6), name="floor")
    scene.add(square(4, (0, 0), 0.5), rt.Emit(8.0, two_sided=True), name="lamp")
    scene.add(square(1, (0, 0), 0.8), rt.Diffuse(0.5, opacity=0.5), name="sheet")
    for name, x, kinds in (("unlit", -1.5, ["camera", "indirect"]), ("unseen", 1.5, ["shadow"])):
        scene.add(square(1.5, (x, 0), 0.5), rt.Diffuse(0.5), name=name)
        scene[name].visible_to = kinds
    images = {}
    for traversal in ("single", "list"):
        with rt.Renderer(scene, device, traversal=traversal, spp=4, max_depth=4) as renderer:
            images[traversal] = renderer.render().rgb
            ran = set(renderer.report()["traversal"]["ran"].values())
    assert images["single"].max() > 0 and np.array_equal(images["single"], images["list"])
    assert ran == {"single" if device.kind == "gpu" else "list"}


@pytest.mark.parametrize("way", ["too many", "shapes", "instances", "brute force"])
def test_scenes_that_cannot_be_listed_are_traced_ray_by_ray(device: Device, way: str) -> None:
    """As with packets: asking for a variant that does not fit is no error."""
    scene = rt.Scene(rt.Camera(origin=(0, 1, 6), target=(0, 0, 0), size=(8, 8)))
    scene.add(rt.sky(1.0), name="sky")
    copies = LIST_TRIANGLES + (way == "too many")
    points = np.random.default_rng(1).normal(size=(3 * copies, 3))
    scene.add(rt.mesh(vertices=points, faces=np.arange(3 * copies).reshape(-1, 3)), rt.Diffuse(), name="leaves")
    if way == "shapes":
        scene.add(rt.sphere(), rt.Diffuse(), name="ball")
    if way == "instances":
        scene.add(rt.instance("leaves").translate(1, 0, 0), name="twin")
    settings = {"bvh": "none"} if way == "brute force" else {}
    with rt.Renderer(scene, device, traversal="list", spp=1, **settings) as renderer:
        renderer.render()
        assert set(renderer.report()["traversal"]["ran"].values()) == {"single"}


@pytest.fixture
def own_choices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of its own for what trials find, launches of any size that count, and a clock by which each takes
    a few hundredths of a millisecond: on a busy machine a trial's time may be over before its launches are."""
    steps = Random(4)
    looks = accumulate(steps.uniform(1e-5, 2e-5) for _ in count())  # no two variants are as quick as each other
    now = lambda: next(looks)  # noqa: E731
    monkeypatch.setattr(trial, "time", SimpleNamespace(perf_counter=now, process_time=now))
    monkeypatch.setattr(trial, "FileCache", lambda kind: FileCache(kind, tmp_path))
    monkeypatch.setattr(trial, "FEWEST_RAYS", 64)
    monkeypatch.setattr(trial, "FEWEST_SAMPLES", 1)
    monkeypatch.setattr(trial, "PART", 256)
    monkeypatch.setattr(trial, "ROUNDS", 3)
    monkeypatch.setattr(later, "ENOUGH", 0)  # renders of any length have all variants
    return tmp_path / "traversal"


def shown(device: Device, traversal: str = "auto", spp: int = 18) -> tuple[np.ndarray, dict]:
    """A small picture by many small waves, and what its report says of the traversal."""
    scene = rt.load(CORNELL)
    with rt.Renderer(scene, device, traversal=traversal, memory=60_000, size=(48, 40), spp=spp) as renderer:
        return renderer.render().rgb, renderer.report()["traversal"]


def test_a_trial_changes_no_bit_and_is_remembered(device: Device, own_choices: Path) -> None:
    """Each wave's kind is tried, or is too rare to be; the next render knows what this one found."""
    wanted, forced = shown(device, "single")
    assert {one["by"] for one in forced["choice"].values()} == {"usual"} and not own_choices.exists()
    image, first = shown(device)
    assert np.array_equal(image, wanted)
    if device.kind == "gpu":
        assert first["choice"] == forced["choice"]
        return
    found = {kind: one for kind, one in first["choice"].items() if one["by"] == "trial"}
    assert {"primary", "shadow[1]"} <= set(found) and first["trial_s"] > 0
    for kind, one in found.items():
        assert set(one["rays_per_s"]) == {"single", "list"} | ({"packet"} if kind == "primary" else set())
        assert one["runs"] == max(one["rays_per_s"], key=one["rays_per_s"].__getitem__)
    image, second = shown(device)
    assert np.array_equal(image, wanted)
    for kind, one in found.items():
        assert second["choice"][kind] == {**one, "by": "cache"}
        assert second["ran"].get(kind, one["runs"]) == one["runs"]


def test_a_measurement_tries_anew_and_leaves_what_is_remembered_as_it_is(device: Device, own_choices: Path) -> None:
    if device.kind == "gpu":
        pytest.skip("there is nothing to choose")
    shown(device)
    before = {path: path.read_bytes() for path in own_choices.rglob("*") if path.is_file()}
    with rt.Renderer(rt.load(CORNELL), device, memory=60_000, size=(48, 40), spp=18) as renderer:
        assert renderer.trial.as_dict()["primary"]["by"] == "cache"
        renderer.trial.forget()
        renderer.render()
        assert renderer.trial.as_dict()["primary"]["by"] == "trial"
    assert before and before == {path: path.read_bytes() for path in own_choices.rglob("*") if path.is_file()}


def test_damaged_choices_are_tried_again(device: Device, own_choices: Path) -> None:
    if device.kind == "gpu":
        pytest.skip("there is nothing to choose")
    shown(device)
    records = [path for path in own_choices.rglob("*") if path.is_file()]
    assert records
    for path in records:
        path.write_bytes(path.read_bytes()[:-1] + b"x")
    assert shown(device)[1]["choice"]["primary"]["by"] == "trial"
    for path in (path for path in own_choices.rglob("*") if path.is_file()):
        FileCache("traversal", own_choices.parent).put(path.name, {}, b'{"single": 1.0}')  # whole, but of no use
    assert shown(device)[1]["choice"]["primary"]["by"] == "trial"


def test_a_short_render_waits_for_no_trial(device: Device, own_choices: Path) -> None:
    choice = shown(device, spp=1)[1]["choice"]["shadow[1]"]
    assert choice["by"] == "usual" and choice["runs"] == ("single" if device.kind == "gpu" else "list")
    assert not own_choices.exists() or "shadow[1]" not in [
        FileCache("traversal", own_choices.parent).get(path.name).facts["kind"]  # type: ignore[union-attr]
        for path in own_choices.rglob("*")
        if path.is_file()
    ]


def test_packets_need_a_tree(device: Device) -> None:
    with rt.Renderer(rt.load(CORNELL), device, size=(16, 16), spp=1, bvh="none") as renderer:
        renderer.render()
        assert set(renderer.report()["traversal"]["ran"].values()) == {"single"}


def test_an_unknown_traversal_lists_the_known_ones(device: Device) -> None:
    with pytest.raises(UsageError, match="psychic.*auto, single, list, packet"):
        rt.Renderer(rt.load(SCENES / "cornell" / "cornell.toml"), device, traversal="psychic")
