"""The parser of a command: one-line errors, help in groups, and the options of every command."""

import argparse
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NoReturn

from ...errors import InputError

EXIT_CODES = (
    "exit codes: 0 success; 1 finished with failures (several photos or objects, batch,\n"
    "thesis, validate); 2 invalid input, stderr names the remedy; 130 cancelled."
)
# Where `add_general_options` stores its values.
GENERAL = ("quiet", "verbose", "progress", "cancel_at_eof", "config", "no_config")
_WIDTH = 96


class _Help(argparse.RawDescriptionHelpFormatter):
    """Keeps the line breaks of the examples, and wraps other text."""

    def __init__(self, prog: str, **options: Any) -> None:
        super().__init__(prog, max_help_position=26, **options)
        self._action_max_length = 20  # argparse forgets the indent of sub-commands

    def add_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[Any],
        prefix: str | None = None,
    ) -> None:
        """Show only required arguments; called by argparse. Options are listed below.

        Parameters
        ----------
        usage, actions, groups, prefix
            As in argparse; with an empty prefix the usage becomes the name of sub-commands.
        """
        if usage is None and prefix is None:
            required = [a for a in actions if a.required or not a.option_strings]
            parts = self._format_usage(None, required, [], "").removeprefix(self._prog).split()
            usage = " ".join([self._prog, "[options]", *parts])
        super().add_usage(usage, actions, groups, prefix)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        keep = "\n" in text
        return super()._fill_text(
            text if keep else "\n".join(textwrap.wrap(text, width)), width, indent
        )


class Parser(argparse.ArgumentParser):
    """An argument parser that raises `InputError` instead of printing its usage.

    Options cannot be abbreviated, so that new ones never change old scripts.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, add_help=False, formatter_class=_Help, **options)

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> tuple[Any, list[str]]:
        """Parse arguments, of which none may be unknown; called by argparse for sub-commands, too.

        argparse itself leaves unknown options of a sub-command to the main parser, whose help does
        not list the options.

        Parameters
        ----------
        args, namespace
            As in argparse.

        Returns
        -------
        namespace, unknown
            As in argparse; `unknown` is empty.

        Raises
        ------
        InputError
            For invalid and unknown arguments.
        """
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return options, unknown

    def error(self, message: str) -> NoReturn:
        """Raise the error of a command line as `InputError`.

        Parameters
        ----------
        message : str
            What is wrong.

        Raises
        ------
        InputError
            Always.
        """
        raise InputError(f"{message} (see `{self.prog} --help`)")


def describe(
    parser: argparse.ArgumentParser,
    run: Callable[..., list[str]],
    description: str,
    *,
    examples: str = "",
    more: str = "",
) -> None:
    """Set the function and the help text of a command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    run : callable
        Called with the options and a `Monitor`; returns the lines to print.
    description : str
        Printed above the options.
    examples : str
        Lines of examples, each indented by two spaces; may end in remarks.
    more : str
        Printed between the options and the examples, such as a table of names.
    """
    parser.set_defaults(run=run)
    parser.description = description
    parts = (more, f"examples:\n{examples}" if examples else "", EXIT_CODES)
    parser.epilog = "\n\n".join(part for part in parts if part)


def add_general_options(parser: argparse.ArgumentParser, *, again: bool = False) -> None:
    """Add the options that every command has, to a parser and to those of its actions.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    again : bool
        For an action of a command that has them, so that they may precede or follow it.
    """

    def default(value: object) -> object:
        # An option before the action must not be reset by a default after it.
        return argparse.SUPPRESS if again else value

    group = parser.add_argument_group("general options")
    add = group.add_argument
    add("-h", "--help", action="help", help="show this help and exit")
    add(
        "-q",
        "--quiet",
        action="store_true",
        default=default(False),
        help="hide progress and print results only",
    )
    add(
        "-v",
        "--verbose",
        action="store_true",
        default=default(False),
        help="print every stage with its time, and the configuration file",
    )
    add(
        "--progress",
        choices=("bar", "json"),
        default=default("bar"),
        help="json: for programs, one JSON object per line on stdout; the line `cancel` on stdin "
        "cancels (default bar)",
    )
    add(
        "--cancel-at-eof",
        action="store_true",
        default=default(False),
        help="with --progress json: the end of stdin also cancels",
    )
    add(
        "--config",
        metavar="FILE",
        default=default(None),
        help="read defaults of options from this TOML file (default: isc.toml, if it exists)",
    )
    add("--no-config", action="store_true", default=default(False), help="ignore isc.toml")
    for _, action in actions_of(parser):
        add_general_options(action, again=True)


def actions_of(parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Iterate over the parsers of a command's actions.

    Parameters
    ----------
    parser : argparse.ArgumentParser

    Yields
    ------
    tuple of str and argparse.ArgumentParser
        Name and parser of an action.
    """
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.items()


def table(title: str, rows: dict[str, str]) -> str:
    """Return a list of names with one line for each, for the help.

    Parameters
    ----------
    title : str
    rows : dict
        Description by name.

    Returns
    -------
    str
        Lines, without a final line end.
    """
    width = 2 + max(map(len, rows))
    indent = " " * (2 + width)
    lines = [
        textwrap.fill(f"  {name:<{width}}{what}", _WIDTH, subsequent_indent=indent)
        for name, what in rows.items()
    ]
    return "\n".join([f"{title}:", *lines])


def hints(options: argparse.Namespace, *lines: str) -> list[str]:
    """Return the lines, or none with --quiet.

    Parameters
    ----------
    options : argparse.Namespace
    *lines : str

    Returns
    -------
    list of str
    """
    return [] if options.quiet else list(lines)
