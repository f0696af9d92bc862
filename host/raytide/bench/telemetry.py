"""Temperature, clock and power of the processor, where Linux lets a user read them; nothing from a data sheet."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

_SENSORS = ("coretemp", "k10temp", "zenpower", "cpu_thermal")
METHOD, SCOPE = "RAPL (powercap)", "processor packages, everything that ran on them"


class Telemetry:
    """One row a value: the hottest sensor [degrees C], the mean clock of all cores [MHz], and the mean power [W]."""

    def __init__(self, root: Path = Path("/sys")) -> None:
        self._temperatures = [file for folder in sorted(root.glob("class/hwmon/hwmon*"))
                              if _text(folder / "name") in _SENSORS for file in folder.glob("temp*_input")]  # fmt: skip
        self._clocks = sorted(root.glob("devices/system/cpu/cpu[0-9]*/cpufreq/scaling_cur_freq"))
        self._packages = [folder for folder in sorted(root.glob("class/powercap/*:*"))
                          if folder.name.count(":") == 1 and _text(folder / "name").startswith("package")]  # fmt: skip
        self._rows: dict[str, list[float]] = {"temp_c": [], "clock_mhz": [], "power_w": []}
        self.begin()

    def begin(self) -> None:
        """From now on."""
        self._energy, self._since = self._energies(), time.perf_counter()

    def end(self) -> None:
        """Adds a row of what can be read."""
        if found := _numbers(self._temperatures):
            self._rows["temp_c"].append(max(found) / 1e3)
        if found := _numbers(self._clocks):
            self._rows["clock_mhz"].append(sum(found) / len(found) / 1e3)
        before, now = self._energy, self._energies()
        if before and len(before) == len(now):
            spent = sum((b - a) % most for (a, most), (b, _) in zip(before, now, strict=True))
            self._rows["power_w"].append(spent / 1e6 / max(time.perf_counter() - self._since, 1e-9))

    def _energies(self) -> list[tuple[float, float]]:
        """Microjoules of each package, and where its counter begins anew; empty where one may not be read."""
        out = []
        for folder in self._packages:
            now, most = (_numbers([folder / name]) for name in ("energy_uj", "max_energy_range_uj"))
            if not now or not most or most[0] <= 0:
                return []
            out.append((now[0], most[0]))
        return out

    def as_dict(self) -> dict[str, Any]:
        """For JSON. Without power `method` and `scope` are null."""
        known = bool(self._rows["power_w"])
        return {**self._rows, "method": METHOD if known else None, "scope": SCOPE if known else None}


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return ""


def _numbers(paths: list[Path]) -> list[float]:
    """Those that can be read."""
    return [float(text) for path in paths if (text := _text(path)).lstrip("-").isdigit()]
