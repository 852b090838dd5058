"""ISC in Blender: a photo of a glossy object becomes the object itself, its material, its light and
the photo's camera.

Blender calls `register` and `unregister`. Importing the package needs no Blender, so that its
command line can say what it does without.
"""


def register() -> None:
    """Makes properties, operators and panels known to Blender."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Ends the run that goes on, and takes everything away again."""
    from . import registration

    registration.unregister()
