"""The tables of compare_embree.py, from its JSON: `python tools/compare_tables.py FILE.json` prints them again."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from raytide.report.summary import geometric_mean

# ray set, what is compared with, goal
GOALS = (
    ("primt", "1", 3.0), ("primt", "best", 1.15), ("primt", "robust 1", 3.5),
    ("diff", "1", 1.2), ("diff", "best", 1.1), ("diff", "robust 1", 1.4),
    ("shadt", "1", 1.5), ("shadt", "best", 1.1), ("shadt", "robust 1", 1.7),
)  # fmt: skip
ROOM_GOALS = (("diff", "high 1", 1.1), ("diff", "robust 1", 1.3))
AGAINST = ("1", "best", "robust 1", "robust best", "high 1")
HIT_LIMIT, T_LIMIT = 2e-5, 5e-4  # shares of rays that may differ


def print_tables(result: dict[str, Any], clock: str = "processor") -> None:
    """Everything on stdout; `clock` is "processor" or "wall"."""
    device = result["device"]
    loads = [result[when][0] for when in ("load_before", "load_after")]
    print(f"raytide on {device['id']} ({device['name']}, {device['driver']}) against Embree {result['embree']}")
    print(f"{result['threads']} threads, medians of {result['repeats']}, load {loads[0]:.1f} to {loads[1]:.1f}\n")
    traversals = sorted({name for scene in result["scenes"].values() for one in scene["sets"].values()
                         for name in one["rates"] if name.startswith("raytide")})  # fmt: skip
    for traversal in traversals:
        rates_table(result, traversal, clock)
    print_goals(result, traversals, clock)
    print_agreement(result)
    print_builds(result)


def rates_table(result: dict[str, Any], traversal: str, clock: str) -> None:
    """Mrays/s and ratios of one traversal in every scene and set."""
    print(f"{traversal}, Mrays/s by {clock} time; ratios to Embree's modes (1 = rtcIntersect1 or rtcOccluded1)\n")
    head = ["scene", "rays", "raytide", "Embree 1", "16", "16 coherent", *(f"/ {name}" for name in AGAINST)]
    rows = []
    for name, scene in result["scenes"].items():
        for rays, one in scene["sets"].items():
            rates = {key: value[clock] / 1e6 for key, value in one["rates"].items()}
            ours = rates[traversal]
            embree = [rates[f"default {mode}"] for mode in ("1", "16", "16 coherent")]
            rows.append([name, rays, *(f"{x:.1f}" for x in (ours, *embree)),
                         *(f"{ratio(one, traversal, other, clock):.2f}" for other in AGAINST)])  # fmt: skip
    print_table(head, rows)


def ratio(one: dict[str, Any], traversal: str, other: str, clock: str) -> float:
    """A traversal's rate over that of a mode of Embree, such as "1", "best", "robust 1" or "high best"."""
    rates = {name: value[clock] for name, value in one["rates"].items()}
    world, _, mode = other.rpartition(" ")
    world = world or "default"
    if mode == "best":
        return rates[traversal] / max(rate for name, rate in rates.items() if name.startswith(f"{world} "))
    return rates[traversal] / rates[f"{world} {mode}"]


def print_goals(result: dict[str, Any], traversals: list[str], clock: str) -> None:
    """Geometric means over the scenes beside the goals."""
    print("Geometric means over scenes, and goals\n")
    rows = []
    for scenes, goals in ((list(result["scenes"]), GOALS), (["room"], ROOM_GOALS)):
        found = [result["scenes"][name]["sets"] for name in scenes if name in result["scenes"]]
        for rays, other, goal in goals:
            sets = [one[rays] for one in found if rays in one]
            ratios = [[ratio(one, name, other, clock) for name in traversals] for one in sets]
            if sets:
                means = [geometric_mean(list(column)) for column in zip(*ratios, strict=True)]
                means.append(geometric_mean([max(row) for row in ratios]))
                where = "all" if scenes != ["room"] else "room"
                rows.append([where, rays, f"Embree {other}", f">= {goal:.2f}", *(f"{mean:.2f}" for mean in means)])
    print_table(["scenes", "rays", "against", "goal", *traversals, "fastest in each scene"], rows)


def print_agreement(result: dict[str, Any]) -> None:
    """The largest shares of rays on which answers differ."""
    worst: dict[str, tuple[float, str]] = {}
    for name, scene in result["scenes"].items():
        for rays, one in scene["sets"].items():
            for pair, shares in one["agreement"].items():
                for what, share in shares.items():
                    worst[what] = max(worst.get(what, (0.0, "")), (share, f"{name} {rays}, {pair}"))
    limits = {"hit": HIT_LIMIT, "t": T_LIMIT}
    rows = [[what, f"{share:.1e}", f"{limits[what]:.0e}" if what in limits else "", where]
            for what, (share, where) in worst.items()]  # fmt: skip
    print("Shares of rays on which the answers differ, at most\n")
    print_table(["what", "share", "limit", "where"], rows)


def print_builds(result: dict[str, Any]) -> None:
    """Build times and surface-area costs."""
    rows = []
    for name, scene in result["scenes"].items():
        for builder, one in scene.get("builds", {}).items():
            rows.append([name, str(scene["triangles"]), builder, f"{one['wall_s']:.3f}", f"{one['processor_s']:.3f}",
                         f"{one['cost']:.3f}"])  # fmt: skip
    if rows:
        print("Builders: seconds, and surface-area cost for 8-wide nodes and leaves\n")
        print_table(["scene", "triangles", "builder", "wall s", "processor s / threads", "cost"], rows)


def print_table(head: list[str], rows: list[list[str]]) -> None:
    """One Markdown table."""
    for row in (head, ["---"] * len(head), *rows):
        print("| " + " | ".join(row) + " |")
    print()


if __name__ == "__main__":
    print_tables(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), *sys.argv[2:])
