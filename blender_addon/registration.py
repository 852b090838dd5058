"""What Blender is told about, and what it tells: another file is loaded, Blender is closed."""

import atexit
from typing import Any

import bpy
from bpy.app.handlers import persistent

from . import operators, panels
from .operators.modal import show
from .operators.worker_run import active, end_active
from .settings import preferences, properties

_CLASSES = (
    preferences.ISC_AP_preferences,
    *properties.CLASSES,
    *operators.CLASSES,
    *panels.CLASSES,
)


def register() -> None:
    """Registers all classes, the properties of scenes, and what has to be known of loading and
    closing.
    """
    for kind in _CLASSES:
        bpy.utils.register_class(kind)
    properties.attach()
    bpy.app.handlers.load_pre.append(_end_before_loading)
    # Blender closes without a word to add-ons; the worker would notice, but not its files.
    atexit.register(end_active)


def unregister() -> None:
    """The same backwards; the run that goes on ends."""
    end_active()
    atexit.unregister(end_active)
    bpy.app.handlers.load_pre.remove(_end_before_loading)
    properties.detach()
    for kind in reversed(_CLASSES):
        bpy.utils.unregister_class(kind)


@persistent
def _end_before_loading(*_: Any) -> None:
    """The run belongs to the file that it was begun in."""
    run = active()
    if run is not None:
        run.cancel()
        show(bpy.context, run)
