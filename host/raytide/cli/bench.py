"""`raytide bench`: measure a device. Reads no configuration file, so that equal commands mean equal work."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

Flag = Annotated[bool, Parameter(negative="")]


def bench(
    *,
    suite: Literal["rays"] = "rays",
    device: str | None = None,
    json: Path | None = None,
    quick: Flag = False,
    threads: int | None = None,
    traversal: str = "single",
) -> int:
    """Measure how fast a device works.

    Parameters
    ----------
    suite
        What to measure. rays: rays a second in three scenes, cost against scene size, brute force against the tree.
    device
        Part of a device id.
    json
        Write all figures, raw values included, to this file.
    quick
        Fewer rays and repetitions: under a minute instead of a few.
    threads
        Threads of a CPU device.
    traversal
        How rays are traced.
    """
    from raytide.cli.options import check_outputs
    from raytide.device import open_device
    from raytide.report.ray_suite import FULL, QUICK, run_suite

    check_outputs([], [json], no_clobber=False)
    with open_device(device, threads=threads) as opened:
        result = run_suite(opened, QUICK if quick else FULL, say, traversal)
    print(tables(result))
    if json:
        import json as text

        json.write_text(text.dumps(result, indent=1) + "\n", encoding="utf-8")
    return 0 if result["brute_force"]["same_bits"] else 1


def say(line: str) -> None:
    """One line for people."""
    print(f"raytide: {line}", file=sys.stderr, flush=True)


def tables(result: dict[str, Any]) -> str:
    """Everything for people to read."""
    device = result["device"]
    parts = [
        f"{device['id']}: {device['name']}, {device['platform']} {device['driver']}, {device['compute_units']} units",
        f"traversal {result['traversal']}, options {' '.join(device['options'])}",
        rates_table(result["scenes"]),
        scaling_table(result["scaling"]),
        force_table(result["brute_force"]),
    ]
    return "\n\n".join(parts)


def rates_table(scenes: dict[str, Any]) -> str:
    """Mrays/s of every scene and set."""
    head = ["SCENE", "TRIANGLES", "RAYS", "MRAYS/S", "+-", "DEVICE CLOCK", "PROCESSOR TIME", ""]
    rows = []
    for name, scene in scenes.items():
        if scene["status"] != "ok":
            rows.append([name, scene["status"], scene["reason"], "", "", "", "", ""])
            continue
        for rays, one in scene["sets"].items():
            rates = one["rays_per_s"]
            host = rates["host"]
            rows.append([name, str(scene["triangles"]), rays, mega(host["median"]), mega(host["mad"]),
                         mega(rates["device"]["median"]),
                         mega(rates["processor"]["median"]) if "processor" in rates else "",
                         "unstable" if host["unstable"] else ""])  # fmt: skip
    return aligned(head, rows)


def mega(value: float) -> str:
    """Millions with three digits or so."""
    return f"{value / 1e6:.{2 if value < 1e7 else 1}f}"


def scaling_table(scaling: dict[str, Any]) -> str:
    """Cost a ray against the number of triangles."""
    head = ["TERRAIN", "PRIMARY NS/RAY", "DIFFUSE NS/RAY", "BUILD S", "BYTES/TRIANGLE", "DEPTH"]
    rows = [
        [str(row["triangles"]), f"{row['primt_ns']:.1f}", f"{row['difft_ns']:.1f}", f"{row['build_s']:.3f}",
         f"{row['bytes_per_triangle']:.0f}", str(row["depth"])]
        for row in scaling["rows"]
    ]  # fmt: skip
    lines = [aligned(head, rows)]
    for name, fit in scaling["fits"].items():
        lines.append(f"{name}: {fit['ns_a_doubling']:+.1f} ns a doubling; grows like N^{fit['exponent']:.2f}")
    lines += [f"{one['triangles']} triangles left out: {one['reason']}" for one in scaling["skipped"]]
    return "\n".join(lines)


def force_table(force: dict[str, Any]) -> str:
    """Brute force against the tree."""
    head = ["TERRAIN", "BRUTE FORCE NS/RAY", "TREE NS/RAY", "TREE IS FASTER BY", "SAME BITS"]
    rows = [
        [str(row["triangles"]), f"{row['force_ns']:.1f}", f"{row['tree_ns']:.1f}",
         f"{row['force_ns'] / row['tree_ns']:.2f}", "yes" if row["same_bits"] else "NO"]
        for row in force["rows"]
    ]  # fmt: skip
    return aligned(head, rows)


def aligned(head: list[str], rows: list[list[str]]) -> str:
    """Columns: the first to the left, the others to the right."""
    table = [head, *rows]
    widths = [max(len(row[column]) for row in table) for column in range(len(head))]
    lines = []
    for row in table:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
