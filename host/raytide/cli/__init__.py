"""The command line: one file a command. Commands read arguments, call the API and print; nothing else does."""

from __future__ import annotations

from contextvars import ContextVar

COMMAND_WORDS: ContextVar[tuple[str, ...]] = ContextVar("COMMAND_WORDS", default=())  # of the command that runs now
PREFIX = "RAYTIDE_"  # of environment variables
OTHER_VARIABLES = ("CACHE_DIR", "CACHE_MB", "BUILD_WORKERS")  # which are no settings of a render
