#!/usr/bin/env python3
"""Speed of whole renders, and what leaving out saves.

    python3 tools/run.py python tools/measure_speed.py [--size 256x256] [--spp 64] [--repeats 5] [--terrain 1000000]

Prints two Markdown tables. Every figure is the median of `repeats` renders; rates use the wall time of the render
alone, the first picture is timed from the start of the process, with the kernel cache warm and cold.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import raytide as rt

ROOT = Path(__file__).resolve().parents[1]
SCENES = {"cornell": "cornell/cornell.toml", "whitted": "whitted/whitted.toml", "terrain": "terrain/terrain.toml"}
WAVES = ("primary", "reflection[1]", "shadow[1]")


def terrain_overrides(triangles: int) -> list[str]:
    """Makes the large terrain beside the small one, once."""
    mesh = ROOT / "scenes/terrain" / f"terrain_{triangles}.ply"
    if not mesh.exists():
        subprocess.run([sys.executable, mesh.parent / "generate.py", str(triangles), mesh], check=True)
    return [f"objects.ground.mesh={mesh.name}"]


def renders(path: str, overrides: list[str], options: argparse.Namespace) -> dict[str, object]:
    """Medians over renders of one scene in one process."""
    width, height = (int(word) for word in options.size.split("x"))
    scene = rt.load(ROOT / "scenes" / path, overrides=overrides)
    with rt.Renderer(scene, size=(width, height), spp=options.spp) as renderer:
        reports = []
        for seed in range(options.repeats + 1):
            renderer.restart(seed=seed)
            renderer.render()
            reports.append(renderer.report())
        del reports[0]  # warm-up
    samples = width * height * options.spp

    def median(values: list[float]) -> float:
        return statistics.median(values)

    seconds = median([report["times_s"]["render"] for report in reports])
    rows: dict[str, object] = {
        "triangles": scene.flatten(share=False).triangles.shape[0],
        "samples_per_s": samples / seconds,
        "mrays_per_s": median([r["rays"]["total"] / r["times_s"]["render"] / 1e6 for r in reports]),
        "bvh_s": reports[0]["tree"]["build_s"],
    }
    for wave in WAVES:
        rows[wave] = median([report["waves"].get(wave, {}).get("mrays_per_s", 0.0) for report in reports])
    device = sum(row["s"] for row in reports[0]["waves"].values())
    rows["shade share"] = reports[0]["waves"]["shade"]["s"] / device
    return rows


def whole_commands(
    path: str, overrides: list[str], options: argparse.Namespace, more: list[str]
) -> dict[str, float]:
    """First picture of the command (process start to file written), cold and warm; the build's share; memory."""
    figures: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        words = [sys.executable, "-m", "raytide", "render", str(ROOT / "scenes" / path), "--size", options.size]
        words += ["--spp", "1", "--quiet", "-o", str(Path(folder) / "a.png"), "--report", str(report), *more]
        for change in overrides:
            words += ["--set", change]
        environment = os.environ | {"RAYTIDE_CACHE_DIR": folder + "/cache"}
        times = []
        for _ in range(options.repeats + 1):
            begun = time.perf_counter()
            subprocess.run(words, check=True, env=environment, stdout=subprocess.DEVNULL)
            times.append(time.perf_counter() - begun)
            if len(times) == 1:
                figures["cold build"] = json.loads(report.read_text())["times_s"]["kernels"]
        data = json.loads(report.read_text())
    figures |= {"cold": times[0], "warm": statistics.median(times[1:])}
    figures["device memory"] = data["memory"]["peak_device_bytes"] / 2**20
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="256x256")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--terrain", type=int, default=1_000_000)
    options = parser.parse_args()
    print(f"{rt.pick().id}, {options.size}, {options.spp} spp, medians of {options.repeats}\n")
    print("| scene | triangles | M samples/s | Mrays/s | primary | reflection[1] | shadow[1] | shading | tree |")
    print("|---|---|---|---|---|---|---|---|---|")
    changes = {name: terrain_overrides(options.terrain) if name == "terrain" else [] for name in SCENES}
    for name, path in SCENES.items():
        row = renders(path, changes[name], options)
        print(f"| {name} | {row['triangles']} | {row['samples_per_s'] / 1e6:.2f} | {row['mrays_per_s']:.1f} "  # type: ignore[operator]
              f"| {row['primary']:.1f} | {row['reflection[1]']:.1f} | {row['shadow[1]']:.1f} "
              f"| {100 * row['shade share']:.0f} % | {row['bvh_s']:.2f} s |", flush=True)  # type: ignore[operator]  # fmt: skip
    print("\n| scene | kernels | first picture, cold | of it building | warm | M samples/s | device memory |")
    print("|---|---|---|---|---|---|---|")
    width, height = (int(word) for word in options.size.split("x"))
    for name, path in SCENES.items():
        for label, more in (("what the scene needs", []), ("everything", ["--everything"])):
            row2 = whole_commands(path, changes[name], options, more)
            with rt.Renderer(rt.load(ROOT / "scenes" / path, overrides=changes[name]), size=(width, height),
                             spp=options.spp, everything=bool(more)) as renderer:  # fmt: skip
                rates = []
                for seed in range(options.repeats + 1):
                    renderer.restart(seed=seed)
                    renderer.render()
                    rates.append(width * height * options.spp / renderer.report()["times_s"]["render"] / 1e6)
            print(f"| {name} | {label} | {row2['cold']:.1f} s | {row2['cold build']:.1f} s | {row2['warm']:.2f} s "
                  f"| {statistics.median(rates[1:]):.2f} | {row2['device memory']:.0f} MiB |", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
