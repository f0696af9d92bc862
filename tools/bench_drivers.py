"""Runs the benchmark on three drivers of this machine's processor and keeps the results in results/.

    python3 tools/run.py python tools/bench_drivers.py [--suite quick] [--only NAME ...] [--folder results]

The embedded PoCL, a PoCL of the system (Debian's pocl-opencl-icd), and Intel's runtime (`raytide doctor
--enable-intel`). A driver that is not there is left out, and said to be. Exit code: the worst of the runs. Nothing else
should run beside.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DRIVERS = {"pocl-wheel": "pocl-3.0rc", "pocl-debian": "pocl-3.1", "intel": "intel"}  # name of the file: part of an id


def main() -> int:
    """Exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suite", default="quick")
    parser.add_argument("--only", nargs="*", default=[], choices=list(DRIVERS), metavar="NAME")
    parser.add_argument("--folder", type=Path, default=ROOT / "results")
    wanted = parser.parse_args()
    sys.path.insert(0, str(ROOT / "host"))
    from raytide.device import devices_in_child

    found = [one.id for one in devices_in_child()]
    codes = []
    for name in wanted.only or DRIVERS:
        device = next((one for one in found if DRIVERS[name] in one), None)
        if device is None:
            print(f"{name}: no device {DRIVERS[name]!r} here: left out", flush=True)
            continue
        file = wanted.folder / f"{name}{'' if wanted.suite == 'quick' else '-' + wanted.suite}.bench.json"
        words = ["bench", "--suite", wanted.suite, "--device", device, "-o", str(file)]
        environment = dict(os.environ, PYTHONPATH=str(ROOT / "host"))
        codes.append(subprocess.run([sys.executable, "-m", "raytide", *words], env=environment).returncode)
    return max(codes, default=3)


if __name__ == "__main__":
    sys.exit(main())
