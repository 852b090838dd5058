"""`isc completion`: completion of commands and options for a shell, by shtab."""

import argparse
from pathlib import Path

from ...progress import Monitor
from ..interface.parser import actions_of, describe

_FILES = ("FILE", "DIR", "INPUT")
_SHELLS = ("bash", "zsh", "fish")
_EXAMPLES = """  isc completion bash > ~/.local/share/bash-completion/completions/isc
  isc completion zsh > ~/.zfunc/_isc      with fpath+=~/.zfunc before compinit in ~/.zshrc
  isc completion fish > ~/.config/fish/completions/isc.fish

The script contains the commands that are installed now: write it again after an update."""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    """
    describe(
        parser,
        run,
        "Print a script that completes commands, options, their values and file names in a shell.",
        examples=_EXAMPLES,
    )
    parser.add_argument("shell", choices=_SHELLS, metavar="SHELL", help=", ".join(_SHELLS))


def run(options: argparse.Namespace, monitor: Monitor) -> list[str]:
    """Run the command.

    Parameters
    ----------
    options : argparse.Namespace
    monitor : Monitor

    Returns
    -------
    list of str
        Lines to print.
    """
    import shtab

    from . import build_parser

    del monitor
    parser = build_parser()
    _mark_files(parser, shtab.FILE, shtab.DIRECTORY)
    return [str(shtab.complete(parser, options.shell))]


def _mark_files(parser: argparse.ArgumentParser, file: object, folder: object) -> None:
    """Mark the arguments that are names of files and folders, as shtab reads it."""
    for action in parser._actions:
        if action.type is Path or action.metavar in _FILES:
            action.complete = folder if action.metavar == "DIR" else file  # type: ignore[attr-defined]
    for _, inner in actions_of(parser):
        _mark_files(inner, file, folder)
