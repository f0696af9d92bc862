"""`raytide verify`: which numerical cases hold on a device. Exit code 0 where all that ran hold, else 4."""

from __future__ import annotations

import json as text
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from raytide.errors import UsageError

if TYPE_CHECKING:
    from raytide.verify import Verdict

Flag = Annotated[bool, Parameter(negative="")]
SHORT = 4
MOST_FIGURES = 24  # of a case that falls short; where it has more, those of the trials that do


def verify(
    *,
    device: str | None = None,
    group: str | None = None,
    case: str | None = None,
    quick: Flag = False,
    full: Flag = False,
    json: Path | None = None,
    replay: Path | None = None,
    list: Flag = False,
    threads: int | None = None,
) -> int:
    """Try stiff and extreme cases on a device, against exact or extended-precision oracles.

    Parameters
    ----------
    device
        Part of a device id.
    group
        Only this group of cases: geometry, ...
    case
        Only this case, by its id, e.g. T2.
    quick
        Fewer inputs: seconds instead of minutes. The default.
    full
        As many inputs as the catalogue asks for.
    json
        Write all verdicts, each with its worst input, to this file.
    replay
        A file that --json wrote: judge the worst inputs in it again, alone. With --case only that one's.
    list
        Print the cases and their bars, and stop.
    threads
        Threads of a CPU device.
    """
    from raytide.cli.options import check_outputs
    from raytide.device import open_device
    from raytide.verify import chosen_cases, run_cases
    from raytide.verify.lab import Lab

    if quick and full:
        raise UsageError("came both --quick and --full; wanted one of them")
    cases = chosen_cases(group, case)
    if list:
        for one in cases:
            print(f"{one.id:4} {one.group:10} {one.title}\n{'':16}bar: {one.bar}")
        return 0
    check_outputs([], [json], no_clobber=False)
    records = earlier(replay, case) if replay else []
    with open_device(device, threads=threads) as opened:
        lab = Lab(opened, full=full)
        print(f"raytide: {opened.info.id}, {size_of(full)}", file=sys.stderr)
        verdicts = again(records, lab) if replay else run_cases(cases, lab, say)
        found = opened.info.as_dict() | {"options": [*opened.options]}
    if json:
        write(json, found, size_of(full), verdicts)
    return conclude(verdicts)


def size_of(full: bool) -> str:
    return "full" if full else "quick"


def write(path: Path, device: dict[str, Any], size: str, verdicts: Sequence[Verdict]) -> None:
    """All verdicts as JSON."""
    result = {"schema": "raytide.verify/1", "size": size, "device": device, "verdicts": [asdict(x) for x in verdicts]}
    path.write_text(text.dumps(result, indent=1, default=float) + "\n", encoding="utf-8")


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


def earlier(path: Path, case: str | None) -> list[dict[str, Any]]:
    """Records of an earlier run that can be replayed. UsageError for a file of another kind."""
    try:
        found = text.loads(path.read_text(encoding="utf-8"))
        records = [one for one in found["verdicts"] if one["worst"] and case in (None, one["id"])]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(f"replay: {path} cannot be read as a file of verify --json: {error!r}") from None
    if not records:
        raise UsageError(f"replay: {path} holds no input" + (f" of case {case}" if case else ""))
    return records


def again(records: list[dict[str, Any]], lab: Any) -> list[Verdict]:
    """Verdicts of single inputs."""
    from raytide.verify import replay as judge

    verdicts = []
    for record in records:
        verdicts.append(judge(record, lab))
        say(verdicts[-1])
    return verdicts
