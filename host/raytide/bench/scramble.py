"""The same workload in disguise: triangles in another order, kernels under other names. Rates should not change.

Both are timed in turns, so that a machine that slows down slows both.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from raytide.bench.doubts import CLOSE
from raytide.bench.plan import Plan
from raytide.bench.workloads import Workload
from raytide.device import Device, open_device
from raytide.render import Renderer
from raytide.report.summary import ratio_of_medians
from raytide.scene import Scene

_MOST_TURNS = 40


def against_plain(device: Device, scene: Scene, workload: Workload, plan: Plan, spp: int, seed: int) -> dict[str, Any]:
    """Rates of `scene` on `device`, both disguised, over those of the workload as it is, with the 95 % interval of the
    ratio. `same` is False where the whole interval is further than 3 % from 1."""
    rates: tuple[list[float], list[float]] = ([], [])  # plain, disguised
    with tempfile.TemporaryDirectory(prefix="raytide-bench-") as folder, open_device(device.info) as plain_device:
        sides = [(workload.make(Path(folder), None), plain_device), (scene, device)]
        renderers = [Renderer(s, d, max_depth=workload.max_depth, size=plan.size, seed=seed) for s, d in sides]
        for turn in range(_MOST_TURNS + 1):
            for renderer, found in zip(renderers, rates, strict=True):
                rate = rate_of(renderer, spp, seed)
                if turn:  # the first warms up
                    found.append(rate)
            if turn >= plan.values and settled(*rates):
                break
        for renderer in renderers:
            renderer.close()
    ratio, low, high = ratio_of_medians(*rates)
    return {"ratio": ratio, "ci95": [low, high], "same": low <= 1 + CLOSE and high >= 1 - CLOSE,
            "plain_rays_per_s": rates[0], "disguised_rays_per_s": rates[1]}  # fmt: skip


def settled(plain: list[float], disguised: list[float]) -> bool:
    """Whether the interval of the ratio is narrow enough to tell 3 %."""
    _, low, high = ratio_of_medians(plain, disguised)
    return bool(np.isfinite(high)) and high - low <= CLOSE


def rate_of(renderer: Renderer, spp: int, seed: int) -> float:
    """Rays/s of one picture."""
    renderer.restart(seed)
    renderer.render(spp=spp)
    assert renderer.frame is not None
    return renderer.rays.total / max(renderer.frame.seconds, 1e-9)
