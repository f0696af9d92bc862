"""Deliberate faults of a device, which the benchmark must call invalid; and a slow device, which it must not.

    python3 tools/run.py python tools/bench_faults.py [--only WORD] [--device ID]

Each fault changes one place of the kernels as they are read (the files stay as they are) and runs one workload's
verification. Then one compute unit, at the lowest priority, must stay valid. Exit code 0 where all is as it must be,
else 4. About twenty seconds a fault.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Fault:
    """`find` in a file of cl/ becomes `put`; `workload` must show it. `options` are added to those of every build.
    `wide` is the same fault where eight vertices are shaded at once: file, find, put."""

    name: str
    workload: str
    file: str = ""
    find: str = ""
    put: str = ""
    options: tuple[str, ...] = ()
    wide: tuple[str, str, str] | None = None

    @property
    def places(self) -> list[tuple[str, str, str]]:
        """(file, find, put) of everything that it changes."""
        own = [(self.file, self.find, self.put)] if self.file else []
        return [*own, self.wide] if self.wide else own


FAULTS = (
    Fault("reflectance at glass a tenth too high", "spheres", "material/dielectric.cl", "u.z < reflectance;",
          "u.z < 1.1f * reflectance;"),
    Fault("last row of pixels lost", "spheres", "wave/film.cl", "y >= settings->height", "y + 1u >= settings->height"),
    Fault("fast mathematics", "terrain", options=("-cl-fast-relaxed-math",)),
    Fault("random numbers skewed", "cornell", "wave/shade.cl",
          "const float8 both = vertex_numbers(sampler, s->settings->joins, edge);",
          "const float8 both = 0.99f * vertex_numbers(sampler, s->settings->joins, edge);",
          wide=("base/sampler.cl", "return float8_of(as_int8(bits)) * 5.9604644775390625e-8f;",
                "return float8_of(as_int8(bits)) * 5.9e-8f;")),
    Fault("light sampling without its weight against chance", "cornell", "wave/vertex.cl",
          "const float weight = light.delta || shadows_alone(settings) ? 1.0f : power_heuristic(pdf, bsdf.pdf);",
          "const float weight = 1.0f;",
          wide=("wave/wide_light.cl", "light.delta != 0u ? (float8)(1.0f) : shared;", "(float8)(1.0f);")),
    Fault("survivors of Russian roulette not weighed", "cornell", "wave/roulette.cl",
          "*carried = *carried * (1.0f / survival);", "*carried = *carried * 1.0f;",
          wide=("wave/wide_shade.cl", "scale8(before, 1.0f / survival)", "before")),
    Fault("lamps of the tree picked as if all were alike", "lights", "light/tree.cl",
          "*probability = tree_probability(range);", "*probability = 1.0f / (float)lights.count;"),
    Fault("lamps of the table picked as if all were alike", "materials", "light/pick.cl",
          "*probability = lights.table[picked].position.w;", "*probability = 1.0f / (float)lights.count;",
          wide=("wave/wide_light.cl",
                "*probability = words.w;",
                "*probability = (float8)(1.0f / (float)lights.count);")),
    Fault("sun one per cent too strong", "terrain", "wave/wide_light.cl",
          "choose8(parallel, radiance, out->radiance);",
          "choose8(parallel, scale8(radiance, (float8)(1.01f)), out->radiance);"),
    Fault("triangles tested loosely: rays pass the edge of the last lane", "terrain", "accel/watertight.cl",
          "return sheared_met8(v, (float8)(limit), depth);",
          "return sheared_met8(v, (float8)(limit), depth) & 0x7fu;"),
    Fault("camera rays through one diagonal of each pixel", "spheres", "wave/wide_primary.cl",
          "at.y += radius * (2.0f * u.y - 1.0f);", "at.y += radius * (2.0f * u.x - 1.0f);"),
    Fault("masking of the viewer's side forgotten", "materials", "base/ggx.cl",
          "return 1.0f / (z + sqrt_of(z * z + alpha * alpha * ((1.0f - z) * (1.0f + z))));", "return 0.5f / z;"),
    Fault("pictures interpolated along one axis only", "textured", "texture/bitmap.cl",
          "y.high = t->height - 1u - up.high;", "y.high = y.low;"),
    Fault("every numbered sample drawn twice", "spheres", "wave/wide_primary.cl",
          "const uint8 sample = first_sample + traced / TILE;",
          "const uint8 sample = (first_sample + traced / TILE) & ~1u;"),
    Fault("what lies behind a hit is visited too", "terrain", "accel/traverse.cl",
          "while ((uint)(entry >> 32) > last) {", "while ((uint)(entry >> 32) > last && !last) {"),
)  # fmt: skip


def main() -> int:
    """Exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="faults whose name holds this word")
    parser.add_argument("--device", default=None, help="part of a device id")
    parser.add_argument("--alone", default=None, help=argparse.SUPPRESS)
    wanted = parser.parse_args()
    sys.path.insert(0, str(ROOT / "host"))
    if wanted.alone is not None:
        return slow_child(wanted.device) if wanted.alone == "slow" else fault_child(int(wanted.alone), wanted.device)
    rows = []
    for number, fault in enumerate(FAULTS):
        if wanted.only in fault.name:
            rows.append((fault.name, fault.workload, *run(str(number), wanted.device), "invalid"))
            print_row(rows[-1])
    if not wanted.only:
        rows.append(("one compute unit, lowest priority", "spheres", *run("slow", wanted.device), "ok"))
        print_row(rows[-1])
    right = sum(came == expected for _, _, came, _, _, expected in rows)
    print(f"\n{right} of {len(rows)} as they must be")
    return 0 if right == len(rows) else 4


def print_row(row: tuple[str, str, str, str, float, str]) -> None:
    name, workload, came, reason, seconds, expected = row
    mark = "" if came == expected else f"  <-- wanted {expected}"
    print(f"| {name} | {workload} | {came} | {reason} | {seconds:.0f} s |{mark}", flush=True)


def run(what: str, device: str | None) -> tuple[str, str, float]:
    """Status, reason and seconds of a fault in a process of its own."""
    command = [sys.executable, __file__, "--alone", what, *(["--device", device] if device else [])]
    begun = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        said = (done.stderr.strip().splitlines() or ["no words"])[-1]
        return "error", said, time.perf_counter() - begun
    status, _, reason = lines[-1].partition("\t")
    return status, reason, time.perf_counter() - begun


def fault_child(number: int, device: str | None) -> int:
    """Puts the fault in and verifies its workload."""
    from raytide.device import Device, pick
    from raytide.device.environment import opencl
    from raytide.kernels import source

    fault = FAULTS[number]
    read = source._read
    changed = {}
    for file, find, put in fault.places:
        text = read(file)
        assert text.count(find) == 1, f"{file}: found {text.count(find)} times: the fault is stale"
        changed[file] = text.replace(find, put)
    source._read = lambda name: changed.get(name) or read(name)  # type: ignore[assignment]
    with Device(opencl(), pick(*([device] if device else [])), options=fault.options) as opened:
        told(measured(opened, fault.workload))
    return 0


def measured(device: Any, workload: str) -> dict[str, Any]:
    from raytide.bench.plan import QUICK
    from raytide.bench.renders import measure_render

    plan = replace(QUICK, values=2, most_values=2, value_s=0.01, warmup_s=0.0, size=(80, 48))
    return measure_render(device, workload, plan, lambda line: None)


def told(found: dict[str, Any]) -> None:
    print(f"{found['status']}\t{found['reason'] or ''}")


def slow_child(device: str | None) -> int:
    """One compute unit at the lowest priority."""
    from raytide.device import open_device

    os.nice(19)
    with open_device(device, threads=1) as opened:
        told(measured(opened, "spheres"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
