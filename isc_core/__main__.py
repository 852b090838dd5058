"""Entry point of the process: `python -m isc_core`, and the script `isc`.

Importing the libraries takes long enough for a user to press Ctrl-C, and some of them catch the
exception that it raises. Until `cli.main` takes over, nothing has been written, so Ctrl-C ends the
process at once. The handler is installed before anything else is imported. Garbage collection,
which takes a tenth of the time of imports and frees nothing, is enabled after them. Threads share
one heap. BLAS runs on one thread unless the environment sets another number: its threads wait for
work by spinning, which takes cores from ISC's own threads. It uses the instructions of this
processor even if it is older than it.

Finalising the interpreter after a decomposition takes a third of a second and only frees memory
that the system reclaims anyway. So the process calls the functions registered with `atexit` and
exits at once.
"""

import atexit
import gc
import os
import signal
import sys

_CANCELLED = 130
# Seconds (Python's default is 5e-3) that a thread waits, after each array operation, for a thread
# that imports.
_SWITCH_INTERVAL = 5e-4


def _end(number: int, frame: object) -> None:
    """End the process as `cli.main` ends a cancelled run."""
    if "json" in sys.argv or "--progress=json" in sys.argv:
        os.write(1, b'{"event": "cancelled"}\n')
    else:
        os.write(2, b"isc: cancelled\n")
    os._exit(_CANCELLED)


def _choose_blas() -> None:
    """Set what OpenBLAS reads when NumPy is imported, unless the user has."""
    from .numerics.blas import openblas_core_type

    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    core_type = openblas_core_type()
    if core_type is not None:
        os.environ.setdefault("OPENBLAS_CORETYPE", core_type)


def start() -> None:
    """Run `isc` with the arguments of the process, and end the process with its exit code."""
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, _end)
    gc.disable()  # until `cli.main` has imported the command
    sys.setswitchinterval(_SWITCH_INTERVAL)
    _choose_blas()
    from contextlib import suppress

    from .io.memory import reuse_memory

    reuse_memory()
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
