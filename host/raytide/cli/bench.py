"""`raytide bench`: measure devices. Reads no configuration file, so that equal commands mean equal work."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

from raytide.cli.parameters import Flag
from raytide.errors import DeviceError, UsageError

if TYPE_CHECKING:
    from raytide.bench.runner import Job

INVALID, NO_DEVICE, FAILED, REGRESSION, INTERRUPTED = 4, 3, 1, 5, 130
SUFFIX = ".bench.json"
PATIENCE = "5min"
LONGEST_S = 1e6

app = App(name="bench", help="Measure devices: a score for right pictures only.", result_action="return_value")


@app.default
def bench(
    *,
    suite: Literal["quick", "full", "peaks", "build", "rays", "renders"] = "quick",
    device: str | None = None,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"])] = None,
    csv: Path | None = None,
    html: Path | None = None,
    quick: Flag = False,
    workload: Annotated[list[str] | None, Parameter(negative="")] = None,
    threads: int | None = None,
    traversal: str = "single",
    scramble: Flag = False,
    soak: str | None = None,
    patience: str = PATIENCE,
) -> int:
    """Measure a device, or all. Each runs in a process of its own: one that crashes or hangs is a result.

    Ctrl-C keeps the parts that were finished: as a partial result, which has no score.

    Parameters
    ----------
    suite
        quick: everything, small, at most three minutes on two cores; full: at most twelve. peaks: arithmetic,
        bandwidth, launches. build: trees. rays: fixed sets of rays. renders: six pictures, verified, then timed.
    device
        Part of a device id, or all.
    output
        Write the result here, by custom as NAME.bench.json. With several devices each has a file of its own.
    csv
        Write one row for each measurement to this file.
    html
        Write a page for people to this file: works offline, tables sort.
    quick
        The sizes of suite quick for another suite.
    workload
        Only this workload of suite renders; may be repeated. No score then.
    threads
        Threads of a CPU device.
    traversal
        How suite rays traces them.
    scramble
        Permute triangles and workloads: rates should not change. Never scored.
    soak
        Time for which every workload is repeated after its timing, such as 10min: does the device slow down?
    patience
        Time without a word from a driver after which it is ended.
    """
    jobs = jobs_of(suite, device, quick, workload, threads, traversal, scramble, soak, patience)
    return measure(jobs, output, csv, html)


def measure(jobs: Sequence[Job], output: Path | None, csv: Path | None, html: Path | None) -> int:
    """Runs the jobs, shows and writes what they found; gives the exit code of the worst."""
    from raytide.bench.runner import run_job
    from raytide.cli.options import check_outputs

    check_outputs([], [output, csv, html], no_clobber=False)
    results = []
    for job in jobs:
        say(f"{job.device}: suite {job.suite}")
        results.append(run_job(job, say, sys.argv[1:]))
        show(results[-1])
        if output:
            write(output if len(jobs) == 1 else beside(output, job.device), results[-1])
        if results[-1].get("partial"):
            break
    if csv:
        write_csv(csv, results)
    if html:
        write_html(html, results)
    if results[-1].get("partial"):
        return INTERRUPTED
    return max(map(exit_code, results), key=(0, FAILED, NO_DEVICE, INVALID).index)


def jobs_of(
    suite: str, device: str | None, quick: bool, workload: Sequence[str] | None, threads: int | None, traversal: str,
    scramble: bool, soak: str | None, patience: str,
) -> list[Job]:
    """One for each device. Raises UsageError and DeviceError before anything runs."""
    import secrets
    from dataclasses import replace

    from raytide.bench.runner import Job
    from raytide.bench.workloads import WORKLOADS
    from raytide.cli.options import seconds_of
    from raytide.errors import list_words, nearest
    from raytide.report.ray_tracer import TRAVERSALS

    for name in workload or ():
        if name not in WORKLOADS:
            hint = nearest(name, list(WORKLOADS))
            wanted = list_words(list(WORKLOADS)) + (f"; {hint}" if hint else "")
            raise UsageError(f"workload: came {name!r}; wanted {wanted}")
    if traversal not in TRAVERSALS:
        raise UsageError(f"traversal: came {traversal!r}; wanted one of {', '.join(TRAVERSALS)}")
    if threads is not None and not 1 <= threads < 1e6:
        raise UsageError(f"threads: came {threads}; wanted a number from 1 on")
    soak_s, patience_s = seconds_of("--soak", soak) or 0.0, seconds_of("--patience", patience) or 0.0
    for option, text, value, least in (("--soak", soak, soak_s, 0.0), ("--patience", patience, patience_s, 1.0)):
        if not least <= value < LONGEST_S:
            raise UsageError(f"{option}: came {text!r}; wanted a time from {least:g} s to {LONGEST_S:g} s")
    seed = secrets.randbits(30) if scramble else None
    job = Job("", suite, quick, threads, tuple(workload or ()), seed, soak_s, patience_s, traversal)
    refuse_idle(job)
    return [replace(job, device=name) for name in device_ids(device)]


def refuse_idle(job: Job) -> None:
    """Refuse options that would change nothing in this suite. Raises UsageError."""
    kinds = {part.partition("/")[0] for part in job.parts}
    for option, given, needed in (("workload", bool(job.only), "renders"), ("soak", job.soak_s > 0, "renders"),
                                  ("traversal", job.traversal != "single", "rays")):  # fmt: skip
        if given and needed not in kinds:
            raise UsageError(f"{option}: does nothing in suite {job.suite}; wanted suite quick, full or {needed}")


def device_ids(wanted: str | None) -> list[str]:
    """Ids of the devices to measure; no driver is loaded in this process. Checking tools only where they are named."""
    from raytide.device import choose, devices_in_child

    found = devices_in_child()
    if wanted == "all":
        ids = [one.id for one in found if not one.id.startswith("oclgrind")]
        if not ids:
            choose(found, [])
            raise DeviceError("no device but a checking tool was found; name it with --device")
        return ids
    override = os.environ.get("RAYTIDE_DEVICE")
    wishes = [override] if override else [wanted] if wanted else []
    return [choose(found, wishes, from_environment=bool(override)).id]


def exit_code(result: dict[str, Any]) -> int:
    """4 where anything was wrong, 3 where the device did nothing, 1 where a part of it failed."""
    from raytide.bench.runner import statuses

    found = set(statuses(result).values())
    if "invalid" in found:
        return INVALID
    return 0 if "error" not in found else NO_DEVICE if found == {"error"} else FAILED


def say(line: str) -> None:
    """One line for people."""
    print(f"raytide: {line}", file=sys.stderr, flush=True)


def show(result: dict[str, Any]) -> None:
    from raytide.bench.show import tables

    print(tables(result), flush=True)


def beside(output: Path, device: str) -> Path:
    """NAME.DEVICE.bench.json for NAME.bench.json."""
    name = output.name.removesuffix(SUFFIX) if output.name.endswith(SUFFIX) else output.stem
    return output.with_name(f"{name}.{device.replace('/', '-')}{SUFFIX}")


def write(path: Path, result: dict[str, Any]) -> None:
    """The file appears only when it is complete."""
    import json

    from raytide.report.files import write_text

    write_text(path, json.dumps(result, indent=1) + "\n")  # as it was hashed
    say(f"wrote {path}")


def write_csv(path: Path, results: Sequence[dict[str, Any]]) -> None:
    from raytide.bench.show import csv_text
    from raytide.report.files import write_text

    texts = [csv_text(result) for result in results]
    write_text(path, texts[0] + "".join(text.partition("\n")[2] for text in texts[1:]))
    say(f"wrote {path}")


def write_pyperf(path: Path, result: dict[str, Any]) -> None:
    from raytide.bench.pyperf_export import pyperf_text
    from raytide.report.files import write_text

    write_text(path, pyperf_text(result))
    say(f"wrote {path}")


def write_html(path: Path, results: Sequence[dict[str, Any]]) -> None:
    from raytide.bench.report import result_page, summary_page

    write_document(path, result_page(results[0]) if len(results) == 1 else summary_page(results))


def write_document(path: Path, document: str) -> None:
    """A page for people."""
    from raytide.report.page import write_page

    write_page(path, document)
    say(f"wrote {path}")


@app.command
def schema() -> int:
    """Print the JSON schema of result files."""
    import json

    from raytide.bench.model import json_schema

    print(json.dumps(json_schema(), indent=1))
    return 0


@app.command(name="show")
def show_file(
    file: Path, /, *, csv: Flag = False, html: Path | None = None, pyperf: Path | None = None
) -> int:
    """Print a result file as tables, or as CSV.

    Parameters
    ----------
    file
        What `raytide bench -o` wrote.
    csv
        One row for each measurement.
    html
        Write a page for people to this file instead.
    pyperf
        Write the raw values to this file, for `python -m pyperf` to check, plot and compare, instead.
    """
    from raytide.bench.files import load_result
    from raytide.bench.show import csv_text, tables
    from raytide.cli.options import check_outputs

    check_outputs([], [html, pyperf], no_clobber=False)
    result = load_result(file)
    if html:
        write_html(html, [result])
    if pyperf:
        write_pyperf(pyperf, result)
    if html or pyperf:
        return exit_code(result)
    print(csv_text(result) if csv else tables(result), end="" if csv else "\n")
    return exit_code(result)


@app.command
def compare(
    *files: Path, fail_above: str | None = None, html: Path | None = None, force: Flag = False
) -> int:
    """Compare result files with the first of them: what differs around them, then ratios with intervals.

    Exit code 5 with --fail-above where a measurement became worse by more than that, and by more than noise, or was
    right in the first and is wrong or has failed since. What others disturbed does not count; 1 where nothing else is
    left to judge.

    Parameters
    ----------
    files
        Two or more result files.
    fail_above
        Share such as 5%.
    html
        Write a page for people to this file too.
    force
        Compare results of other suites, classes or kernels nevertheless.
    """
    from raytide.bench import compare as comparing
    from raytide.bench.files import load_result
    from raytide.cli.options import check_outputs

    if len(files) < 2:
        raise UsageError(f"compare: came {len(files)} files; wanted two or more that `raytide bench -o` wrote")
    share = comparing.share_of(fail_above) if fail_above else None
    check_outputs([], [html], no_clobber=False)
    first, *others = [load_result(file) for file in files]
    names = names_of(files)
    found = [comparing.compare(first, other, force) for other in others]
    worse, blind = list[str](), list[str]()
    for name, one in zip(names[1:], found, strict=True):
        print(comparing.comparison_text((names[0], name), one))
        if share is not None:
            worse += [f"{name}: {row.part} {row.name} {row.ratio:.3f}" + (f" ({row.remark})" if row.remark else "")
                      for row in one.regressions(share)]  # fmt: skip
            worse += [f"{name}: {what}: {reason}" for what, reason in one.lost]
            if said := one.not_judged():
                say(f"fail-above: {name}: {said}")
            if not one.judged:
                blind.append(name)
    if html:
        from raytide.bench.report import comparison_page

        write_document(html, comparison_page(names, found))
    for line in worse:
        say(f"worse: {line}")
    for name in blind:
        say(f"fail-above: {name}: nothing could be judged: no measurement is in both files that others left alone")
    return REGRESSION if worse else 1 if blind else 0


def names_of(files: Sequence[Path]) -> list[str]:
    """What results are called: their files' names, with folders where two share one."""
    names = [file.name.removesuffix(SUFFIX) for file in files]
    return names if len(set(names)) == len(names) else [str(file).removesuffix(SUFFIX) for file in files]


@app.command
def summary(folder: Path, /, *, html: Path | None = None) -> int:
    """Summarise a folder of result files as one table, and as one page that sorts and works offline.

    Files that are no results are left out, and named.

    Parameters
    ----------
    folder
        Where the files *.bench.json are.
    html
        Write the page to this file too.
    """
    from raytide.bench.files import load_result
    from raytide.bench.report import summary_markdown, summary_page
    from raytide.cli.options import check_outputs

    files = sorted(folder.glob(f"*{SUFFIX}"))
    if not files:
        raise UsageError(f"{folder}: came no file *{SUFFIX}; wanted a folder with results of `raytide bench -o`")
    check_outputs([], [html], no_clobber=False)
    results = []
    for file in files:
        try:
            results.append(load_result(file))
        except UsageError as error:
            say(f"warning: left out {error}")
    if not results:
        raise UsageError(f"{folder}: none of its files *{SUFFIX} is a result; wanted what `raytide bench -o` wrote")
    print(summary_markdown(results))
    if html:
        write_document(html, summary_page(results))
    return 0
