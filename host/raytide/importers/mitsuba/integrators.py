"""Integrators: raytide's path tracer, or its tracer of light, with Mitsuba's depths."""

from __future__ import annotations

from typing import Any

from raytide.importers.mitsuba.build import Build
from raytide.importers.mitsuba.document import Plugin
from raytide.importers.mitsuba.reader import Reader

ENDLESS = 1024  # raytide's largest max_depth; Russian roulette ends paths long before
PATHS = ("path", "volpath", "volpathmis")
WRAPPERS = ("moment", "aov")
KNOWN = (*PATHS, "direct", "ptracer", *WRAPPERS)
OTHERS = ("depth", "stokes", "prb", "prb_basic", "prb_projective", "prbvolpath", "direct_projective")


def read_integrator(build: Build, plugin: Plugin | None, render: dict[str, Any]) -> None:
    """Fill depth and roulette of `render`. Both count alike: 1 sees emitters, 2 adds direct light."""
    if plugin is None:
        render |= {"integrator": "path", "max_depth": ENDLESS, "roulette_start": 5}
        build.report.warn(build.document.root.element, "no integrator: a path tracer is taken, as Mitsuba does")
        return
    reader = Reader(build, plugin)
    if plugin.type in WRAPPERS:  # raytide writes variance and layers with every picture
        reader.ignore("aovs", "block_size", "samples_per_pass", "timeout", "hide_emitters")
        inner = reader.part("integrator", what=f"one integrator inside {plugin.type}")
        reader.finish()
        if inner is None:
            reader.problem("", "no integrator inside it", "a path or direct integrator inside it")
        else:
            read_integrator(build, inner, render)
        return
    if plugin.type not in KNOWN:
        from raytide.importers.mitsuba.bsdfs import unknown_plugin

        unknown_plugin(build, plugin, KNOWN, OTHERS)
        return
    render["integrator"] = "path"
    reader.ignore("block_size", "samples_per_pass")
    reader.refuse("timeout", "use --time", -1.0)
    if plugin.type == "ptracer":
        reader.refuse("hide_emitters", "hidden emitters where light is traced from them", False)
        render["integrator"] = "photon"
    elif reader.flag("hide_emitters", False):
        hide_emitters(build, render)
    if plugin.type == "direct":
        _read_direct(reader, render)
    else:
        _read_path(reader, render)
    reader.finish()
    for key, name in (("max_depth", "max_depth"), ("roulette_start", "rr_depth")):
        if name in plugin.properties:
            element = plugin.properties[name].element
            build.places[("render", key)] = (element.file, element.line)


def hide_emitters(build: Build, render: dict[str, Any]) -> None:
    """The camera looks through what shines, and sees no sky."""
    build.hidden_emitters = True
    render["show_sky"] = False


def _read_path(reader: Reader, render: dict[str, Any]) -> None:
    depth = reader.count("max_depth", -1)
    if depth < -1:
        reader.problem("max_depth", str(depth), "a depth from 0, or -1 for no limit")
    if depth == 0:
        reader.lacks("a depth of 0 (a black picture)", "a depth from 1, or -1 for no limit", "max_depth")
    render["max_depth"] = ENDLESS if depth == -1 or depth > ENDLESS else max(depth, 1)
    roulette = reader.count("rr_depth", 5)
    if roulette <= 0:
        reader.problem("rr_depth", str(roulette), "a depth from 1")
    render["roulette_start"] = min(max(roulette, 1), ENDLESS)


def _read_direct(reader: Reader, render: dict[str, Any]) -> None:
    """Two edges; how samples are shared between light and material changes the noise, not the picture."""
    both = reader.given("shading_samples") and (reader.given("emitter_samples") or reader.given("bsdf_samples"))
    if both:
        reader.problem("shading_samples", "it beside emitter_samples or bsdf_samples", "one or the other")
    counts = [reader.count(name, 1) for name in ("shading_samples", "emitter_samples", "bsdf_samples")]
    if min(counts) < 0 or not sum(counts[1:]):
        reader.problem("", "no samples", "at least one emitter or bsdf sample")
    elif not (counts[1] and counts[2]):
        reader.warn("raytide samples lights and materials both: what only the other finds is seen, too")
    render |= {"max_depth": 2, "roulette_start": 0}
