"""`python -m isc_core` is the command `isc`."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
