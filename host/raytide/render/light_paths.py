"""Integrator photon: light is traced from the lights through the scene, and every vertex asks what the camera sees.

A pass sends out one path for each of the picture's pixels and samples, wherever it may end, and adds what arrives to
the pixels in whole units (cl/wave/splat.cl), so that order changes nothing. The film adds a pass's sum, shared out
evenly, to each of the pass's samples; what the camera sees of the lights themselves comes from camera rays as ever.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from raytide.accel import FlatGeometry
from raytide.device import Buffer, Device
from raytide.errors import Problem, SceneError
from raytide.kernels.constants import SPLAT_WORDS, TILE
from raytide.kernels.features import kind_number
from raytide.render.pack import PackedScene
from raytide.render.schedule import Chunk
from raytide.render.textures import has_relief, sky_radiance
from raytide.render.waves import Waves
from raytide.scene.flatten import FlatScene
from raytide.scene.lights import SKY_LIGHTS, DirectionalLight

SPLAT_BYTES = 4 * SPLAT_WORDS  # a pixel
FRACTION_BITS = 36  # of a unit below the brightness that the scene's lights promise: what is dimmer by 2^-37 is lost
_LIMIT = 90  # exponents of units stay where float32 has all its digits
_LUMINANCE = np.array((0.2126, 0.7152, 0.0722))  # Rec. 709


def check_photon(flat: FlatScene) -> None:
    """Raises SceneError, with all reasons, where light cannot be traced to the camera."""
    render, found = flat.render, []
    if render.filter != "box" or render.width != 1.0:
        came = f"{render.filter} of width {render.width:g}"
        found.append(Problem("render.filter", came, "box of width 1 with integrator photon"))
    if render.adaptive:
        found.append(Problem("render.adaptive", "true", "false with integrator photon, whose paths choose no pixel"))
    if has_relief(flat):
        found.append(Problem("materials", "a normal or bump map", "none with integrator photon: their normals turn "
                             "towards the viewer, whom light does not know"))  # fmt: skip
    if any("priority" in model.model_fields_set for model in flat.materials):
        found.append(Problem("materials", "clear bodies with a priority", "none with integrator photon: light that "
                             "starts within bodies does not know them"))  # fmt: skip
    endless = any(isinstance(light, (DirectionalLight, *SKY_LIGHTS)) for light in flat.lights)
    if endless and any(shape.kind == "plane" for shape in flat.shapes):
        found.append(Problem("objects", "an infinite plane under light from infinity", "a rectangle with integrator "
                             "photon, which cannot send light to all of a plane"))  # fmt: skip
    if found:
        raise SceneError(found)


@dataclass(frozen=True)
class Around:
    """Sphere around all that has an end, relative to the geometry's origin."""

    center: np.ndarray
    radius: float

    def record(self) -> np.ndarray:
        """(4,) float32: centre and radius."""
        return np.array([*self.center, self.radius], np.float32)


def sphere_around(geometry: FlatGeometry) -> Around:
    """Half the diagonal of the box around triangles, shapes and instances, but for infinite planes, as radius."""
    shapes = geometry.shapes[geometry.plane_count :]
    own, placed = np.split(shapes, [len(shapes) - geometry.instance_count])
    reach = sum(np.abs(own[axis][:, :3].astype(float)) for axis in "uvw") if len(own) else np.zeros((0, 3))
    corner = lambda names: np.stack([placed[name][:, 3] for name in names], axis=1).astype(float)  # noqa: E731
    used = geometry.vertices[np.unique(geometry.triangles[:, :3])][:, :3].astype(float)
    points = np.concatenate([
        used, own["center"][:, :3] - reach, own["center"][:, :3] + reach,
        corner(("inverse_u", "inverse_v", "inverse_w")), corner("uvw"),
    ])  # fmt: skip
    if not len(points):
        return Around(np.zeros(3), 1.0)
    low, high = points.min(axis=0), points.max(axis=0)
    return Around((low + high) / 2, max(float(np.linalg.norm(high - low)) / 2 * 1.00001, 1e-30))


def unit_exponent(flat: FlatScene, packed: PackedScene, around: Around) -> int:
    """log2 of the unit of splats [radiance]: 2^-FRACTION_BITS of what a white surface as far off as the scene is large
    would show of a path of the strongest light. Brighter paths have 2^25 of that above them."""
    table, radius = packed.lights, around.radius
    brightness = table["radiance"][:, :3].astype(float) @ _LUMINANCE
    disk = math.pi * radius**2
    cone = 2 * math.pi * (1 - np.cos(table["extra"][:, 2].astype(float)))
    up = np.column_stack([table["extra"][:, :2], table["direction"][:, 3]]).astype(float)
    factors = {
        "point": np.full(len(table), 4 * math.pi),
        "spot": cone,
        "textured_spot": cone,
        "projector": 4 * table["extra"][:, 3] / np.maximum(np.sum(up**2, axis=1), 1e-30),
        "sun": disk / np.maximum(table["extra"][:, 1], 1e-30),
        "directional": np.full(len(table), disk),
        "environment": np.full(len(table), math.pi * disk),
        "environment_map": np.full(len(table), math.pi * disk * _sky_mean(flat)),
        "emitter": math.pi * table["extra"][:, 1].astype(float),
    }
    power = np.zeros(len(table))
    for kind, factor in factors.items():
        power = np.where(table["kind"] == kind_number("light", kind), brightness * factor, power)
    raster, size = packed.camera["raster"][0].astype(float), flat.camera.size
    film = abs(raster[2] * raster[3]) * size[0] * size[1]
    seen = math.pi * film * (1.0 if flat.camera.type == "orthographic" else radius**2)
    strongest = float(np.max(power / np.maximum(table["position"][:, 3], 1e-30), initial=0.0)) / seen
    wanted = math.floor(math.log2(strongest)) - FRACTION_BITS if 0 < strongest < math.inf else -FRACTION_BITS
    return max(-_LIMIT, min(wanted, _LIMIT))


def _sky_mean(flat: FlatScene) -> float:
    return 0.0 if flat.textures.sky is None else float(np.mean(sky_radiance(flat.textures.sky).astype(float)))


class LightPaths:
    """What traces light, and the sums of splats of the pass at work."""

    def __init__(self, device: Device, waves: Waves, flat: FlatScene, packed: PackedScene) -> None:
        self.device, self.waves = device, waves
        width, height = flat.window[2:]
        self._max_depth = flat.render.max_depth
        around = sphere_around(packed.geometry)
        self._around = device.upload(around.record())
        self.unit = 2.0 ** unit_exponent(flat, packed, around)
        self._scale = 1.0 / (self.unit * width * height)
        self.splats = device.empty(width * height * SPLAT_BYTES)
        self._targets = device.empty(waves.plan.capacity * 4)

    def clear(self) -> None:
        """A pass begins."""
        self.device.fill(self.splats, 0)

    def film_arguments(self, samples: int) -> tuple[Buffer | np.float32, ...]:
        """What the film reads of a pass of so many samples a pixel."""
        return self.splats, np.float32(self.unit / samples)

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
            *scene.geometry("indirect"), scene.lights[0], *scene.textures, waves.settings, self._around,
            waves.queues[0], *(np.uint32(x) for x in numbers),
            waves.path_rays, waves.throughput, waves.paths, *waves.scatterings,
            label="emit",
        )  # fmt: skip
        waves.extend(place, count, "emitted", "shadow")

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
