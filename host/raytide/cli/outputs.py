"""What a render leaves behind: pictures, report, trace, and the last line for people."""

from __future__ import annotations

import json
import shlex
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from raytide.cli import COMMAND_WORDS
from raytide.cli.job import Job
from raytide.cli.progress_text import error_with_band
from raytide.cli.signals import SIGNALS, StopOnSignal
from raytide.errors import ImageInvalid

if TYPE_CHECKING:
    from raytide.render import Film, Renderer
    from raytide.scene.scene import Scene

TRACE = ("wall_s", "device_s", "spp", "rays", "relmse", "relmse_low", "relmse_high")
MOST_EXCLUDED = 1e-6  # share of samples that may be left out as non-finite or negative before the picture is invalid

MOST_ORIGINS = 4  # named in a message


def save(job: Job, film: Film) -> None:
    """Write every output file."""
    from raytide.render.film import LAYERS

    begun = time.perf_counter()
    for path in job.outputs:
        film.save(path, aovs=LAYERS, half=job.half, exposure=job.exposure, no_clobber=job.no_clobber)
    job.timed("write", begun)


def write_report(job: Job, renderer: Renderer) -> None:
    """The renderer's report with the command and its own times, as JSON."""
    from raytide.report.files import write_json

    assert job.report is not None
    report = renderer.report()
    tiles = renderer.film.tile_errors
    report["tiles"] = tiles.as_dict() if tiles else None
    report["times_s"] = {**job.times, **report.get("times_s", {})}
    if job.coherence:
        from raytide.render.coherence import measure_coherence

        report["coherence"] = measure_coherence(renderer)
    report["command"] = shlex.join(["raytide", *COMMAND_WORDS.get()])
    report["outputs"] = [str(path) for path in job.outputs]
    write_json(job.report, report, no_clobber=job.no_clobber)


def write_trace(job: Job, path: Path, renderer: Renderer) -> None:
    """The series of passes as CSV: a head, then a line a pass; a field that is not known is empty."""
    from raytide.report.files import write_text

    rows = renderer.report()["series"]
    lines = [",".join(TRACE), *(",".join(field_words(row[key]) for key in TRACE) for row in rows)]
    write_text(path, "\n".join(lines) + "\n", no_clobber=job.no_clobber)


def field_words(value: float | None) -> str:
    """A number of a CSV file."""
    return "" if value is None else repr(value)


def summary(scene: Scene, film: Film, signals: StopOnSignal, stopped_by: str | None, as_json: bool) -> str:
    """`raytide: 256x256, 64 spp in 3.21 s, 12.3 Mrays/s, estimated error 2.8 % (2.5-3.1 %), ended by spp on gpu/0`."""
    stats = film.stats
    if as_json:
        named = ("spp", "seconds", "rays", "mrays_per_s", "error", "device")
        row = {key: stats.get(key) for key in named} | {"size": scene.camera.size, "partial": bool(signals.number)}
        band = film.error.as_dict() if film.error else {}
        row |= {key: band.get(key) for key in ("error_low", "error_high")}
        row["bias"] = film.bias.as_dict() if film.bias else None
        return json.dumps({"event": "done"} | row | {"stopped_by": stopped_by})
    height, width = film.rgb.shape[:2]
    parts = [f"{width}x{height}", f"{film.spp} spp in {stats.get('seconds', 0.0):.2f} s"]
    parts.append(f"{stats.get('mrays_per_s', 0.0):.1f} Mrays/s")
    known = film.error
    told = f"estimated {error_with_band(known.as_dict())}" if known else "error unknown (4 spp and more tell it)"
    parts.append(f"{told}{bias_words(film)}")
    parts.append(f"ended by {stopped_by}")
    partial = f" (partial: {SIGNALS[signals.number]})" if signals.number else ""
    return f"raytide: {', '.join(parts)} on {stats.get('device', 'an unnamed device')}{partial}"


def bias_words(film: Film) -> str:
    """What to add to the estimated error of a picture that is biased; nothing for others."""
    return f" of noise alone, {film.bias}" if film.bias else ""


def check_health(film: Film) -> None:
    """Refuse to call a picture good when too many of its samples had to be left out. Raises ImageInvalid."""
    excluded = sum(film.health.values())
    total = excluded + int(film.samples.sum())
    if excluded > MOST_EXCLUDED * total:
        raise ImageInvalid(
            f"{excluded} of {total} samples were non-finite, negative or inside too many bodies and were left out; "
            f"the picture was written but must not be trusted (limit {MOST_EXCLUDED:.0e} of the samples)"
            f"{origin_words(film.faults)}"
        )


def origin_words(faults: Mapping[str, int]) -> str:
    """Where unsound values came from, the most frequent ones; empty where nothing is known."""
    most = sorted(faults.items(), key=lambda item: -item[1])[:MOST_ORIGINS]
    return f"; they come from {', '.join(f'{label} ({count})' for label, count in most)}" if most else ""
