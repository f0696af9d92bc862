"""Every numerical case holds on every device, with the counts of `raytide verify --quick`."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

from raytide.device import Device
from raytide.verify import CASES, judge_case, replay
from raytide.verify.case import place_of
from raytide.verify.lab import Lab

# What falls short, and why. A case that comes to hold must leave this list.
SHORT: dict[str, str] = {}
_LABS: dict[Device, Lab] = {}


def lab_of(device: Device) -> Lab:
    """One lab a device, so that its programs are built once."""
    if device not in _LABS:
        _LABS[device] = Lab(device)
    return _LABS[device]


@pytest.mark.parametrize("id", sorted(CASES, key=place_of))
def test_case_holds(device: Device, id: str) -> None:
    found = judge_case(CASES[id], lab_of(device))
    if id in SHORT:
        assert found.state == "falls short", f"{id} holds now: take it off the list"
        return
    assert found.state == "holds", f"{found.excess:.3g} of the bar ({found.bar}): {found.figures} {found.reason}"
    assert found.inputs > 0


@pytest.mark.parametrize("id", ["S1", "P2", "T1", "F1"])
def test_the_worst_input_alone_gives_the_same_excess(device: Device, id: str) -> None:
    lab = lab_of(device)
    found = judge_case(CASES[id], lab)
    alone = replay(asdict(found), lab)
    assert alone.state == found.state
    assert np.isclose(alone.excess, found.excess, rtol=1e-12) or id == "F1"  # the film's one pixel stands for all
