"""What biases a picture on request, and how that is told: light that clamping cut away, and lobes that regularisation
widened (regularise.py).

What a bound cuts off a sample is a sample of another picture, the light that is missing. It goes through the film as
the picture's own samples do, so that both together are the picture without a bound, and blocks, shards, checkpoints and
adaptive numbers of samples count it alike: in the order of samples, without atomics.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from raytide.errors import Problem, SceneError, UsageError, few_of
from raytide.render.film_sums import Sums
from raytide.scene.flatten import FlatScene
from raytide.scene.settings import RenderSettings

CLAMPING = ("lost", "lost_share", "clamped_samples", "clamped_share")  # keys of Bias that clamping fills
WIDENING = ("widened", "sharp")  # and regularisation
LONGEST_REGULARISED = 2**15 - 1  # edges: paths keep one bit of their number for a mark (PATH_SCATTERED)
CUT = "cut_"  # before names of arrays that are of the light that is missing


@dataclass(frozen=True)
class Bias:
    """Why a picture is not what it would become with samples without end.

    Where it was `clamped`: light that clamping took, `lost`, radiance, mean over pixels and channels; `lost_share` of
    the light that there would be; `clamped_samples`, and their `clamped_share` of all. The first two err as the picture
    does. Where it was regularised: names of the materials that got wider, `widened`, and of those that stayed `sharp`
    though they are specular; what that adds or takes cannot be told from the picture.
    """

    lost: float = 0.0
    lost_share: float = 0.0
    clamped_samples: float = 0.0
    clamped_share: float = 0.0
    clamped: bool = True
    widened: tuple[str, ...] = ()
    sharp: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, object]:
        """Ready for JSON: the causes, and the figures of those."""
        causes = {"clamping": CLAMPING if self.clamped else (), "regularisation": WIDENING if self.widened else ()}
        told: dict[str, object] = {"cause": " and ".join(cause for cause, keys in causes.items() if keys)}
        return told | {key: getattr(self, key) for keys in causes.values() for key in keys}

    def __str__(self) -> str:
        """For people."""
        parts = []
        if self.clamped_samples != 0:
            parts.append(f"clamping took {percent(self.lost_share)} of the light "
                         f"({percent(self.clamped_share)} of the samples)")  # fmt: skip
        if self.widened:
            sharp = f"; {few_of(self.sharp)} stayed sharp" if self.sharp else ""
            parts.append(f"paths regularised ({few_of(self.widened)} widened{sharp})")
        return f"biased: {', '.join(parts)}" if parts else "biased by clamping, which took nothing so far"


def percent(share: float) -> str:
    """Two digits: 0.043 %."""
    return f"{float(f'{100 * share:.2g}'):g} %"


def bias_of(kept: Sums, cut: Sums | None, regularised: Mapping[str, Sequence[str]] | None) -> Bias | None:
    """The figures by the sums of a picture and of what it lost, and the names of what was `widened` and `sharp`; None
    where neither was asked for."""
    names: dict[str, Any] = {key: tuple(found) for key, found in (regularised or {}).items()}
    if cut is None:
        return Bias(clamped=False, **names) if names else None
    counts = np.maximum(kept.valid, 1).astype(np.float64)[..., None]
    lost, left = float((cut.wide / counts).mean()), float((kept.wide / counts).mean())
    samples = float(cut.hits.sum(dtype=np.float64))
    share = lost / (lost + left) if lost > 0 else 0.0
    return Bias(lost, share, samples, samples / max(int(kept.valid.sum()), 1), **names)


def told_bias(header: Mapping[str, object]) -> str | None:
    """What the header of an EXR file says of its bias, for people; None where there is none."""
    text = header.get("raytide.bias")
    if text is None:
        return None
    try:
        told = json.loads(str(text))
        causes = told["cause"].split(" and ")
        clamped, widens = "clamping" in causes, "regularisation" in causes
        figures: dict[str, Any] = {key: float(told[key]) for key in (CLAMPING if clamped else ())}
        figures |= {key: tuple(str(one) for one in told[key]) for key in (WIDENING if widens else ())}
        figures["clamped"] = clamped
        found = Bias(**figures)
        unknown = not set(causes) <= {"clamping", "regularisation"}
    except (ValueError, KeyError, TypeError, AttributeError):
        unknown = True
    if unknown:
        return f"biased, in words that this version does not know: {text}"
    return str(found) if found.clamped_samples != 0 or found.widened else None


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


def check_bias(flat: FlatScene) -> None:
    """Raises SceneError where samples cannot be clamped, or paths not be regularised."""
    render, integrator = flat.render, flat.render.integrator
    found = [Problem(f"render.{key}", f"{value:g} with integrator {integrator}", "integrator path")
             for key, value in _asked(render).items() if integrator != "path"]  # fmt: skip
    if render.regularise and integrator != "path":
        found.append(Problem("render.regularise", f"true with integrator {integrator}", "integrator path"))
    if render.regularise and render.caustics:
        found.append(Problem("render.regularise", "true with caustics", "one of them: light from the lamps meets what "
                             "is sharp"))  # fmt: skip
    if render.regularise and render.max_depth > LONGEST_REGULARISED:
        wanted = f"at most {LONGEST_REGULARISED} with regularise"
        found.append(Problem("render.max_depth", str(render.max_depth), wanted))
    if found:
        raise SceneError(found)


def refuse_biased(render: RenderSettings, what: str) -> None:
    """Raises UsageError where `what` would be biased."""
    asked = {key: f"{value:g}" for key, value in _asked(render).items()}
    for key, value in (asked | ({"regularise": "true"} if render.regularise else {})).items():
        wanted = "none" if key in asked else "false"
        raise UsageError(f"render.{key}: came {value} for {what}, which must not be biased; wanted {wanted}")


def without_bias(render: RenderSettings) -> None:
    """Takes all that biases pictures out of `render`."""
    render.clamp_direct = render.clamp_indirect = None
    render.regularise = False
