"""Drives a real Blender window with a real mouse and keyboard: decompose, undo, redo, Esc, the
Cancel button, save, load during a run.

Run by ../shared/tools/blender_window/blender_acceptance.sh on Linux, as root:
    blender_acceptance.sh --ext dist/isc_intrinsic-VERSION-linux-x64-cp314.zip --tab ISC --in
    demo/input/photo.png --size 1280x800 \\
        --timeout 600 --driver tests/addon/window_driver.py --out OUT
`acc` is that script's helper: `find` moves the mouse until the button under it runs the operator,
`shot` saves the screen, a number that is yielded is waited for. Exit code 1 where a check fails;
OUT/measured.txt holds the longest calls.
"""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy

NAME = "photo"


def main(acc: Any) -> Iterator[float]:
    """The whole of it."""
    measured: list[str] = []
    settings = bpy.context.scene.isc
    settings.image, settings.preset = bpy.data.images.load(f"{acc.inp}/{NAME}.png"), "DRAFT"
    yield 1.5
    yield acc.shot("1_panel")
    yield from decompose(acc, measured)
    yield from undo_and_redo(acc)
    bpy.context.scene.isc.max_size = 512
    yield from cancel(acc, measured, "Esc", escape)
    yield from cancel(acc, measured, "Cancel", press_cancel)
    yield from load_during_a_run(acc, measured)
    Path(acc.out, "measured.txt").write_text("\n".join(measured) + "\n")


def decompose(acc: Any, measured: list[str]) -> Iterator[float]:
    """A click on the button; the object appears, in its own scene."""
    yield from begin(acc)
    yield from until(lambda: shown().fraction > 0.05, 240)
    yield acc.shot("2_running")
    yield from until(lambda: shown().state not in {"running", "ready"}, 400)
    note(acc, measured, "decomposed")
    acc.check(
        shown().state == "done" and objects() == [NAME], f"the run ends well: {shown().message}"
    )
    acc.check(bpy.context.scene.name == NAME, "the object's own scene is shown")
    yield acc.shot("3_done")
    space = acc.view3d()[1].spaces.active
    space.shading.type = "RENDERED"
    yield 20
    yield acc.shot("4_rendered")
    space.shading.type = "SOLID"
    yield 1


def undo_and_redo(acc: Any) -> Iterator[float]:
    """One step takes all of it away, one brings it back."""
    yield keys(acc, "ctrl+z", 4)
    left = [len(blocks) for blocks in (objects(), [s for s in bpy.data.scenes if s.name == NAME])]
    acc.check(left == [0, 0], f"one undo takes all of it away: {left}")
    yield acc.shot("5_undone")
    yield keys(acc, "ctrl+shift+z", 4)
    acc.check(objects() == [NAME], "redo brings it back")


def cancel(
    acc: Any, measured: list[str], how: str, stop: Callable[[Any], Iterator[float]]
) -> Iterator[float]:
    """A run that is ended from the window: its worker dies, the scene is as before."""
    yield from begin(acc)
    yield from until(lambda: shown().fraction > 0.02, 100)
    acc.check(shown().state == "running" and workers(), "a worker is at work")
    yield acc.shot(f"6_before_{how}")
    yield from stop(acc)
    yield from until(lambda: shown().state == "cancelled", 5)
    acc.check(shown().state == "cancelled", f"{how} cancels")
    note(acc, measured, how)
    yield from until(lambda: not workers(), 5)
    acc.check(
        not workers() and objects() == [NAME], "no worker is left, and the scene is as before"
    )
    yield acc.shot(f"7_after_{how}")


def load_during_a_run(acc: Any, measured: list[str]) -> Iterator[float]:
    """The file is saved; loading it ends the run that goes on; all is there."""
    blend = f"{acc.out}/saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    yield from begin(acc)
    acc.check(shown().state == "running", "a run goes on while a file is loaded")
    bpy.ops.wm.open_mainfile(filepath=blend)
    yield 3
    yield from until(lambda: not workers(), 5)
    acc.check(not workers(), "loading a file ends the worker")
    acc.check(objects() == [NAME], "the object is in the file")
    note(acc, measured, "loaded")
    acc.tab("ISC")
    yield 2
    yield acc.shot("8_loaded")


def begin(acc: Any) -> Iterator[float]:
    """Clicks the button."""
    acc.tab("ISC")
    yield 1
    place = yield from acc.find("isc.decompose")
    if acc.check(place, "the button is found"):
        yield acc.click(*place, settle=0.5)
        yield from until(lambda: shown().state == "running", 10)


def escape(acc: Any) -> Iterator[float]:
    """Presses Esc over the view."""
    yield keys(acc, "Escape", 1.5)


def press_cancel(acc: Any) -> Iterator[float]:
    """Clicks the button."""
    place = yield from acc.find("isc.cancel")
    if acc.check(place, "the cancel button is found"):
        yield acc.click(*place, settle=1)


def keys(acc: Any, text: str, wait: float) -> float:
    """Presses keys with the mouse over the view; the seconds to wait."""
    left, top, width, height = acc.rect("VIEW_3D", "WINDOW")
    return float(
        acc.xdo(f"mousemove {left + width // 3} {top + height // 2} sleep .3 key {text}", wait)
    )


def until(fact: Callable[[], Any], seconds: float) -> Iterator[float]:
    """Waits, the window alive."""
    end = time.monotonic() + seconds
    while not fact() and time.monotonic() < end:
        yield 0.3


def shown() -> Any:
    """The state of the run that the window shows."""
    return bpy.context.window_manager.isc


def objects() -> list[str]:
    """Meshes that the extension made."""
    return [thing.name for thing in bpy.data.objects if thing.type == "MESH" and "isc_key" in thing]


def workers() -> list[int]:
    """Processes that Blender has started and that go on."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == os.getpid() and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


def note(acc: Any, measured: list[str], what: str) -> None:
    """Keeps how long the run's calls took."""
    run = shown()
    times = f"longest call {run.longest_call_ms:.1f} ms, import {run.import_ms:.0f} ms"
    line = f"{what}: {times}; {run.message}"
    acc.log(line)
    measured.append(line)
