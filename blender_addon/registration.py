"""Registration with Blender, and what to do when Blender loads another file or exits."""

import atexit
from typing import Any

import bpy
from bpy.app.handlers import persistent

from . import menus, operators, panels
from .operators.live_edits import add_handlers, remove_handlers
from .operators.modal import update_display
from .runs.active_run import active_run, cancel_active_run
from .scene.appended import separate_appended
from .settings import preferences, properties

_CLASSES = (
    preferences.ISC_AP_preferences,
    *properties.CLASSES,
    *operators.CLASSES,
    *panels.CLASSES,
    *menus.CLASSES,
)


def register() -> None:
    """Register all classes, the properties of scenes, and the handlers."""
    for kind in _CLASSES:
        bpy.utils.register_class(kind)
    properties.add_properties()
    menus.add_entries()
    bpy.app.handlers.load_pre.append(_cancel_before_loading)
    bpy.app.handlers.blend_import_post.append(_after_append)
    add_handlers()
    # Blender exits without notifying add-ons. The worker would stop by itself, but leave its files.
    atexit.register(cancel_active_run)


def unregister() -> None:
    """Cancel the active run and undo the registration in reverse order."""
    cancel_active_run()
    atexit.unregister(cancel_active_run)
    remove_handlers()
    bpy.app.handlers.blend_import_post.remove(_after_append)
    bpy.app.handlers.load_pre.remove(_cancel_before_loading)
    menus.remove_entries()
    properties.remove_properties()
    for kind in reversed(_CLASSES):
        bpy.utils.unregister_class(kind)


@persistent
def _cancel_before_loading(*_: Any) -> None:
    """A run belongs to the file that it was started in."""
    run = active_run()
    if run is not None:
        run.cancel()
        update_display(bpy.context, run)


@persistent
def _after_append(context: Any, *_: Any) -> None:
    """Two photos of one name stay two objects."""
    separate_appended([item.id for item in context.import_items if item.id is not None])
