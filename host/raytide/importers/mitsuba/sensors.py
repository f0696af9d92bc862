"""Sensors with their film and sampler: raytide's camera and part of its settings."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from raytide.importers.mitsuba.build import Build
from raytide.importers.mitsuba.document import Plugin
from raytide.importers.mitsuba.reader import Reader
from raytide.importers.mitsuba.transforms import is_mirror, uniform_scale

FILM_DIAGONAL = math.hypot(36.0, 24.0)  # mm, of 35 mm film
SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")
SENSORS = ("perspective", "thinlens", "orthographic")
OTHER_SENSORS = ("radiancemeter", "irradiancemeter", "distant", "batch")
LONGEST_SIDE = 65536  # a film beyond it is left for the scene's own check to refuse


def read_sensor(build: Build, plugin: Plugin, render: dict[str, Any]) -> None:
    """Fill the camera table, and the samples and filter of `render`."""
    reader = Reader(build, plugin)
    if plugin.type not in SENSORS:
        from raytide.importers.mitsuba.bsdfs import unknown_plugin

        unknown_plugin(build, plugin, SENSORS, OTHER_SENSORS)
        return
    film = _read_film(build, reader.part("film"), render)
    _read_sampler(build, reader.part("sampler"), render)
    near, far = reader.number("near_clip", 1e-2), reader.number("far_clip", 1e4)
    if not 0 < near < far:
        reader.problem("near_clip", f"{near:g} with far_clip {far:g}", "0 < near_clip < far_clip")
    elif reader.given("near_clip") or reader.given("far_clip"):
        reader.warn(f"raytide has no clip planes: what lies nearer than {near:g} or beyond {far:g} is seen")
    reader.ignore("shutter_open", "shutter_close")  # nothing moves
    reader.refuse("srf", "spectral response of the sensor")
    matrix = reader.matrix()
    table: dict[str, Any] = {"type": "pinhole", **_aim(reader, matrix), "size": film.crop_size}
    if plugin.type == "orthographic":
        reader.ignore("focus_distance")
        table |= _orthographic(reader, matrix, film)
    else:
        table |= _perspective(reader, film)
        _check_rigid(reader, matrix)
    if plugin.type == "thinlens":
        table["type"] = "thin_lens"
        table["focus"] = reader.number("focus_distance", far)
        table["aperture"] = reader.number("aperture_radius", 0.0)
        if not reader.given("aperture_radius"):
            reader.problem("aperture_radius", "nothing (the parameter is missing)", "the radius of the lens")
    elif plugin.type == "perspective":
        reader.ignore("focus_distance")
    reader.finish()
    build.check("cameras", table, plugin)
    build.tables["camera"] = table
    build.note(("camera",), table, plugin)
    for key, name in (("aperture", "aperture_radius"), ("focus", "focus_distance"), ("origin", "to_world")):
        if name in plugin.properties:
            build.places[("camera", key)] = build.places[("camera", name)] = (
                plugin.properties[name].element.file, plugin.properties[name].element.line,
            )  # fmt: skip


class Film:
    """Sizes of a film [pixels]."""

    def __init__(self, size: list[int], crop_size: list[int], crop_offset: list[int]) -> None:
        self.size, self.crop_size, self.crop_offset = size, crop_size, crop_offset

    @property
    def aspect(self) -> float:
        """Width by height of the whole film."""
        return self.size[0] / self.size[1]

    def shift(self, offset_x: float = 0.0, offset_y: float = 0.0) -> tuple[list[float], float]:
        """Where the middle of the crop window lies, right and up of the axis, in heights of the window; and the
        window's height as a share of the film's. `offset`: of the principal point, left and up, as a share of the
        film."""
        width, height = self.size
        middle_x = (self.crop_offset[0] + self.crop_size[0] / 2) - width * (0.5 - offset_x)
        middle_y = (self.crop_offset[1] + self.crop_size[1] / 2) - height * (0.5 - offset_y)
        crop = self.crop_size[1]
        return [middle_x / crop, -middle_y / crop], crop / height


def _read_film(build: Build, plugin: Plugin | None, render: dict[str, Any]) -> Film:
    if plugin is None:
        _read_filter(build, None, render)
        return Film([768, 576], [768, 576], [0, 0])
    reader = Reader(build, plugin)
    if plugin.type != "hdrfilm":
        from raytide.importers.mitsuba.bsdfs import unknown_plugin

        unknown_plugin(build, plugin, ("hdrfilm",), ("specfilm",))
        return Film([768, 576], [768, 576], [0, 0])
    size = [reader.count("width", 768), reader.count("height", 576)]
    crop_size = [reader.count("crop_width", size[0]), reader.count("crop_height", size[1])]
    offset = [reader.count("crop_offset_x", 0), reader.count("crop_offset_y", 0)]
    reader.text("file_format", "openexr", ("openexr", "exr", "rgbe", "pfm"))
    reader.text("pixel_format", "rgb", ("luminance", "luminance_alpha", "rgb", "rgba", "xyz", "xyza"))
    reader.text("component_format", "float16", ("float16", "float32", "uint32"))
    reader.ignore("sample_border", "compensate", "banner")
    _read_filter(build, reader.part("rfilter"), render)
    sound = True
    for axis, name in enumerate(("width", "height")):
        if not 0 < size[axis] <= LONGEST_SIDE:
            reader.problem(name, str(size[axis]), f"pixels from 1 to {LONGEST_SIDE}")
            sound = False
        elif not (offset[axis] >= 0 and crop_size[axis] > 0 and offset[axis] + crop_size[axis] <= size[axis]):
            came = f"a window from {offset[axis]} of {crop_size[axis]} pixels"
            reader.problem(f"crop_{name}", came, f"one inside the film of {size[axis]} pixels")
            sound = False
    reader.finish()
    return Film(size, crop_size, offset) if sound else Film([768, 576], [768, 576], [0, 0])


def _read_filter(build: Build, plugin: Plugin | None, render: dict[str, Any]) -> None:
    """The pixel filter; Mitsuba's default is a Gaussian."""
    kind = plugin.type if plugin else "gaussian"
    reader = Reader(build, plugin) if plugin else None
    if kind == "box":
        render["filter"] = "box"
    elif kind == "gaussian":
        deviation = reader.number("stddev", 0.5) if reader else 0.5
        render["filter"] = "gaussian"
        if deviation != 0.5:
            render["filter_width"] = 8 * deviation  # cut at 4 standard deviations, as Mitsuba does
    elif reader and plugin:
        _read_other_filter(build, reader, plugin, render)
    if reader:
        reader.finish()


def _read_other_filter(build: Build, reader: Reader, plugin: Plugin, render: dict[str, Any]) -> None:
    from raytide.importers.mitsuba.bsdfs import unknown_plugin

    known = ("box", "gaussian", "tent", "mitchell", "catmullrom", "lanczos")
    if plugin.type not in known:
        unknown_plugin(build, plugin, known, ())
        return
    filters = build.kinds.get("filters", {})
    usual: dict[str, dict[str, float]] = {
        "tent": {}, "mitchell": {"B": 1 / 3, "C": 1 / 3}, "catmullrom": {}, "lanczos": {"lobes": 3},
    }  # fmt: skip
    given = {name: reader.number(name, value) for name, value in usual[plugin.type].items()}
    odd = [name for name, value in usual[plugin.type].items() if abs(given[name] - value) > 1e-6]
    wanted = "catmull_rom" if plugin.type == "catmullrom" else plugin.type
    if plugin.type == "mitchell" and abs(given["B"]) < 1e-6 and abs(given["C"] - 0.5) < 1e-6:
        wanted, odd = "catmull_rom", []
    if wanted not in filters or odd:
        what = f"the filter {plugin.type}" + (f" with {odd[0]}" if odd else "")
        reader.lacks(what, "box or gaussian" if wanted not in filters else f"{wanted} with its usual parameters")
        return
    render["filter"] = wanted
    if plugin.type == "tent":
        radius = reader.number("radius", 1.0)
        if not radius > 0:
            reader.problem("radius", f"{radius:g}", "a number above 0")
        elif radius != 1:
            render["filter_width"] = 2 * radius


def _read_sampler(build: Build, plugin: Plugin | None, render: dict[str, Any]) -> None:
    """Samples and seed. Every sampler becomes raytide's: the expected picture is the same, the noise is less."""
    if plugin is None:
        render["spp"] = 4
        return
    reader = Reader(build, plugin)
    if plugin.type not in SAMPLERS:
        from raytide.importers.mitsuba.bsdfs import unknown_plugin

        unknown_plugin(build, plugin, SAMPLERS, ())
        return
    render["spp"] = reader.count("sample_count", 4)
    seed = reader.count("seed", 0)
    if seed:
        render["seed"] = seed
    if plugin.type in ("stratified", "multijitter", "orthogonal"):
        reader.ignore("jitter")
    if plugin.type == "orthogonal":
        reader.ignore("strength")
    reader.finish()
    item = plugin.properties.get("sample_count")
    if item is not None:
        build.places[("render", "spp")] = (item.element.file, item.element.line)


def _aim(reader: Reader, matrix: np.ndarray) -> dict[str, Any]:
    """Origin, target and up out of a transform whose +z looks ahead, +y up, +x left; `mirror` where it is right."""
    origin, forward, up = matrix[:3, 3], matrix[:3, 2], matrix[:3, 1]
    if not (np.linalg.norm(forward) > 0 and np.linalg.norm(up) > 0):
        reader.problem("to_world", "a singular transform", "an invertible one")
        forward, up = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    ahead = forward / np.linalg.norm(forward)
    return {
        "origin": origin.tolist(),
        "target": (origin + ahead).tolist(),
        "up": (up / np.linalg.norm(up)).tolist(),
        **({"mirror": True} if is_mirror(matrix) else {}),
    }


def _check_rigid(reader: Reader, matrix: np.ndarray) -> None:
    scale = uniform_scale(matrix)
    if scale is None or abs(scale - 1) > 1e-3:
        reader.problem("to_world", "a transform that scales or shears", "turns and shifts only")


def _perspective(reader: Reader, film: Film) -> dict[str, Any]:
    """Vertical field of view of the crop window, and its shift."""
    across = math.tan(math.radians(horizontal_fov(reader, film.aspect)) / 2)
    offsets = [0.0, 0.0]
    if reader.plugin.type == "perspective":
        offsets = [reader.number(f"principal_point_offset_{axis}", 0.0) for axis in "xy"]
    shift, share = film.shift(*offsets)
    table: dict[str, Any] = {"fov": math.degrees(2 * math.atan(across / film.aspect * share))}
    if any(abs(part) > 1e-12 for part in shift):
        table["shift"] = shift
    return table


def horizontal_fov(reader: Reader, aspect: float) -> float:
    """Mitsuba's rules: `fov` along `fov_axis`, or the focal length of 35 mm film along the diagonal [degrees]."""
    axes = ("x", "y", "diagonal", "smaller", "larger")
    if reader.given("fov"):
        fov, axis = reader.number("fov", 40.0), reader.text("fov_axis", "x", axes)
        if reader.given("focal_length"):
            reader.refuse("focal_length", "either fov or focal_length")
    else:
        reader.ignore("fov", "fov_axis")
        words = reader.text("focal_length", "50mm")
        found = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(?:mm)?\s*", words)
        if not found or not float(found[1]) > 0:
            reader.problem("focal_length", repr(words[:40]), 'a length such as "50mm"')
        length = float(found[1]) if found and float(found[1]) > 0 else 50.0
        fov, axis = math.degrees(2 * math.atan(FILM_DIAGONAL / (2 * length))), "diagonal"
    if not 0 < fov < 180:
        reader.problem("fov", f"{fov:g}", "an angle above 0 and below 180 degrees")
        fov = 40.0
    half = math.tan(math.radians(fov) / 2)
    if axis == "y" or (axis == "smaller" and aspect > 1) or (axis == "larger" and aspect <= 1):
        half *= aspect
    elif axis == "diagonal":
        half /= math.sqrt(1 + 1 / aspect**2)
    return math.degrees(2 * math.atan(half))


def _orthographic(reader: Reader, matrix: np.ndarray, film: Film) -> dict[str, Any]:
    """The film is two units wide before the transform, which may scale its sides each by its own factor."""
    left, up, forward = (matrix[:3, axis] for axis in range(3))
    wide, high = np.linalg.norm(left), np.linalg.norm(up)
    sound = min(wide, high, np.linalg.norm(forward)) > 0
    leaning = sound and max(abs(left @ up) / wide / high, abs(left @ forward) / wide, abs(up @ forward) / high) > (
        1e-4 * max(1.0, float(np.linalg.norm(forward)))
    )
    if not sound or leaning:
        reader.problem("to_world", "a shear" if sound else "a singular transform", "turns, shifts and scales only")
        return {"type": "orthographic", "height": 1.0}
    shift, share = film.shift()
    table: dict[str, Any] = {"type": "orthographic", "height": float(2 * high / film.aspect * share)}
    if abs(wide - high) > 1e-4 * wide:
        table["width"] = float(2 * wide * film.crop_size[0] / film.size[0])
    if any(abs(part) > 1e-12 for part in shift):
        table["shift"] = shift
    return table
