"""Settings put over those of a scene, and the record in which kernels read them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from raytide.errors import SceneError, UsageError
from raytide.kernels.constants import JOINS_DIRECTIONS, JOINS_FILM
from raytide.kernels.records import RECORDS
from raytide.render.bias import check_bias
from raytide.render.light_pairs import is_one_pair
from raytide.render.light_paths import check_light_paths
from raytide.render.lights import left_to_scattering, shadows_alone
from raytide.render.pack import PackedScene, film_area
from raytide.render.regularise import shown_materials
from raytide.render.schedule import tiles_across
from raytide.scene.check import crop_problem
from raytide.scene.flatten import FlatScene


def with_settings(flat: FlatScene, settings: dict[str, Any]) -> FlatScene:
    """`flat` with keys of [render] and the camera's size replaced, checked as in a scene file. Raises SceneError for
    a value and UsageError for a key that cannot be."""
    known = type(flat.render).model_fields
    camera, render = flat.camera.model_copy(), flat.render.model_copy()
    for key, value in settings.items():
        if key == "size":
            camera.size = value
        elif key in known:
            setattr(render, key, value)
        else:
            raise UsageError(f"{key}: came an unknown render setting; wanted one of {', '.join(known)}, size")
    if render.adaptive and render.sampler == "blue_noise":
        raise UsageError("adaptive: came with sampler blue_noise, whose pixels share their numbers; wanted sobol")
    problem = crop_problem(camera, render)
    if problem:
        raise SceneError([problem])
    out = replace(flat, camera=camera, render=render)
    check_bias(out)
    if render.integrator == "photon" or render.caustics:
        check_light_paths(out)
    return out


def _block_bits(spp: int) -> int:
    """log2 of the samples that sampler blue_noise sets apart for a pixel: the power of four from `spp` up, at most
    2^20."""
    return min((max(spp - 1, 1).bit_length() + 1) // 2 * 2, 20)


def _joins(flat: FlatScene) -> int:
    """What shares a set of sample dimensions."""
    lobes = any(model.has_lobes for model in shown_materials(flat))
    return (0 if flat.camera.type == "thin_lens" else JOINS_FILM) | (0 if lobes else JOINS_DIRECTIONS)


def settings_record(flat: FlatScene, packed: PackedScene) -> np.ndarray:
    """The Settings record of a render."""
    row = np.zeros(1, RECORDS["Settings"].dtype)
    row["first_x"], row["first_y"], width, height = flat.window
    render = flat.render
    row["width"], row["height"], row["tiles_x"] = width, height, tiles_across(width)
    row["whole_width"], row["block_bits"] = flat.camera.size[0], _block_bits(render.spp)
    row["seed"] = render.seed
    row["max_depth"] = 1 if render.integrator == "photon" else render.max_depth  # of paths from the camera
    row["roulette_start"], row["reflection_depth"] = render.roulette_start, render.reflection_depth
    sky_alone = len(packed.lights) == 1 and left_to_scattering(flat)
    picked = 0 if sky_alone else 1 if is_one_pair(packed.lights) else len(packed.lights)
    row["light_count"], row["environment"] = picked, packed.environment
    row["joins"] = _joins(flat)
    row["filter_radius"] = render.width / 2
    if packed.sending is not None:
        row["camera_density"] = 1.0 / (film_area(packed.camera) * width * height)
    row["media"], row["first_medium"] = packed.media, packed.first_medium
    row["sun_count"] = sum(light.kernel == "sun" for light in flat.lights)
    row["shadows"] = render.shadows
    row["shadows_alone"] = shadows_alone(flat)
    return row
