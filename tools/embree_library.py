"""Embree 3 for comparisons: Debian's libembree-dev behind tools/embree_harness.cpp, compiled on the spot and kept.

    apt-get install libembree-dev g++
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import subprocess
from pathlib import Path

import numpy as np

from raytide.device import cache_dir
from raytide.errors import UsageError
from raytide.kernels.records import RECORDS

QUALITIES = {"LOW": 0, "MEDIUM": 1, "HIGH": 2}
_SOURCE = Path(__file__).with_name("embree_harness.cpp")
_COMMAND = ("g++", "-O3", "-march=native", "-std=c++17", "-shared", "-fPIC")
_INSTALL = "apt-get install libembree-dev g++"


class EmbreeScene:
    """One scene built by Embree. Vertices (V, 4) float32 and triangles (T, 4) uint32 stay with the caller's arrays."""

    def __init__(self, library: ctypes.CDLL, vertices: np.ndarray, triangles: np.ndarray, threads: int) -> None:
        self._library, self.threads = library, threads
        self._vertices, self._triangles = vertices, triangles
        self._world = ctypes.c_void_p()
        self._check(library.embree_open(threads, ctypes.byref(self._world)), "opening a device")
        number = library.embree_version(self._world)
        self.version = f"{number // 10000}.{number // 100 % 100}.{number % 100}"

    def _check(self, code: int, doing: str) -> None:
        if code:
            raise RuntimeError(f"Embree gave error {code} when {doing}")

    def build(self, quality: str = "MEDIUM", robust: bool = False) -> None:
        """Build, or build anew."""
        code = self._library.embree_build(
            self._world, _address(self._vertices), len(self._vertices), _address(self._triangles),
            len(self._triangles), QUALITIES[quality], int(robust),
        )  # fmt: skip
        self._check(code, "building")

    def trace(self, rays: np.ndarray, hits: np.ndarray, width: int, any_hit: bool, coherent: bool) -> None:
        """Trace records Ray (n,) into records Hit (n,); any hit writes only t, below 0 where something is met."""
        code = self._library.embree_trace(
            self._world, _address(rays), _address(hits), len(rays), width, int(any_hit), int(coherent), self.threads
        )
        self._check(code, "tracing")

    def cost(self, quality: str) -> float:
        """Surface-area cost, as in raytide's TreeStats, of Embree's builder told to make 8-wide nodes and leaves."""
        cost = ctypes.c_double()
        code = self._library.embree_cost(
            self._world, _address(self._vertices), _address(self._triangles), len(self._triangles),
            QUALITIES[quality], ctypes.byref(cost),
        )  # fmt: skip
        self._check(code, "building for the cost")
        return cost.value

    def close(self) -> None:
        """Let Embree's scene and device go."""
        self._library.embree_close(self._world)


def hit_records(count: int) -> np.ndarray:
    """Room for the results of `count` rays."""
    return np.zeros(count, RECORDS["Hit"].dtype)


def load_embree() -> ctypes.CDLL:
    """The harness, compiled if need be. Raises UsageError that names the command where something is missing."""
    path = _library_path()
    if not path.exists():
        _compile(path)
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        raise UsageError(f"Embree cannot be loaded ({error}); run: {_INSTALL}") from None
    pointer, size, number = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
    library.embree_open.argtypes = [number, pointer]
    library.embree_version.argtypes = library.embree_close.argtypes = [pointer]
    library.embree_build.argtypes = [pointer, pointer, size, pointer, size, number, number]
    library.embree_trace.argtypes = [pointer, pointer, pointer, size, number, number, number, number]
    library.embree_cost.argtypes = [pointer, pointer, pointer, size, number, pointer]
    library.embree_close.restype = None
    return library


def _address(array: np.ndarray) -> int:
    assert array.flags.c_contiguous, "Embree reads the array in place"
    return array.ctypes.data


def _library_path() -> Path:
    """In the cache folder, named by the source, the compiler and the processor that -march=native means."""
    try:
        compiler = subprocess.run([_COMMAND[0], "--version"], capture_output=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        raise UsageError(f"the harness needs a C++ compiler; run: {_INSTALL}") from None
    processor = Path("/proc/cpuinfo").read_text().split("\n\n")[0] if os.path.exists("/proc/cpuinfo") else ""
    flags = next((line for line in processor.splitlines() if line.startswith("flags")), "")
    key = hashlib.sha256(b"\0".join([_SOURCE.read_bytes(), compiler, flags.encode(), " ".join(_COMMAND).encode()]))
    return cache_dir() / "tools" / f"embree-{key.hexdigest()[:16]}.so"


def _compile(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    finished = path.with_suffix(f".{os.getpid()}")
    command = [*_COMMAND, str(_SOURCE), "-o", str(finished), "-lembree3"]
    made = subprocess.run(command, capture_output=True, text=True)
    if made.returncode:
        missing = "embree3/rtcore.h" in made.stderr or "-lembree3" in made.stderr
        raise UsageError(f"Embree is missing; run: {_INSTALL}" if missing else f"{' '.join(command)}\n{made.stderr}")
    os.replace(finished, path)
