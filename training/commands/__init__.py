"""Commands of `isc` for those who train its networks; each an entry point of `isc.commands`.

They exist in a checkout of the repository alone: the wheel leaves `training` out.
"""

from isc_core.cli.commands.registry import CommandEntry

WORLD = CommandEntry(
    "world", "build the bodies that the networks learn from", f"{__name__}.world", "training,synth"
)
