"""What the workloads must show: pictures of fixed samples, and converged means of tiles with the spread of one run.

Kept in references.npz, made by tools/make_bench_references.py on the embedded PoCL; wanted again whenever scenes or the
numbers that pixels draw change.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

FILE = Path(__file__).with_name("references.npz")
SAME_SPP, SAME_SEED = 8, 20261122  # of the picture of fixed samples
RUN_SPP = 32  # of one run with a seed of its own
REFERENCE_RUNS = 256
TILE = 4  # pixels


@dataclass(frozen=True)
class Reference:
    """What one workload shows.

    `image` (h, w, 3) float32: fixed samples. `tiles` (h/4, w/4, 3): means over REFERENCE_RUNS runs of RUN_SPP samples,
    `tiles_variance` of one such run; `picture` and `picture_variance` (3,) the same of the whole picture. `rays` of the
    fixed samples by kind. `visits` of the same by layout of the tree ("wide", "compact") and by kind of wave:
    nodes, leaves, hits.
    """

    image: np.ndarray
    tiles: np.ndarray
    tiles_variance: np.ndarray
    picture: np.ndarray
    picture_variance: np.ndarray
    scene_sha256: str
    rays: dict[str, int]
    visits: dict[str, dict[str, dict[str, int]]]

    @property
    def sha256(self) -> str:
        """Of all that devices are held against."""
        sha = hashlib.sha256(json.dumps([self.scene_sha256, self.rays, self.visits], sort_keys=True).encode())
        for array in (self.image, self.tiles, self.tiles_variance, self.picture, self.picture_variance):
            sha.update(np.ascontiguousarray(array).tobytes())
        return sha.hexdigest()


ARRAYS = ("image", "tiles", "tiles_variance", "picture", "picture_variance")


@cache
def load_references() -> dict[str, Reference]:
    """Every workload's reference, by its id."""
    with np.load(FILE) as content:
        facts: dict[str, Any] = json.loads(bytes(content["facts"]).decode())
        return {
            name: Reference(**{part: content[f"{name}/{part}"] for part in ARRAYS}, **one)
            for name, one in facts["workloads"].items()
        }


def save_references(found: dict[str, Reference]) -> None:
    """Replace the file."""
    facts = {"workloads": {name: {"scene_sha256": one.scene_sha256, "rays": one.rays, "visits": one.visits}
                           for name, one in found.items()}}  # fmt: skip
    arrays = {f"{name}/{part}": getattr(one, part) for name, one in found.items() for part in ARRAYS}
    text = np.frombuffer(json.dumps(facts, sort_keys=True).encode(), np.uint8)
    np.savez_compressed(FILE, facts=text, **arrays)
