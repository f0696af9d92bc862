"""One peer's own process: `python peer_child.py PEER FOLDER` writes which rays of FOLDER/rays.npz miss its mesh.

Needs numpy and the peer, and nothing of raytide, so that any Python may run it. The last line printed is the version.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np

Traced = tuple[np.ndarray, str]  # whether each ray missed, and the version


def embree(vertices: np.ndarray, faces: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> Traced:
    """Embree by embreex, with the flags that it sets."""
    from embreex.mesh_construction import TriangleMesh  # type: ignore[import-not-found]
    from embreex.rtcore_scene import EmbreeScene  # type: ignore[import-not-found]

    scene = EmbreeScene()
    mesh = TriangleMesh(scene, vertices, faces.astype(np.int32))  # kept alive beside its scene
    missed = scene.run(origin, direction) < 0
    del mesh
    return missed, version("embreex")


def mitsuba(vertices: np.ndarray, faces: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> Traced:
    """Mitsuba's llvm back end."""
    import mitsuba as mi  # type: ignore[import-not-found]

    mi.set_variant("llvm_ad_rgb")
    mesh = mi.Mesh("mesh", len(vertices), len(faces))
    values = mi.traverse(mesh)
    values["vertex_positions"], values["faces"] = vertices.ravel(), faces.astype(np.uint32).ravel()
    values.update()
    scene = mi.load_dict({"type": "scene", "mesh": mesh})
    found = scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(*origin.T), mi.Vector3f(*direction.T)))
    return ~np.array(found.is_valid()), version("mitsuba")


PEERS: dict[str, Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], Traced]] = {
    "embree": embree,
    "mitsuba": mitsuba,
}


def main(peer: str, folder: str) -> None:
    """Writes FOLDER/missed.npy, (n,) bool. ImportError where the peer is not installed."""
    rays = np.load(Path(folder) / "rays.npz")
    names = ("vertices", "faces", "origin", "direction")
    missed, found = PEERS[peer](*(np.ascontiguousarray(rays[name]) for name in names))
    np.save(Path(folder) / "missed.npy", np.asarray(missed, bool))
    print(found)


if __name__ == "__main__":
    main(*sys.argv[1:])
