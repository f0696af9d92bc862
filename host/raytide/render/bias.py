"""What clamping cut away: its bounds on the device, and the figures that tell how wrong the picture is by it.

What a bound cuts off a sample is a sample of another picture, the light that is missing. It goes through the film as
the picture's own samples do, so that both together are the picture without a bound, and blocks, shards, checkpoints and
adaptive numbers of samples count it alike: in the order of samples, without atomics.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

import numpy as np

from raytide.errors import Problem, SceneError, UsageError
from raytide.render.film_sums import Sums
from raytide.scene.flatten import FlatScene
from raytide.scene.settings import RenderSettings

CUT = "cut_"  # before names of arrays that are of the light that is missing


@dataclass(frozen=True)
class Bias:
    """Light that clamping took: `lost`, radiance, mean over pixels and channels; `lost_share` of the light that there
    would be; `clamped_samples`, and their `clamped_share` of all. The first two err as the picture does."""

    lost: float
    lost_share: float
    clamped_samples: float
    clamped_share: float

    def as_dict(self) -> dict[str, object]:
        """Ready for JSON."""
        return {"cause": "clamping", **asdict(self)}

    def __str__(self) -> str:
        """For people."""
        if self.clamped_samples == 0:
            return "biased by clamping, which took nothing so far"
        return (f"biased: clamping took {percent(self.lost_share)} of the light "
                f"({percent(self.clamped_share)} of the samples)")  # fmt: skip


def percent(share: float) -> str:
    """Two digits: 0.043 %."""
    return f"{float(f'{100 * share:.2g}'):g} %"


def bias_of(kept: Sums, cut: Sums) -> Bias:
    """The figures by the sums of a picture and of what it lost."""
    counts = np.maximum(kept.valid, 1).astype(np.float64)[..., None]
    lost, left = float((cut.wide / counts).mean()), float((kept.wide / counts).mean())
    samples = float(cut.hits.sum(dtype=np.float64))
    return Bias(lost, lost / (lost + left) if lost > 0 else 0.0, samples, samples / max(int(kept.valid.sum()), 1))


def told_bias(header: Mapping[str, object]) -> str | None:
    """What the header of an EXR file says of light that was cut away, for people; None where nothing was."""
    text = header.get("raytide.bias")
    if text is None:
        return None
    try:
        told = json.loads(str(text))
        found = Bias(*(float(told[one.name]) for one in fields(Bias)))
    except (ValueError, KeyError, TypeError):
        return f"biased, in words that this version does not know: {text}"
    return str(found) if found.clamped_samples != 0 else None


def bounds_of(render: RenderSettings) -> tuple[np.float32, np.float32] | None:
    """The bounds as kernels take them, direct and indirect; None where there is none."""
    asked = _asked(render)
    if not asked:
        return None
    return np.float32(asked.get("clamp_direct", math.inf)), np.float32(asked.get("clamp_indirect", math.inf))


def _asked(render: RenderSettings) -> dict[str, float]:
    """The bounds that were asked for, by key."""
    given = {"clamp_direct": render.clamp_direct, "clamp_indirect": render.clamp_indirect}
    return {key: value for key, value in given.items() if value is not None}


def check_clamp(flat: FlatScene) -> None:
    """Raises SceneError where samples cannot be clamped."""
    integrator = flat.render.integrator
    for key, value in _asked(flat.render).items():
        if integrator != "path":
            raise SceneError([Problem(f"render.{key}", f"{value:g} with integrator {integrator}", "integrator path")])


def refuse_clamped(render: RenderSettings, what: str) -> None:
    """Raises UsageError where `what` would be biased."""
    for key, value in _asked(render).items():
        raise UsageError(f"render.{key}: came {value:g} for {what}, which must not be biased; wanted none")
