"""Whether renders know how wrong they are: many seeds, held against a converged reference.

Counted is how often the 95 % bands hold what they are about: the relMSE of a tile in that very picture, and of the
whole picture; and how the mean estimate compares with the mean error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytide.image.metrics import tile_means
from raytide.render import Film, Renderer
from raytide.report.convergence import Truth
from raytide.report.experiment import Plan

NOISELESS = 1e-10  # relMSE: below, only rounding is left
GOAL = (0.93, 0.97)


@dataclass(frozen=True)
class Verdict:
    """One scene at one number of samples. `coverage` of tiles with its standard error over seeds, None where there is
    no noise; `too_low`, `too_high`: shares of tiles whose band lies below or above their error; `width`: median of a
    tile's high / low."""

    scene: str
    spp: int
    seeds: int
    tiles: int
    relmse: float
    ratio: float | None
    coverage: float | None
    coverage_error: float
    too_low: float
    too_high: float
    width: float | None
    picture_coverage: float | None

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    @property
    def words(self) -> str:
        """`held`, or what is wrong."""
        if self.coverage is None:
            return "no noise"
        if self.coverage > GOAL[1]:
            return "cautious"
        if self.coverage >= GOAL[0]:
            return "as promised"
        return "too low" if self.too_low > self.too_high else "too high"


@dataclass
class Tally:
    """Counts of one scene at one number of samples."""

    held: list[float]  # share of tiles by seed
    low: list[float]
    high: list[float]
    widths: list[float]
    estimates: list[float]
    truths: list[float]
    pictures: list[bool]

    @classmethod
    def empty(cls) -> Tally:
        """Nothing counted."""
        return cls([], [], [], [], [], [], [])

    def add(self, film: Film, truth: Truth) -> None:
        """Hold one film against the truth."""
        known, tiles = film.error, film.tile_errors
        if known is None or tiles is None:
            raise ValueError("an audit needs 16 samples a pixel")
        real = relative_errors(film.rgb, truth)
        by_tile = tile_means(real, 8)
        counted = (by_tile > NOISELESS) | (tiles.relmse > NOISELESS)
        self.truths.append(float(real.mean()))
        self.estimates.append(known.relmse)
        self.pictures.append(known.low <= self.truths[-1] <= known.high)
        if counted.any():
            low, high = tiles.low[counted], tiles.high[counted]
            off = by_tile[counted]
            self.held.append(float(np.mean((low <= off) & (off <= high))))
            self.low.append(float(np.mean(high < off)))
            self.high.append(float(np.mean(off < low)))
            self.widths.append(float(np.median(high / np.maximum(low, 1e-300))))

    def verdict(self, scene: str, spp: int, tiles: int) -> Verdict:
        """What was counted, in figures."""
        true = float(np.mean(self.truths))
        noisy = bool(self.held) and true > NOISELESS
        mean = lambda values: float(np.mean(values)) if noisy else None  # noqa: E731
        error = float(np.std(self.held, ddof=1) / len(self.held) ** 0.5) if len(self.held) > 1 else float("nan")
        return Verdict(
            scene, spp, len(self.truths), tiles, true,
            float(np.mean(self.estimates)) / true if noisy else None, mean(self.held), error,
            mean(self.low) or 0.0, mean(self.high) or 0.0, float(np.median(self.widths)) if noisy else None,
            mean(self.pictures),
        )  # fmt: skip


def relative_errors(rgb: NDArray[np.float32], truth: Truth) -> NDArray[np.float64]:
    """Relative squared error of every pixel (h, w), the reference's own variance subtracted."""
    return (((rgb.astype(np.float64) - truth.rgb) ** 2 - truth.variance) * truth.weight).mean(axis=2)


def audit_scene(renderer: Renderer, plan: Plan, truth: Truth, stopped: Callable[[], bool],
                tell: Callable[[int], None] = lambda done: None) -> list[Verdict]:  # fmt: skip
    """Verdicts of one scene for each of the plan's budgets; where `stopped` ends it, of the seeds so far."""
    tallies = [Tally.empty() for _ in plan.budgets]
    for replicate in range(plan.replicates):
        for at, budget in enumerate(plan.budgets):
            if stopped():
                break
            assert budget.spp is not None
            renderer.restart(seed=plan.seed_of(replicate, at))
            film = renderer.render(budget.spp)
            if renderer.stopped_by != "interrupt":
                tallies[at].add(film, truth)
        tell(replicate + 1)
    tiles = int(np.prod([-(-side // 8) for side in truth.rgb.shape[:2]]))
    pairs = zip(plan.budgets, tallies, strict=True)
    return [tally.verdict(plan.name, budget.spp or 0, tiles) for budget, tally in pairs if tally.truths]
