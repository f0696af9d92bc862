"""`raytide doctor`: what works, what does not, and one command that mends each fault."""

from __future__ import annotations

import sys

from raytide.cli.parameters import Flag


def doctor(*, json: Flag = False, enable_intel: Flag = False) -> int:
    """Check drivers, devices and caches, and tell what mends them.

    Parameters
    ----------
    json
        Print the checks as JSON.
    enable_intel
        Make Intel's CPU runtime (package intel-opencl-rt) visible first.
    """
    if enable_intel:
        from raytide.device.intel import enable_intel as write_icd

        path = write_icd()
        print(f"wrote {path}; to undo it run: rm {path}", file=sys.stderr)
    from raytide.device.doctor import FAIL, OK, diagnose, intel_hint

    checks = diagnose([("exr", exr_round_trip)])
    if json:
        import json as text

        sound = all(check.state != FAIL for check in checks)
        print(text.dumps({"ok": sound, "checks": [check.as_dict() for check in checks]}, indent=2))
    else:
        for check in checks:
            print(f"[{check.state:>4}] {check.name}: {check.detail}")
            if check.fix:
                print(f"       run: {check.fix}")
        hint = intel_hint()
        if hint:
            print(f"       {hint}")
    if not any(check.state != FAIL for check in checks if check.name.startswith("device ")):
        return 3
    return 0 if all(check.state in (OK, "warn") for check in checks) else 1


def exr_round_trip() -> str:
    """Write a small EXR and read the same bits back. Raises ImageInvalid."""
    import tempfile
    from pathlib import Path

    import numpy as np

    from raytide.errors import ImageInvalid
    from raytide.image import read_exr, write_exr

    picture = np.linspace(0.0, 1e5, 12, dtype=np.float32).reshape(2, 2, 3)
    with tempfile.TemporaryDirectory(prefix="raytide-doctor-") as folder:
        path = Path(folder) / "check.exr"
        try:
            write_exr(path, {"beauty": picture})
            found = read_exr(path).layers["beauty"]
        except Exception as error:  # a broken OpenEXR raises anything
            raise ImageInvalid(f"a small EXR file cannot be written and read: {error}") from None
    if not np.array_equal(found, picture):
        raise ImageInvalid("a small EXR file comes back changed")
    return "a small file comes back bit for bit"
