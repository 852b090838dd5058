"""How a run lives in a window: a timer that only polls, progress in the panels and the status bar,
Esc.

The operators here have no UNDO of their own: Blender would push an undo step for them while they go
on. What is built is built by an operator of its own that has it, called when the work is done: one
step, whatever the user did meanwhile.
"""
# mypy: allow-subclassing-any
# ruff: noqa: RUF012 (Blender wants its options as sets)

import time
from typing import Any

import bpy

from isc_core.errors import InputError

from .messages import keep_report
from .worker_run import Run, active, begin, end_active

SECONDS = 0.1
_PANELS = {"VIEW_3D", "IMAGE_EDITOR"}


class WorkerOperator:
    """A mixin for operators whose work is a run: `prepare` makes it.

    From a panel it goes on while the user works; without a window, or from a script that does not
    ask for more, it is waited for.
    """

    report: Any  # Blender's own
    _timer: Any = None
    _run: Run | None = None

    def prepare(self, context: Any) -> Run:
        """The run. Raises `InputError`, with nothing left behind, where it cannot be."""
        raise NotImplementedError

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Begins the run and returns at once."""
        del event
        run = self._begin(context)
        if run is None:
            return {"CANCELLED"}
        if bpy.app.background or context.window is None:
            return self._wait(context, run)
        manager = context.window_manager
        self._run = run
        self._timer = manager.event_timer_add(SECONDS, window=context.window)
        manager.modal_handler_add(self)
        show(context, run)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Begins the run and waits for its end."""
        run = self._begin(context)
        return {"CANCELLED"} if run is None else self._wait(context, run)

    def modal(self, context: Any, event: Any) -> set[str]:
        """Looks how far the work is, ten times a second; all that the user does passes through."""
        run = self._run
        if run is None:
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            run.cancel()
        elif event.type != "TIMER":
            return {"PASS_THROUGH"}
        if not advance(context, run):
            return {"PASS_THROUGH"}
        self._stop_timer(context)
        return self._told(run)

    def cancel(self, context: Any) -> None:
        """Blender ends the operator itself: its window is closed, or another file is loaded."""
        self._stop_timer(context)
        end_active()

    def _begin(self, context: Any) -> Run | None:
        began = time.perf_counter()
        try:
            run = begin(self.prepare(context))
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return None
        run.count(time.perf_counter() - began)
        return run

    def _wait(self, context: Any, run: Run) -> set[str]:
        while not advance(context, run):
            time.sleep(SECONDS / 2)
        return self._told(run)

    def _told(self, run: Run) -> set[str]:
        state, message, report = run.status.state, run.status.message, run.status.report
        if state == "failed" and report:
            message += f" (see the text {keep_report(run.title, message, report).name})"
        self.report({"ERROR" if state == "failed" else "INFO"}, message)
        return {"FINISHED"} if state == "done" else {"CANCELLED"}

    def _stop_timer(self, context: Any) -> None:
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None


def advance(context: Any, run: Run) -> bool:
    """One tick of a run; whether it has ended.

    Its result is taken in as soon as the user is not in the middle of editing something.
    """
    began = time.perf_counter()
    state = run.step().state
    # Undo within a mode of editing knows that mode alone: what is built then could not be undone by
    # one step.
    editing = context.mode.startswith("EDIT")
    show(context, run, "leave Edit Mode to see the result" if state == "ready" and editing else "")
    run.count(time.perf_counter() - began)
    if state == "ready" and not editing:
        run.take_in(context)
        show(context, run)
    return run.ended


def show(context: Any, run: Run, remark: str = "") -> None:
    """Brings what the window shows up to date with the run."""
    shown, status = context.window_manager.isc, run.status
    stage = remark or status.stage
    shown.longest_call_ms, shown.import_ms = run.longest_call_ms, run.import_ms
    # The view redraws when something that can be seen has changed, not ten times a second.
    now = (run.title, status.state, stage, round(status.fraction, 2), status.message)
    if now == (shown.title, shown.state, shown.stage, round(shown.fraction, 2), shown.message):
        return
    shown.title, shown.state, shown.stage, shown.fraction, shown.message = now
    _say(
        context,
        None if run.ended else f"{run.title}: {stage} ({100 * status.fraction:.0f} %), Esc cancels",
    )
    redraw(context)


def _say(context: Any, text: str | None) -> None:
    """Shows the text in the status bar;

    None takes it away from wherever it was shown, as the user may have changed the workspace.
    """
    for workspace in [context.workspace] if text else bpy.data.workspaces:
        if workspace is not None:
            workspace.status_text_set(text)


def redraw(context: Any) -> None:
    """Draws the panels again, in all windows."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in _PANELS:
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


class ISC_OT_cancel(bpy.types.Operator):
    """Ends the run that goes on."""

    bl_idname = "isc.cancel"
    bl_label = "Cancel"
    bl_description = "End the work at once; nothing of it is kept (Esc does the same)"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        """While a run goes on."""
        del context
        return active() is not None

    def execute(self, context: Any) -> set[str]:
        """Ends it; its operator notices at its next tick."""
        run = active()
        if run is None:
            return {"CANCELLED"}
        run.cancel()
        show(context, run)
        return {"FINISHED"}
