"""Makes host/raytide/bench/references.npz: what the benchmark's workloads must show.

    python3 tools/run.py python tools/make_bench_references.py [--only NAME ...]

Needed after every change of a workload's scene, of the order of random numbers, or of what a surface shows. Refuses
where the converged means moved by more than their noise, unless --moved says that this is meant. About three minutes on
two cores.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))

from raytide.bench import references, validity  # noqa: E402
from raytide.bench.references import REFERENCE_RUNS, SAME_SEED, SAME_SPP, Reference  # noqa: E402
from raytide.bench.workloads import WORKLOADS, Workload  # noqa: E402
from raytide.device import Device, open_device  # noqa: E402
from raytide.image.statistics import normal_limit, sidak  # noqa: E402
from raytide.render import Renderer  # noqa: E402
from raytide.render.coherence import count_visits  # noqa: E402
from raytide.scene import Scene  # noqa: E402


def main() -> int:
    """Exit code: 1 where means moved and nobody said that they may."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], choices=list(WORKLOADS), metavar="NAME")
    parser.add_argument("--moved", action="store_true", help="the means are meant to have changed")
    parser.add_argument("--images", action="store_true", help="only the pictures of fixed samples; the means stay")
    parser.add_argument("--device", default="pocl")
    wanted = parser.parse_args()
    before = references.load_references() if references.FILE.exists() else {}
    found = dict(before)
    with open_device(wanted.device) as device:
        for name in wanted.only or WORKLOADS:
            found[name] = reference_of(WORKLOADS[name], device, before.get(name) if wanted.images else None)
            off = moved(before[name], found[name]) if name in before else 0.0
            print(f"{name}: means moved by {off:.2f} of what noise may", flush=True)
            if off > 1 and not wanted.moved:
                print("the picture itself changed: look at it, then give --moved", file=sys.stderr)
                return 1
    references.save_references({name: found[name] for name in WORKLOADS if name in found})
    return 0


def reference_of(workload: Workload, device: Device, means: Reference | None = None) -> Reference:
    """Rendered anew, but for the means where they are given."""
    with tempfile.TemporaryDirectory(prefix="raytide-bench-") as folder:
        scene = workload.make(Path(folder), None)
        with Renderer(scene, device, max_depth=workload.max_depth) as renderer:
            renderer.restart(SAME_SEED)
            image = renderer.render(spp=SAME_SPP).rgb
            rays = validity.ray_counts(renderer)
            sha256 = renderer.scene_sha256
            visits = visits_of(scene, workload, device)
            if means is not None:
                return replace(means, image=image.astype(np.float32), scene_sha256=sha256, rays=rays, visits=visits)
            tiles, picture = validity.means_of_runs(renderer, 1 << 28, REFERENCE_RUNS)
    return Reference(
        image.astype(np.float32), tiles.mean(axis=0), tiles.var(axis=0, ddof=1).astype(np.float32),
        picture.mean(axis=0), picture.var(axis=0, ddof=1), sha256, rays, visits,
    )  # fmt: skip


def visits_of(scene: Scene, workload: Workload, device: Device) -> dict[str, dict[str, dict[str, int]]]:
    """By layout of the tree: what the fixed samples visit and meet."""
    found = {}
    for layout in ("single", "compact"):
        with Renderer(scene, device, max_depth=workload.max_depth, traversal=layout, seed=SAME_SEED) as renderer:
            found["compact" if renderer.features.compact else "wide"] = count_visits(renderer, SAME_SPP)
    return found


def moved(old: Reference, new: Reference) -> float:
    """The largest |z| of a tile's mean over what noise allows."""
    if old.tiles.shape != new.tiles.shape:
        return float("inf")
    z = validity.scores(new.tiles, old.tiles, (old.tiles_variance + new.tiles_variance) / REFERENCE_RUNS)
    return float(np.abs(z).max() / normal_limit(sidak(1e-3, z.size)))


if __name__ == "__main__":
    sys.exit(main())
