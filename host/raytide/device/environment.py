"""Folders and environment variables. What drivers read once must be set before the first platform is asked for."""

from __future__ import annotations

import logging
import operator
import os
from pathlib import Path
from types import ModuleType

from raytide.errors import DeviceError, UsageError

log = logging.getLogger("raytide.device")

_PREFIXES = ("POCL_", "PYOPENCL_", "OCL_", "OPENCL_", "CUDA_", "NEO_", "GPU_", "AMD_", "CL_", "RAYTIDE_", "RUSTICL_")
_CHANGES_CODE = ("POCL_EXTRA_BUILD_FLAGS", "POCL_WORK_GROUP", "POCL_VECTORIZER", "POCL_LLVM", "POCL_WILOOPS",
                 "POCL_FORCE", "POCL_FULL", "NEO_", "GPU_", "AMD_", "CL_CONFIG")  # fmt: skip
_POCL_THREADS = ("POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT")  # PoCL 3 obeys the first, later ones the other

_opened: ModuleType | None = None


def cache_dir() -> Path:
    """raytide's cache folder (it may not exist yet): RAYTIDE_CACHE_DIR, else the user's cache folder."""
    wanted = os.environ.get("RAYTIDE_CACHE_DIR")
    if wanted:
        return Path(wanted).expanduser()
    from platformdirs import user_cache_dir

    return Path(user_cache_dir("raytide"))


def driver_variables() -> dict[str, str]:
    """Every variable that is set and may change what drivers, loaders or caches do."""
    return {name: value for name, value in sorted(os.environ.items()) if name.startswith(_PREFIXES)}


def code_variables() -> dict[str, str]:
    """The variables that may change generated code: they belong to the key of every cached kernel."""
    return {name: value for name, value in driver_variables().items() if name.startswith(_CHANGES_CODE)}


def opencl(threads: int | None = None) -> ModuleType:
    """The pyopencl module, imported on first use after the environment is in order.

    `threads` limits PoCL's worker threads on the first call of the process, since PoCL reads it only once; it is
    checked on every call (see `checked_threads`).
    """
    global _opened
    threads = checked_threads(threads)
    if _opened is None:
        _prepare(threads)
        try:
            import pyopencl
        except ImportError as error:
            raise DeviceError(f"pyopencl cannot be imported ({error}); run: pip install 'pyopencl[pocl]'") from None
        _opened = pyopencl
    return _opened


def _prepare(threads: int | None) -> None:
    from raytide.device import rundir

    os.environ.setdefault("PYOPENCL_NO_CACHE", "1")  # its cache is not atomic and a stale lock stalls for a minute
    # One compilation serves every local and global size; speed measured equal, builds two to three times faster.
    os.environ.setdefault("POCL_WORK_GROUP_SPECIALIZATION", "0")
    limit = threads if threads is not None else _allowed_processors()
    if limit is not None:
        for name in _POCL_THREADS:
            if threads is not None:
                os.environ[name] = str(limit)
            else:
                os.environ.setdefault(name, str(limit))
    os.environ["POCL_CACHE_DIR"] = str(rundir.private_folder())


def checked_threads(threads: int | None) -> int | None:
    """`threads`, or with a warning the processors of this process where it asks for more of them: PoCL starts as many
    threads as it is told, and ends the process where the system refuses one. Raises UsageError for less than 1 and for
    what is no whole number."""
    if threads is None:
        return None
    try:
        count = operator.index(threads)
    except TypeError:
        count = 0
    if count < 1 or isinstance(threads, bool):
        raise UsageError(f"threads: came {threads!r}; wanted a whole number from 1 to {processors()}")
    if count > processors():
        log.warning("threads: came %d; this process has %d processors: going on with as many", count, processors())
    return min(count, processors())


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _allowed_processors() -> int | None:
    """Processors of this process where fewer than the machine has: PoCL counts them all."""
    return processors() if processors() < (os.cpu_count() or 1) else None
