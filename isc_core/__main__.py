"""Start of the process: `python -m isc_core`, and the script `isc`.

Importing the libraries takes longer than a user takes to press Ctrl-C, and some of them catch the
exception that it raises. Until `cli.main` takes over, nothing has been written, so Ctrl-C ends the
process at once. The handler is installed before anything else is imported. Python's search for
unreachable objects, a tenth of the time of imports that leave none, begins after them. BLAS works
on one thread unless the environment says otherwise: its threads wait for work by spinning, which
takes the cores from ISC's own.

Dismantling the interpreter after a decomposition takes a third of a second, which frees memory that
the system takes back anyway. So the process ends itself, after what was registered with `atexit`.
"""

import atexit
import gc
import os
import signal
import sys
from contextlib import suppress
from typing import NoReturn

_CANCELLED = 130
# Seconds (Python's own are 5e-3) that a thread waits, after each array operation, for one that
# imports.
_SWITCH = 5e-4


def _end(number: int, frame: object) -> None:
    """End the process as `cli.main` ends a cancelled run."""
    if "json" in sys.argv or "--progress=json" in sys.argv:
        os.write(1, b'{"event": "cancelled"}\n')
    else:
        os.write(2, b"isc: cancelled\n")
    os._exit(_CANCELLED)


def start() -> NoReturn:
    """Run `isc` with the arguments of the process, and end the process with its exit code."""
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, _end)
    gc.disable()  # until `cli.main` has imported the command
    sys.setswitchinterval(_SWITCH)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from .cli.main import main

    code = main()
    # The result is complete: nothing is left to cancel.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # gone, closed, or there is none
            stream.flush()
    os._exit(code)


if __name__ == "__main__":
    start()
