"""Keeping what libraries print away from the terminal.

Problem: decoders of damaged files warn, through Python or, being C, straight into the process's
error stream. What a person has to know is in the `InputError` that follows. Limits: descriptor 2
belongs to the whole process: what other threads print to it meanwhile is lost, too.
"""

import contextlib
import io
import os
import warnings
from collections.abc import Iterator


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """No warnings, and nothing printed, while it lasts."""
    with (
        warnings.catch_warnings(),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.ExitStack() as stack,
    ):
        warnings.simplefilter("ignore")
        with contextlib.suppress(
            OSError
        ):  # without a descriptor 2 (a program with windows only) there is nothing to silence
            saved = os.dup(2)
            stack.callback(os.close, saved)
            stack.callback(os.dup2, saved, 2)
            null = os.open(os.devnull, os.O_WRONLY)
            stack.callback(os.close, null)
            os.dup2(null, 2)
        yield
