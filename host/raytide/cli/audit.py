"""`raytide audit SCENE... -o OUT`: how often the error bands hold, counted over many seeds."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from raytide.cli import COMMAND_WORDS
from raytide.cli.options import check_range
from raytide.cli.parameters import Quiet
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
from raytide.cli.signals import StopOnSignal
from raytide.errors import UsageError

if TYPE_CHECKING:
    from raytide.report.audit import Verdict
    from raytide.report.experiment import Budget, Devices, Plan

SHIPPED = Path("scenes")
LEAST_SPP = 16  # of fewer samples no band is claimed


def audit(
    *scenes: Annotated[Path, Parameter(help="scene files; default: all of ./scenes")],
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="folder for results and references")] = None,
    seeds: Annotated[int, Parameter(help="renders of each scene and number of samples, at least 2")] = 64,
    spp: Annotated[str, Parameter(help="samples a pixel, at least 16")] = "16,64",
    size: Annotated[str | None, Parameter(help="such as 64x64; default: as the scene, at most 4096 pixels")] = None,
    device: Annotated[str | None, Parameter(help="part of a device id")] = None,
    threads: Annotated[int | None, Parameter(help="of a CPU device")] = None,
    seed: Annotated[int, Parameter(help="another one, other renders")] = 1,
    quiet: Quiet = False,
) -> int:
    """Count how often renders' own error bands hold, by tile and by picture, against converged references.

    Prints a table and writes audit.json and audit.html. References lie in the output folder and are used again.
    """
    from raytide.report.experiment import Plan, variants_of

    if output is None:
        raise UsageError("no output: give -o FOLDER")
    check_range("--seeds", seeds, 2)
    check_range("--seed", seed, 0, MOST_SEED)
    budgets = samples_of(spp)
    found = scenes or tuple(sorted(SHIPPED.glob("*/*.toml")))
    found = tuple(path for path in found if path.name != "expected.toml")
    if not found:
        raise UsageError(f"came no scene, and ./{SHIPPED} has none; wanted scene files")
    plans = [Plan(path, variants_of([], device), budgets, seeds, picture_size(size), (), seed, threads, title=name)
             for path, name in named_scenes(found)]  # fmt: skip
    make_output(output)
    with StopOnSignal() as signals:
        reporter = Reporter(signals, quiet)
        verdicts: list[Verdict] = []
        every(plans, output, reporter, verdicts)
        if verdicts:
            write(output, verdicts)
    return reporter.ended()


def samples_of(text: str) -> tuple[Budget, ...]:
    """`16,64` samples a pixel. Raises UsageError."""
    try:
        budgets = budgets_of(text)
    except UsageError:
        budgets = ()
    if not budgets or any((budget.spp or 0) < LEAST_SPP for budget in budgets):
        raise UsageError(f"--spp: came {text!r}; wanted rising samples a pixel of at least {LEAST_SPP}, such as 16,64")
    return budgets


def every(plans: list[Plan], output: Path, reporter: Reporter, verdicts: list[Verdict]) -> None:
    """All scenes; `verdicts` grows, and each is printed as it comes."""
    from raytide.render.bias import refuse_biased
    from raytide.report.experiment import Devices, load_variant

    for plan in plans:  # what is wrong in any of them must be said before the first hour
        refuse_biased(load_variant(plan, plan.variants[0]).render, "an audit of error bands")
    print(" | ".join(HEAD))
    with Devices(plans[0].threads) as devices:
        for plan in plans:
            found = audit_one(plan, devices, output, reporter)
            verdicts += found
            for one in found:
                print(line(one), flush=True)
            if reporter.stopped():
                return


def audit_one(plan: Plan, devices: Devices, output: Path, reporter: Reporter) -> list[Verdict]:
    """One scene: its reference, then its seeds."""
    from raytide.render import Renderer
    from raytide.report.audit import audit_scene
    from raytide.report.experiment import load_variant

    def counted(seeds: int) -> None:
        reporter.progress(f"{plan.name}: {seeds}/{plan.replicates} seeds")

    scene = load_variant(plan, plan.variants[0])
    scene.render.spp = slice_spp(plan)
    with Renderer(scene, devices.open(plan.variants[0].device)) as renderer:
        truth = made_reference(renderer, plan, output, reporter)
        if reporter.stopped() or truth is None:
            return []
        return audit_scene(renderer, plan, truth, reporter.stopped, counted)


OPEN = 1e4  # high / low of a band whose low end is 0, or as good as that
HEAD = ("scene", "spp", "error", "estimate / truth (relMSE)", "tiles held", "too low", "too high", "width",
        "pictures held", "")  # fmt: skip


def cells(one: Verdict) -> list[str]:
    """A row of the table."""
    if one.coverage is None or one.ratio is None or one.width is None or one.picture_coverage is None:
        return [one.scene, str(one.spp), "0", "", "", "", "", "", "", one.words]
    return [
        one.scene, str(one.spp), f"{100 * one.relmse ** 0.5:.3g} %", f"{one.ratio:.2f}",
        f"{100 * one.coverage:.1f} +- {100 * one.coverage_error:.1f} %", f"{100 * one.too_low:.1f} %",
        f"{100 * one.too_high:.1f} %", f"x{one.width:.1f}" if one.width < OPEN else "open",
        f"{100 * one.picture_coverage:.0f} %", one.words,
    ]  # fmt: skip


def line(one: Verdict) -> str:
    """The row as a line of a Markdown table."""
    return " | ".join(cells(one))


def write(output: Path, verdicts: list[Verdict]) -> None:
    """audit.json and audit.html."""
    from raytide.report.files import write_json
    from raytide.report.page import page, paragraph, section, table, write_page
    from raytide.report.plot import bars

    command = shlex.join(["raytide", *COMMAND_WORDS.get()])
    write_json(output / "audit.json", {"schema": "raytide.audit/1", "command": command,
                                       "verdicts": [one.as_dict() for one in verdicts]})  # fmt: skip
    noisy = [one for one in verdicts if one.coverage is not None]
    names = [f"{one.scene}, {one.spp} spp" for one in noisy]
    shares = [100 * (one.coverage or 0.0) for one in noisy]
    errors = [100 * one.coverage_error for one in noisy]
    body = [
        section("Tiles whose 95 % band held their error", bars(names, shares, "% of tiles and seeds",
                [a - 2 * b for a, b in zip(shares, errors, strict=True)],
                [a + 2 * b for a, b in zip(shares, errors, strict=True)]) if noisy else None),
        section("All figures", table(list(HEAD), [cells(one) for one in verdicts])),
        paragraph("too low: the error was above the band; too high: below it, the renderer was too cautious. width: "
                  "high / low of a tile's band, median; open where that reaches down to 0."),
        paragraph(command),
    ]  # fmt: skip
    write_page(output / "audit.html", page("Audit of the error bands", *body, lead="many seeds, converged references"))
    print(output / "audit.json", output / "audit.html", sep="\n")
