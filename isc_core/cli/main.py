"""The command `isc`: runs a sub-command and maps its end to an exit code and at most one line.

0: done. 1: done, but a measurement violates a bound; stderr names it. 2: an input cannot be used,
or the machine has no room for it; one line on stderr says what to do. 130: cancelled by Ctrl-C (the
first lets the work stop at its next step, the second stops it at once). Nothing half-written
remains in any case. With `--progress json` the output is for a program instead of a person, see
`interface.json_progress`.
"""

import re
import sys
from collections.abc import Sequence
from itertools import pairwise

from ..errors import Cancelled, InputError, Rejected
from .interface.json_progress import JsonSpeaker
from .interface.terminal import Interrupts, TerminalSpeaker, discard_output

SUCCESS, BROKEN_PIPE, REJECTED, REFUSED, CANCELLED = 0, 1, 1, 2, 130

_Speaker = TerminalSpeaker | JsonSpeaker


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `isc`.

    Parameters
    ----------
    arguments : sequence of str, optional
        By default those of the process.

    Returns
    -------
    int
        The exit code; a user's mistake never raises.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    # Looked for here, so that complaints about the other options are told to a program, too.
    for_program = "--progress=json" in words or ("--progress", "json") in pairwise(words)
    speaker: _Speaker = JsonSpeaker(sys.stdout) if for_program else TerminalSpeaker()
    try:
        with speaker:
            output, lines = _run(words, speaker)
        speaker.done(output, lines)
        sys.stdout.flush()
        return SUCCESS
    except InputError as error:
        return _refused(speaker, str(error))
    except Rejected as verdict:
        speaker.rejected(str(verdict).splitlines(), REJECTED)
        return REJECTED
    except (Cancelled, KeyboardInterrupt):
        speaker.cancelled()
        return CANCELLED
    except BrokenPipeError:
        discard_output()
        return BROKEN_PIPE
    except MemoryError:
        return _refused(
            speaker,
            "there is not enough memory for this: give a smaller image or a smaller --max-size",
        )
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _refused(speaker, f"{where}{error.strerror or error}")


def _run(arguments: list[str], speaker: _Speaker) -> tuple[str, list[str]]:
    """Where the result was written, and the lines to print."""
    # Numerical libraries take a second to load: inside `main`, so that Ctrl-C is answered during
    # that second too.
    from .commands import build_parser

    try:
        options = build_parser().parse_args(arguments)
    except SystemExit:  # --help and --version
        return "", []
    with Interrupts() as interrupts, speaker.progress(options.quiet) as progress:
        lines = options.run(options, interrupts.monitor(progress))
    written = getattr(options, "output", None) or getattr(options, "result", None)
    return "" if written is None else str(written), lines


def _refused(speaker: _Speaker, message: str) -> int:
    speaker.failed(re.sub(r"[\x00-\x1f\x7f]+", " ", message).strip(), REFUSED)
    return REFUSED
