"""The command `isc`: runs a sub-command and maps its outcome to an exit code and a message.

0: success. 1: finished, but a measurement violates a bound, or some of several photos or objects
failed; stderr names them. 2: invalid input, or not enough memory or disk space; one line on stderr
states the remedy. 130: cancelled by Ctrl-C (the first lets the work stop at its next step, the
second stops it immediately). Incomplete files never remain. With `--progress json` the output is
for programs instead of users, see `interface.json_progress`.
"""

import argparse
import gc
import re
import sys
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from itertools import pairwise

from ..errors import Cancelled, InputError, Rejected
from .interface.interrupts import Interrupts
from .interface.json_progress import JsonReporter
from .interface.several import problem_of
from .interface.terminal import TerminalReporter, Verbosity, discard_output

SUCCESS, BROKEN_PIPE, REJECTED, REFUSED, CANCELLED = 0, 1, 1, 2, 130
_HELP = {"-h", "--help", "--version"}

_Reporter = TerminalReporter | JsonReporter


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `isc`.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process by default.

    Returns
    -------
    int
        The exit code; invalid input never raises.
    """
    argv = list(sys.argv[1:] if arguments is None else arguments)
    # Checked before parsing, so that errors in other options are reported as JSON, too.
    json_progress = "--progress=json" in argv or ("--progress", "json") in pairwise(argv)
    reporter: _Reporter = TerminalReporter()
    if json_progress:
        reporter = JsonReporter(sys.stdout, cancel_at_eof="--cancel-at-eof" in argv)
    try:
        # A background process may inherit that Ctrl-C is ignored, but the line `cancel` relies on
        # it.
        with Interrupts(even_if_ignored=json_progress) as interrupts:
            with reporter:
                output, lines = _run(argv, reporter, interrupts)
            interrupts.finish()
            reporter.done(output, lines)
            sys.stdout.flush()
        return SUCCESS
    except InputError as error:
        return _report_failure(reporter, str(error))
    except Rejected as rejection:
        reporter.rejected(str(rejection).splitlines(), REJECTED, rejection.lines)
        return REJECTED
    except (Cancelled, KeyboardInterrupt) as cancellation:
        reporter.cancelled("; ".join(getattr(cancellation, "__notes__", ())))
        return CANCELLED
    except BrokenPipeError:
        discard_output()
        return BROKEN_PIPE
    except (MemoryError, OSError) as error:
        return _report_failure(reporter, problem_of(error))


def _run(
    arguments: list[str], reporter: _Reporter, interrupts: Interrupts
) -> tuple[str, list[str]]:
    """The path of the result, and the lines to print."""
    # The parser imports the command's modules; inside `main`, Ctrl-C works during the imports.
    from .commands import build_parser
    from .config import apply_config

    parser = build_parser(arguments)
    config = None
    # A file that cannot be used must not hide the help, which also says how to ignore the file.
    with suppress(InputError) if _HELP & set(arguments) else nullcontext():
        config = apply_config(parser, arguments)
    try:
        options = parser.parse_args(arguments)
    except SystemExit:  # --help and --version
        return "", []
    interrupts.check()
    if not gc.isenabled():  # disabled by `__main__`
        gc.freeze()
        gc.enable()
    verbosity = _verbosity(options)
    if verbosity is Verbosity.VERBOSE and config is not None:
        print(f"isc: defaults of options from {config}", file=sys.stderr)
    with reporter.progress(verbosity) as progress:
        lines = options.run(options, interrupts.monitor(progress))
    written = getattr(options, "output", None) or getattr(options, "result", None)
    return "" if written is None else str(written), lines


def _verbosity(options: argparse.Namespace) -> Verbosity:
    if options.quiet:
        return Verbosity.QUIET
    return Verbosity.VERBOSE if options.verbose else Verbosity.NORMAL


def _report_failure(reporter: _Reporter, message: str) -> int:
    reporter.failed(re.sub(r"[\x00-\x1f\x7f]+", " ", message).strip(), REFUSED)
    return REFUSED
