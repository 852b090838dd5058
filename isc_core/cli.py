"""The command `isc`: runs a sub-command and turns how it ended into an exit code and at most one line.

0: done. 1: done, but what was measured breaks a bound; stderr says which. 2: something given cannot be used, or the machine has no room
for it; one line on stderr says what to do. 130: cancelled by Ctrl-C (the first lets the work stop at its next step, the second stops it
at once). Nothing half-written is left in any case.
"""

import contextlib
import os
import re
import sys
from collections.abc import Sequence

from .errors import Cancelled, InputError, Rejected

SUCCESS, BROKEN_PIPE, REJECTED, REFUSED, CANCELLED = 0, 1, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs `isc` with `arguments`, those of the process if None, and returns its exit code; never raises for a user's mistake."""
    try:
        code = _run(list(sys.argv[1:] if arguments is None else arguments))
        sys.stdout.flush()
        return code
    except InputError as error:
        return _refuse(str(error))
    except Rejected as verdict:
        for line in str(verdict).splitlines():
            print(f"isc: rejected: {line}", file=sys.stderr)
        return REJECTED
    except (Cancelled, KeyboardInterrupt):
        print("isc: cancelled", file=sys.stderr)
        return CANCELLED
    except BrokenPipeError:
        _discard_output()
        return BROKEN_PIPE
    except MemoryError:
        return _refuse("there is not enough memory for this: give a smaller image or a smaller --max-size")
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _refuse(f"{where}{error.strerror or error}")


def _run(arguments: list[str]) -> int:
    # Numerical libraries take a second to load: inside `main`, so that Ctrl-C is answered during that second too.
    from .commands import build_parser
    from .terminal import Interrupts, ProgressBar

    try:
        options = build_parser().parse_args(arguments)
    except SystemExit as done:  # --help and --version
        return int(done.code or 0)
    with Interrupts() as interrupts, ProgressBar(sys.stderr, quiet=options.quiet) as bar:
        lines = options.run(options, interrupts.monitor(bar))
    for line in lines:
        print(line)
    return SUCCESS


def _refuse(message: str) -> int:
    one_line = re.sub(r"[\x00-\x1f\x7f]+", " ", message).strip()
    print(f"isc: error: {one_line}", file=sys.stderr)
    return REFUSED


def _discard_output() -> None:
    """Points standard output at nothing, so that what is still buffered does not fail once more when Python ends."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
