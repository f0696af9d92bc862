"""`raytide verify`: which numerical cases hold on a device. Exit code 0 where all that ran hold, else 4."""

from __future__ import annotations

import json as text
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raytide.cli.parameters import Flag
from raytide.errors import UsageError

if TYPE_CHECKING:
    from raytide.verify import Case, Verdict

Paths = list[Path] | None  # before a parameter of that name hides `list`
Names = list[str] | None
SHORT = 4
MOST_FIGURES = 24  # of a case that falls short; where it has more, those of the trials that do


def verify(
    *,
    device: str | None = None,
    group: Names = None,
    case: Names = None,
    quick: Flag = False,
    full: Flag = False,
    json: Path | None = None,
    html: Path | None = None,
    replay: Path | None = None,
    against: str | None = None,
    cost: Flag = False,
    peers: Paths = None,
    fuzz: int | None = None,
    list: Flag = False,
    threads: int | None = None,
) -> int:
    """Try stiff and extreme cases on a device, against exact or extended-precision oracles.

    Parameters
    ----------
    device
        Part of a device id.
    group
        Only this group of cases: geometry, ... May be repeated.
    case
        Only this case, by its id, e.g. T2; fuzz: scenes of extremes. May be repeated, and beside groups.
    quick
        Fewer inputs: a minute or two instead of many. The default.
    full
        As many inputs as the catalogue asks for, and 2,000 scenes of extremes.
    json
        Write all verdicts, each with its worst input, to this file; it is whole after every case.
    html
        Write a page of all verdicts to this file.
    replay
        A file that --json wrote: judge the worst inputs in it again, alone. With --case only that one's.
    against
        Part of another device's id: compare the same samples on both, scene by scene, in place of the cases.
    cost
        Measure ns a ray, leaks and errors of every form of the triangle test, in place of the cases; and the leaks of
        Embree (embreex) and Mitsuba, where they are installed.
    peers
        With --cost: a Python that has embreex or mitsuba; may be repeated. By default the one that runs raytide.
    fuzz
        Render so many scenes of extremes, at least 1, in place of the cases.
    list
        Print the cases and their bars, and stop.
    threads
        Threads of a CPU device.
    """
    cases = cases_of(group or (), case or (), quick, full, fuzz, bool(cost or against))
    if peers and not cost:
        raise UsageError("--peers: came without --cost; wanted both")
    if list:
        return listed(cases)
    return tried(cases, device, threads, full, json, html, replay, case or (), against, (peers or []) if cost else None)


def cases_of(
    groups: Iterable[str], ids: Iterable[str], quick: bool, full: bool, fuzz: int | None, none: bool
) -> list[Case]:
    """What the options ask for, in the order of the catalogue. Raises UsageError."""
    from raytide.cli.options import check_range
    from raytide.verify import chosen_cases
    from raytide.verify.fuzz import FUZZED, fuzzed

    if quick and full:
        raise UsageError("came both --quick and --full; wanted one of them")
    check_range("--fuzz", fuzz, 1)
    if fuzz is not None:
        return [fuzzed(fuzz)]
    some = [one for name in groups for one in chosen_cases(group=name)]
    some += [one for id in ids for one in chosen_cases(case=id)]
    if some or none:
        named = {one.id: one for one in some}
        last = [named.pop("fuzz")] if "fuzz" in named else []
        return [] if none else [one for one in chosen_cases() if one.id in named] + last
    return chosen_cases() + ([fuzzed(FUZZED)] if full else [])


def listed(cases: Sequence[Case]) -> int:
    """Prints cases and their bars."""
    for one in cases:
        print(f"{one.id:4} {one.group:10} {one.title}\n{'':16}bar: {one.bar}")
    return 0


def tried(
    cases: Sequence[Case], device: str | None, threads: int | None, full: bool, json: Path | None, html: Path | None,
    replay: Path | None, ids: Sequence[str], against: str | None, cost: Sequence[Path] | None,
) -> int:  # fmt: skip
    """Runs what was asked for, writes the files, and gives the exit code. `cost`: the peers' Pythons, or None."""
    from raytide.cli.options import check_outputs
    from raytide.device import open_device
    from raytide.verify.lab import Lab

    check_outputs([], [json, html], no_clobber=False)
    records = earlier(replay, ids) if replay else []
    with open_device(device, threads=threads) as opened:
        lab = Lab(opened, full=full)
        print(f"raytide: {opened.info.id}, {size_of(full)}", file=sys.stderr)
        result: dict[str, Any] = {"schema": "raytide.verify/1", "size": size_of(full)}
        result |= {"device": opened.info.as_dict() | {"options": [*opened.options]}}
        result |= {"cases": [one.id for one in cases], "verdicts": []}
        verdicts = again(records, lab) if replay else judged(cases, lab, json, result)
        result |= {"verdicts": [asdict(one) for one in verdicts]}
        result |= cost_rows(lab, cost) if cost is not None else {}
        result |= against_rows(lab, against) if against else {}
        lab.close()
    write(json, html, result)
    return conclude(verdicts) if verdicts else 0


def judged(cases: Sequence[Case], lab: Any, json: Path | None, result: dict[str, Any]) -> list[Verdict]:
    """Verdicts of all cases, told as they come; after each the file holds all so far, so that nothing ends with a run
    that is broken off."""
    from raytide.verify import run_cases

    def ended(one: Verdict) -> None:
        hide()
        say(one)
        result["verdicts"].append(asdict(one))
        write(json, None, result)
        begin()

    def begin() -> None:
        place = len(result["verdicts"])
        if place < len(cases):
            show(f"{place + 1} of {len(cases)}: {cases[place].id} {cases[place].title}", lab.full)

    begin()
    try:
        return run_cases(cases, lab, ended)
    finally:
        hide()


def show(line: str, full: bool) -> None:
    """Which case is at work: on a terminal until it ends; elsewhere only where cases take long."""
    if sys.stderr.isatty():
        print(line[:100], end="", file=sys.stderr, flush=True)
    elif full:
        print(f"raytide: {line}", file=sys.stderr, flush=True)


def hide() -> None:
    """Takes that line back."""
    if sys.stderr.isatty():
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def cost_rows(lab: Any, pythons: Sequence[Path]) -> dict[str, Any]:
    """Every form of the triangle test, then the peers that these have, printed as they come."""
    from raytide.verify.cost import Cost, costs
    from raytide.verify.peers import Leaks, peer_leaks

    def show(one: Cost) -> None:
        leaks = ", ".join(f"{n}" for n in one.leaks)
        print(f"{one.form:52} {one.ns_per_ray:7.0f} ns a ray; leaks {leaks} of {one.rays:,}; t {one.t_error:.1e}",
              flush=True)  # fmt: skip

    print("leaks at edges, at vertices, both 268 km away; error of t: 99th percentile")
    def show_peer(one: Leaks) -> None:
        leaks = ", ".join(f"{n}" for n in one.leaks)
        words = f"leaks {leaks} of {one.rays:,}" if one.leaks else f"not asked: {one.reason}"
        print(f"{one.peer + ' ' + one.version:52} {words}", flush=True)

    found = costs(lab, show, lambda form, why: print(f"{form:52} not built: {why.splitlines()[0]}"))
    peers = peer_leaks(lab, pythons, show_peer)
    return {"costs": [asdict(one) for one in found], "peers": [asdict(one) for one in peers]}


def against_rows(lab: Any, wanted: str) -> dict[str, Any]:
    """The same samples on another device, scene by scene."""
    from raytide.device import open_device
    from raytide.verify.against import compare, scenes
    from raytide.verify.lab import Lab

    rows = []
    with open_device(wanted) as opened:
        other = Lab(opened, lab.full)
        print(f"raytide: against {opened.info.id}", file=sys.stderr)
        for name, scene in scenes().items():
            rows.append(one := compare(lab, other, name, scene))
            first = f"first in {one.wave}, by {one.kernel}, {one.rays:.2%} of its rays" if one.kernel else "nowhere"
            print(f"{name:8} {one.other_bits:7.2%} of pixels have other bits, {one.diverged:.2%} diverged, energy x "
                  f"{one.energy_ratio:.6f}; {first}", flush=True)  # fmt: skip
        return {"against": [asdict(one) for one in rows], "other": opened.info.id}


def size_of(full: bool) -> str:
    return "full" if full else "quick"


def write(json: Path | None, html: Path | None, result: dict[str, Any]) -> None:
    """All results as JSON and as a page."""
    if json:
        from raytide.image.atomic import write_file

        write_file(json, text.dumps(result, indent=1, default=float).encode() + b"\n")
    if html:
        from raytide.report.page import write_page
        from raytide.report.verify_page import document

        write_page(html, document(result))


def conclude(verdicts: Sequence[Verdict]) -> int:
    """The last line, and the exit code."""
    short = [one.id for one in verdicts if one.state in ("falls short", "error")]
    skipped = sum(one.state == "skipped" for one in verdicts)
    parts = [f"{len(verdicts) - len(short) - skipped} of {len(verdicts)} hold"]
    parts += [f"{skipped} skipped"] * (skipped > 0) + [f"not: {', '.join(short)}"] * bool(short)
    print("; ".join(parts))
    return SHORT if short else 0


def say(one: Verdict) -> None:
    """One case for people, as it ends."""
    shown = list(one.figures.items())
    shown = [(name, value) for name, value in shown if len(shown) <= MOST_FIGURES or name.split(": ")[0] in one.reason]
    figures = ", ".join(f"{name} {value}" for name, value in shown)
    print(f"[{one.state:^11}] {one.id:4} {one.title}: {one.excess:.2g} of the bar in {one.inputs} inputs, "
          f"{one.seconds:.1f} s", flush=True)  # fmt: skip
    if one.state != "holds":
        lines = [f"bar: {one.bar}"] + [f"found: {figures}"] * bool(figures) + [one.reason] * bool(one.reason)
        print("\n".join(f"{'':15}{line}" for line in lines), flush=True)


def earlier(path: Path, ids: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Records of an earlier run that can be replayed. UsageError for a file of another kind."""
    wanted = "wanted a file that `raytide verify --json` wrote"
    try:
        found = text.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"--replay: {path} cannot be read: {error.strerror or error}; {wanted}") from None
    except ValueError as error:
        raise UsageError(f"--replay: {path}: came no JSON ({error}); {wanted}") from None
    try:
        records = [one for one in found["verdicts"] if one["worst"] and (not ids or one["id"] in ids)]
    except (KeyError, TypeError):
        raise UsageError(f"--replay: {path}: came JSON without verdicts; {wanted}") from None
    if not records:
        raise UsageError(f"--replay: {path} holds no input" + (f" of case {', '.join(ids)}" if ids else ""))
    return records


def again(records: list[dict[str, Any]], lab: Any) -> list[Verdict]:
    """Verdicts of single inputs."""
    from raytide.verify import replay as judge

    verdicts = []
    for record in records:
        verdicts.append(judge(record, lab))
        say(verdicts[-1])
    return verdicts
