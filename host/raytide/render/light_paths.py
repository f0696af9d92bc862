"""Integrator photon: light is traced from the lights through the scene, and every vertex asks what the camera sees.
With `caustics` integrator path leaves to it what mirrors and clear glass gather where the camera looks, and no more.

A pass sends out one path for each of the picture's pixels and samples, wherever it may end, and adds what arrives to
the pixels in whole units (cl/wave/splat.cl), so that order changes nothing. The film adds a pass's sum, shared out
evenly, to each of the pass's samples; what the camera sees of the lights themselves comes from camera rays as ever.
"""

from __future__ import annotations

import math

import numpy as np

from raytide.device import Buffer, Device
from raytide.errors import Problem, SceneError
from raytide.kernels.constants import SPLAT_WORDS, TILE
from raytide.render.emission import emitted_power, sphere_around
from raytide.render.pack import PackedScene, film_area
from raytide.render.schedule import Chunk
from raytide.render.surfaces import is_see_through, is_specular
from raytide.render.textures import has_relief
from raytide.render.waves import Waves
from raytide.scene.flatten import FlatScene
from raytide.scene.lights import SKY_LIGHTS, DirectionalLight

LONGEST_WITH_CAUSTICS = 2**15 - 1  # edges: paths keep one bit of their number for a mark (PATH_CAUSTIC)
SPLAT_BYTES = 4 * SPLAT_WORDS  # a pixel
FRACTION_BITS = 36  # of a unit below the brightness that the scene's lights promise: what is dimmer by 2^-37 is lost
_LIMIT = 90  # exponents of units stay where float32 has all its digits


def check_light_paths(flat: FlatScene) -> None:
    """Raises SceneError, with all reasons, where light cannot be traced to the camera."""
    render, found = flat.render, []
    alone = render.integrator == "photon"
    asked = "integrator photon" if alone else "caustics"
    if render.caustics and render.integrator != "path":
        found.append(Problem("render.caustics", f"true with integrator {render.integrator}", "integrator path"))
    if render.caustics and render.max_depth > LONGEST_WITH_CAUSTICS:
        wanted = f"at most {LONGEST_WITH_CAUSTICS} with caustics"
        found.append(Problem("render.max_depth", str(render.max_depth), wanted))
    if render.filter != "box" or render.width != 1.0:
        came = f"{render.filter} of width {render.width:g}"
        found.append(Problem("render.filter", came, f"box of width 1 with {asked}"))
    if render.adaptive:
        found.append(Problem("render.adaptive", "true", f"false with {asked}: paths of light choose no pixel"))
    if has_relief(flat):
        found.append(Problem("materials", "a normal or bump map", f"none with {asked}: their normals turn towards the "
                             "viewer, whom light does not know"))  # fmt: skip
    if any("priority" in model.model_fields_set for model in flat.materials):
        found.append(Problem("materials", "clear bodies with a priority", f"none with {asked}: light that starts "
                             "within bodies does not know them"))  # fmt: skip
    endless = any(isinstance(light, (DirectionalLight, *(SKY_LIGHTS if alone else ()))) for light in flat.lights)
    planes = [flat.objects[shape.object].material for shape in flat.shapes if shape.kind == "plane" and endless]
    if any(alone or is_specular(flat, material) for material in planes):  # with `caustics` light is sent to no others
        found.append(Problem("objects", "an infinite plane under light from infinity", f"a rectangle with {asked}: "
                             "light cannot be sent to all of a plane"))  # fmt: skip
    elif any(is_see_through(flat, material) for material in planes):
        found.append(Problem("objects", "an infinite plane with an opacity under light from infinity", f"a rectangle "
                             f"with {asked}: light that starts near what has an end knows no such plane"))  # fmt: skip
    if found:
        raise SceneError(found)


def unit_exponent(flat: FlatScene, packed: PackedScene, table: np.ndarray, power: np.ndarray, radius: float) -> int:
    """log2 of the unit of splats [radiance]: 2^-FRACTION_BITS of what a white surface as far off as the scene is large
    would show of a path of the strongest light, by their `power` and the shares in `table`. Brighter paths have 2^25 of
    that above them."""
    film = film_area(packed.camera) * flat.camera.size[0] * flat.camera.size[1]
    seen = math.pi * film * (1.0 if flat.camera.type == "orthographic" else radius**2)
    shares = table["position"][:, 3]
    strongest = float(np.max(power[shares > 0] / shares[shares > 0], initial=0.0)) / seen
    wanted = math.floor(math.log2(strongest)) - FRACTION_BITS if 0 < strongest < math.inf else -FRACTION_BITS
    return max(-_LIMIT, min(wanted, _LIMIT))


class LightPaths:
    """What traces light, and the sums of splats of the pass at work."""

    def __init__(self, device: Device, waves: Waves, flat: FlatScene, packed: PackedScene) -> None:
        self.device, self.waves = device, waves
        width, height = flat.window[2:]
        self._max_depth = flat.render.max_depth
        around = sphere_around(packed.geometry)
        self._around = device.upload(around.record())
        lights, power = packed.lights, emitted_power(flat, packed.lights, around.radius)
        self._lights = waves.scene.lights[0]
        self._met_by = "shadow"  # the kind of rays that leave lights: what a path from the camera would send there
        if packed.sending is not None:
            lights, power, self._met_by = packed.sending.lights, packed.sending.power, "indirect"
            self._lights = device.upload(lights)
        self.unit = 2.0 ** unit_exponent(flat, packed, lights, power, around.radius)
        self._scale = 1.0 / (self.unit * width * height)
        self.splats = device.empty(width * height * SPLAT_BYTES)
        self._targets = device.empty(waves.plan.capacity * 4)

    def clear(self) -> None:
        """A pass begins."""
        self.device.fill(self.splats, 0)

    def film_arguments(self, samples: int, lit: bool = True) -> tuple[Buffer | np.float32, ...]:
        """What the film reads of a pass of so many samples a pixel; a film that is not `lit` takes nothing of it."""
        return self.splats, np.float32(self.unit / samples if lit else 0.0)

    def run(self, chunk: Chunk, health: Buffer) -> None:
        """Traces the paths of a chunk to their ends: cut short, it could not be repeated."""
        first_tile, tiles, first_sample, samples = chunk
        emitted = self.waves.pixels_of(first_tile, tiles) * samples

        def begin(place: int, first: int, count: int) -> None:
            self._emit(place, first, count, first_tile, first_sample, samples)

        def scatter(count: int, label: str) -> tuple[int, np.ndarray]:
            return self._connect(count, label, health)

        self.waves.walk(tiles * TILE * samples, begin, scatter, lambda: False)
        self.waves.rays.emitted += emitted

    def _emit(self, *numbers: int) -> None:
        """`numbers`: place in the queue, first item, items, first tile, first sample and samples of the chunk."""
        waves, scene = self.waves, self.waves.scene
        place, _, count = numbers[:3]
        self.device.launch(
            waves.programs["emit"], "emit", count, 64,
            *scene.geometry("indirect"), self._lights, *scene.textures, waves.settings, self._around,
            waves.queues[0], *(np.uint32(x) for x in numbers),
            waves.path_rays, waves.throughput, waves.paths, *waves.scatterings, *scene.aims,
            label="emit",
        )  # fmt: skip
        waves.extend(place, count, "emitted", self._met_by)

    def _connect(self, count: int, label: str, health: Buffer) -> tuple[int, np.ndarray]:
        """Deals with what `count` queued paths met; `label` is that of their shadow rays. Gives those that go on, and
        by edges."""
        waves, scene = self.waves, self.waves.scene
        self.device.launch(
            waves.programs["connect"], "connect", count, 64,
            *scene.geometry("indirect"), scene.objects, scene.materials, *scene.textures, scene.camera, waves.settings,
            np.uint32(self._max_depth), np.float32(self._scale), waves.queues[0], np.uint32(count),
            waves.path_rays, waves.hits, waves.throughput, waves.paths, waves.status,
            waves.shadow_rays, waves.shadow_light, waves.samples, self._targets, *waves.scatterings,
            label="connect",
        )  # fmt: skip

        def splat(shadow: int) -> None:
            if shadow:
                self.device.launch(
                    waves.programs["splat"], "splat", shadow, 64,
                    waves.shadow_queue, np.uint32(shadow), waves.samples, self._targets, self.splats, health,
                    label="splat",
                )  # fmt: skip

        return waves.follow(count, label, "camera", waves.samples, splat)
