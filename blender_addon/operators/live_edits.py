"""Handlers that follow edits, by a slider, a script, undo or the node editor.

After each update of the scene, edits are written into the material (`material_edits`). After it,
and after each change of the frame, highlights of the photo that are no longer valid for the view
are turned off (`photo_highlights`). Baking waits until no slider has moved for a moment, and
computes the colours in a thread, which a later edit stops; without a window, and before a file is
saved or exported, it happens at once.

glTF's exporter asks for `prepare_export` and `finish_export` through the functions of the package
that are named after its interface.
"""

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from threading import Event
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ..datablocks.images import ImageFile
from ..datablocks.provenance import KEY
from ..materials.material import shows_highlights
from ..materials.material_edits import (
    PendingBake,
    apply_edits,
    bake_edits,
    begin_bake,
    color_state,
    finish_bake,
    release_edited,
)
from ..materials.photo_highlights import has_view_changed, hide_highlights, show_highlights

# Seconds: without a change before baking; between two polls of bakes; of a status bar text.
_PAUSE, _POLL, _SHOWN = 0.4, 0.05, 6.0
_MATERIAL_KINDS = ("MATERIAL", "NODETREE", "IMAGE")
_VIEW_KINDS = ("OBJECT", "LIGHT", "CAMERA", "WORLD", "NODETREE", "SCENE")
_HIDDEN_FOR_EXPORT = "isc_hidden_for_export"


def add_handlers() -> None:
    """Follow edits from now on."""
    bpy.app.handlers.depsgraph_update_post.append(_after_update)
    bpy.app.handlers.frame_change_post.append(_after_frame_change)
    bpy.app.handlers.save_pre.append(_before_saving)
    for before in (bpy.app.handlers.undo_pre, bpy.app.handlers.redo_pre):
        before.append(_before_undo)
    for after in (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post):
        after.append(_after_undo)


def remove_handlers() -> None:
    """Stop following edits."""
    for after in (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post):
        after.remove(_after_undo)
    for before in (bpy.app.handlers.undo_pre, bpy.app.handlers.redo_pre):
        before.remove(_before_undo)
    bpy.app.handlers.save_pre.remove(_before_saving)
    bpy.app.handlers.frame_change_post.remove(_after_frame_change)
    bpy.app.handlers.depsgraph_update_post.remove(_after_update)
    _stop_bakes()
    for timer in (_bake_when_idle, _clear_status):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)


@dataclass(frozen=True)
class _RunningBake:
    """Colours that a thread computes.

    Attributes
    ----------
    state : str
        What they depend on, see `PendingBake`.
    stop : Event
        Set when they are no longer needed.
    file : Future
        The colours; None if stopped.
    """

    state: str
    stop: Event
    file: Future[ImageFile | None]


# By Blender's number of the material, which an undo does not change.
_bakes: dict[int, _RunningBake] = {}


def write_edits(material: bpy.types.Material) -> None:
    """Write the edits of a material: numbers at once, colours when no slider moves any more.

    Parameters
    ----------
    material : bpy.types.Material
        A local material of ISC.
    """
    if not apply_edits(material):
        return
    if bpy.app.background:
        bake_edits(material)
        return
    running = _bakes.get(material.session_uid)
    if running is None or running.state != color_state(material):
        _discard(material.session_uid)
        _restart_timer(_bake_when_idle, _PAUSE)


def prepare_export() -> None:
    """Bake all edits, and hide the layers of highlights: they would be exported as light."""
    for material in _materials():
        if shows_highlights(material):
            hide_highlights(material)
            material[_HIDDEN_FOR_EXPORT] = True
        _bake_now(material)


def finish_export() -> None:
    """Show the layers of highlights again."""
    for material in _materials():
        if _HIDDEN_FOR_EXPORT in material:
            del material[_HIDDEN_FOR_EXPORT]
            show_highlights(material)
            _bake_now(material)


def _materials() -> Iterator[bpy.types.Material]:
    for material in bpy.data.materials:
        if KEY in material and material.library is None and material.override_library is None:
            yield material


@persistent
def _after_update(scene: Any, depsgraph: Any) -> None:
    if any(depsgraph.id_type_updated(kind) for kind in _MATERIAL_KINDS):
        for material in _materials():
            write_edits(material)
    if any(depsgraph.id_type_updated(kind) for kind in _VIEW_KINDS):
        _hide_outdated_highlights(scene, depsgraph)


@persistent
def _after_frame_change(scene: Any, depsgraph: Any) -> None:
    # A render in the background of a window reads the materials at the same time.
    if not bpy.app.is_job_running("RENDER") or scene.render.use_lock_interface:
        _hide_outdated_highlights(scene, depsgraph)


def _hide_outdated_highlights(scene: Any, depsgraph: Any) -> None:
    for material in _materials():
        if shows_highlights(material) and has_view_changed(material, scene, depsgraph):
            hide_highlights(material)
            write_edits(material)
            _show_status(f"{material.name}: photo highlights turned off, because the view changed")


@persistent
def _before_saving(*_: Any) -> None:
    for material in _materials():
        _bake_now(material)


@persistent
def _before_undo(*_: Any) -> None:
    for material in _materials():
        release_edited(material)


@persistent
def _after_undo(*_: Any) -> None:
    for material in _materials():
        write_edits(material)


def _bake_now(material: bpy.types.Material) -> None:
    """Bake all edits of a material; waits for the colours that a thread computes."""
    running = _bakes.get(material.session_uid)
    if running is not None and running.state == color_state(material):
        _finish(material, running)
    _discard(material.session_uid)
    bake_edits(material)


def _bake_when_idle() -> float | None:
    """Start bakes in threads, and show finished ones; stays registered while some are running."""
    if bpy.app.is_job_running("RENDER"):
        return _PAUSE
    present = {material.session_uid: material for material in _materials()}
    for number, running in list(_bakes.items()):
        material = present.get(number)
        if material is None or running.state != color_state(material):
            _discard(number)
        elif running.file.done():
            _finish(material, running)
            _discard(number)
    for number, material in present.items():
        if number not in _bakes and (pending := begin_bake(material)) is not None:
            _bakes[number] = _start(pending)
    return _POLL if _bakes else None


def _start(pending: PendingBake) -> _RunningBake:
    stop, pool = Event(), ThreadPoolExecutor(1)
    file = pool.submit(pending.file, stop.is_set)
    pool.shutdown(wait=False)
    return _RunningBake(pending.state, stop, file)


def _finish(material: bpy.types.Material, running: _RunningBake) -> None:
    if (file := running.file.result()) is not None:
        finish_bake(material, running.state, file)


def _discard(number: int) -> None:
    if (running := _bakes.pop(number, None)) is not None:
        running.stop.set()


def _stop_bakes() -> None:
    for number in list(_bakes):
        _discard(number)


def _show_status(line: str) -> None:
    """Show a line in the status bar for a while."""
    if bpy.app.background:
        print(line)
        return
    for window in bpy.context.window_manager.windows:
        window.workspace.status_text_set(line)
    _restart_timer(_clear_status, _SHOWN)


def _clear_status() -> None:
    for window in bpy.context.window_manager.windows:
        window.workspace.status_text_set(None)


def _restart_timer(timer: Any, seconds: float) -> None:
    if bpy.app.timers.is_registered(timer):
        bpy.app.timers.unregister(timer)
    bpy.app.timers.register(timer, first_interval=seconds)
