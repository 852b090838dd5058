"""`python -m isc_core` is the command `isc`."""

import sys

from .cli.main import main

if __name__ == "__main__":
    sys.exit(main())
