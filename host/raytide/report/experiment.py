"""Independent renders of one scene: variants side by side, budgets, seeds; kernels and trees are made once.

The order is by replicate, then variant, then budget, so that a machine that drifts favours nobody, and a run that was
interrupted has as many replicates of one as of the other.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from raytide.device import Device, open_device
from raytide.errors import SceneError, UsageError, wanted_of
from raytide.render import Film, Renderer
from raytide.render.limits import MOST_SPP
from raytide.report.convergence import Point, Truth
from raytide.scene.load import load
from raytide.scene.scene import Scene
from raytide.scene.settings import RenderSettings

HOST_KEYS = ("device", "traversal", "precision")
EXACT = "exact"  # the arithmetic that renders have
OWN_KEYS = ("spp", "time", "error", "seed")  # what an experiment itself sets
MOST_PIXELS = 64 * 64  # of a picture whose size nobody gave


@dataclass(frozen=True)
class Variant:
    """One way to render: its name, keys of the scene's render table as text, device, traversal, and what its arithmetic
    is called."""

    name: str
    keys: tuple[tuple[str, str], ...] = ()
    device: str | None = None
    traversal: str = "auto"
    precision: str = EXACT


@dataclass(frozen=True)
class Budget:
    """Samples a pixel, or seconds of rendering."""

    spp: int | None = None
    seconds: float | None = None

    @property
    def label(self) -> str:
        """`16 spp`, `10 s`."""
        return f"{self.spp} spp" if self.spp else f"{self.seconds:g} s"


@dataclass(frozen=True)
class Plan:
    """What is rendered: one scene file with what is put over it, its variants, budgets and replicates."""

    scene: Path
    variants: tuple[Variant, ...]
    budgets: tuple[Budget, ...]
    replicates: int
    size: tuple[int, int] | None = None
    overrides: tuple[str, ...] = ()
    seed: int = 1
    threads: int | None = None
    allow_outside: bool = False
    title: str = ""

    @property
    def name(self) -> str:
        """What results call the scene: the file's name unless a title was given."""
        return self.title or self.scene.stem

    @property
    def most_spp(self) -> int:
        """Of all budgets; 0 where all are times."""
        return max((budget.spp or 0 for budget in self.budgets), default=0)

    def seed_of(self, replicate: int, budget: int) -> int:
        """Another seed for each render of a variant. References count from 2^31 (reference.py)."""
        return (self.seed * 100_003 + replicate * len(self.budgets) + budget) % 2**31

    def seeds(self) -> set[int]:
        """Of all renders."""
        return {self.seed_of(replicate, at) for replicate, _, at in order(self)}


@dataclass
class Track:
    """One variant of one scene: its points, and the seconds and hashes of its set-up."""

    variant: Variant
    points: list[Point]
    set_up: dict[str, float] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)


def variants_of(vary: Sequence[str], device: str | None = None) -> tuple[Variant, ...]:
    """All combinations of `key=value,value` words. UsageError for a key that cannot vary."""
    axes: list[list[tuple[str, str]]] = []
    known = [*HOST_KEYS, *(name for name in RenderSettings.model_fields if name not in OWN_KEYS)]
    for word in vary:
        key, equals, values = word.partition("=")
        listed = [value.strip() for value in values.split(",") if value.strip()]
        if key not in known:
            raise UsageError(f"--vary {word}: came the key {key!r}; {wanted_of(key, known)}")
        if not equals or not listed or len(set(listed)) < len(listed):
            raise UsageError(f"--vary {word}: came no list of different values; wanted, for example, {key}=A,B")
        if any(key == axis[0][0] for axis in axes):
            raise UsageError(f"--vary {word}: the key {key} came twice; wanted all its values in one list")
        axes.append([(key, value) for value in listed])
    return tuple(variant_of(pairs, device) for pairs in itertools.product(*axes))


def variant_of(pairs: Sequence[tuple[str, str]], device: str | None) -> Variant:
    """One combination."""
    host = dict(pair for pair in pairs if pair[0] in HOST_KEYS)
    keys = tuple(pair for pair in pairs if pair[0] not in HOST_KEYS)
    name = ", ".join(f"{key}={value}" for key, value in pairs) or "as the scene says"
    return Variant(name, keys, host.get("device", device), host.get("traversal", "auto"), host.get("precision", EXACT))


def load_variant(plan: Plan, variant: Variant) -> Scene:
    """The scene with its size and the variant's keys. Raises SceneError."""
    words = [*plan.overrides, *(f"render.{key}={value}" for key, value in variant.keys)]
    scene = load(plan.scene, overrides=words, allow_outside=plan.allow_outside)
    scene.camera.size = plan.size or small_size(scene.camera.size)
    scene.render.spp = plan.most_spp or MOST_SPP
    scene.render.time = scene.render.error = None
    return scene


def small_size(size: tuple[int, int] | list[int]) -> tuple[int, int]:
    """The same shape with about MOST_PIXELS pixels, where it has more."""
    width, height = size
    share = min(1.0, (MOST_PIXELS / (width * height)) ** 0.5)
    return max(1, round(width * share)), max(1, round(height * share))


class Devices(ExitStack):
    """Opens each device once with each arithmetic and closes all at the end. `other` opens one again with an arithmetic
    that has a name."""

    def __init__(
        self, threads: int | None = None, other: Callable[[Device, str, int | None], Device] | None = None
    ) -> None:
        super().__init__()
        self.threads, self.other = threads, other
        self.opened: dict[tuple[str | None, str], Device] = {}

    def open(self, name: str | None, precision: str = EXACT) -> Device:
        """The device of an id. Raises DeviceError."""
        key = (name, precision)
        if key not in self.opened:
            self.opened[key] = self.enter_context(self._opened(name, precision))
        return self.opened[key]

    def _opened(self, name: str | None, precision: str) -> Device:
        if precision == EXACT:
            return open_device(name, threads=self.threads)
        if self.other is None:
            raise UsageError(f"precision: came {precision!r}; wanted {EXACT}")
        return self.other(self.open(name), precision, self.threads)


@dataclass(frozen=True)
class Step:
    """Where an experiment is: renders done of all, and the seconds that the rest will take at the pace so far."""

    done: int
    renders: int
    left_s: float | None
    what: str


def run(plan: Plan, truth: Truth, devices: Devices, stopped: Callable[[], bool], tell: Callable[[Step], None],
        attach: Callable[[Renderer], None] = lambda renderer: None) -> list[Track]:  # fmt: skip
    """All renders of a plan. Ends early where `stopped` says so, dropping the render that it interrupted; `attach` gets
    the renderer at work. Raises SceneError, UsageError and DeviceError before the first render."""
    with ExitStack() as stack:
        renderers = []
        tracks = []
        for variant in plan.variants:
            begun = time.perf_counter()
            scene = load_variant(plan, variant)
            device = devices.open(variant.device, variant.precision)
            renderer = stack.enter_context(Renderer(scene, device, traversal=variant.traversal))
            track = Track(variant, [Point(truth, budget.label) for budget in plan.budgets])
            track.set_up = {"in_process": time.perf_counter() - begun, **renderer.times}
            track.provenance = dict(renderer.film.provenance["raytide"])  # type: ignore[call-overload]
            track.provenance["precision"] = variant.precision
            for key in ("spp", "seed", "time_s"):  # nothing is rendered yet; every render has its own
                track.provenance.pop(key, None)
            renderers.append(renderer)
            tracks.append(track)
        check_size(tracks, renderers, truth)
        begun = time.perf_counter()
        spent, whole = 0.0, plan.replicates * cost_of_all(plan)
        for count, (replicate, place, at) in enumerate(order(plan)):
            if stopped():
                break
            attach(renderers[place])
            budget = plan.budgets[at]
            if replicate == 0 and at == 0:
                one_render(renderers[place], budget if budget.spp else Budget(seconds=0.2), 0)  # not counted: warms up
            seed = plan.seed_of(replicate, at)
            film, seconds = one_render(renderers[place], budget, seed)
            if stopped() or renderers[place].stopped_by == "interrupt":
                break
            add(tracks[place].points[at], film, seed, seconds)
            spent += cost_of(budget)
            left = (time.perf_counter() - begun) * (whole - spent) / spent
            what = f"{plan.name}, {plan.variants[place].name}, {budget.label}, replicate {replicate + 1}"
            tell(Step(count + 1, plan.replicates * len(plan.variants) * len(plan.budgets), left, what))
        return tracks


def order(plan: Plan) -> Iterator[tuple[int, int, int]]:
    """(replicate, variant, budget) in the order of the renders."""
    return itertools.product(range(plan.replicates), range(len(plan.variants)), range(len(plan.budgets)))


def cost_of(budget: Budget) -> float:
    """Of one render, in units that budgets of a plan share; what every render costs counts as 16 samples."""
    return budget.spp + 16.0 if budget.spp else float(budget.seconds or 0.0)


def cost_of_all(plan: Plan) -> float:
    """Of one replicate of every variant."""
    return len(plan.variants) * sum(cost_of(budget) for budget in plan.budgets)


def one_render(renderer: Renderer, budget: Budget, seed: int) -> tuple[Film, float]:
    """A picture from nothing, and the seconds until it was read back and had its error estimated."""
    begun = time.perf_counter()
    renderer.restart(seed=seed)
    film = renderer.render(budget.spp or MOST_SPP, time=budget.seconds)
    _ = film.rgb, film.error
    return film, time.perf_counter() - begun


def add(point: Point, film: Film, seed: int, seconds: float) -> None:
    """Hold a film against the truth."""
    known = film.error
    estimate = (known.relmse, known.low, known.high) if known else None
    spp = round(float(film.samples.mean())) if film.samples.any() else 0
    point.add(film.rgb, seed, spp, seconds, estimate)


def check_size(tracks: Sequence[Track], renderers: Sequence[Renderer], truth: Truth) -> None:
    """Refuse a reference of another size. Raises UsageError, and SceneError where there is nothing to render."""
    for renderer in renderers:
        width, height = renderer.flat.window[2:]
        if truth.rgb.shape[:2] != (height, width):
            came = f"{truth.rgb.shape[1]}x{truth.rgb.shape[0]}"
            raise UsageError(f"{truth.name}: came a picture of {came}; wanted {width}x{height}: --size or another file")
    if not tracks:
        raise SceneError([])
