"""What happens after an edit, by a slider, a script, undo or the node editor.

After each update of the scene, edits are written into the material (`scene.material_edits`), and
highlights of the photo that no longer belong to what is seen are turned off
(`scene.photo_highlights`). Baking waits until no slider has moved for a moment; without a window,
and before a file is saved or exported, it happens at once.

glTF's exporter asks for `prepare_export` and `finish_export` through the functions of the package
that are named after its interface.
"""

from collections.abc import Iterator
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ..datablocks.provenance import KEY
from ..scene.material import shows_highlights
from ..scene.material_edits import apply_edits, bake_edits
from ..scene.photo_highlights import has_moved, hide_highlights, show_highlights

_PAUSE, _SHOWN = 0.4, 6.0  # seconds: without a change before baking; of a line in the status bar
_MATERIAL_KINDS = ("MATERIAL", "NODETREE")
_VIEW_KINDS = ("OBJECT", "LIGHT", "CAMERA", "WORLD", "NODETREE", "SCENE")
_HIDDEN_FOR_EXPORT = "isc_hidden_for_export"


def add_handlers() -> None:
    """Follow edits from now on."""
    bpy.app.handlers.depsgraph_update_post.append(_after_update)
    bpy.app.handlers.save_pre.append(_before_saving)


def remove_handlers() -> None:
    """Stop following edits."""
    bpy.app.handlers.save_pre.remove(_before_saving)
    bpy.app.handlers.depsgraph_update_post.remove(_after_update)
    for timer in (_bake_when_idle, _clear_status):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)


def settle_edits(material: bpy.types.Material) -> None:
    """Write the edits of a material: numbers now, colours once no slider moves.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    """
    if not apply_edits(material):
        return
    if bpy.app.background:
        bake_edits(material)
    else:
        _restart(_bake_when_idle, _PAUSE)


def prepare_export() -> None:
    """Bake all edits, and hide the layers of highlights: they would be exported as light."""
    for material in _materials():
        if shows_highlights(material):
            hide_highlights(material)
            material[_HIDDEN_FOR_EXPORT] = True
        bake_edits(material)


def finish_export() -> None:
    """Show the layers of highlights again."""
    for material in _materials():
        if _HIDDEN_FOR_EXPORT in material:
            del material[_HIDDEN_FOR_EXPORT]
            show_highlights(material)
            bake_edits(material)


def _materials() -> Iterator[bpy.types.Material]:
    for material in bpy.data.materials:
        if KEY in material and material.library is None and material.override_library is None:
            yield material


@persistent
def _after_update(scene: Any, depsgraph: Any) -> None:
    if any(depsgraph.id_type_updated(kind) for kind in _MATERIAL_KINDS):
        for material in _materials():
            settle_edits(material)
    if any(depsgraph.id_type_updated(kind) for kind in _VIEW_KINDS):
        for material in _materials():
            if shows_highlights(material) and has_moved(material, scene):
                hide_highlights(material)
                settle_edits(material)
                _tell(f"{material.name}: the photo's highlights are off, as the view has changed")


@persistent
def _before_saving(*_: Any) -> None:
    for material in _materials():
        bake_edits(material)


def _bake_when_idle() -> float | None:
    if bpy.app.is_job_running("RENDER"):
        return _PAUSE
    _before_saving()
    return None


def _tell(line: str) -> None:
    """Show a line in the status bar for a while."""
    if bpy.app.background:
        print(line)
        return
    for window in bpy.context.window_manager.windows:
        window.workspace.status_text_set(line)
    _restart(_clear_status, _SHOWN)


def _clear_status() -> None:
    for window in bpy.context.window_manager.windows:
        window.workspace.status_text_set(None)


def _restart(timer: Any, seconds: float) -> None:
    if bpy.app.timers.is_registered(timer):
        bpy.app.timers.unregister(timer)
    bpy.app.timers.register(timer, first_interval=seconds)
