"""Errors and tables of compare_peers.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from raytide.image.metrics import relmse
from raytide.image.statistics import compare_means

EPSILON = 0.1  # of relMSE, in units of radiance: what keeps dark pixels from ruling it
TILE = 16  # pixels a side
SMALL = 1e-3  # relative differences of a picture's mean that count as agreement whatever their error


@dataclass(frozen=True)
class Reference:
    """Independent replicates (R, h, w, 3) of a long render."""

    pictures: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        return self.pictures.mean(axis=0, dtype=np.float64)

    @property
    def variance(self) -> np.ndarray:
        """Of the mean, by pixel and channel."""
        return self.pictures.var(axis=0, ddof=1, dtype=np.float64) / len(self.pictures)


def figures(result: dict[str, Any], pictures: dict[str, np.ndarray], reference: Reference) -> dict[str, Any]:
    """Errors at each time, efficiency of the longest (1 / (relMSE x seconds)), and agreement with the reference."""
    mean, variance = reference.mean, reference.variance
    times = []
    for row in result["times"]:
        each = [relmse(one, mean, EPSILON, variance).value for one in pictures[str(row["wanted_s"])]]
        times.append(row | {"relmse": float(np.mean(each)), "replicates": each})
    longest = times[-1]
    product = longest["relmse"] * longest["seconds"]
    return {
        "times": times,
        "efficiency": 1.0 / product if product > 0 else None,
        "agreement": agreement(pictures[str(longest["wanted_s"])], reference),
    }


def agreement(pictures: np.ndarray, reference: Reference) -> dict[str, Any]:
    """Whole means by channel against the reference's, and the root mean square difference of 16x16 tiles beside what
    noise explains of it, both over the mean."""
    ours = pictures.mean(axis=0, dtype=np.float64)
    of_ours = pictures.mean(axis=(1, 2), dtype=np.float64)
    own = of_ours.var(axis=0, ddof=1) / len(of_ours) if len(of_ours) > 1 else np.zeros(3)
    theirs = reference.pictures.mean(axis=(1, 2), dtype=np.float64)
    test = compare_means(of_ours.mean(axis=0), own, theirs.mean(axis=0), theirs.var(axis=0, ddof=1) / len(theirs))
    level = reference.mean.mean()
    difference = tiles(ours) - tiles(reference.mean)
    of_tiles = np.stack([tiles(one) for one in reference.pictures]).var(axis=0, ddof=1) / len(reference.pictures)
    of_tiles = of_tiles + np.stack([tiles(one) for one in pictures]).var(axis=0) / max(1, len(pictures) - 1)
    return {
        "mean_ratio": test.ratio.tolist(),
        "ratio_error": test.error.tolist(),
        "z": test.z.tolist(),
        "agrees": bool(((np.abs(test.z) <= 3.0) | (np.abs(test.ratio - 1.0) <= SMALL)).all()),
        "tile_difference": float(np.sqrt((difference**2).mean()) / level),
        "tile_noise": float(np.sqrt(of_tiles.mean()) / level),
    }


def tiles(picture: np.ndarray) -> np.ndarray:
    """Means of tiles; what is left over at the right and below is not looked at."""
    height, width = (side // TILE * TILE for side in picture.shape[:2])
    cut = picture[:height, :width].reshape(height // TILE, TILE, width // TILE, TILE, 3)
    return cut.mean(axis=(1, 3), dtype=np.float64)


def print_tables(result: dict[str, Any]) -> None:
    """Everything on stdout, as Markdown."""
    about, rows = result["about"], result["rows"]
    good = {(row["scene"], row["renderer"]): row for row in rows if "failed" not in row}
    renderers = list(dict.fromkeys(row["renderer"] for row in rows))
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    size = about["size"]
    print(f"{about['threads']} threads, {size}x{size}, reference {about['reference_spp']} samples a pixel")
    for name in renderers:
        label = next((row["label"] for row in rows if row["renderer"] == name and "label" in row), "failed")
        print(f"- {name}: {label}")

    def grid(title: str, cell: Callable[[dict[str, Any]], str]) -> None:
        print(f"\n{title}\n\n| scene | {' | '.join(renderers)} |\n|---|{'---|' * len(renderers)}")
        for scene in scenes:
            cells = [cell(good[scene, name]) if (scene, name) in good else "-" for name in renderers]
            print(f"| {scene} | {' | '.join(cells)} |")

    grid("M samples/s (least to most)", lambda row: f"{row['samples_per_s'] / 1e6:.2f} "
         f"({min(row['rates']) / 1e6:.2f}-{max(row['rates']) / 1e6:.2f})")  # fmt: skip
    for i, seconds in enumerate(about["seconds"]):
        grid(f"relMSE after {seconds:g} s of rendering", lambda row, i=i: f"{row['times'][i]['relmse']:.3g}")
    grid(f"Efficiency, 1 / (relMSE x seconds), at {about['seconds'][-1]:g} s",
         lambda row: f"{row['efficiency']:.3g}" if row["efficiency"] else "-")  # fmt: skip
    grid("Variance of one sample: relMSE x samples a pixel, at the longest time",
         lambda row: f"{row['times'][-1]['relmse'] * row['times'][-1]['spp']:.3g}")  # fmt: skip
    grid("First picture of 1 sample, cold / warm caches [s]",
         lambda row: f"{row['cold_first_picture_s']:.2f} / {row['first_picture_s']:.2f}")  # fmt: skip
    grid("Most memory, after the first picture / after all [MB]",
         lambda row: f"{row['first_mb']:.0f} / {row['peak_mb']:.0f}")  # fmt: skip
    grid("Mean against the reference, by channel; tiles' difference (noise explains)",
         lambda row: agrees(row["agreement"]))  # fmt: skip
    print_best(good, scenes)


def agrees(found: dict[str, Any]) -> str:
    ratios = " ".join(f"{ratio:.4f}" for ratio in found["mean_ratio"])
    word = "" if found["agrees"] else " DIFFERS"
    return f"{ratios}{word}; {100 * found['tile_difference']:.2f} % ({100 * found['tile_noise']:.2f} %)"


def print_best(good: dict[tuple[str, str], dict[str, Any]], scenes: list[str]) -> None:
    """raytide's efficiency over that of the best of the others."""
    print("\nraytide over the best of the others\n\n| scene | samples/s | relMSE | efficiency |\n|---|---|---|---|")
    for scene in scenes:
        others = [row for (where, name), row in good.items() if where == scene and name != "raytide"]
        ours = good.get((scene, "raytide"))
        if not ours or not others:
            continue
        rate = ours["samples_per_s"] / max(row["samples_per_s"] for row in others)
        errors = [ours["times"][i]["relmse"] / min(row["times"][i]["relmse"] for row in others)
                  for i in range(len(ours["times"]))]  # fmt: skip
        gain = (ours["efficiency"] or 0.0) / max(row["efficiency"] or 1e-30 for row in others)
        print(f"| {scene} | {rate:.2f} | {' / '.join(f'{error:.2f}' for error in errors)} | {gain:.2f} |")
