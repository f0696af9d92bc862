"""`raytide render SCENE -o OUT`: one picture from a scene file."""

from __future__ import annotations

import logging
import os
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from raytide.cli.config import HOST, Settings, environment, gather
from raytide.cli.job import Job, checkpoints_of
from raytide.cli.options import SUFFIXES, check_outputs, defines_of, seconds_of, with_render_keys
from raytide.cli.outputs import check_health, save, summary, write_report, write_trace
from raytide.cli.parameters import (
    Changes,
    Defines,
    Every,
    Exposure,
    Flag,
    Half,
    Kept,
    LogJson,
    NoClobber,
    Outputs,
    Quiet,
    Samples,
    Verbose,
)
from raytide.cli.progress import Progress, progress_for, set_up_logging
from raytide.cli.shard import SHARD_SUFFIXES, check_shard, render_samples
from raytide.cli.signals import SIGNALS, Interrupted, StopOnSignal
from raytide.errors import RaytideError, UsageError

if TYPE_CHECKING:
    from raytide.render import Checkpoints, Film, Renderer
    from raytide.scene.scene import Scene


@with_render_keys
def render(
    scene: Annotated[Path, Parameter(help="scene file: .toml, .json, or Mitsuba 3 .xml")],
    /,
    *,
    output: Outputs = None,
    size: Annotated[str | None, Parameter(help="picture size, such as 640x360; default: the scene's")] = None,
    device: Annotated[str | None, Parameter(help=f"{HOST['device']}; `raytide devices` lists them")] = None,
    threads: Annotated[str | None, Parameter(help=f"of a CPU device: {HOST['threads']}; default: all")] = None,
    memory: Annotated[str | None, Parameter(help=f"{HOST['memory']}; default: by the device")] = None,
    changes: Changes = None,
    define: Defines = None,
    report: Annotated[Path | None, Parameter(help="write times, rates, memory and what was left out, as JSON")] = None,
    trace: Annotated[Path | None, Parameter(help="write time, samples, rays and error after each pass, as CSV")] = None,
    checkpoint: Kept = None,
    every: Every = None,
    samples: Samples = None,
    coherence: Annotated[Flag, Parameter(help="measure how coherent each wave's rays are, into --report")] = False,
    everything: Annotated[Flag, Parameter(help="leave nothing out of the kernels, to compare")] = False,
    traversal: Annotated[str, Parameter(help="of rays: single, list, packet, compact or auto; same picture")] = "auto",
    explain: Annotated[Flag, Parameter(help="show each setting's value and origin; without -o render nothing")] = False,
    allow_outside: Annotated[Flag, Parameter(help="let the scene name files outside its folder")] = False,
    half: Half = False,
    exposure: Exposure = 0.0,
    no_clobber: NoClobber = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    log_json: LogJson = False,
    **keys: Any,
) -> int:
    """Render SCENE and write it to every -o file. The files' names go to stdout, all else to stderr.

    Ctrl-C or SIGTERM finishes the wave, saves what there is and exits with 130 or 143.
    """
    set_up_logging(quiet=quiet, verbose=verbose, as_json=log_json)
    outputs = output or []
    check_request(outputs, report, explain=explain, coherence=coherence)
    check_shard(samples, outputs, {"--report": report, "--trace": trace, "--checkpoint": checkpoint})
    check_outputs(outputs, [report, trace], no_clobber, SUFFIXES if samples is None else SHARD_SUFFIXES)
    check_checkpoint(checkpoint, every)
    settings = gather({**keys, "size": size, "device": device, "threads": threads, "memory": memory}, environment())
    job = Job(
        scene, outputs, report, trace, changes or [], defines_of(define), allow_outside, coherence, everything,
        traversal, half, exposure, no_clobber, quiet, log_json, checkpoint, seconds_of("--every", every), samples,
    )  # fmt: skip
    job.times["start"] = process_age()
    with StopOnSignal() as signals:
        try:
            loaded = load_scene(job, settings)
            if explain:
                show_explanation(loaded, settings, job)
            return render_scene(job, loaded, settings, signals) if outputs else 0
        except Interrupted:
            return nothing_written(signals)


def nothing_written(signals: StopOnSignal) -> int:
    """A signal came before there was a picture; the exit code."""
    print(f"raytide: {SIGNALS[signals.number or 2]}; nothing was written", file=sys.stderr)
    return signals.exit_code


def check_request(outputs: list[Path], report: Path | None, *, explain: bool, coherence: bool) -> None:
    """Refuse options that make no sense together. Raises UsageError."""
    if not outputs and not explain:
        raise UsageError("no output: give at least one -o FILE.exr or -o FILE.png")
    if coherence and report is None:
        raise UsageError("--coherence: came without --report; wanted a file for its figures")


def check_checkpoint(checkpoint: Path | None, every: str | None) -> None:
    """Refuse a place where no checkpoint can be. Raises UsageError."""
    if every and not checkpoint:
        raise UsageError("--every: came without --checkpoint; wanted a file to write to")
    check_outputs([], [checkpoint], False)


def load_scene(job: Job, settings: Settings) -> Scene:
    """The scene with all layers put over it. Raises SceneError."""
    begun = time.perf_counter()
    from raytide.scene.load import load

    job.timed("import", begun)
    begun = time.perf_counter()
    scene = load(
        job.scene, allow_outside=job.allow_outside, layers=settings.layers, overrides=job.overrides, defines=job.defines
    )
    free_samples(scene)
    job.timed("load", begun)
    return scene


def free_samples(scene: Scene) -> None:
    """Whoever asks for a time or an error outside the scene file is not held to the samples that it names."""
    own = ("default", "scene file")
    asked = [origin for key in ("time", "error") if (origin := scene.origins.get(f"render.{key}", own[0])) not in own]
    if asked and scene.origins.get("render.spp", own[0]) in own:
        from raytide.render.limits import MOST_SPP

        scene.render.spp, scene.origins["render.spp"] = MOST_SPP, asked[0]


def show_explanation(scene: Scene, settings: Settings, job: Job) -> None:
    """To stdout as the command's data, or to stderr where a render follows."""
    from raytide.cli.explain import explanation

    print(explanation(scene, settings, job.overrides), file=sys.stderr if job.outputs else sys.stdout)


def render_scene(job: Job, scene: Scene, settings: Settings, signals: StopOnSignal) -> int:
    """Render, save, report; the exit code. Raises RaytideError."""
    if job.samples is not None:
        return render_samples(job.samples, job, scene, settings, signals)
    progress = progress_for(quiet=job.quiet, as_json=job.log_json)
    with closing(progress), open_renderer(job, scene, settings) as renderer:
        signals.attach(renderer.stop, progress.say)
        for warning in renderer.flat.warnings:
            logging.getLogger("raytide.scene").warning(warning)
        if job.resumed:
            renderer.resume(job.resumed)
        checkpoints = checkpoints_of(job, settings)
        film = last_film(job, renderer, progress, checkpoints)
        progress.close()
        if not has_picture(film):
            why = " by time" if renderer.stopped_by == "time" else ""
            print(f"raytide: stopped{why} before the first samples; nothing was written", file=sys.stderr)
            return signals.exit_code or 1
        save(job, film)
        if job.report:
            write_report(job, renderer)
        if job.trace:
            write_trace(job, job.trace, renderer)
        if not job.quiet:
            print(summary(scene, film, signals, renderer.stopped_by, job.log_json), file=sys.stderr)
        print(*job.outputs, sep="\n", flush=True)
        check_health(film)
        if checkpoints and checkpoints.failed:
            raise RaytideError(f"{checkpoints.failed}; the picture was written")
    return signals.exit_code


def open_renderer(job: Job, scene: Scene, settings: Settings) -> Renderer:
    """The renderer with everything built, before the first wave."""
    begun = time.perf_counter()
    from raytide.render import Renderer

    job.timed("import", begun)
    host = {key: setting.value for key, setting in settings.host.items()}
    layers = any(path.suffix.lower() == ".exr" for path in job.outputs)
    return Renderer(
        scene, host["device"], memory=host["memory"], threads=host["threads"], everything=job.everything, layers=layers,
        traversal=job.traversal,
    )  # fmt: skip


def last_film(job: Job, renderer: Renderer, progress: Progress, checkpoints: Checkpoints | None) -> Film:
    """Run all passes, showing each."""
    for _ in renderer.passes(watch=not job.quiet or bool(job.trace or job.report), checkpoints=checkpoints):
        progress.show(renderer.status)
    return renderer.film


def has_picture(film: Film) -> bool:
    """Whether any pixel has a sample: a pass that was stopped counts none as finished, but may have some."""
    return film.spp > 0 or bool(film.samples.any())


def process_age() -> float:
    """Seconds since the process started; where the system does not tell, its CPU time so far."""
    try:
        fields = Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()
        started = int(fields[19]) / os.sysconf("SC_CLK_TCK")
        return time.clock_gettime(time.CLOCK_BOOTTIME) - started
    except (OSError, AttributeError, IndexError, ValueError):
        return time.process_time()
