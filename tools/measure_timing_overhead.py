"""What measuring device times costs a render: each workload of the benchmark with profiling events and without.

    python3 tools/run.py python tools/measure_timing_overhead.py [--device ID] [--turns 20] [--only NAME ...]

Both take turns. Prints with over without, with a 95 % bootstrap interval of the median of turns, for each workload and
for all together: seconds, and seconds of processor time, which other programs hardly disturb (of devices that are
processors, all the work is in them). Exit code 4 where a whole interval of all together is above 1.01. About half a
second a turn and workload; for the seconds, nothing else should run beside.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))

from raytide.bench.workloads import WORKLOADS  # noqa: E402
from raytide.device import Device, open_device  # noqa: E402
from raytide.device import device as device_module  # noqa: E402
from raytide.render import Renderer  # noqa: E402

MOST = 1.01
SIZE, VALUE_S = (320, 192), 0.25


class NoClock:
    """In the place of a device's clock: keeps nothing."""

    def add(self, label: str, event: Any) -> None:
        """Lets the event go."""

    def take(self) -> dict[str, tuple[int, float]]:
        """Nothing was kept."""
        return {}


def untimed(device: Device) -> Device:
    """The same device with a queue that profiles nothing."""
    found = Device(device._cl, device.info)
    found._queue = device._cl.CommandQueue(found._context)
    found._clock = NoClock()  # type: ignore[assignment]
    return found


def main() -> int:
    """Exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default=None, help="part of a device id")
    parser.add_argument("--turns", type=int, default=20)
    parser.add_argument("--only", nargs="*", default=[], choices=list(WORKLOADS), metavar="NAME")
    wanted = parser.parse_args()
    device_module.event_seconds = lambda event: 0.0  # first launches ask an event, which may know nothing
    ratios: list[np.ndarray] = []
    with open_device(wanted.device) as timed_device, untimed(timed_device) as untimed_device:
        for name in wanted.only or WORKLOADS:
            ratios.append(measured(name, (untimed_device, timed_device), wanted.turns))
            show(name, ratios[-1])
    return 4 if show("all", np.concatenate(ratios)) > MOST else 0


def show(name: str, ratios: np.ndarray) -> float:
    """Prints the ratios (turns, 2) of both kinds of seconds; gives the larger of the lower ends."""
    rng = np.random.default_rng(1)
    medians = np.median(ratios[rng.integers(0, len(ratios), (2000, len(ratios)))], axis=1)
    low, high = np.percentile(medians, (2.5, 97.5), axis=0)
    middle = np.median(ratios, axis=0)
    words = ("seconds", "processor")
    texts = [f"{word} {middle[k]:.4f} ({low[k]:.4f} to {high[k]:.4f})" for k, word in enumerate(words)]
    print(f"{name}: {', '.join(texts)}", flush=True)
    return float(low.max())


def measured(name: str, devices: tuple[Device, Device], turns: int) -> np.ndarray:
    """With over without (turns, 2): seconds, and processor time, of equal pictures. The first turn warms up and is
    dropped."""
    with tempfile.TemporaryDirectory(prefix="raytide-bench-") as folder:
        scene = WORKLOADS[name].make(Path(folder), None)
        depth = WORKLOADS[name].max_depth
        both = [Renderer(scene, one, max_depth=depth, size=SIZE, seed=1, traversal="single") for one in devices]
        spp, rows = 1, []
        while (spent := once(both[0], spp)[0]) < VALUE_S and spp < 1 << 14:
            spp = max(spp + 1, round(spp * min(2.0, 1.1 * VALUE_S / max(spent, 1e-6))))
        for turn in range(turns + 1):
            order = (0, 1) if turn % 2 else (1, 0)  # neither always comes first
            row = {place: once(both[place], spp) for place in order}
            rows.append(row[1] / np.maximum(row[0], 1e-9))
        for renderer in both:
            renderer.close()
    return np.array(rows[1:])


def once(renderer: Renderer, spp: int) -> np.ndarray:
    """Seconds, and seconds of processor time, of one picture."""
    begun, worked = time.perf_counter(), time.process_time()
    renderer.restart(1)
    renderer.render(spp=spp)
    return np.array([time.perf_counter() - begun, time.process_time() - worked])


if __name__ == "__main__":
    sys.exit(main())
