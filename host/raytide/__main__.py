"""`raytide`, and `python -m raytide`: the command line, with its streams in order."""

import sys


def main() -> int:
    """Run the command of sys.argv and give its exit code; Ctrl-C during the imports is one, too."""
    try:
        from raytide.cli.main import main as command
        from raytide.cli.streams import prepare_streams

        prepare_streams()
        return command()
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
