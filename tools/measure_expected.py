"""Render the shipped scenes and hold them against the numbers in their expected.toml.

    python tools/measure_expected.py [NAME ...] [--spp N] [--device ID]     compare; exit 4 if one is off
    python tools/measure_expected.py NAME ... --write --spp 1024 --seeds 16  measure and store mean and standard error

NAME is folder/scene (lights/point) or a folder; all scenes by default. An expected.toml holds, for each scene, checks:

    pixels = [x0, y0, x1, y1]     half open, row 0 on top; the whole picture if absent
    value = [r, g, b]             mean radiance over them
    relative, absolute            tolerance of a closed form: relative * value + absolute
    standard_error = [r, g, b]    of a measured value; then ERRORS combined standard errors are the tolerance
    source                        who measured it, with what settings

Values of another renderer (tools/mitsuba_reference.py) are worth more than our own: --write refuses to replace them.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

SCENES = Path(__file__).resolve().parents[1] / "scenes"
ERRORS = 4.0  # combined standard errors
OWN = "raytide"


@dataclass(frozen=True)
class Result:
    """One check of one scene: what came, what was expected, and by how much it may differ."""

    scene: str
    check: dict[str, Any]
    came: np.ndarray
    tolerance: np.ndarray

    @property
    def holds(self) -> bool:
        return bool((np.abs(self.came - self.check["value"]) <= self.tolerance).all())  # NaN does not

    def __str__(self) -> str:
        off = np.abs(self.came - self.check["value"]) / np.maximum(self.tolerance, 1e-30)
        words = self.check.get("why") or self.check.get("source", "")
        return (f"{'ok ' if self.holds else 'OFF'} {self.scene:28} {np.array2string(self.came, precision=6):34} "
                f"expected {np.array2string(np.asarray(self.check['value'], float), precision=6):34} "
                f"{off.max():5.2f} of tolerance  {words}")


def scene_names(wanted: list[str]) -> list[str]:
    """All `folder/scene` names that have checks, or those wanted. SystemExit for an unknown one."""
    known = [f"{path.parent.name}/{name}" for path in sorted(SCENES.glob("*/expected.toml"))
             for name in read_checks(path) if name != "format"]
    missing = [name for name in wanted if not any(k == name or k.startswith(name + "/") for k in known)]
    if missing:
        raise SystemExit(f"came {', '.join(missing)}; wanted some of {', '.join(known)}")
    return [k for k in known if not wanted or any(k == name or k.startswith(name + "/") for name in wanted)]


def read_checks(path: Path) -> dict[str, Any]:
    with open(path, "rb") as file:
        return tomllib.load(file)


def checks_of(name: str) -> list[dict[str, Any]]:
    """The checks of `folder/scene`."""
    folder, scene = name.split("/")
    return read_checks(SCENES / folder / "expected.toml")[scene]


def mean_over(image: np.ndarray, check: dict[str, Any]) -> np.ndarray:
    """Mean over the pixels of a check, float64 (..., 3), of pictures (..., h, w, 3)."""
    x0, y0, x1, y1 = check.get("pixels", (0, 0, image.shape[-2], image.shape[-3]))
    return image[..., y0:y1, x0:x1, :].mean(axis=(-3, -2), dtype=np.float64)


def pictures(name: str, device: Any, seeds: int, **settings: Any) -> np.ndarray:
    """Independent renders of a shipped scene, float32 (seeds, h, w, 3)."""
    import raytide as rt

    scene = rt.load(SCENES / f"{name}.toml")
    out = []
    for seed in range(1, seeds + 1):
        with rt.Renderer(scene, device=device, seed=seed, **settings) as renderer:
            out.append(renderer.render().rgb)
    return np.stack(out)


def results(name: str, device: Any, **settings: Any) -> Iterator[Result]:
    """Every check of `folder/scene`, rendered with its own settings unless overridden.

    Checks with a standard error need our own: it comes from four renders with different seeds.
    """
    checks = checks_of(name)
    seeds = 4 if any("standard_error" in check for check in checks) else 1
    images = pictures(name, device, seeds, **settings)
    for check in checks:
        means = mean_over(images, check)
        came, value = means.mean(axis=0), np.abs(np.asarray(check["value"], dtype=np.float64))
        tolerance = check.get("relative", 0.0) * value + check.get("absolute", 0.0)
        if "standard_error" in check:
            own = means.std(axis=0, ddof=1) / len(means) ** 0.5
            tolerance = tolerance + ERRORS * np.hypot(own, check["standard_error"])
        yield Result(name, check, came, np.broadcast_to(tolerance, 3))


def store(name: str, device: Any, seeds: int, **settings: Any) -> None:
    """Measure the checks of a scene that have a standard error, and write them back, comments kept."""
    import tomlkit

    import raytide as rt

    folder, scene = name.split("/")
    path = SCENES / folder / "expected.toml"
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    mine = [check for check in document[scene] if check.get("source", OWN).startswith(OWN)
            and "standard_error" in check]
    if not mine:
        print(f"{name}: nothing to measure: its numbers are closed forms or another renderer's")
        return
    images = pictures(name, device, seeds, **settings)
    for check in mine:
        write_measured(check, mean_over(images, check),
                       f"{OWN} {getattr(rt, '__version__', '')}, {seeds} seeds x {settings['spp']} spp")
    path.write_text(tomlkit.dumps(document), encoding="utf-8")
    print(f"{path}: {len(mine)} checks of {scene} measured")


def write_measured(check: Any, means: np.ndarray, source: str) -> None:
    """Put mean and standard error of replicates (n, 3) into a check."""
    check["value"] = [float(f"{v:.7g}") for v in means.mean(axis=0)]
    check["standard_error"] = [float(f"{v:.3g}") for v in means.std(axis=0, ddof=1) / len(means) ** 0.5]
    check["source"] = source


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--spp", type=int)
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--device")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    settings = {"spp": options.spp} if options.spp else {}
    if options.write and not (options.names and options.spp):
        parser.error("--write needs NAME and --spp")
    from raytide.device import open_device

    device = open_device(options.device)
    off = 0
    try:
        for name in scene_names(options.names):
            if options.write:
                store(name, device, options.seeds, **settings)
                continue
            for result in results(name, device, **settings):
                print(result, flush=True)
                off += not result.holds
    finally:
        device.close()
    return 4 if off else 0


if __name__ == "__main__":
    sys.exit(main())
