"""Whether a device shows what it should: the same samples, and no bias under a seed that nobody knew before.

The first test finds what is wrong in a few samples; the second cannot be met by stored pictures, nor by a driver that
knows the benchmark.
"""

from __future__ import annotations

import secrets
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from raytide.bench.references import REFERENCE_RUNS, RUN_SPP, SAME_SEED, SAME_SPP, TILE, Reference
from raytide.image import tile_means
from raytide.image.metrics import flip_mean
from raytide.image.statistics import normal_limit, sidak
from raytide.render import Renderer
from raytide.render.coherence import count_visits

ALPHA = 1e-3  # of a false alarm in one run of all six workloads
WORKLOADS_A_RUN = 6
RUNS = 16  # with seeds of their own
CLOSE = 1e-3  # relative: a pixel further off took another path
MOST_DIVERGED = 0.01  # share of pixels: paths fork where rounding decides
MOST_ENERGY = 1e-3  # relative, by channel
MOST_COUNTS = 1e-3  # relative, of rays by kind; of visits and hits by kind of wave
ROUNDING = 2e-6  # relative: constant regions differ by the last bits


@dataclass
class Validity:
    """Outcome of all tests of one workload; `reasons` is empty where it is valid."""

    figures: dict[str, Any] = field(default_factory=dict)
    reasons: list[str] = field(default_factory=list)
    image: np.ndarray | None = None  # the fixed samples, (h, w, 3) linear

    @property
    def passed(self) -> bool:
        return not self.reasons

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**self.figures, "passed": self.passed}


def verify(renderer: Renderer, reference: Reference, scrambled: bool = False) -> Validity:
    """All tests. The renderer's picture is lost. Triangles in another order have other samples, but the same means."""
    out = Validity()
    sound_arithmetic(renderer, out)
    if not scrambled:
        same_samples(renderer, reference, out)
    unbiased(renderer, reference, out)
    return out


def sound_arithmetic(renderer: Renderer, out: Validity) -> None:
    """What the start-up probe found of the device's arithmetic with the options of this run. Fast mathematics often
    shows nothing in a picture, but takes from every guard the power to stop what is not a number."""
    found = renderer.device.probes
    out.figures["arithmetic"] = {"nan_compares_false": found.nan_compares_false, "nan_bits": found.nan_bits,
                                 "contracted": found.contracted}  # fmt: skip
    if not found.nan_compares_false:
        out.reasons.append("comparisons with NaN are true: fast mathematics; guards do not hold")


def same_samples(renderer: Renderer, reference: Reference, out: Validity) -> None:
    """Fixed samples against the stored picture, in linear float32."""
    renderer.restart(SAME_SEED)
    film = renderer.render(spp=SAME_SPP)
    image, wanted = film.rgb.astype(np.float64), reference.image.astype(np.float64)
    floor = 0.01 * float(wanted.mean())
    relative = np.abs(image - wanted) / (np.abs(wanted) + floor)
    diverged = float(np.mean(~(relative.max(axis=-1) <= CLOSE)))  # NaN diverges
    energy = image.mean(axis=(0, 1)) / np.maximum(wanted.mean(axis=(0, 1)), 1e-30)
    lost = sum(film.health.values())
    out.image = film.rgb
    out.figures["same_samples"] = {
        "spp": SAME_SPP, "seed": SAME_SEED, "ref_sha256": reference.sha256,
        "relmse": float(np.mean((image - wanted) ** 2 / (wanted**2 + floor**2))),
        "p999_rel": float(np.quantile(relative, 0.999)), "diverged_frac": diverged, "energy_ratio": energy.tolist(),
        "lost_samples": lost, "flip_mean": flip_mean(image, wanted),
    }  # fmt: skip
    if not diverged <= MOST_DIVERGED:
        out.reasons.append(f"same samples: {diverged:.1%} of the pixels differ; {MOST_DIVERGED:.0%} may")
    if not bool((np.abs(energy - 1) <= MOST_ENERGY).all()):
        out.reasons.append(f"same samples: energy is {worst(energy):.4f} of the reference's; wanted 1 within 0.1 %")
    if lost:
        out.reasons.append(f"same samples: {lost} samples were not finite or negative")
    count_rays(renderer, reference, out)
    count_work(renderer, reference, out)


def count_rays(renderer: Renderer, reference: Reference, out: Validity) -> None:
    """Rays that were counted on the device against the reference's."""
    came = ray_counts(renderer)
    wanted = reference.rays
    off = max(abs(came[kind] - wanted[kind]) / max(wanted[kind], 1) for kind in wanted)
    out.figures["counters"] = {**came, "max_rel_diff": off}
    out.figures["counters_match"] = off <= MOST_COUNTS
    if not off <= MOST_COUNTS:
        out.reasons.append(f"same samples: counts of rays differ by {off:.2%}; 0.1 % may")


def count_work(renderer: Renderer, reference: Reference, out: Validity) -> None:
    """Nodes, leaves and hits of the fixed samples, counted by an instrumented build, against the reference's for this
    layout of the tree: it finds a tree that culls too little, and rays that were not traced."""
    layout = "compact" if renderer.features.compact else "wide"
    wanted = reference.visits.get(layout)
    if wanted is None:
        return
    renderer.restart(SAME_SEED)
    came = count_visits(renderer, SAME_SPP)
    total = {what: sum(one[what] for one in wanted.values()) for what in ("nodes", "leaves", "hits")}
    off = max(abs(came.get(wave, {}).get(what, 0) - number) / max(total[what], 1)
              for wave, one in wanted.items() for what, number in one.items())  # fmt: skip
    out.figures["work"] = {"layout": layout, **came, "max_rel_diff": off}
    if not off <= MOST_COUNTS:
        out.reasons.append(f"same samples: visits and hits of rays differ by {off:.2%}; 0.1 % may")


def ray_counts(renderer: Renderer) -> dict[str, int]:
    """Rays of the picture so far by kind."""
    rays = renderer.rays
    return {"primary": rays.primary, "reflection": int(rays.reflection.sum()), "shadow": int(rays.shadow.sum())}


def worst(ratio: np.ndarray) -> float:
    return float(ratio[np.argmax(np.abs(ratio - 1))])


def unbiased(renderer: Renderer, reference: Reference, out: Validity) -> None:
    """Means under new seeds against the converged ones. What fails is tried once more with four times the samples, and
    other seeds, before it counts."""
    seed = secrets.randbits(30)
    found = z_scores(renderer, reference, seed, RUNS)
    if not found["passed"]:
        first = found
        found = z_scores(renderer, reference, secrets.randbits(30), 4 * RUNS)
        found["tried_before"] = first
    out.figures["unbiased"] = found
    if not found["passed"]:
        out.reasons.append(
            f"new seeds: a mean is {max(found['max_abs_z'], found['picture_max_abs_z']):.1f} standard errors off; "
            f"{found['limit']:.1f} may be"
        )


def z_scores(renderer: Renderer, reference: Reference, seed: int, runs: int) -> dict[str, Any]:
    """The largest |z| over tiles and channels and of the whole picture, with their limits (Sidak's, for all workloads
    of a run together: half the level each)."""
    tiles, picture = means_of_runs(renderer, seed, runs)
    by_tile = scores_of_runs(tiles, reference.tiles, reference.tiles_variance)
    whole = scores_of_runs(picture, reference.picture, reference.picture_variance)
    limit = normal_limit(sidak(ALPHA / 2, by_tile.size * WORKLOADS_A_RUN))
    whole_limit = normal_limit(sidak(ALPHA / 2, whole.size * WORKLOADS_A_RUN))
    largest, largest_whole = float(np.abs(by_tile).max()), float(np.abs(whole).max())
    return {
        "seed": seed, "runs": runs, "spp": RUN_SPP, "tiles": by_tile[..., 0].size,
        "max_abs_z": finite(largest), "limit": limit,
        "picture_max_abs_z": finite(largest_whole), "picture_limit": whole_limit,
        "passed": bool(largest <= limit and largest_whole <= whole_limit),
    }  # fmt: skip


def scores_of_runs(came: np.ndarray, wanted: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """z of the means of runs (runs, ...) against means over REFERENCE_RUNS runs; `variance` is of one of these. Where
    the runs themselves vary more, theirs counts: one bright sample moves a mean by no more than it widens it."""
    own = np.maximum(came.var(axis=0, ddof=1), variance)
    return scores(came.mean(axis=0), wanted, own / len(came) + variance / REFERENCE_RUNS)


def scores(came: np.ndarray, wanted: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """z of a difference of means; what is not finite is infinitely far off."""
    difference = came - wanted
    z = difference / np.sqrt(variance + (ROUNDING * np.abs(wanted)) ** 2 + 1e-30)
    return np.where(np.isfinite(z), z, np.inf)


def finite(value: float) -> float:
    return value if np.isfinite(value) else 1e30  # JSON knows no infinity


def means_of_runs(renderer: Renderer, seed: int, runs: int) -> tuple[np.ndarray, np.ndarray]:
    """Means of tiles (runs, h/4, w/4, 3) and of the picture (runs, 3), one seed a run."""
    tiles, picture = [], []
    for run in range(runs):
        renderer.restart((seed + run) % 2**30)
        image = renderer.render(spp=RUN_SPP).rgb
        tiles.append(tile_means(image, TILE))
        picture.append(image.astype(np.float64).mean(axis=(0, 1)))
    return np.array(tiles), np.array(picture)
