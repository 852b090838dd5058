"""ISC in Blender: a photo of a glossy object becomes the object, its material, its light and the
photo's camera.

Blender calls `register` and `unregister`. Importing the package needs no Blender, so that the
command without a window can print its help anywhere.

Modules at the top may import the folders, never the other way round. The folders build on each
other in this order: `files`, `worker`, `datablocks`, `materials`, `scene`, `settings`, `runs`,
`operators`.
"""

from typing import Any


def register() -> None:
    """Register properties, operators and panels with Blender."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Cancel the active run and unregister everything."""
    from . import registration

    registration.unregister()


def glTF2_pre_export_callback(export_settings: Any) -> None:
    """Prepare the materials; Blender's glTF exporter calls this before it reads them.

    Parameters
    ----------
    export_settings : dict
        The exporter's settings; not used.
    """
    from .operators.live_edits import prepare_export

    del export_settings
    prepare_export()


def glTF2_post_export_callback(export_settings: Any) -> None:
    """Restore the materials; Blender's glTF exporter calls this at its end.

    Parameters
    ----------
    export_settings : dict
        The exporter's settings; not used.
    """
    from .operators.live_edits import finish_export

    del export_settings
    finish_export()
