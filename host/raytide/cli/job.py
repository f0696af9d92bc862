"""What one render was asked for, in a form that a checkpoint keeps, so that `raytide resume` needs no more words."""

from __future__ import annotations

import os
import time
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raytide.cli.config import HostSetting, Settings
from raytide.errors import UsageError
from raytide.scene.layers import Layer

if TYPE_CHECKING:
    from raytide.render import Checkpoints


@dataclass
class Job:
    """What one render was asked for, and the seconds that the command itself spent."""

    scene: Path
    outputs: list[Path]
    report: Path | None
    trace: Path | None
    overrides: list[str]
    defines: dict[str, str]
    allow_outside: bool
    coherence: bool
    everything: bool
    traversal: str
    half: bool
    exposure: float
    no_clobber: bool
    quiet: bool
    log_json: bool
    checkpoint: Path | None = None
    every: float | None = None
    samples: str | None = None
    resumed: Path | None = None
    times: dict[str, float] = field(default_factory=dict)

    def timed(self, stage: str, begun: float) -> None:
        """Note a stage that began at `begun` (perf_counter) and ends now."""
        self.times[stage] = self.times.get(stage, 0.0) + time.perf_counter() - begun


# of one run, not of the render
OWN = ("quiet", "log_json", "checkpoint", "every", "samples", "resumed", "times", "no_clobber")
PATHS = ("scene", "report", "trace")


def notes_of(job: Job, settings: Settings) -> dict[str, Any]:
    """The job and all that was set around it, ready for JSON; paths hold from every folder."""
    row = {key: value for key, value in asdict(job).items() if key not in OWN}
    row |= {key: os.path.abspath(row[key]) for key in PATHS if row[key] is not None}
    row["outputs"] = [os.path.abspath(path) for path in job.outputs]
    return {
        "job": row,
        "layers": [[layer.name, layer.values] for layer in settings.layers],
        "host": {key: [setting.value, setting.origin] for key, setting in settings.host.items()},
    }


def job_of(notes: dict[str, Any], path: Path) -> tuple[Job, Settings]:
    """The job and settings that a checkpoint keeps. Raises UsageError for notes of another kind, as a script's are."""
    try:
        row = dict(notes["job"])
        row |= {key: Path(row[key]) for key in PATHS if row[key] is not None}
        row["outputs"] = [Path(output) for output in row["outputs"]]
        known = {one.name for one in fields(Job)} - set(OWN)
        if set(row) != known:
            raise KeyError(*sorted(set(row) ^ known))
        job = Job(**row, no_clobber=False, quiet=False, log_json=False, resumed=path)
        layers = [Layer(origin, values) for origin, values in notes["layers"]]
        host = {key: HostSetting(value, origin) for key, (value, origin) in notes["host"].items()}
    except (KeyError, TypeError, ValueError) as error:
        raise UsageError(
            f"{path}: came a checkpoint without the command that began it ({error}); wanted one by `raytide render "
            "--checkpoint`; a script goes on with Renderer.resume"
        ) from error
    return job, Settings(layers=layers, host=host)


def checkpoints_of(job: Job, settings: Settings) -> Checkpoints | None:
    """Where and how often the render keeps what it has."""
    if job.checkpoint is None:
        return None
    from raytide.render import Checkpoints

    return Checkpoints(job.checkpoint, job.every, notes_of(job, settings), goes_on=job.resumed == job.checkpoint)
