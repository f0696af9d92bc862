"""The page of verify shows every case, and what stability costs where it was measured."""

from __future__ import annotations

from raytide.report.verify_page import document

VERDICT = {"id": "T1", "group": "geometry", "title": "edges <of> a mesh", "bar": "no leak", "naive": "7.1 %",
           "state": "holds", "excess": 0.0, "inputs": 5, "figures": {"leaks": 0}, "seconds": 0.5,
           "reason": ""}  # fmt: skip


def result(**more: object) -> dict[str, object]:
    short = VERDICT | {"id": "M12", "group": "shading", "state": "skipped", "reason": "not built yet"}
    return {"size": "quick", "device": {"id": "pocl"}, "verdicts": [VERDICT, short], **more}


def test_every_case_is_shown_and_words_are_escaped() -> None:
    made = document(result())
    assert "1 of 2 cases hold; 1 skipped; quick counts." in made
    assert "edges &lt;of&gt; a mesh" in made and "not built yet" in made and "What stability costs" not in made


def test_costs_and_another_device_have_sections_where_they_were_measured() -> None:
    cost = {"form": "as it is", "ns_per_ray": 165.0, "leaks": (0, 0, 1, 2), "rays": 1000, "t_error": 1e-7}
    other = {"scene": "room", "other_bits": 0.5, "diverged": 0.0, "energy_ratio": 1.0, "wave": "primary",
             "kernel": "camera", "rays": 0.25}  # fmt: skip
    peers = [{"peer": "embree", "version": "4.4.0", "leaks": (0, 16411, 0, 0), "rays": 1000, "reason": ""},
             {"peer": "mitsuba", "version": "", "leaks": (), "rays": 0, "reason": "not installed"}]  # fmt: skip
    made = document(result(costs=[cost], peers=peers, against=[other], other="intel/cpu0"))
    assert "embree 4.4.0" in made and "16411" in made.replace(",", "") and "mitsuba" not in made
    assert "What stability costs" in made and "165" in made and "intel/cpu0" in made and "primary" in made
