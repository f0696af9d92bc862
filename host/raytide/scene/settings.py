"""Render settings: the `[render]` table."""

from __future__ import annotations

from typing import Literal

from raytide.scene.model import Table
from raytide.scene.values import Count, Flag, Number, Seconds, Share, Window, key

DEFAULT_WIDTH = {  # the Gaussian is cut at 2 pixels = 4 sigma of 0.5
    "box": 1.0, "tent": 2.0, "gaussian": 4.0, "mitchell": 4.0, "catmull_rom": 4.0, "lanczos": 6.0, "centre": 0.0,
}  # fmt: skip


class RenderSettings(Table):
    """How to render, apart from what is seen."""

    integrator: Literal["path", "local", "photon"] = key(
        "path", doc="path: global light; local: direct light and mirrors only; photon: global light traced from the "
        "lights to the camera, for caustics"
    )
    spp: Count = key(64, low=1, high=2**24, unit="samples a pixel", doc="samples for each pixel")
    time: Seconds | None = key(None, above=0, doc="end after this time of rendering, set-up apart")
    error: Share | None = key(
        None, above=0, below=1, doc="end at this estimated error, the root of relMSE: a share of radiance"
    )
    max_depth: Count = key(
        8, low=1, high=2**16 - 1, unit="edges", doc="longest path: 1 sees emitters, 2 adds direct light"
    )
    roulette_start: Count = key(
        5, low=0, high=1024, unit="edges", doc="first edge where roulette may end a path; 0: never"
    )
    seed: Count = key(0, low=0, high=2**32 - 1, doc="another seed, another noise")
    crop: Window | None = key(
        None, unit="pixels", doc="render only this window: column and row of its upper left pixel, width, height"
    )
    filter: Literal["box", "tent", "gaussian", "mitchell", "catmull_rom", "lanczos", "centre"] = key(
        "box", doc="pixel filter; from mitchell on they sharpen and are noisier; centre shoots through exact centres"
    )
    filter_width: Number | None = key(
        None, above=0, high=16, unit="pixels",
        doc="full width of the filter; default 1 for box, 2 for tent, 6 for lanczos, 4 for the others",
    )
    light_choice: Literal["auto", "uniform", "power", "tree"] = key(
        "auto", doc="how one of all lights is picked at a point; tree: by what each could send there; auto: the tree "
        "where more than eight lights or shining triangles have a place",
    )
    sampler: Literal["sobol", "blue_noise", "random"] = key(
        "sobol", doc="sobol: Owen-scrambled sequences; blue_noise: the same, whose error cancels between neighbouring "
        "pixels once spp samples are done; random: independent numbers, to compare with",
    )
    adaptive: Flag = key(
        False, doc="more samples where the error is large, fewer where it is small; spp is their mean, from 16 on"
    )
    bvh: Literal["sah", "sah-hq", "lbvh", "none"] = key(
        "sah", doc="tree builder: sah-hq builds longer and traces faster; none tests every primitive"
    )
    show_sky: Flag = key(
        True, doc="whether the camera sees skies and suns; false: black in their place, while they light the scene"
    )
    caustics: Flag = key(
        False, doc="integrator path: light that mirrors and clear glass send to surfaces that the camera sees is "
        "traced from the lights"
    )
    clamp_indirect: Number | None = key(
        None, above=0, unit="W/(sr m^2)", doc="integrator path: light that scattered twice or more adds at most this "
        "to a sample at a time, in its brightest channel; biased, and counted",
    )
    clamp_direct: Number | None = key(
        None, above=0, unit="W/(sr m^2)", doc="integrator path: the same of light that scattered once or not at all"
    )
    regularise: Flag = key(
        False, doc="integrator path: mirrors, glass and gloss are rougher to paths that scattered before, so that "
        "lamps can be asked for caustics; biased, and told"
    )
    shadows: Flag = key(True, doc="integrator local: whether lights cast shadows")
    reflection_depth: Count = key(4, low=0, high=1024, doc="integrator local: longest chain of mirrors")

    @property
    def is_clamped(self) -> bool:
        """Whether what a path adds to its sample is held to a bound."""
        return self.clamp_direct is not None or self.clamp_indirect is not None

    @property
    def width(self) -> float:
        """Full width of the pixel filter [pixels], the default filled in; a Gaussian's sigma is an eighth of it."""
        return self.filter_width if self.filter_width is not None else DEFAULT_WIDTH[self.filter]
