"""The words of a progress line: figures of a running render in few characters."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

JSON_KEYS = (
    "spp", "seconds", "rays", "mrays_per_s", "error", "error_low", "error_high", "error_spp", "left_s", "prediction",
    "limits",
)  # fmt: skip


def figures(status: Mapping[str, Any]) -> str:
    """`16/64 spp  3.2 % (2.5-3.7 %)  12.3 Mrays/s`; the parts that are not known are left out."""
    total = (status.get("limits") or {}).get("spp")
    samples = f"{status.get('spp', 0)}/{total} spp" if total else f"{status.get('spp', 0)} spp"
    rate = f"{status.get('mrays_per_s', 0.0):.1f} Mrays/s"
    return "  ".join(part for part in (samples, error_with_band(status), rate) if part)


def error_with_band(status: Mapping[str, Any]) -> str:
    """`error 3.2 % (2.5-3.7 %)`, or nothing where it is not known."""
    if status.get("error") is None:
        return ""
    low, high = (percent(status[key]) for key in ("error_low", "error_high"))
    return f"error {percent(status['error'])} ({low.removesuffix(' %')}-{high})"


def percent(share: float) -> str:
    """Two digits: `3.2 %`, `0.085 %`, `120 %`."""
    digits = f"{100 * share:.2g}"
    return f"{float(digits):.0f} %" if "e" in digits else f"{digits} %"


def prediction_words(prediction: Mapping[str, float]) -> str:
    """`1 % in 4 min 10 s +- 40 s`."""
    left = prediction["left_s"]
    doubt = max(prediction["high_s"] - left, left - prediction["low_s"])
    return f"{percent(prediction['target'])} in {duration(left)} +- {duration(doubt)}"


def duration(seconds: float) -> str:
    """Two units at most: `4.2 s`, `12 s`, `4 min 10 s`, `3 h 20 min`, `2 d 3 h`."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    for large, small, words in ((86400, 3600, ("d", "h")), (3600, 60, ("h", "min")), (60, 1, ("min", "s"))):
        if round(seconds / small) * small >= large:
            count = round(seconds / small)
            whole, rest = divmod(count, large // small)
            return f"{whole} {words[0]} {rest} {words[1]}" if rest else f"{whole} {words[0]}"
    return f"{seconds:.0f} s"


def left_words(status: Mapping[str, Any]) -> str:
    """The prediction, where an error is to be reached, else `12 s left`."""
    if status.get("prediction"):
        return prediction_words(status["prediction"])
    return f"{duration(status['left_s'])} left" if status.get("left_s") is not None else ""


def plain_line(status: Mapping[str, Any]) -> str:
    """One line of progress for people."""
    return "raytide: " + "  ".join(part for part in (figures(status), left_words(status)) if part)


def json_line(status: Mapping[str, Any]) -> str:
    """One line of progress for programs."""
    return json.dumps({"event": "progress"} | {key: status.get(key) for key in JSON_KEYS})
