"""`raytide converge SCENE... -o OUT`: error against time and samples, from independent renders and a reference."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from raytide.cli import COMMAND_WORDS
from raytide.cli.options import check_range
from raytide.cli.parameters import Flag, Quiet
from raytide.cli.replicates import (
    MOST_SEED,
    Reporter,
    budgets_of,
    made_reference,
    make_output,
    named_scenes,
    picture_size,
    slice_spp,
)
from raytide.cli.signals import Interrupted, StopOnSignal
from raytide.errors import UsageError, wanted_of

if TYPE_CHECKING:
    from raytide.report.convergence import Truth
    from raytide.report.convergence_files import Outcome
    from raytide.report.experiment import Devices, Plan

BUDGETS = "1,2,4,8,16,32,64,128"
VARY = "key=A,B: a render key, device, traversal, or precision: exact and arithmetic that is worse"


def converge(
    *scenes: Annotated[Path, Parameter(help="scene files")],
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="folder for results and references")] = None,
    reference: Annotated[Path | None, Parameter(help="a converged picture, for a single scene")] = None,
    reference_spp: Annotated[int | None, Parameter(help="of references made; default: 64 x the largest")] = None,
    budgets: Annotated[str, Parameter(help="samples a pixel (1,2,4), or times of rendering (1s,10s,1min)")] = BUDGETS,
    vary: Annotated[list[str] | None, Parameter(negative="", help=VARY)] = None,
    replicates: Annotated[int, Parameter(help="renders of each budget: 16 for curves, 32 for claims")] = 16,
    size: Annotated[str | None, Parameter(help="such as 64x64; default: as the scene, at most 4096 pixels")] = None,
    device: Annotated[str | None, Parameter(help="part of a device id")] = None,
    threads: Annotated[int | None, Parameter(help="of a CPU device")] = None,
    seed: Annotated[int, Parameter(help="another one, other renders")] = 1,
    start_runs: Annotated[int, Parameter(help="starts of the whole command to measure its set-up; 0: none")] = 3,
    changes: Annotated[list[str] | None, Parameter(name="--set", negative="", help="key.path=value; repeats")] = None,
    allow_outside: Annotated[Flag, Parameter(help="let scenes name files outside their folders")] = False,
    quiet: Quiet = False,
) -> int:
    """Measure error against time: independent renders for each budget, held against a reference.

    Writes renders.csv, converge.json, converge.html and, with matplotlib, converge.png into the output folder. Ctrl-C
    ends it after the render at work; what was finished is written.
    """
    from raytide.render.limits import MOST_SPP
    from raytide.report.experiment import Plan, variants_of

    if output is None:
        raise UsageError("no output: give -o FOLDER")
    check_range("--replicates", replicates, 2)
    check_range("--start-runs", start_runs, 0)
    check_range("--seed", seed, 0, MOST_SEED)
    check_range("--reference-spp", reference_spp, 1, MOST_SPP)
    found, variants = budgets_of(budgets), variants_of(vary or [], device)
    check_precisions(variant.precision for variant in variants)
    plans = [Plan(scene, variants, found, replicates, picture_size(size), tuple(changes or ()), seed, threads,
                  allow_outside, name) for scene, name in named_scenes(scenes)]  # fmt: skip
    if reference is not None and len(plans) > 1:
        raise UsageError(f"--reference: came with {len(plans)} scenes; wanted a single one")
    if reference is None and reference_spp is None and not plans[0].most_spp:
        raise UsageError("--budgets: came times without a reference; wanted --reference FILE or --reference-spp N too")
    make_output(output)
    begun, outcomes = time.perf_counter(), list[Any]()
    with StopOnSignal() as signals:
        reporter = Reporter(signals, quiet)
        try:
            every(plans, reference, reference_spp, start_runs, output, reporter, outcomes)
        except Interrupted:
            return signals.exit_code
        if outcomes:
            write(output, outcomes, about(plans[0], begun), reporter)
    return reporter.ended()


def check_precisions(names: Iterable[str]) -> None:
    """Refuse arithmetic that nobody knows. Raises UsageError."""
    from raytide.report.experiment import EXACT
    from raytide.verify.variants import VARIANTS

    known = (EXACT, *VARIANTS)
    for name in names:
        if name not in known:
            raise UsageError(f"--vary precision: came {name!r}; {wanted_of(name, known)}")


def every(plans: list[Plan], reference: Path | None, reference_spp: int | None, start_runs: int, output: Path,
          reporter: Reporter, outcomes: list[Outcome]) -> None:  # fmt: skip
    """All scenes, one after the other; `outcomes` grows, so that what is finished is not lost."""
    from raytide.report.convergence_files import Outcome
    from raytide.report.experiment import Devices, load_variant, run
    from raytide.verify.variants import with_arithmetic

    for plan in plans:  # what is wrong in any of them must be said before hours of work
        for variant in plan.variants:
            load_variant(plan, variant)
    with Devices(plans[0].threads, with_arithmetic) as devices:
        for plan in plans:
            truth = truth_of(plan, devices, reference, reference_spp, output, reporter)
            if truth is None or reporter.stopped():
                return
            tracks = run(plan, truth, devices, reporter.stopped, reporter.step, reporter.attach)
            if any(point.rows for track in tracks for point in track.points):
                outcomes.append(Outcome(plan, truth, tracks, {}))
            if reporter.stopped():
                return
            outcomes[-1].starts.update(starts_of(plan, start_runs, reporter))


def truth_of(plan: Plan, devices: Devices, reference: Path | None, spp: int | None, output: Path,
             reporter: Reporter) -> Truth | None:  # fmt: skip
    """The reference that was given, or one made in the output folder; None where that was interrupted too early."""
    from raytide.render import Renderer
    from raytide.render.bias import without_bias
    from raytide.report.experiment import Variant, load_variant
    from raytide.report.reference import read_reference

    if reference is not None:
        return read_reference(reference, plan.seeds())
    scene = load_variant(plan, Variant("reference"))
    scene.render.spp = slice_spp(plan, spp)
    without_bias(scene.render)  # so that it counts as error
    with Renderer(scene, devices.open(plan.variants[0].device)) as renderer:
        return made_reference(renderer, plan, output, reporter)


def starts_of(plan: Plan, runs: int, reporter: Reporter) -> dict[str, Any]:
    """What starting the command costs: of every variant warm, of the first one cold too."""
    from raytide.report.experiment import small_size
    from raytide.report.start_cost import measure_start
    from raytide.scene.load import load

    found: dict[str, Any] = {}
    for variant in plan.variants if runs else ():
        if reporter.stopped():
            break
        reporter.progress(f"{plan.name}, {variant.name}: what the command costs beside rendering")
        width, height = plan.size or small_size(load(plan.scene, overrides=plan.overrides).camera.size)
        words = [str(plan.scene), "--size", f"{width}x{height}", "--traversal", variant.traversal]
        words += [part for word in plan.overrides for part in ("--set", word)]
        words += [part for key, value in variant.keys for part in ("--set", f"render.{key}={value}")]
        words += ["--device", variant.device] if variant.device else []
        words += ["--threads", str(plan.threads)] if plan.threads else []
        words += ["--allow-outside"] if plan.allow_outside else []
        found[variant.name] = measure_start(words, runs, cold=variant is plan.variants[0])
    return found


def about(plan: Plan, begun: float) -> dict[str, Any]:
    """What the results say of themselves."""
    import platform

    import raytide
    from raytide.bench.record import tool_record

    tool = tool_record()
    return {
        "raytide": raytide.__version__,
        "git_commit": tool["git_commit"],
        "git_dirty": tool["git_dirty"],
        "command": shlex.join(["raytide", *COMMAND_WORDS.get()]),
        "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "machine": f"{platform.machine()}, {platform.platform()}, Python {platform.python_version()}",
        "budgets": ", ".join(budget.label for budget in plan.budgets),
        "replicates": plan.replicates,
        "seed": plan.seed,
        "seconds": round(time.perf_counter() - begun, 3),
    }


def write(output: Path, outcomes: list[Outcome], facts: dict[str, Any], reporter: Reporter) -> None:
    """All files; their names and the table go to stdout."""
    from raytide.report import files
    from raytide.report.convergence_files import csv_text, result_of, write_plot
    from raytide.report.convergence_page import document
    from raytide.report.page import write_page

    files.write_text(output / "renders.csv", csv_text(outcomes))
    files.write_json(output / "converge.json", result_of(outcomes, facts))
    write_page(output / "converge.html", document(outcomes, facts))
    plotted = write_plot(output / "converge.png", outcomes)
    if not plotted:
        reporter.say("no converge.png: matplotlib is not installed (pip install 'raytide[report]')")
    for text in (text for outcome in outcomes for text in outcome.remarks()):
        reporter.say(text)
    print(lines(outcomes))
    names = ["renders.csv", "converge.json", "converge.html", *(["converge.png"] if plotted else [])]
    print(*(output / name for name in names), sep="\n")
    sys.stdout.flush()


def lines(outcomes: list[Outcome]) -> str:
    """A table for people."""
    from raytide.bench.show import aligned
    from raytide.report.convergence_files import complete

    head = ["SCENE", "VARIANT", "BUDGET", "ERROR", "95 %", "SLOPE", "99 %", "SET-UP S", "RENDER S"]
    rows = []
    for outcome in outcomes:
        for track in outcome.tracks:
            if not complete(track):  # it was interrupted before
                continue
            last, fitted = complete(track)[-1].figures(), outcome.fit_of(track)
            ends = [100 * max(last[key], 0.0) ** 0.5 for key in ("relmse_low", "relmse_high")]
            rows.append([
                outcome.name, track.variant.name, last["budget"], f"{100 * last['rmse_relative']:.3g} %",
                f"{ends[0]:.3g}-{ends[1]:.3g}", f"{fitted.slope:.3f}" if fitted else "",
                f"{fitted.slope99[0]:.3f} to {fitted.slope99[1]:.3f}" if fitted else "",
                f"{outcome.set_up_s(track):.2f}", f"{last['render_s']:.3g}",
            ])  # fmt: skip
    return aligned(head, rows)
