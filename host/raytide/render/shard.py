"""Shards: the samples of a picture from number A to number B, rendered apart, and put together to one render's bits.

The film sums blocks of FILM_BLOCK samples by themselves (cl/wave/film.cl), so a shard keeps the sums of its blocks, and
`merge` adds them up in the film's order. Nothing else decides a picture: a sample depends on its pixel and number only.
"""

from __future__ import annotations

import logging
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from raytide.errors import UsageError
from raytide.kernels.constants import FILM_BLOCK
from raytide.render import checkpoint_file, layers
from raytide.render.bias import CUT
from raytide.render.checkpoint import check_origin, origin_of
from raytide.render.checkpoint_file import Content
from raytide.render.film import Film, FilmData
from raytide.render.film_sums import Differences, Sums
from raytide.render.limits import MOST_SPP
from raytide.render.provenance import provenance_of
from raytide.scene.given import path_given, paths_given

if TYPE_CHECKING:
    from raytide.render.renderer import Renderer

KIND = "shard"
_PARTS = ("hi", "lo", "valid", "hits")  # of Sums, stacked over blocks
_CUT_PARTS = tuple(CUT + name for name in _PARTS)  # the same of what clamping took
_REST = ("differences", "half")  # after the first block; all other arrays are layers
_log = logging.getLogger("raytide.render")


def check_range(first: int, end: int, spp: int | None) -> None:
    """Raises UsageError where samples `first` to `end` - 1 are no whole blocks; the last one of a picture of `spp`
    samples may be a part."""
    words = f"samples: came {first}:{end}"
    whole = all(isinstance(number, (int, np.integer)) for number in (first, end))
    if not whole or not 0 <= first < end <= (spp or MOST_SPP):
        raise UsageError(f"{words}; wanted A:B with 0 <= A < B <= {spp or MOST_SPP}, the picture's samples")
    if first % FILM_BLOCK or (end % FILM_BLOCK and end != spp):
        raise UsageError(
            f"{words}; wanted multiples of {FILM_BLOCK}, the film's block of samples; B may also be the picture's last "
            "sample, its spp"
        )


def write_shard(
    renderer: Renderer,
    path: str | os.PathLike[str],
    first: int,
    end: int,
    *,
    no_clobber: bool = False,
    show: Callable[[Mapping[str, Any]], None] = lambda status: None,
) -> int:
    """Renders samples `first` to `end` - 1 of every pixel into the file `path` and gives the number behind the last:
    `end`, or less where `Renderer.stop` ended it, and `first` where no block was finished, and nothing written.

    A file takes 32 bytes a pixel for every 64 samples, twice that where light is clamped. `show` is told
    `Renderer.status` after every block. Raises UsageError for a range that is no whole blocks, and for adaptive
    renders, whose pixels have ranges of their own.
    """
    path = path_given(path, example="part.shard")
    check_range(first, end, _wanted_spp(renderer))
    if renderer.features.adaptive:
        raise UsageError("samples: came a range of an adaptive render; wanted the same samples for all pixels")
    done, blocks, arrays = first, [], {}
    for behind, sums in renderer.blocks(first, end):
        done = behind
        blocks.append(sums)
        show(renderer.status)
        if first == 0 and len(blocks) == 1:
            rows, half = renderer.opened()[0].differences()
            arrays = {"differences": rows, "half": half, **layers.render_layers(renderer)}
    if blocks:
        for prefix, films in zip(("", CUT), zip(*blocks, strict=True), strict=False):
            arrays |= {prefix + name: np.stack([getattr(sums, name) for sums in films]) for name in _PARTS}
        checkpoint_file.write(path, Content(_facts(renderer, first, done), arrays), KIND, no_clobber=no_clobber)
    return done


def _wanted_spp(renderer: Renderer) -> int | None:
    """Samples a pixel of the whole picture; None where nobody said."""
    render = renderer.flat.render
    return render.spp if "spp" in render.model_fields_set else None


def _facts(renderer: Renderer, first: int, end: int) -> dict[str, Any]:
    frame = renderer.opened()[0]
    provenance = provenance_of(renderer)
    provenance["worldToCamera"] = provenance["worldToCamera"].tolist()
    return {
        **origin_of(renderer),
        "first": first,
        "end": end,
        "wanted_spp": _wanted_spp(renderer),
        "health": frame.health(),
        "faults": frame.faults_met(),
        "rays": renderer.rays.total,
        "seconds": frame.seconds,
        "provenance": provenance,
    }


def merge(paths: Sequence[str | os.PathLike[str]] | str | os.PathLike[str]) -> Film:
    """The picture of all shards together, in any order, or of a single one: bit for bit that of one render on the same
    device.

    Raises UsageError, and names the file or the samples, for files that are no whole shard, holes, samples that two
    shards have, and renders of another scene, other settings or other kernels. Shards of several devices mix, with a
    warning; so do the first ones of a picture whose `spp` they know, and the picture's header says what is `missing`.
    """
    parts = _in_order(paths_given(paths, "shards", "a.shard"))
    facts = [one for _, one in parts]
    if missing := _missing(facts):
        _log.warning("samples %d to %d of %d are in no shard; the picture is of those before",
                     missing[0], missing[1] - 1, missing[1])  # fmt: skip
    picture = _Picture()
    for path, _ in parts:
        content = checkpoint_file.read_one(path, KIND)
        try:
            picture.add(content)
        except (KeyError, ValueError, TypeError) as error:
            raise UsageError(f"{path}: came a shard that lacks or spoils a part ({error})") from error
    return Film(facts[-1]["end"], _figures(facts), _provenance(facts), picture.data, lambda: picture.layers)


class _Picture:
    """Adds shards up, which come in order."""

    def __init__(self) -> None:
        self._total: Sums | None = None
        self._cut: Sums | None = None
        self._differences: Differences | None = None
        self._health: Counter[str] = Counter()
        self._faults: Counter[str] = Counter()
        self.layers: dict[str, np.ndarray] = {}

    def add(self, content: Content) -> None:
        """The next shard. Raises KeyError, ValueError and TypeError for one that is not whole."""
        arrays, n, end = content.arrays, content.facts["first"], content.facts["end"]
        blocks = _blocks(arrays, _PARTS)
        if len(blocks) != -(-(end - n) // FILM_BLOCK):
            raise ValueError(f"{len(blocks)} blocks for samples {n} to {end - 1}")
        if self._total is None or self._differences is None:
            self._total = Sums.none_like(blocks[0])
            self._differences = Differences(arrays["differences"], arrays["half"])
            known = (*_PARTS, *_CUT_PARTS, *_REST)
            self.layers = {name: array for name, array in arrays.items() if name not in known}
        for block in blocks:
            n = min(n + FILM_BLOCK, end)
            self._total = self._total.plus(block)
            self._differences.take(self._total, n)
        for block in _blocks(arrays, _CUT_PARTS) if _CUT_PARTS[0] in arrays else ():
            self._cut = (self._cut or Sums.none_like(block)).plus(block)
        self._health.update(content.facts["health"])
        self._faults.update(content.facts["faults"])

    def data(self) -> FilmData:
        """The film of all of them."""
        assert self._total is not None and self._differences is not None
        return FilmData(self._total, self._differences.rows, dict(self._health), dict(self._faults), self._cut)


def _blocks(arrays: Mapping[str, np.ndarray], names: Sequence[str]) -> list[Sums]:
    return [Sums(*parts) for parts in zip(*(arrays[name] for name in names), strict=True)]


def _in_order(paths: list[Path]) -> list[tuple[Path, dict[str, Any]]]:
    """Files and facts by their samples, every sample in one of them."""
    if not paths:
        raise UsageError("no shards: came nothing; wanted the files of `raytide render --samples A:B -o FILE.shard`")
    parts = [(path, _facts_of(path)) for path in paths]
    parts.sort(key=lambda part: (part[1]["first"], part[1]["end"]))
    begin, known = parts[0]
    behind, before = 0, None
    for path, facts in parts:
        check_origin(facts, path, known, str(begin))
        if facts["device"] != known["device"]:
            _log.warning("%s is of %s, %s of %s: the same samples, rounded as each device does",
                         path, facts["device"], begin, known["device"])  # fmt: skip
        if facts["first"] > behind:
            raise UsageError(f"samples {behind} to {facts['first'] - 1} are in no shard; wanted a file that has them")
        if facts["first"] < behind:
            raise UsageError(
                f"{path}: came samples from {facts['first']} on; {before} has those up to {behind - 1} already"
            )
        if behind % FILM_BLOCK:
            raise UsageError(f"{path}: came samples from {behind} on; {before} ended the picture inside a block")
        behind, before = facts["end"], path
    return parts


def _facts_of(path: Path) -> dict[str, Any]:
    facts = checkpoint_file.peek(path, KIND)
    if facts is None:
        checkpoint_file.read_one(path, KIND)  # says why
        raise UsageError(f"{path}: came a file without a shard's facts")
    return facts


def _missing(facts: list[dict[str, Any]]) -> list[int] | None:
    """The first sample behind all shards, and the number behind the last one that they should have; None where none
    is missing or no shard knows."""
    end, wanted = facts[-1]["end"], max(one.get("wanted_spp") or 0 for one in facts)
    return [end, wanted] if wanted > end else None


def _figures(facts: list[dict[str, Any]]) -> dict[str, object]:
    seconds, rays = sum(one["seconds"] for one in facts), sum(one["rays"] for one in facts)
    devices = list(dict.fromkeys(one["device"] for one in facts))
    rate = rays / seconds / 1e6 if seconds > 0 else 0.0
    figures = {"spp": facts[-1]["end"], "seconds": seconds, "rays": rays, "mrays_per_s": rate}
    return figures | {"device": ", ".join(devices)}


def _provenance(facts: list[dict[str, Any]]) -> dict[str, object]:
    """That of the first shard, with the samples and render time of all."""
    first = dict(facts[0]["provenance"])
    first["worldToCamera"] = np.array(first["worldToCamera"], np.float32)
    own = dict(first["raytide"])
    own["spp"] = facts[-1]["end"]
    own["time_s"] = own["time_s"] | {"render": round(sum(one["seconds"] for one in facts), 6)}
    own["shards"] = [[one["first"], one["end"], one["device"]] for one in facts]
    own |= {"missing": missing} if (missing := _missing(facts)) else {}
    return first | {"raytide": own}


def range_of(text: str) -> tuple[int, int]:
    """`256:512` as (256, 512). Raises UsageError for other text."""
    first, _, end = text.partition(":")
    if not (first.isdecimal() and end.isdecimal() and first.isascii() and end.isascii() and len(text) < 40):
        raise UsageError(f"--samples: came {text!r}; wanted A:B, such as 256:512 for samples 256 to 511")
    return int(first), int(end)
