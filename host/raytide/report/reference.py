"""References: slices with seeds of their own, so that the variance of every pixel is known without any assumption.

Each slice is a whole render. Sums over slices, in float64, lie beside the picture and grow until there are enough: a
run that was interrupted goes on, and a reference can be made better later.
"""

from __future__ import annotations

import json
import logging
import os
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raytide
from raytide.errors import ImageInvalid, UsageError
from raytide.image import capture_date, read_exr, replacing, write_exr
from raytide.render import Renderer
from raytide.render.bias import told_bias
from raytide.report.convergence import Truth

FIRST_SEED = 2**31  # seeds of references; others stay below
STATE_FORMAT = 1

_log = logging.getLogger(__name__)


@dataclass
class Slices:
    """Sums over finished slices: means (h, w, 3) float64 and sums of squared deviations; what they belong to."""

    identity: dict[str, Any]
    count: int
    mean: NDArray[np.float64]
    squares: NDArray[np.float64]
    seconds: float = 0.0
    makers: list[dict[str, Any]] = field(default_factory=list)  # who rendered how many `slices`, in turn

    def credit(self, maker: dict[str, Any]) -> None:
        """One slice more is of this maker."""
        if not self.makers or {**self.makers[-1], "slices": 0} != {**maker, "slices": 0}:
            self.makers.append({**maker, "slices": 0})
        self.makers[-1]["slices"] += 1

    def other_kernels(self, maker: dict[str, Any]) -> list[str]:
        """Names of kernels that slices so far were made with in another form."""
        own = maker["kernels_sha256"]
        return sorted({name for one in self.makers for name, sha in one["kernels_sha256"].items()
                       if own.get(name, sha) != sha})  # fmt: skip

    def add(self, rgb: NDArray[np.float32], seconds: float) -> None:
        """One slice more."""
        self.count += 1
        step = rgb - self.mean
        self.mean += step / self.count
        self.squares += step * (rgb - self.mean)
        self.seconds += seconds

    @property
    def variance(self) -> NDArray[np.float64]:
        """Of the mean of all slices, each pixel's own (h, w, 3); NaN for a single slice."""
        if self.count < 2:
            return np.full_like(self.mean, np.nan)
        return self.squares / (self.count * (self.count - 1))

    def truth(self, name: str) -> Truth:
        """As a reference for errors."""
        return Truth(self.mean, np.nan_to_num(self.variance), name)


def state_path(path: Path) -> Path:
    """Where the sums lie: beside the picture."""
    return path.with_suffix(".slices.npz")


def identity_of(renderer: Renderer, spp: int) -> dict[str, Any]:
    """What all slices of a reference must share: the scene's content, its settings but seed, samples of a slice."""
    render = renderer.flat.render.model_dump(mode="json", exclude={"seed", "spp", "time", "error", "bvh"})
    return {"format": STATE_FORMAT, "scene_sha256": renderer.scene_sha256, "render": render,
            "size": list(renderer.flat.camera.size), "spp_of_a_slice": spp}  # fmt: skip


def make_reference(renderer: Renderer, path: Path, spp: int, slices: int, stopped: Callable[[], bool] = lambda: False,
                   tell: Callable[[Slices], None] = lambda done: None) -> Slices:  # fmt: skip
    """Renders what is missing of `slices` slices of `spp` samples a pixel and writes `path` after each; what `stopped`
    interrupted is dropped. UsageError where the sums beside `path` belong to another scene or to other settings."""
    identity = identity_of(renderer, spp)
    found = read_state(path)
    if found is not None and found.identity != identity:
        differ = sorted(key for key in identity if found.identity.get(key) != identity[key])
        raise UsageError(f"{state_path(path)}: belongs to another reference ({', '.join(differ)} differ); wanted one "
                         "of this scene and these settings: name another file, or remove it")  # fmt: skip
    maker = maker_of(renderer)
    if found and found.count < slices and (names := found.other_kernels(maker)):
        _log.warning("%s: holds slices of other kernels (%s) than today's; it goes on, which is right unless those "
                     "were wrong: remove it to begin anew", state_path(path), ", ".join(names))  # fmt: skip
    width, height = renderer.flat.window[2:]
    empty = np.zeros((height, width, 3))
    done = found or Slices(identity, 0, empty, empty.copy())
    while done.count < slices and not stopped():
        begun = time.perf_counter()
        renderer.restart(seed=FIRST_SEED + done.count)
        film = renderer.render(spp)
        if renderer.stopped_by == "interrupt" or stopped():
            break
        if not np.isfinite(film.rgb).all():
            raise ImageInvalid(f"{path}: slice {done.count} has pixels that are not finite; no reference can be made")
        done.add(film.rgb, time.perf_counter() - begun)
        done.credit(maker)
        write_state(path, done)
        tell(done)
    if done.count:
        write_picture(path, done, renderer)
    return done


def maker_of(renderer: Renderer) -> dict[str, Any]:
    """Who renders: for the provenance of slices."""
    return {"version": raytide.__version__, "device": renderer.device.info.id, "driver": renderer.device.info.driver,
            "kernels_sha256": {name: source.sha256 for name, source in renderer.sources.items()}}  # fmt: skip


def write_state(path: Path, done: Slices) -> None:
    """The sums, so that a later run goes on. The old file stays until the new one is complete."""
    with replacing(state_path(path)) as file:
        np.savez(file, identity=json.dumps(done.identity), count=done.count, mean=done.mean, squares=done.squares,
                 seconds=done.seconds, makers=json.dumps(done.makers))  # fmt: skip


def read_state(path: Path) -> Slices | None:
    """The sums beside `path`, or None where there are none. UsageError for a damaged file."""
    place = state_path(path)
    if not place.exists():
        return None
    try:
        with np.load(place, allow_pickle=False) as kept:
            identity = json.loads(str(kept["identity"]))
            mean, squares = kept["mean"], kept["squares"]
            if not isinstance(identity, dict) or mean.shape != squares.shape or mean.ndim != 3:
                raise ValueError("its arrays do not fit")
            makers = json.loads(str(kept["makers"])) if "makers" in kept else []  # older files know none
            return Slices(identity, int(kept["count"]), mean, squares, float(kept["seconds"]), makers)
    except Exception as error:  # zip, pickle and JSON each raise their own
        what = f"{place}: cannot be read as slices of a reference ({error}); remove it to begin anew"
        raise UsageError(what) from None


def write_picture(path: Path, done: Slices, renderer: Renderer) -> None:
    """The mean and its variance, with provenance, as EXR."""
    from raytide.render.provenance import provenance_of

    truth = done.truth(str(path))
    header = provenance_of(renderer)
    own = dict(header["raytide"])
    own |= {"spp": done.count * int(done.identity["spp_of_a_slice"]), "seed": FIRST_SEED, "slices": done.count,
            "seconds": done.seconds, "own_relmse": truth.own_relmse if done.count > 1 else None,
            "made_by": done.makers, "kind": "reference: mean of slices with consecutive seeds"}  # fmt: skip
    layers = {"beauty": done.mean, "variance": done.variance}
    write_exr(path, layers, {**header, "raytide": own, **capture_date()})


def read_reference(path: str | os.PathLike[str], seeds: Collection[int] = ()) -> Truth:
    """Any EXR picture; its `variance` layer, of pixel means, is subtracted where it has one. Raises UsageError, for a
    picture too that says it is biased, or rendered with one of `seeds`, those of the renders that it is to judge: its
    samples would be theirs, and their errors too small. Raises ImageInvalid."""
    image = read_exr(path)
    rgb = image.rgb.astype(np.float64)
    if bias := told_bias(image.header):
        raise UsageError(f"{os.fspath(path)}: came a picture that is {bias}; wanted a reference without")
    seed = str(image.header.get("raytide.seed"))
    if seed.isdecimal() and int(seed) in seeds:
        raise UsageError(f"{os.fspath(path)}: came a picture of the seed {seed}, which a replicate has, too, so that "
                         "both share samples; wanted one of another seed, or another --seed")  # fmt: skip
    variance = image.layers.get("variance")
    known = variance is not None and variance.shape == rgb.shape and bool(np.isfinite(variance).all())
    if not np.isfinite(rgb).all():
        raise ImageInvalid(f"{os.fspath(path)}: holds pixels that are not finite; wanted a reference without")
    own = np.asarray(variance, np.float64) if known else np.zeros_like(rgb)
    return Truth(rgb, own, os.fspath(path))
