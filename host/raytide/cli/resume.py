"""`raytide resume FILE`: goes on with a render from its checkpoint."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from raytide.cli.config import HOST, HostSetting, Settings, checked_host
from raytide.cli.job import Job, job_of
from raytide.cli.options import check_outputs, seconds_of
from raytide.cli.parameters import Every, LogJson, Quiet, Verbose
from raytide.cli.progress import set_up_logging
from raytide.cli.render import load_scene, nothing_written, process_age, render_scene
from raytide.cli.signals import Interrupted, StopOnSignal
from raytide.errors import UsageError


def resume(
    checkpoint: Annotated[Path, Parameter(help="file of `raytide render --checkpoint FILE`")],
    /,
    *,
    output: Annotated[
        list[Path] | None,
        Parameter(name=["--output", "-o"], negative="", help=".exr or .png instead of the first command's; repeatable"),
    ] = None,
    spp: Annotated[str | None, Parameter(help="other number of samples for each pixel, all counted")] = None,
    time: Annotated[str | None, Parameter(help="other time of rendering, such as 30s, all counted")] = None,
    error: Annotated[str | None, Parameter(help="other estimated error to end at, such as 1%")] = None,
    device: Annotated[str | None, Parameter(help=f"{HOST['device']}; default: the first command's")] = None,
    threads: Annotated[str | None, Parameter(help=f"of a CPU device: {HOST['threads']}")] = None,
    memory: Annotated[str | None, Parameter(help=HOST["memory"])] = None,
    report: Annotated[Path | None, Parameter(help="write the report here instead")] = None,
    trace: Annotated[Path | None, Parameter(help="write the series of passes here instead")] = None,
    every: Every = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
    log_json: LogJson = False,
) -> int:
    """Go on with the render in CHECKPOINT, with the options of the command that began it, and write its files.

    On the device that it was begun on, the picture is that of a render that was never stopped, bit for bit. On another
    one it goes on too, and says so. A render that had ended goes on where --spp, --time or --error say that it may.
    """
    set_up_logging(quiet=quiet, verbose=verbose, as_json=log_json)
    job, settings = kept(checkpoint)
    job.outputs, job.report, job.trace = output or job.outputs, report or job.report, trace or job.trace
    job.quiet, job.log_json, job.checkpoint = quiet, log_json, checkpoint
    job.every = seconds_of("--every", every)
    check_outputs(job.outputs, [job.report, job.trace], False)
    check_outputs([], [job.checkpoint], False)
    ends = {"spp": spp, "time": time, "error": error}
    job.overrides += [f"render.{key}={value}" for key, value in ends.items() if value is not None]
    for key, value in {"device": device, "threads": threads, "memory": memory}.items():
        if value is not None:
            settings.host[key] = host_setting(key, value)
    job.times["start"] = process_age()
    with StopOnSignal() as signals:
        try:
            return render_scene(job, load_scene(job, settings), settings, signals)
        except Interrupted:
            return nothing_written(signals)


def kept(checkpoint: Path) -> tuple[Job, Settings]:
    """The first command as the newest whole generation tells it. Raises UsageError."""
    from raytide.render import checkpoint_file

    content, _ = checkpoint_file.read(checkpoint)  # a damaged generation is told of when the render goes on
    return job_of(content.facts.get("notes", {}), checkpoint)


def host_setting(key: str, value: str) -> HostSetting:
    """A setting of the machine. Raises UsageError."""
    checked = checked_host(key, value)
    if checked is None:
        raise UsageError(f"--{key}: came {value!r}; wanted {HOST[key]}")
    return HostSetting(checked, f"--{key}")
