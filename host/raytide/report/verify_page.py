"""The page of `verify`: every case with its bar and what came of it, cost of stability, another device beside this."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from raytide.report.page import Html, details, element, facts, grade, number, page, paragraph, section, table
from raytide.report.plot import bars

STATES = {"holds": True, "falls short": False, "error": False, "skipped": None}


def document(result: Mapping[str, Any]) -> str:
    """The page of what `raytide verify --json` writes: device, verdicts, and `costs` and `against` where they are."""
    verdicts = result["verdicts"]
    count = {state: sum(one["state"] == state for one in verdicts) for state in STATES}
    words = [f"{count['holds']} of {len(verdicts)} cases hold"] + [f"{n} {state}" for state, n in count.items()
                                                                if n and state != "holds"]  # fmt: skip
    device = {name: value for name, value in result["device"].items() if isinstance(value, str | int)}
    body = [section("Device", facts(device))]
    body += [group_section(name, verdicts) for name in dict.fromkeys(one["group"] for one in verdicts)]
    if result.get("costs"):
        body.append(cost_section(result["costs"], result.get("peers", ())))
    if result.get("against"):
        body.append(against_section(result["against"], str(result.get("other", ""))))
    return page("Numbers that hold", *body, lead=f"{'; '.join(words)}; {result['size']} counts.")


def group_section(name: str, verdicts: Sequence[Mapping[str, Any]]) -> Html:
    """One group of cases; what was found stands folded under the table."""
    own = [one for one in verdicts if one["group"] == name]
    rows = [[one["id"], one["title"], one["bar"], grade(one["state"], STATES[one["state"]]), float(one["excess"]),
             one["inputs"], one["naive"], float(one["seconds"])] for one in own]  # fmt: skip
    head = ("case", "what is tried", "bar", "", "worst / bar", "inputs", "usual float32", "s")
    lines = [element("p", element("b", one["id"], " "), figures_words(one)) for one in own]
    return section(name, table(head, rows), details("What was found", *lines))


def figures_words(one: Mapping[str, Any]) -> str:
    """Figures and reason of one case."""
    words = ", ".join(f"{name} {number(value)}" for name, value in one["figures"].items())
    return f"{words}{'; ' if words and one['reason'] else ''}{one['reason']}"


def cost_section(costs: Sequence[Mapping[str, Any]], peers: Sequence[Mapping[str, Any]] = ()) -> Html:
    """Time and leaks of every form of the triangle test, and the leaks of peers by the same rays."""
    rows = [[one["form"], one["ns_per_ray"], *one["leaks"], one["t_error"]] for one in costs]
    rows += [[f"{one['peer']} {one['version']}", "", *one["leaks"], ""] for one in peers if one["leaks"]]
    head = ("form", "ns a ray", "leaks at edges", "at vertices", "far edges", "far vertices", "error of t, p99")
    plot = bars([one["form"] for one in costs], [one["ns_per_ray"] for one in costs], "ns a ray, closest and any hit")
    return section("What stability costs", table(head, rows, f"leaks of {costs[0]['rays']:,} aimed rays each"), plot)


def against_section(rows: Sequence[Mapping[str, Any]], other: str) -> Html:
    """The same samples on another device."""
    head = ("scene", "pixels of other bits", "diverged", "energy ratio", "first wave that differs", "kernel", "rays")
    names = ("scene", "other_bits", "diverged", "energy_ratio", "wave", "kernel", "rays")
    lines = [[one[name] for name in names] for one in rows]
    return section("Against another device", paragraph(other), table(head, lines, digits=6))
