"""Renders Mitsuba 3 scenes and tests them against the pictures that Mitsuba made of them.

    python tools/compare_mitsuba.py FOLDER ... [--samples 2e6] [--only WORD] [--device D] [--seed 0]

Each FOLDER is searched for NAME.xml with NAME_ref_rgb.exr and NAME_ref_rgb_var.exr beside it or in refs/ (NAME without
a last _path or _direct): mean, and variance of one sample, of 32000 samples a pixel (--reference-samples). Prints the
share of pixels that pass Mitsuba's own z-test (0.9975 is wanted) and the ratio of the mean luminances with its standard
error (3 are allowed), both with the reference's variance of one sample; exit code 1 where a scene fails. Colours beside
luminance are not tested so sharply: white in Mitsuba's published pictures is (1.0011, 0.9997, 0.9997), in Mitsuba 3.9.1
it is (1, 1, 1).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import raytide as rt
from raytide.errors import RaytideError
from raytide.image.exr import read_exr
from raytide.image.statistics import PASS_SHARE, MeanTest, picture_mean_test, pixel_test
from raytide.image.tone import RGB_TO_XYZ

ENDINGS = ("_path", "_direct")
REFERENCE_SAMPLES = 32000
MOST_ERRORS = 3.0  # combined standard errors between the means of two pictures


@dataclass(frozen=True)
class Reference:
    """A scene file and Mitsuba's picture of it: mean and variance of one sample, linear RGB (h, w, 3) float64."""

    name: str
    scene: Path
    mean: np.ndarray
    variance: np.ndarray


@dataclass(frozen=True)
class Verdict:
    """What the two tests say: share of pixels that pass, test of the mean luminances, samples a pixel, seconds."""

    share: float
    means: MeanTest
    spp: int
    seconds: float

    @property
    def passes(self) -> bool:
        return self.share >= PASS_SHARE and self.means.within(MOST_ERRORS)


def references(folder: Path) -> Iterator[Reference]:
    """Scenes below a folder that have a picture, by name."""
    for scene in sorted(folder.rglob("*.xml")):
        stem = scene.stem
        for ending in ENDINGS:
            stem = stem.removesuffix(ending)
        for place in (scene.parent, scene.parent / "refs"):
            mean = place / f"{stem}_ref_rgb.exr"
            if mean.exists():
                variance = read_exr(place / f"{stem}_ref_rgb_var.exr").rgb
                yield Reference(stem, scene, read_exr(mean).rgb.astype(float), variance.astype(float))


def compare(
    reference: Reference, samples: float, reference_samples: float, device: object = None, seed: int = 0
) -> Verdict:
    """Renders `samples` in all over the picture, and tests it. Raises RaytideError."""
    begun = time.perf_counter()
    height, width = reference.mean.shape[:2]
    spp = max(1, int(samples) // (height * width))
    scene = rt.load(reference.scene, allow_outside=True)
    with rt.Renderer(scene, device, spp=spp, seed=seed) as renderer:
        image = renderer.render().rgb.astype(float)
    mean, variance = reference.mean, reference.variance
    share = pixel_test(image, mean, variance, spp, reference_samples)
    luminance = RGB_TO_XYZ[1:2].T
    own = np.maximum(variance @ luminance, 0.0)
    means = picture_mean_test(image @ luminance, own / spp, mean @ luminance, own / reference_samples)
    return Verdict(share, means, spp, time.perf_counter() - begun)


def arguments(given: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--samples", type=float, default=2e6, help="in all over each picture (2e6, as Mitsuba's test)")
    parser.add_argument("--reference-samples", type=float, default=REFERENCE_SAMPLES, metavar="N")
    parser.add_argument("--only", default="", metavar="WORD", help="scenes whose name holds it")
    parser.add_argument("--device")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args(given)


def main(given: Sequence[str] | None = None) -> int:
    """Prints one row a scene; 1 where a scene fails, 2 where there is none."""
    options = arguments(given)
    found = [one for folder in options.folders for one in references(folder) if options.only in one.name]
    if not found:
        print("no scene with a picture of Mitsuba's there", file=sys.stderr)
        return 2
    print("| scene | spp | pixels that pass | ratio of mean luminances | standard error | z | s | |")
    print("|---|---|---|---|---|---|---|---|")
    failed = False
    for one in found:
        try:
            verdict = compare(one, options.samples, options.reference_samples, options.device, options.seed)
        except RaytideError as error:
            failed = True
            print(f"| {one.name} | | | | | | | {str(error).splitlines()[0]} |", flush=True)
            continue
        failed |= not verdict.passes
        means = verdict.means
        print(f"| {one.name} | {verdict.spp} | {verdict.share:.5f} | {means.ratio[0]:.5f} | {means.error[0]:.5f} | "
              f"{means.z[0]:.2f} | {verdict.seconds:.1f} | {'passes' if verdict.passes else 'FAILS'} |",
              flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
