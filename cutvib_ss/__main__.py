"""`python -m cutvib_ss`: the command line."""

import sys

from cutvib_ss.cli import main

if __name__ == "__main__":
    sys.exit(main())
