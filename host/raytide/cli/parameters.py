"""Parameters that several commands share, with their help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

MOST_STOPS = 100.0


def check_stops(kind: object, stops: float) -> None:
    """Refuse an exposure that no picture survives. Raises ValueError, which the parser tells with the option's name."""
    if not abs(stops) <= MOST_STOPS:  # NaN is refused, too
        raise ValueError(f"wanted stops from {-MOST_STOPS:g} to {MOST_STOPS:g}")


Flag = Annotated[bool, Parameter(negative="")]

Defines = Annotated[
    list[str] | None,
    Parameter(name=["--define", "-D"], negative="", help="name=value of a Mitsuba scene's parameter; may be repeated"),
]
Outputs = Annotated[
    list[Path] | None, Parameter(name=["--output", "-o"], negative="", help=".exr or .png; may be repeated")
]
Changes = Annotated[
    list[str] | None, Parameter(name="--set", negative="", help="key.path=value put over the scene; may be repeated")
]
Kept = Annotated[
    Path | None, Parameter(help="keep the render in this file as it goes on; `raytide resume FILE` goes on from it")
]
Every = Annotated[
    str | None, Parameter(help="time between checkpoints, such as 30s; default: 60s, and at most 1 % of the time")
]
Samples = Annotated[
    str | None, Parameter(help="only samples A:B of each pixel, such as 256:512, into -o F.shard for `raytide merge`")
]
Half = Annotated[Flag, Parameter(help="EXR: beauty and albedo as half floats")]
Exposure = Annotated[float, Parameter(help="PNG: stops", validator=check_stops)]
NoClobber = Annotated[Flag, Parameter(help="refuse to replace a file")]
Quiet = Annotated[Flag, Parameter(help="only errors on stderr")]
Verbose = Annotated[Flag, Parameter(name=["--verbose", "-v"], help="all messages")]
LogJson = Annotated[Flag, Parameter(help="stderr as JSON lines")]
