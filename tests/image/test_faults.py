"""What is unsound in a render is counted where it comes from, and its sample never passes for black."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import raytide as rt
from raytide.device import Device
from raytide.verify.variants import Variant, VariantDevice

NAN = "float_of(0x7fc00000u)"
# The same for eight camera rays at once as FAULTS has it for one
EIGHT_CAMERAS = ("const float8 t_max = inside", f"direction.x = u.z < 0.5f ? (float8)({NAN}) : direction.x;\n"
                 "    const float8 t_max = inside")  # fmt: skip


def scene() -> rt.Scene:
    """No sky: what goes astray sees nothing."""
    made = rt.Scene(camera=rt.Camera(origin=(0, 2, 4), target=(0, 0, 0), fov=20, size=(16, 16)))
    made.add(rt.plane(), rt.Diffuse(0.5), name="floor")
    made.add(rt.sphere((0, 3, 0), 1.0), rt.Emit(1.0), name="lamp")
    return made


def rendered(device: Device, name: str, place: str, fault: str) -> tuple[rt.Film, dict[str, object]]:
    """A picture of kernels in which `place` reads `fault`."""

    found = []

    def broken(text: str) -> str:
        found.append(place in text)
        return text.replace(place, fault).replace(*EIGHT_CAMERAS if name == "camera" else ("", "", 0))

    other = VariantDevice(device, Variant(name, name, broken))
    try:
        with rt.Renderer(scene(), other, spp=16, max_depth=3) as renderer:
            film = renderer.render()
            assert any(found), f"no program reads {place!r} any more"
            return film, renderer.report()
    finally:
        other.close()


FAULTS = {  # by origin: what is written instead, the fault's label, the share of samples that it spoils
    "onward": ("out.pdf = out.wi.z * INVERSE_PI;", f"out.pdf = u.x < 0.25f ? {NAN} : out.wi.z * INVERSE_PI;",
               "onward[1] non_finite", 0.25),
    "way": ("out.ray = ray_from(v, wi, wi, 1);", "out.ray = ray_from(v, wi, wi, 1);\n"
            f"    out.ray.direction.x = u.x < 0.25f ? {NAN} : out.ray.direction.x;", "onward[1] non_finite", 0.25),
    "direct": ("out.light = xyz(v->state) * bsdf.value", "out.light = -xyz(v->state) * bsdf.value",
               "direct[1] negative", None),
    "camera": ("ray.direction.w = inside", f"ray.direction.x = u.z < 0.5f ? {NAN} : ray.direction.x;\n"
               "    ray.direction.w = inside", "camera[1] non_finite", 0.5),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_counted_where_it_comes_from_and_its_samples_are_left_out(device: Device, name: str) -> None:
    place, fault, label, share = FAULTS[name]
    film, report = rendered(device, name, place, fault)
    assert label in film.faults and report["faults"] == film.faults
    assert {words.split("[")[0] for words in film.faults} <= {label.split("[")[0], "sky", "emission"}
    assert np.isfinite(film.rgb).all() and film.rgb.min() >= 0
    if share is not None:
        lost = film.health["non_finite"] / (16 * 16 * 16)
        assert abs(lost - share) < 0.05 + share * 0.3, film.health


@pytest.fixture
def sound(device: Device) -> Iterator[rt.Renderer]:
    with rt.Renderer(scene(), device, spp=4, max_depth=3) as renderer:
        renderer.render()
        yield renderer


def test_a_sound_render_says_so_with_the_room_that_its_stack_and_queues_had(sound: rt.Renderer) -> None:
    report = sound.report()
    assert report["faults"] == {} == sound.film.header()["raytide"]["faults"]
    assert report["stack"]["deepest_tree"] <= report["stack"]["limit"]
    assert 0 < report["queue"]["most_used"] <= report["queue"]["slots"]
