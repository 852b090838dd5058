"""ISC in Blender: a photo of a glossy object becomes the object, its material, its light and the
photo's camera.

Blender calls `register` and `unregister`. Importing the package needs no Blender, so that the
command without a window can print its help anywhere.

Modules at the top may import the folders, never the other way round. The folders build on each
other in this order: `files` and `worker`, then `scene` and `settings`, then `operators`.
"""


def register() -> None:
    """Register properties, operators and panels with Blender."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Cancel the active run and unregister everything."""
    from . import registration

    registration.unregister()
