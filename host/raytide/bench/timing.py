"""One workload's timed picture: how many samples make a value, the value itself, and what stands in the file."""

from __future__ import annotations

from typing import Any

import numpy as np

from raytide.bench.plan import Plan, Values, summary_of_kept
from raytide.bench.references import Reference
from raytide.bench.validity import Validity
from raytide.device import Device
from raytide.render import Renderer

SEED = 20261125  # of timed pictures
SCALE_DOUBT = 0.01  # relative: a timed picture's mean may differ from the reference's by this, beside its noise
MOST_SPP = 1 << 16


def shares_processor(device: Device) -> bool:
    """Whether other programs can take from the device what it computes with."""
    return device.info.type == "cpu"


def samples_for(renderer: Renderer, seconds: float) -> int:
    """Samples a pixel of a value that takes `seconds` or a little more."""
    spp = 1
    while True:
        renderer.restart(SEED)
        renderer.render(spp=spp)
        assert renderer.frame is not None
        spent = max(renderer.frame.seconds, 1e-9)
        if spent >= seconds or spp >= MOST_SPP:
            return spp
        growth = 2.0 if spent < seconds / 3 else 1.1 * seconds / spent
        spp = min(MOST_SPP, max(spp + 1, round(spp * growth)))


def chosen(renderer: Renderer) -> dict[str, str]:
    """Which variant of the traversal traces which kind of wave, as this visit's own trial found."""
    return {kind: row["runs"] for kind, row in renderer.trial.as_dict().items()}


def picture_again(renderer: Renderer, spp: int) -> float:
    """The same picture once more; gives its seconds by the device's clock."""
    renderer.restart(SEED)
    renderer.render(spp=spp)
    return renderer.frame.device_seconds if renderer.frame else 0.0


def check_timed(film: Any, reference: Reference, validity: Validity) -> None:
    """Whether what was timed is the picture that was verified: its mean, which does not depend on size."""
    mean = film.rgb.astype(np.float64).mean(axis=(0, 1))
    variance = film.variance.astype(np.float64).sum(axis=(0, 1)) / (film.rgb.shape[0] * film.rgb.shape[1]) ** 2
    noise = 6 * np.sqrt(np.nan_to_num(2 * variance, nan=np.inf) + reference.picture_variance / 256)
    ratio = mean / reference.picture
    validity.figures["timed_mean_ratio"] = ratio.tolist()
    if not bool((np.abs(mean - reference.picture) <= noise + SCALE_DOUBT * reference.picture).all()):
        shares = f"{ratio.min():.4f} to {ratio.max():.4f}"
        validity.reasons.append(f"the timed picture's mean is {shares} of the reference's")
    if lost := sum(film.health.values()):
        validity.reasons.append(f"{lost} samples of the timed picture were not finite or negative")


def timing_of(found: Values, renderer: Renderer, spp: int) -> dict[str, Any]:
    """The table `timing` of the result file."""
    assert renderer.frame is not None
    width, height = renderer.frame.size
    return {
        "clock": "perf_counter_ns",
        "work_per_value": {"rays": renderer.rays.total, "samples": spp * width * height, "spp": spp},
        "warmup_s": found.warmup_s, "values_s": found.values_s, "t_offset_s": found.offsets_s,
        "event_s": found.event_s, "event_gap_frac": gap(found), "others_frac": found.others_frac,
    }  # fmt: skip


def gap(found: Values) -> float:
    """Share of the host's time that the device's clock does not know of."""
    return 1 - sum(found.event_s) / max(sum(found.values_s), 1e-9)


def summary_of_render(found: Values, plan: Plan, work: dict[str, Any]) -> dict[str, Any]:
    """Rays/s, and samples/s by their median."""
    summary = summary_of_kept(work["rays"], found, plan, "rays")
    return {**summary, "samples_per_s": summary["median"] * work["samples"] / max(work["rays"], 1)}
