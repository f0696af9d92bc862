#!/usr/bin/env python3
"""Device time of shading in closed rooms full of balls of 1, 4 or 12 kinds of material, beside other scenes.

    python3 tools/run.py python tools/measure_shading.py [--scenes kinds1,kinds4,kinds12,cornell,room] [--size 256]
        [--spp 4] [--repeats 5]

Prints a Markdown table of medians over renders: vertices (what camera rays and rays that scatter led to), seconds of
device time in `shade` and `partition`, and nanoseconds a vertex of both together; first with vertices shaded in the
order of the queue, then by the kind of their material (wave/wide_order.cl). The two take turns in one process. No path
leaves the rooms, nothing in them is shaded alone for its features, and their balls are triangles.
"""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import raytide as rt
from compare_peers_scenes import SCENES, box, globe, quads
from peer_adapter import scene_of
from raytide.device import open_device
from raytide.kernels import Features

MATERIALS = (
    rt.Diffuse((0.7, 0.5, 0.3)),
    rt.RoughConductor("gold", roughness=0.2),
    rt.Dielectric(1.5),
    rt.Plastic((0.6, 0.2, 0.2)),
    rt.Mirror(0.9),
    rt.Conductor("copper"),
    rt.Glossy((0.3, 0.5, 0.3)),
    rt.Principled(base_color=(0.5, 0.4, 0.7), roughness=0.4),
    rt.RoughDielectric(1.5, roughness=0.3),
    rt.RoughPlastic((0.2, 0.5, 0.6), roughness=0.3),
    rt.ThinDielectric(1.5),
    rt.ThinFilm(400.0, eta=(1.6, 0.9, 0.5), k=(9.2, 6.3, 4.8)),
)
ROOMS = {f"kinds{kinds}": kinds for kinds in (1, 4, 12)}


def balls(kinds: int, size: int, spp: int) -> rt.Scene:
    """A matte room with 5 x 5 x 4 balls of the first `kinds` of MATERIALS and a lamp in its ceiling."""
    scene = rt.Scene(
        rt.Camera(origin=(0.0, 2.0, 5.8), target=(0.0, 2.0, 0.0), fov=50, size=(size, size)),
        rt.RenderSettings(max_depth=12, roulette_start=0, spp=spp),
    )
    walls, faces = box((-6.0, 0.0, -6.0), (6.0, 6.0, 6.0))
    scene.add(rt.mesh(vertices=walls, faces=faces[:, ::-1]), rt.Diffuse(0.7), name="walls")
    lamp, sides = quads([(-2.0, 5.9, -2.0), (2.0, 5.9, -2.0), (2.0, 5.9, 2.0), (-2.0, 5.9, 2.0)])
    scene.add(rt.mesh(vertices=lamp, faces=sides), rt.Emit(8.0), name="lamp")
    places = [(2.0 * x - 4, 1.3 * y + 0.7, 2.0 * z - 5.0) for x in range(5) for y in range(4) for z in range(5)]
    order = np.random.default_rng(3).permutation(len(places))
    ball, sides = globe((0.0, 0.0, 0.0), 0.62, 3)
    for kind, material in enumerate(MATERIALS[:kinds]):
        here = [np.add(ball, places[i]) for i in order[kind::kinds]]
        several = np.concatenate([sides + len(ball) * i for i in range(len(here))])
        scene.add(rt.mesh(vertices=np.concatenate(here), faces=several), material, name=f"balls{kind}")
    return scene


def scene_named(name: str, size: int, spp: int) -> rt.Scene:
    """A room of ROOMS, or a scene of compare_peers.py."""
    if name in ROOMS:
        return balls(ROOMS[name], size, spp)
    return scene_of(rt, SCENES[name](None), size, size)


@contextmanager
def unsorted() -> Iterator[None]:
    """Kernels that are built meanwhile shade vertices in the order of the queue."""
    switches = Features.switches
    Features.switches = lambda self: switches(self) | {"several_materials": False}  # type: ignore[method-assign]
    try:
        yield
    finally:
        Features.switches = switches  # type: ignore[method-assign]


def measured(renderer: rt.Renderer, spp: int, seed: int) -> dict[str, float]:
    """Of one render: vertices, and seconds of device time of both kinds of launch."""
    renderer.restart(seed=seed)
    renderer.render(spp)
    rays, waves = renderer.rays, renderer.report()["waves"]
    return {"vertices": rays.primary + int(rays.reflection.sum()),
            **{wave: waves[wave]["s"] for wave in ("shade", "partition")}}  # fmt: skip


def main() -> int:
    """Exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=",".join((*ROOMS, "cornell", "room")), help=", ".join((*ROOMS, *SCENES)))
    parser.add_argument("--size", type=int, default=256, help="pixels a side")
    parser.add_argument("--spp", type=int, default=4)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--device", default="pocl")
    wanted = parser.parse_args()
    print("| scene | order | vertices | shade | partition | ns a vertex |")
    print("|---|---|---|---|---|---|")
    with open_device(wanted.device) as device:
        for name in wanted.scenes.split(","):
            scene = scene_named(name, wanted.size, wanted.spp)
            with ExitStack() as stack:
                with unsorted():
                    queue = stack.enter_context(rt.Renderer(scene, device=device))
                both = {"queue": queue, "kinds": stack.enter_context(rt.Renderer(scene, device=device))}
                rows = [{order: measured(renderer, wanted.spp, seed) for order, renderer in both.items()}
                        for seed in range(wanted.repeats + 1)][1:]  # fmt: skip
            for order in both:
                middle = {key: statistics.median(row[order][key] for row in rows) for key in rows[0][order]}
                each = 1e9 * (middle["shade"] + middle["partition"]) / middle["vertices"]
                print(f"| {name} | {order} | {middle['vertices']:.0f} | {middle['shade']:.4f} s "
                      f"| {middle['partition']:.4f} s | {each:.1f} |", flush=True)  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
