"""Small renders under Oclgrind, a simulator that reports invalid accesses and data races. Exit 1 on any finding.

Oclgrind runs as an OpenCL driver (its .icd is made here, so that it does not show up anywhere else). Kernels are
built without optimisation: Oclgrind 21.10 lacks some functions that LLVM's optimiser puts in. A kernel with a known
fault comes first, to see that faults are reported at all.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIBRARIES = ("/usr/lib", "/usr/lib/x86_64-linux-gnu", "/usr/local/lib")
# scene, further options
RENDERS = (
    ("cornell/cornell.toml", []),
    ("cornell/cornell.toml", ["--bvh", "none", "--integrator", "local"]),
    ("whitted/whitted.toml", []),
    ("materials/glossy.toml", []),
    ("blob/blob.toml", ["--bvh", "sah"]),
    ("blob/blob.toml", ["--bvh", "lbvh"]),
    ("blob/blob.toml", ["--bvh", "sah-hq"]),
)
FAULT = """
import numpy, pyopencl
device = pyopencl.get_platforms()[0].get_devices()[0]
assert "clgrind" in device.name
context = pyopencl.Context([device])
queue = pyopencl.CommandQueue(context)
program = pyopencl.Program(context, "kernel void f(global int *a) { a[get_global_id(0)] = 1; }").build()
program.f(queue, (5,), None, pyopencl.Buffer(context, pyopencl.mem_flags.READ_WRITE, 16))
queue.finish()
"""


def main() -> int:
    """Run the known fault, then every render."""
    library = next((path for base in LIBRARIES for path in Path(base).glob("oclgrind/liboclgrind-rt-icd.so")), None)
    if library is None:
        print("oclgrind: the driver library was not found", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        (work / "oclgrind.icd").write_text(f"{library}\n")
        if "Invalid write" not in findings(work, ["-c", FAULT]):
            print("oclgrind: a known fault was not reported", file=sys.stderr)
            return 1
        failed = [scene for scene, options in RENDERS if not clean(work, scene, options)]
    print(f"oclgrind: {len(RENDERS)} renders, {'0 errors' if not failed else 'FAILED: ' + ', '.join(failed)}")
    return 1 if failed else 0


def clean(work: Path, scene: str, options: list[str]) -> bool:
    """Render 8x8 and show what Oclgrind had to say."""
    begun = time.monotonic()
    picture = work / "picture.exr"
    picture.unlink(missing_ok=True)
    words = ["-P", "-m", "raytide", "render", str(ROOT / "scenes" / scene), "--size", "8x8", "--spp", "1", "--quiet"]
    said = findings(work, [*words, *options, "-o", str(picture)])
    good = not said and picture.exists()
    print(f"oclgrind: {scene} {' '.join(options)}: {'ok' if good else 'FAILED'}, {time.monotonic() - begun:.0f} s")
    if not good:
        print("\n".join(said.splitlines()[:40]))
    return good


def findings(work: Path, words: list[str]) -> str:
    """What Oclgrind reports while Python runs `words`; a failed or endless run is a finding too."""
    log = work / "log"
    log.unlink(missing_ok=True)
    settings = {
        "OCL_ICD_VENDORS": str(work / "oclgrind.icd"),
        "OCLGRIND_LOG": str(log),
        "OCLGRIND_DATA_RACES": "1",
        "OCLGRIND_BUILD_OPTIONS": "-cl-opt-disable -D__has_builtin(x)=0",
        "RAYTIDE_CACHE_DIR": str(work / "cache"),
        "RAYTIDE_BUILD_WORKERS": "1",  # its compiler is not safe for threads
    }
    try:
        ran = subprocess.run(
            [sys.executable, *words], env=os.environ | settings, cwd=work, capture_output=True, text=True, timeout=300
        )
    except subprocess.TimeoutExpired:
        return "no end within 300 s"
    said = log.read_text() if log.exists() else ""
    return said + (f"exit {ran.returncode}\n{ran.stderr}" if ran.returncode else "")


if __name__ == "__main__":
    sys.exit(main())
