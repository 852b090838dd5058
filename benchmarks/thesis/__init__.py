"""Every table and figure of the thesis, regenerated on open data: `isc thesis`.

Imports point one way: images -> measuring -> report -> items -> registry -> making -> command;
drawing is used by report and items.

Citation: H. Akbar, "3D Intrinsic Scene Characteristics Extraction Framework for a Single Image",
thesis (2016).
"""

from isc_core.cli.commands.registry import CommandEntry

THESIS = CommandEntry(
    "thesis", "regenerate the tables and figures of the thesis", f"{__name__}.command", "thesis"
)
