"""Running a benchmark: what its user got wrong is one line, and exit code 2."""

import sys
from collections.abc import Callable
from typing import NoReturn

from isc_core.errors import InputError


def run_program(main: Callable[[], int | None]) -> NoReturn:
    """Run the main function of a program, and end the process.

    Parameters
    ----------
    main : callable
        Returns an exit code, or None for success.

    Raises
    ------
    SystemExit
        With the exit code; 2 after an `InputError`, whose message is printed.
    """
    try:
        code = main()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        code = 2
    sys.exit(code)
