"""One renderer on one scene, for compare_peers.py: a process of its own, in that renderer's environment (numpy only).

    PYTHON tools/compare_peers_worker.py RENDERER PICTURE.npz RESULT.npz '{"job": ..., ...}'

Jobs: "start" = up to the first picture of one sample; "measure" = that, the rate, and pictures of each equal time;
"reference" = replicates of a given length. RESULT.npz holds the pictures; the last line printed is JSON.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import resource
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from compare_peers_scenes import PeerScene  # noqa: E402

RENDERERS = {  # module and class: __init__(threads), label, build(scene, w, h), whole(spp), render(spp, seed)
    "raytide": ("peer_adapter", "Raytide"),
    "mitsuba": ("compare_peers_mitsuba", "Mitsuba"),
    "mitsuba_mj": ("compare_peers_mitsuba", "MitsubaMultijitter"),
    "cycles": ("compare_peers_cycles", "Cycles"),
    "luxcore": ("compare_peers_luxcore", "LuxCore"),
}
LONG_S = 1.5  # of the longer of the two renders that give the rate


def peak_mb() -> float:
    """Most memory that this process has had."""
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return kilobytes / (2**20 if sys.platform == "darwin" else 1024)


def timed(call: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    begun = time.perf_counter()
    out = call(*arguments)
    return time.perf_counter() - begun, out


def start(name: str, scene: PeerScene, size: int, threads: int) -> tuple[Any, dict[str, Any]]:
    """The renderer after its first picture, and what that took."""
    own = peak_mb()
    module, kind = RENDERERS[name]
    load_s, peer = timed(lambda: getattr(importlib.import_module(module), kind)(threads))
    build_s, _ = timed(peer.build, scene, size, size)
    first_s, _ = timed(peer.render, 1, 0)
    facts = {"load_s": load_s, "build_s": build_s, "first_s": first_s, "first_picture_s": load_s + build_s + first_s}
    return peer, facts | {"label": peer.label, "own_mb": own, "first_mb": peak_mb() - own}


def rates(peer: Any, pixels: int, repeats: int) -> dict[str, Any]:
    """Samples a second from a long and a short render, so that what every render costs cancels. What the first
    longer render compiles must not pass for rendering: those that count would be far too short."""
    peer.render(peer.whole(2), 1)
    high, seconds = 2, timed(peer.render, peer.whole(2), 1)[0]
    while seconds < LONG_S:
        high = math.ceil(high * min(4.0, 1.2 * LONG_S / seconds))
        seconds, _ = timed(peer.render, peer.whole(high), 1)
    found, fixed = [], []
    for seed in range(repeats):
        (short, (_, few)), (long, (_, many)) = (
            timed(peer.render, peer.whole(max(1, n)), 2 + seed) for n in (high // 4, high))  # fmt: skip
        found.append((many - few) * pixels / (long - short))
        fixed.append(max(0.0, long - many * pixels / found[-1]))
    return {"samples_per_s": statistics.median(found), "rates": found, "render_call_s": statistics.median(fixed)}


def equal_times(peer: Any, pixels: int, rate: float, job: dict[str, Any]) -> tuple[list[dict], dict[str, np.ndarray]]:
    """Replicates of as many samples as each time allows: rows and pictures (replicates, h, w, 3)."""
    rows, pictures = [], {}
    for seconds in job["seconds"]:
        spp = peer.whole(max(1, int(seconds * rate / pixels)))
        made = [timed(peer.render, spp, 1000 * spp + seed) for seed in range(job["replicates"])]
        done = statistics.mean(spp for _, (_, spp) in made)
        rows.append({"wanted_s": seconds, "spp": done, "seconds": done * pixels / rate, "wall_s": [t for t, _ in made]})
        pictures[str(seconds)] = np.stack([picture for _, (picture, _) in made])
    return rows, pictures


def main(name: str, scene_file: str, out: str, options: str) -> None:
    job = json.loads(options)
    scene, size = PeerScene.load(Path(scene_file)), job["size"]
    peer, result = start(name, scene, size, job["threads"])
    if job["job"] == "measure":
        result |= rates(peer, size * size, job["repeats"])
        result["times"], pictures = equal_times(peer, size * size, result["samples_per_s"], job)
        np.savez(out, **pictures)
    elif job["job"] == "reference":
        seeds = range(1_000_000 + job["first"], 1_000_000 + job["first"] + job["count"])  # far from the measured ones
        made = [peer.render(job["spp"], seed)[0] for seed in seeds]
        np.savez(out, pictures=np.stack(made))
    result["peak_mb"] = peak_mb() - result["own_mb"]
    print("\n" + json.dumps(result), flush=True)
    os._exit(0)  # some of the renderers crash when Python ends


if __name__ == "__main__":
    main(*sys.argv[1:])
