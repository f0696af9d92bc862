"""`raytide reference SCENE -o R.exr`: a reference with the variance of every pixel, in slices; a later run goes on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from raytide.cli.parameters import Flag
from raytide.cli.replicates import Reporter, picture_size
from raytide.cli.signals import StopOnSignal
from raytide.errors import UsageError

if TYPE_CHECKING:
    from raytide.report.reference import Slices
    from raytide.scene.scene import Scene


def reference(
    scene: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    spp: int = 1024,
    slices: int = 16,
    size: str | None = None,
    device: str | None = None,
    threads: int | None = None,
    changes: Annotated[list[str] | None, Parameter(name="--set", negative="")] = None,
    allow_outside: Flag = False,
    quiet: Flag = False,
) -> int:
    """Render a reference: the mean of slices with seeds of their own, and the variance of that mean in every pixel.

    A run that was interrupted goes on with the same command; more --slices make a finished reference better.

    Parameters
    ----------
    scene
        Scene file.
    output
        The picture, .exr; beside it FILE.slices.npz keeps the sums.
    spp
        Samples a pixel of each slice; a power of two is best.
    slices
        Slices in all, at least 2.
    size
        Picture size, such as 64x64; default: the scene's.
    device
        Part of a device id.
    threads
        Threads of a CPU device.
    changes
        key.path=value put over the scene; may be repeated.
    allow_outside
        Let the scene name files outside its folder.
    quiet
        Only errors on stderr.
    """
    from raytide.cli.options import check_outputs, check_range
    from raytide.render.bias import refuse_biased
    from raytide.render.limits import MOST_SPP
    from raytide.scene.load import load

    if output is None or output.suffix.lower() != ".exr":
        raise UsageError(f"output: came {output}; wanted -o FILE.exr")
    check_range("--slices", slices, 2)
    check_range("--spp", spp, 1, MOST_SPP)
    check_outputs([output], [], no_clobber=False)
    with StopOnSignal() as signals:
        loaded = load(scene, overrides=changes or [], allow_outside=allow_outside)
        loaded.camera.size = picture_size(size) or loaded.camera.size
        loaded.render.spp = spp
        refuse_biased(loaded.render, "a reference")
        reporter = Reporter(signals, quiet)
        render_slices(loaded, output, slices, device, threads, reporter)
    return reporter.ended()


def render_slices(scene: Scene, output: Path, slices: int, device: str | None, threads: int | None,
                  reporter: Reporter) -> None:  # fmt: skip
    """All slices that are missing; the file's name goes to stdout once there is one."""
    from raytide.render import Renderer
    from raytide.report.reference import make_reference

    with Renderer(scene, device, threads=threads) as renderer:
        reporter.attach(renderer)
        spp = scene.render.spp
        done = make_reference(renderer, output, spp, slices, reporter.stopped, lambda one: tell(reporter, one, slices))
    if done.count:
        reporter.say(f"{output}: {done.count} slices of {spp} spp in {done.seconds:.1f} s, error {own_error(done)}")
        print(output)


def tell(reporter: Reporter, done: Slices, slices: int) -> None:
    """A line of progress."""
    text = f"{done.count}/{slices} slices, {done.seconds / done.count:.1f} s each"
    reporter.progress(f"{text}, error {own_error(done)}" if done.count > 1 else text, done.count == slices)


def own_error(done: Slices) -> str:
    """The reference's own error, from the spread of its slices."""
    return f"{100 * done.truth('').own_relmse ** 0.5:.2g} %" if done.count > 1 else "unknown (one slice)"
