"""`raytide render --samples A:B -o F.shard` and `raytide merge F.shard... -o OUT`: one picture from many machines."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from raytide.cli.config import Settings
from raytide.cli.job import Job
from raytide.cli.options import check_outputs
from raytide.cli.outputs import bias_words, check_health
from raytide.cli.parameters import Exposure, Half, LogJson, NoClobber, Outputs, Quiet, Verbose
from raytide.cli.progress import progress_for, set_up_logging
from raytide.cli.progress_text import error_with_band
from raytide.cli.signals import SIGNALS, StopOnSignal
from raytide.errors import UsageError

if TYPE_CHECKING:
    from raytide.scene.scene import Scene

SHARD_SUFFIXES = (".shard",)


def check_shard(samples: str | None, outputs: Sequence[Path], others: Mapping[str, object]) -> None:
    """Refuse what a shard cannot be given. Raises UsageError."""
    if samples is None:
        return
    if len(outputs) != 1:
        raise UsageError(f"--samples: came {len(outputs)} outputs; wanted one -o FILE.shard")
    for option, value in others.items():
        if value is not None:
            raise UsageError(f"{option}: came with --samples; wanted it without: a shard has no picture of its own yet")


def render_samples(text: str, job: Job, scene: Scene, settings: Settings, signals: StopOnSignal) -> int:
    """Render a range of samples into the job's shard; the exit code. Raises RaytideError."""
    from raytide.cli.render import open_renderer
    from raytide.render.shard import check_range, range_of, write_shard

    first, end = range_of(text)
    given = {key: value for key in ("time", "error") if (value := getattr(scene.render, key)) is not None}
    for key in given:
        raise UsageError(f"render.{key}: came a render that {key} ends, with --samples; wanted one of fixed samples")
    check_range(first, end, scene.render.spp if "spp" in scene.render.model_fields_set else None)
    (path,) = job.outputs
    progress = progress_for(quiet=job.quiet, as_json=job.log_json)
    with closing(progress), open_renderer(job, scene, settings) as renderer:
        signals.attach(renderer.stop, progress.say)
        done = write_shard(renderer, path, first, end, no_clobber=job.no_clobber, show=progress.show)
        progress.close()
        if done == first:
            print("raytide: stopped before the first whole block of samples; nothing was written", file=sys.stderr)
            return signals.exit_code or 1
        if not job.quiet:
            partial = f" (partial: {SIGNALS[signals.number]}; wanted {first}:{end})" if signals.number else ""
            seconds = renderer.opened()[0].seconds
            device = renderer.device.info.id
            print(f"raytide: samples {first}:{done} in {seconds:.2f} s on {device}{partial}", file=sys.stderr)
        print(path, flush=True)
    return signals.exit_code


def merge(
    shards: Annotated[list[Path], Parameter(help="files of `raytide render --samples A:B -o F.shard`, in any order")],
    /,
    *,
    output: Outputs = None,
    half: Half = False,
    exposure: Exposure = 0.0,
    no_clobber: NoClobber = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    log_json: LogJson = False,
) -> int:
    """Put SHARDS together and write the picture to every -o file, with its error.

    From shards of one device it is the picture of one render there, bit for bit. All samples must be there once: holes,
    overlaps, damaged files, and files of other scenes, settings or kernels are refused. Where only the last ones are
    missing, the picture is of those before, and a warning says so.
    """
    set_up_logging(quiet=quiet, verbose=verbose, as_json=log_json)
    if not output:
        raise UsageError("no output: give at least one -o FILE.exr or -o FILE.png")
    check_outputs(output, [], no_clobber)
    from raytide.render.film import LAYERS
    from raytide.render.shard import merge as merged

    film = merged(shards)
    for path in output:
        film.save(path, aovs=LAYERS, half=half, exposure=exposure, no_clobber=no_clobber)
    if not quiet:
        height, width = film.rgb.shape[:2]
        error = f"estimated {error_with_band(film.error.as_dict())}" if film.error else "error unknown"
        error += bias_words(film)
        print(f"raytide: {width}x{height}, {film.spp} spp of {len(shards)} shards, {error}", file=sys.stderr)
    print(*output, sep="\n", flush=True)
    check_health(film)
    return 0
