"""Commands of `isc` that come with the generator: one per module, each an entry point of the group
`isc.commands`.
"""

from isc_core.cli.commands.registry import CommandEntry

SYNTH = CommandEntry(
    "synth", "render glossy objects with ground truth", f"{__name__}.synth", "synth"
)
VALIDATE = CommandEntry(
    "validate", "measure every stage on rendered scenes", f"{__name__}.validate", "synth"
)
REFINE = CommandEntry(
    "refine", "fit light and gloss of a result to its highlights", f"{__name__}.refine", "synth"
)
