"""`isc refine` in this process, whether or not its entry point is installed."""

import argparse

from isc_core.progress import Monitor
from synth.commands import refine as command_module


def command(words: list[str], monitor: Monitor | None = None) -> list[str]:
    """Run `isc refine`; returns the lines to print."""
    parser = argparse.ArgumentParser()
    command_module.declare(parser)
    options = parser.parse_args(words, argparse.Namespace(quiet=False))
    return command_module.run(options, monitor or Monitor())
