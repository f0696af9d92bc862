"""`python -m raytide` is the command line."""

import sys

from raytide.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
