"""Results put side by side: what changed around them first, then what changed in them, with intervals."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from raytide.bench.doubts import flags_of
from raytide.bench.others import seconds_of
from raytide.bench.score import interval_line, score_line
from raytide.bench.show import aligned, figure, measurements
from raytide.errors import UsageError
from raytide.report.summary import ratio_of_medians

# What is looked at where environments are compared, in this order; "" is the file itself.
_LOOKED_AT = (
    ("", ("suite", "class", "class_reasons")),
    ("plan", ("name",)),
    ("tool", ("suite_version", "version", "git_commit", "git_dirty", "suite_sha256", "kernels_sha256")),
    ("device", ("id", "name", "platform_version", "driver", "device_version", "compute_units", "options",
                "driver_files")),
    ("host", ("cpu_model", "cpu_logical", "cpu_allowed", "smt", "mem_bytes", "governor", "turbo", "kernel", "python",
              "numpy", "pyopencl")),
)  # fmt: skip


FAILED = ("invalid", "error")
OTHER_WORK = "another scene, setting or reference"


@dataclass(frozen=True)
class Row:
    """One measurement in both results. `ratio` is new over old, above 1 being better, with its 95 % interval. `doubts`
    are flags of either with the side that has it: ("disturbed", "new")."""

    part: str
    name: str
    old: float
    new: float
    unit: str
    ratio: float
    low: float
    high: float
    doubts: tuple[tuple[str, str], ...] = ()

    @property
    def word(self) -> str:
        """What the interval says, and whether that is certain."""
        found = "better" if self.low > 1 else "worse" if self.high < 1 else None
        return "same within noise" if found is None else f"perhaps {found}" if self.doubts else found

    @property
    def remark(self) -> str:
        """What weakens it, on which side."""
        return ", ".join(f"{flag} in {side}" for flag, side in self.doubts)

    @property
    def disturbed(self) -> bool:
        """Whether others took what the device computes with, on either side."""
        return any(flag == "disturbed" for flag, _ in self.doubts)


@dataclass(frozen=True)
class Comparison:
    """All rows that two results share, what differs around them, what could not be compared, with reasons, what of it
    was right in the old and is wrong or has failed in the new (`lost`), and what the score of each is."""

    differences: list[tuple[str, str, str]]
    rows: list[Row]
    left_out: list[tuple[str, str]]
    lost: list[tuple[str, str]] = field(default_factory=list)
    scores: tuple[str, str] = ("none", "none")
    score_ratio: float | None = None

    def regressions(self, share: float) -> list[Row]:
        """Rows that became worse by more than `share`, and by more than noise. Those that others disturbed are not
        among them: they tell of the machine's load, not of what was measured."""
        return [row for row in self.rows if row.ratio < 1 - share and row.high < 1 and not row.disturbed]

    @property
    def judged(self) -> bool:
        """Whether there is anything that `regressions` can tell of."""
        return any(not row.disturbed for row in self.rows)

    def not_judged(self) -> str | None:
        """What `regressions` leaves out, for people."""
        count = sum(row.disturbed for row in self.rows)
        said = f"{count} of {len(self.rows)} measurements, which others disturbed, do not count"
        return f"{said}: run again on an idle machine" if count else None

    def warning(self) -> str | None:
        """How many rows are in doubt, and why; None where all are as certain as their intervals."""
        doubted = [row for row in self.rows if row.doubts]
        if not doubted:
            return None
        counts = Counter(f"{flag} in {side}" for row in doubted for flag, side in row.doubts)
        said = ", ".join(f"{count} {what}" for what, count in counts.items())
        again = any(flag != OTHER_WORK for row in doubted for flag, _ in row.doubts)
        return f"{len(doubted)} of {len(self.rows)} measurements are in doubt ({said}): what is said of them is not " \
               "certain" + ("; run again on an idle machine" if again else "")  # fmt: skip


def share_of(text: str) -> float:
    """`5%` or `0.05` as 0.05. Raises UsageError."""
    found = re.fullmatch(r"\s*(\d{1,9}(?:\.\d{1,9})?)\s*(%?)\s*", text)
    value = float(found[1]) / (100 if found[2] else 1) if found else -1.0
    if not 0 <= value < 1:
        raise UsageError(f"fail-above: came {text!r}; wanted a share such as 5% or 0.05")
    return value


def check_keys(old: dict[str, Any], new: dict[str, Any], force: bool) -> None:
    """Refuse results of other suites or classes, which measure other work. Raises UsageError."""
    pairs = [("suite_version", old["tool"]["suite_version"], new["tool"]["suite_version"]),
             ("class", old["class"], new["class"]),
             ("plan", old["plan"]["name"], new["plan"]["name"])]  # fmt: skip
    if not same_device(old, new):  # two versions on one device may differ in kernels, two devices may not
        pairs.append(("kernels_sha256", old["tool"]["kernels_sha256"][:12], new["tool"]["kernels_sha256"][:12]))
    bad = [f"{name}: {a} and {b}" for name, a, b in pairs if a != b]
    if bad and not force:
        raise UsageError(f"the results are of other work ({'; '.join(bad)}); --force compares them nevertheless")


def same_device(old: dict[str, Any], new: dict[str, Any]) -> bool:
    """Whether both ran on one device, or on equal ones: ids alone are equal on all machines that have one driver."""
    seen = [(one["device_id"], (one["device"] or {}).get("name"), one["host"].get("cpu_model")) for one in (old, new)]
    return seen[0] == seen[1]


def compare(old: dict[str, Any], new: dict[str, Any], force: bool = False) -> Comparison:
    """`new` against `old`. Raises UsageError where their keys differ, unless forced."""
    check_keys(old, new, force)
    before = {(part, name): one for part, name, one in measurements(old)}
    loads = tuple(any("disturbed" in flags_of(one) for _, _, one in measurements(result)) for result in (old, new))
    rows, left_out, lost = [], [], []
    for part, name, one in measurements(new):
        other = before.pop((part, name), None)
        reason = why_not(other, one, force)
        if reason:
            left_out.append((f"{part} {name}", reason))
            if other and other["status"] == "ok" and one["status"] in FAILED:
                lost.append(left_out[-1])
        else:
            assert other is not None
            rows.append(row_of(part, name, other, one, doubts_of((other, one), loads)))
    for part, name in before:
        whole = new.get(part) or {} if part != "renders" else {}  # a part that failed as a whole has no rows
        failed = before[part, name]["status"] == "ok" and whole.get("status") in FAILED
        left_out.append((f"{part} {name}", f"{whole['status']} in the second: {whole['reason']}" if failed
                         else "only in the first"))  # fmt: skip
        lost += left_out[-1:] if failed else []
    return Comparison(list(differences(old, new)), rows, left_out, lost, (score_words(old), score_words(new)),
                      score_ratio(old, new))  # fmt: skip


def score_words(result: dict[str, Any]) -> str:
    """The score of a result, what its readers must know of it, and where another run may end."""
    line = None if result.get("edited") else score_line(result.get("score"), result["workloads"])
    return "; ".join(filter(None, (line, interval_line(result["score"])))) if line else "none"


def score_ratio(old: dict[str, Any], new: dict[str, Any]) -> float | None:
    """The new score over the old; None where either has none, or they are of different tables."""
    scores = [one.get("score") or {} for one in (old, new) if not one.get("edited")]
    if len(scores) < 2 or any(scores[0].get(key) != scores[1].get(key) for key in ("name", "reference_table")):
        return None
    before, after = (one.get("value") for one in scores)
    return float(after / before) if before and after else None


def why_not(old: dict[str, Any] | None, new: dict[str, Any], force: bool) -> str | None:
    """Why two measurements cannot be compared."""
    if old is None:
        return "only in the second"
    for which, one in (("first", old), ("second", new)):
        if one["status"] != "ok":
            return f"{one['status']} in the {which}: {one['reason']}"
    if old.get("workload_sha256") != new.get("workload_sha256") and not force:
        return "another workload: scene, settings or reference changed"
    return None


def doubts_of(sides: Sequence[dict[str, Any]], loads: Sequence[bool]) -> tuple[tuple[str, str], ...]:
    """Flags of a measurement in the old and in the new, and whether it is of other work. Where nobody watched who else
    was there (sets of rays), it is disturbed where anything in its run is (`loads`)."""
    out: list[tuple[str, str]] = []
    if sides[0].get("workload_sha256") != sides[1].get("workload_sha256"):  # only where forced
        out.append((OTHER_WORK, "new"))
    for side, one, load in zip(("old", "new"), sides, loads, strict=True):
        unseen = ["disturbed"] if load and "disturbed" not in one["summary"] else []
        out += [(flag, side) for flag in (*unseen, *flags_of(one))]
    return tuple(out)


def row_of(
    part: str, name: str, old: dict[str, Any], new: dict[str, Any], doubts: tuple[tuple[str, str], ...] = ()
) -> Row:
    """A ratio of medians with its bootstrap interval, from the raw values."""
    _, low, high = ratio_of_medians(rates_of(old), rates_of(new))
    summary = new["summary"]
    return Row(part, name, old["summary"]["median"], summary["median"], summary["unit"],
               summary["median"] / old["summary"]["median"], low, high, doubts)  # fmt: skip


def rates_of(one: dict[str, Any]) -> np.ndarray:
    """The rate of each value that counts."""
    summary = one["summary"]
    if "values" in summary:
        return np.array(summary["values"])
    seconds = np.array(seconds_of(one), np.float64)
    return summary["median"] * float(np.median(seconds)) / seconds


def differences(old: dict[str, Any], new: dict[str, Any]) -> Iterator[tuple[str, str, str]]:
    """(what, in the old, in the new) of everything around the numbers that differs."""
    for group, keys in _LOOKED_AT:
        for key in keys:
            a, b = (((one.get(group) or {}) if group else one).get(key) for one in (old, new))
            if a != b:
                yield f"{group}.{key}".lstrip("."), short(a), short(b)
    for name in sorted({*old["env"], *new["env"]}):
        a, b = (one["env"].get(name) for one in (old, new))
        if a != b:
            yield f"env.{name}", short(a), short(b)
    for key in ("edited",):
        if old.get(key) or new.get(key):
            yield "the file was edited", short(bool(old.get(key))), short(bool(new.get(key)))


def short(value: Any) -> str:
    """A value in a few words."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return ", ".join(f"{one.get('name')} {str(one.get('sha256'))[:8]}" for one in value)
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    text = "not set" if value is None else str(value)
    return text[:12] if re.fullmatch(r"[0-9a-f]{40,64}", text) else text


def comparison_text(names: Sequence[str], found: Comparison) -> str:
    """For a terminal."""
    parts = [f"{names[1]} against {names[0]}"]
    if warning := found.warning():
        parts.append(f"NOTE: {warning}")
    if found.differences:
        first, second = (f"  {name + ':':{max(map(len, names)) + 1}}" for name in names)
        rows = [f"{what}\n{first} {old}\n{second} {new}" for what, old, new in found.differences]
        parts.append("\n".join(["WHAT DIFFERS", *rows]))
    if found.scores != ("none", "none"):
        width = max(map(len, names)) + 1
        lines = [f"  {name + ':':{width}} {words}" for name, words in zip(names, found.scores, strict=True)]
        lines += [f"  new over old: {found.score_ratio:.3f}"] if found.score_ratio else []
        parts.append("\n".join(["SCORE", *lines]))
    if found.rows:
        cells = [[f"{row.part} {row.name}", figure(row.old, unit(row)), figure(row.new, unit(row)), f"{row.ratio:.3f}",
                 f"{row.low:.3f} to {row.high:.3f}", "; ".join(filter(None, (row.word, row.remark)))]
                 for row in found.rows]  # fmt: skip
        parts.append(aligned(["MEASUREMENT", "OLD", "NEW", "NEW / OLD", "95 %", ""], cells))
    reasons: dict[str, list[str]] = {}
    for name, reason in found.left_out:
        reasons.setdefault(reason, []).append(name)
    if reasons:
        parts.append("\n".join(f"left out: {', '.join(which)}: {reason}" for reason, which in reasons.items()))
    return "\n\n".join(parts)


def unit(row: Row) -> str:
    return "/s" if row.unit == "1/s" else row.unit
