"""`raytide COMMAND ...`: finds the command, and turns every failure into one message and an exit code.

Commands are imported only when they are asked for, so that `raytide --help` starts at once.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import raytide
from raytide.cli import COMMAND_WORDS, OTHER_VARIABLES, PREFIX
from raytide.errors import RaytideError, wanted_of

if TYPE_CHECKING:
    from cyclopts import App, CycloptsError
    from rich.console import Console

# name: where the function or App is, and its line in the help
COMMANDS = {
    "render": ("raytide.cli.render:render", "Render a scene file to EXR or PNG."),
    "resume": ("raytide.cli.resume:resume", "Go on with a render from its checkpoint."),
    "merge": ("raytide.cli.shard:merge", "Put sample ranges of one picture together."),
    "scene": ("raytide.cli.scene:app", "Check, describe and convert scene files."),
    "compare": ("raytide.cli.compare:compare", "Compare two pictures: errors, and whether they differ beyond noise."),
    "reference": ("raytide.cli.reference:reference", "Render a converged picture that knows its own variance."),
    "converge": ("raytide.cli.converge:converge", "Measure error against time and samples."),
    "audit": ("raytide.cli.audit:audit", "Count how often the error bands of renders hold."),
    "devices": ("raytide.cli.devices:devices", "List the OpenCL devices."),
    "doctor": ("raytide.cli.doctor:doctor", "Check drivers, devices and caches, and tell what mends them."),
    "verify": ("raytide.cli.verify:verify", "Try numerically hard cases on a device."),
    "bench": ("raytide.cli.bench:app", "Measure devices: a score for right pictures only."),
    "cache": ("raytide.cli.cache:app", "Show or clear the kernel cache."),
}
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and give its exit code: 0 ok, 1 run time, 2 usage, 3 no device, 4 image invalid, 130 Ctrl-C."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return run(words)
    except RaytideError as error:
        return failed(str(error), error.exit_code, words)
    except KeyboardInterrupt:
        return failed("interrupted; nothing was written", INTERRUPTED, words)
    except BrokenPipeError:  # the reader of stdout went away, as in `raytide devices | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except MemoryError:
        return unfinished("the host is out of memory", words)
    except OSError as error:
        return unfinished(str(error), words)
    except Exception as error:
        what = f"unexpected {type(error).__name__}: {error}"
        return unfinished(f"{what}; please report it with the output of `raytide doctor`", words)


def run(words: list[str]) -> int:
    """Parse `words` and call the command. Raises what the command raises."""
    if words == ["--version"]:
        print(f"raytide {raytide.__version__}")
        return 0
    from cyclopts import CycloptsError

    COMMAND_WORDS.set(tuple(words))
    app = command_app()
    if not words:
        app.help_print([], console=people())
        return 2
    if not words[0].startswith("-") and words[0] not in COMMANDS:  # cyclopts would load every command to say this
        return failed(f"came the unknown command {words[0]!r}; {wanted_of(words[0], list(COMMANDS))}", 2, words)
    warn_of_variables(words)
    try:
        result = app(words, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        return failed(f"{' '.join(str(error).split())} (`{help_command(error)}` lists the options)", 2, words)
    return result if isinstance(result, int) else 0


def warn_of_variables(words: Sequence[str]) -> None:
    """Tell of variables that look like settings and are none; silent with --quiet."""
    plain = tuple(PREFIX + key for key in ("DEVICE", *OTHER_VARIABLES, "TEST_"))
    if "--quiet" in words or all(name.startswith(plain) for name in os.environ if name.startswith(PREFIX)):
        return  # as a rule, without loading the table of all settings
    from raytide.cli.config import unknown_variables

    for text in unknown_variables(os.environ):
        if "--log-json" in words:
            import json

            print(json.dumps({"event": "log", "level": "warning", "text": text}), file=sys.stderr)
        else:
            print(f"raytide: warning: {text}", file=sys.stderr)


def command_app() -> App:
    """The command line's root; commands stay unloaded."""
    from cyclopts import App

    app = App(
        name="raytide",
        help="Portable OpenCL compute renderer: waves of rays, honest errors, stable numbers.",
        version=f"raytide {raytide.__version__}",
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )
    for name, (place, line) in COMMANDS.items():
        app.command(place, name=name, help=line)
    return app


def people() -> Console:
    """The console of stderr."""
    from rich import console

    return console.Console(stderr=True)


def help_command(error: CycloptsError) -> str:
    """The command whose help fits what was typed: the innermost that was found, `raytide bench compare --help`."""
    return " ".join(["raytide", *(error.command_chain or ()), "--help"])


def failed(message: str, code: int, words: Sequence[str]) -> int:
    """Print why, as JSON to those who asked for it, and give the exit code back."""
    sys.stdout.flush()
    if "--log-json" in words:
        import json

        print(json.dumps({"event": "failed", "exit_code": code, "text": message}), file=sys.stderr)
    else:
        print("\n".join(f"raytide: {line}" for line in message.splitlines() or ["failed"]), file=sys.stderr)
    return code


def unfinished(message: str, words: Sequence[str]) -> int:
    """A run-time failure; the traceback only for those who asked with -v."""
    if "-v" in words or "--verbose" in words:
        import traceback

        traceback.print_exc()
        return failed(message, 1, words)
    return failed(f"{message} (-v shows where)", 1, words)
