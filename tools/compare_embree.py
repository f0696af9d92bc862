"""raytide's tracing against Embree's, ray for ray, in one process.

    PYTHONPATH=host python tools/compare_embree.py [--device ID] [--scenes blob,terrain,room] [--json FILE]

Needs `apt-get install libembree-dev g++`; the harness compiles itself. Both tracers get the same bytes of rays and run
in turn with as many threads; figures are medians of millions of rays a second, by processor time of this process over
the number of threads (which other load disturbs least) and by wall clock. Prints Markdown.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from compare_tables import print_tables
from embree_library import QUALITIES, EmbreeScene, hit_records, load_embree
from raytide.accel import build_tree, tree_sources
from raytide.accel.build import BUILDERS
from raytide.device import Device, open_device
from raytide.errors import RaytideError
from raytide.kernels.records import NONE
from raytide.report.ray_room import room_scene
from raytide.report.ray_scenes import RayScene, blob_scene, in_box, terrain_scene
from raytide.report.ray_sets import SETS, RaySet, make_ray_sets
from raytide.report.ray_tracer import TRAVERSALS, RayTracer, geometry_of

SCENES = {"blob": blob_scene, "terrain": terrain_scene, "room": room_scene}
WORLDS = {  # Embree's scenes: quality and robust mode
    "default": ("MEDIUM", False),
    "robust": ("MEDIUM", True),
    "high": ("HIGH", False),
    "high robust": ("HIGH", True),
}
T_TOLERANCE = 1e-4  # relative


@dataclass
class Contender:
    """Something that traces the rays of a set; rates in rays/s, one a repetition."""

    name: str
    run: Callable[[], object]
    by_processor: list[float] = field(default_factory=list)
    by_wall: list[float] = field(default_factory=list)

    def measure(self, rays: int, threads: int) -> None:
        wall, processor = time.perf_counter(), time.process_time()
        self.run()
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        self.by_wall.append(rays / wall)
        self.by_processor.append(rays / (processor / threads))

    def as_dict(self) -> dict[str, Any]:
        return {
            "processor": float(np.median(self.by_processor)),
            "wall": float(np.median(self.by_wall)),
            "by_processor": self.by_processor,
            "by_wall": self.by_wall,
        }


def main() -> int:
    """Exit code 0; 2 or 3 where Embree or a device is missing."""
    wanted = options()
    try:
        result = compare(wanted)
    except RaytideError as error:
        print(f"compare_embree: {error}", file=sys.stderr)
        return error.exit_code
    print_tables(result)
    if wanted.json:
        wanted.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return 0


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", help="part of a device id")
    parser.add_argument("--scenes", default="blob,terrain,room", help="names, by commas")
    parser.add_argument("--mesh", type=Path, help="a closed mesh that stands in for the blob, scaled to its height")
    parser.add_argument("--sets", default=",".join(SETS), help="names of ray sets, by commas")
    parser.add_argument("--traversal", default=TRAVERSALS[0], help=f"some of {', '.join(TRAVERSALS)}, by commas")
    parser.add_argument("--builder", default="sah", help="raytide's tree for the traces")
    parser.add_argument("--repeats", type=int, default=7, help="of each measurement")
    parser.add_argument("--size", type=int, default=1024, help="pixels along each side of the image that makes rays")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--no-builds", action="store_true", help="leave the builders out")
    parser.add_argument("--json", type=Path, help="write all figures to this file")
    return parser.parse_args()


def compare(wanted: argparse.Namespace) -> dict[str, Any]:
    """All figures, ready for JSON."""
    result: dict[str, Any] = {"schema": "raytide.compare-embree/1", "command": sys.argv, "threads": wanted.threads,
                              "size": wanted.size, "repeats": wanted.repeats, "builder": wanted.builder}
    result["load_before"] = os.getloadavg()
    result["machine"] = {"processor": processor_name(), "cpus": os.cpu_count(), "system": platform.platform()}
    result["scenes"] = {}
    with open_device(wanted.device, threads=wanted.threads) as device:
        library = load_embree()  # after the drivers: Intel's is not found once Embree has loaded an older TBB
        result["device"] = device.info.as_dict()
        for name in wanted.scenes.split(","):
            scene = scene_from_file(wanted.mesh) if wanted.mesh and name == "blob" else SCENES[name]()
            print(f"{scene.name}: {len(scene.triangles)} triangles", file=sys.stderr)
            result["scenes"][scene.name] = compare_scene(library, device, scene, wanted, result)
    result["load_after"] = os.getloadavg()
    return result


def compare_scene(library: Any, device: Device, scene: RayScene, wanted: argparse.Namespace, result: dict) -> dict:
    geometry = geometry_of(scene)
    tracers = {name: RayTracer(device, geometry, wanted.builder, name) for name in wanted.traversal.split(",")}
    first = next(iter(tracers.values()))
    worlds = {name: EmbreeScene(library, geometry.vertices, geometry.triangles, wanted.threads) for name in WORLDS}
    for name, world in worlds.items():
        world.build(*WORLDS[name])
        result["embree"] = world.version
    sets = make_ray_sets(scene, wanted.size, first.closest)
    found: dict[str, Any] = {"triangles": len(scene.triangles), "tree": vars(first.tree.stats), "sets": {}}
    for name in wanted.sets.split(","):
        print(f"  {name}", file=sys.stderr, flush=True)
        found["sets"][name] = compare_set(tracers, worlds, sets[name], wanted)
    if not wanted.no_builds:
        print("  builders", file=sys.stderr, flush=True)
        found["builds"] = compare_builds(device, geometry, worlds["default"], wanted)
    for world in worlds.values():
        world.close()
    return found


def compare_set(
    tracers: dict[str, RayTracer], worlds: dict[str, EmbreeScene], rays: RaySet, wanted: argparse.Namespace
) -> dict[str, Any]:
    """Every contender in turn, `repeats` times over, and whether the answers agree."""
    hits = hit_records(len(rays.rays))
    contenders = []
    for name, tracer in tracers.items():
        tracer.load(rays)
        contenders.append(Contender(f"raytide {name}", tracer.run))
    for name, world in worlds.items():
        for mode, (width, coherent) in modes(rays, name).items():
            contenders.append(Contender(f"{name} {mode}", embree_run(world, rays, hits, width, coherent)))
    for contender in contenders:
        contender.run()
    for _ in range(wanted.repeats):
        for contender in contenders:
            contender.measure(len(rays.rays), wanted.threads)
    agreement = {
        f"{tracer} with {world}": agree(tracers[tracer], worlds[world], rays, hits)
        for tracer in tracers
        for world in ("default", "robust")
    }
    return {"rates": {one.name: one.as_dict() for one in contenders}, "agreement": agreement}


def modes(rays: RaySet, world: str) -> dict[str, tuple[int, bool]]:
    """Ray width and coherent flag to measure; away from the default scene only what can be the fastest."""
    every = {"1": (1, False), "16": (16, False), "16 coherent": (16, True)}
    if world != "default":
        del every["16" if rays.name.startswith("prim") else "16 coherent"]
    return every


def embree_run(world: EmbreeScene, rays: RaySet, hits: np.ndarray, width: int, coherent: bool) -> Callable[[], object]:
    return lambda: world.trace(rays.rays, hits, width, rays.any_hit, coherent)


def agree(tracer: RayTracer, world: EmbreeScene, rays: RaySet, hits: np.ndarray) -> dict[str, float]:
    """Shares of rays on which the two disagree: whether anything is met, how far it is, and which triangle."""
    world.trace(rays.rays, hits, 1, rays.any_hit, False)
    if rays.any_hit:
        return {"hit": float(np.mean((hits["t"] < 0) != tracer.occluded()))}
    tracer.run()
    ours, theirs = tracer.hits(), hits
    both = (ours["prim"] != NONE) & (theirs["prim"] != NONE)
    far = np.abs(ours["t"] - theirs["t"]) > T_TOLERANCE * np.abs(theirs["t"])
    return {
        "hit": float(np.mean((ours["prim"] != NONE) != (theirs["prim"] != NONE))),
        "t": float(np.mean(both & far)),
        "prim": float(np.mean(both & (ours["prim"] != theirs["prim"]))),
    }


def compare_builds(device: Device, geometry: Any, world: EmbreeScene, wanted: argparse.Namespace) -> dict[str, Any]:
    """Seconds, by wall clock and by processor time over threads, and surface-area costs of all builders."""
    costs = {}
    runs: dict[str, Callable[[], object]] = {}
    for builder in (name for name in BUILDERS if name != "none"):
        costs[f"raytide {builder}"] = build_tree(geometry, builder, device).stats.sah_cost
        runs[f"raytide {builder}"] = raytide_build(device, geometry, builder)
    for quality in QUALITIES:
        costs[f"embree {quality}"] = world.cost(quality)
        runs[f"embree {quality}"] = embree_build(world, quality)
    contenders = [Contender(name, run) for name, run in runs.items()]
    for _ in range(max(3, wanted.repeats // 2)):
        for contender in contenders:
            contender.measure(1, wanted.threads)
    return {
        one.name: {
            "processor_s": 1 / float(np.median(one.by_processor)),
            "wall_s": 1 / float(np.median(one.by_wall)),
            "cost": costs[one.name],
        }
        for one in contenders
    }


def raytide_build(device: Device, geometry: Any, builder: str) -> Callable[[], object]:
    programs = device.build(tree_sources(geometry, builder))

    def build() -> None:
        build_tree(geometry, builder, device, programs=programs)
        device.finish()

    return build


def embree_build(world: EmbreeScene, quality: str) -> Callable[[], object]:
    return lambda: world.build(quality)


def scene_from_file(path: Path) -> RayScene:
    from raytide.importers.geometry import load_mesh

    mesh = load_mesh(path)
    vertices = np.asarray(mesh.vertices, np.float64)
    vertices = vertices * (1.6 / np.ptp(vertices[:, 1]))
    middle = (vertices.max(axis=0) + vertices.min(axis=0)) / 2
    middle[1] = vertices[:, 1].min()
    return in_box(path.stem, (vertices - middle, np.asarray(mesh.triangles, np.int64)))


def processor_name() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "")


if __name__ == "__main__":
    sys.exit(main())
