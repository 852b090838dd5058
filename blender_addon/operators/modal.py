"""Runs in a window: polled by a timer, with progress in the panels and the status bar; Esc cancels.

The operators here have no UNDO of their own: Blender would push an undo step for them while they
run. The result is built by a separate operator that has it, called when the work is done: one undo
step, whatever the user has done in the meantime.
"""
# mypy: allow-subclassing-any
# ruff: noqa: RUF012 (Blender requires sets for operator options)

import time
from collections.abc import Callable
from typing import Any

import bpy

from isc_core.errors import InputError

from ..runs.active_run import active_run, begin_run, cancel_active_run, poll_idle
from ..runs.messages import error_line, progress_message, sentence, stage_text, write_report
from ..runs.worker_run import RunState, WorkerRun

POLL_SECONDS = 0.1
_IMPORT_PAUSE = 0.01  # between two parts of an import
_PANEL_EDITORS = {"VIEW_3D", "IMAGE_EDITOR"}


class NeedsPhoto:
    """Mixin for operators that start a run on the photo of the panel."""

    poll_message_set: Any  # from bpy.types.Operator

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether there is a photo and no run is active.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        bool
            Where False, the tooltip gives the reason.
        """
        if context.scene.isc.image is None:
            cls.poll_message_set("Open a photo first")
            return False
        return poll_idle(cls)


class WorkerOperator:
    """Mixin for operators that start a run, which `prepare` creates.

    From a panel the run continues in the background. Without a window, or when called from a
    script, the operator waits for its end.
    """

    report: Any  # from bpy.types.Operator
    _timer: Any = None
    _run: WorkerRun | None = None
    _interval_shortened = False

    def prepare(self, context: Any) -> WorkerRun:
        """Create the run.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        WorkerRun
            The run, not started.

        Raises
        ------
        InputError
            If the run is impossible; nothing is left behind.
        """
        raise NotImplementedError

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Start the run and return at once.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            The event that started the operator; not used.

        Returns
        -------
        set of str
            {"RUNNING_MODAL"}; {"CANCELLED"} if the run is impossible. Without a window as
            `execute`.
        """
        del event
        if bpy.app.background or context.window is None:
            return self.execute(context)
        run = self._begin(context)
        if run is None:
            return {"CANCELLED"}
        manager = context.window_manager
        self._run = run
        self._timer = manager.event_timer_add(POLL_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        update_display(context, run)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Start the run and wait for its end.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"} if the run is done; {"CANCELLED"} if it is impossible, failed or was
            cancelled. It is impossible in another mode than Object Mode, which nobody could leave
            while Blender waits.
        """
        if context.mode != "OBJECT":
            self.report({"ERROR"}, "Return to Object Mode first")
            return {"CANCELLED"}
        run = self._begin(context)
        return {"CANCELLED"} if run is None else self._wait(context, run)

    def modal(self, context: Any, event: Any) -> set[str]:
        """Poll the run ten times a second; all events of the user pass through.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        event : bpy.types.Event
            A tick of the timer or an event of the user; Esc cancels the run.

        Returns
        -------
        set of str
            {"PASS_THROUGH"} until the run has ended, then as `execute`.
        """
        run = self._run
        if run is None:
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            run.cancel()
        elif event.type != "TIMER":
            return {"PASS_THROUGH"}
        if not advance_run(context, run):
            if run.status.state == RunState.READY:
                self._shorten_interval(context)
            return {"PASS_THROUGH"}
        self._stop_timer(context)
        return self._report_outcome(run)

    def cancel(self, context: Any) -> None:
        """Cancel the run: Blender closes the window or loads another file.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.
        """
        self._stop_timer(context)
        cancel_active_run()

    def _begin(self, context: Any) -> WorkerRun | None:
        began = time.perf_counter()
        try:
            run = begin_run(self.prepare(context))
        except InputError as error:
            self.report({"ERROR"}, sentence(str(error)))
            return None
        run.record_call(time.perf_counter() - began)
        return run

    def _wait(self, context: Any, run: WorkerRun) -> set[str]:
        while not advance_run(context, run):
            if run.status.state != RunState.READY:
                time.sleep(POLL_SECONDS / 2)
        return self._report_outcome(run)

    def _report_outcome(self, run: WorkerRun) -> set[str]:
        state, message, log = run.status.state, run.status.message, run.status.log
        if state == RunState.FAILED and log:
            message += f" (see the text {write_report(run.title, message, log).name})"
        self.report({"ERROR" if state == RunState.FAILED else "INFO"}, sentence(message))
        return {"FINISHED"} if state == RunState.DONE else {"CANCELLED"}

    def _shorten_interval(self, context: Any) -> None:
        """Shorten the timer's interval for the steps of an import."""
        if not self._interval_shortened:
            self._stop_timer(context)
            manager = context.window_manager
            self._timer = manager.event_timer_add(_IMPORT_PAUSE, window=context.window)
            self._interval_shortened = True

    def _stop_timer(self, context: Any) -> None:
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None


def start_operator(operator: Any, start: Callable[..., object], **options: Any) -> None:
    """Start another operator as a button does, and report its error.

    Blender does not show what an operator reports that Python has called.

    Parameters
    ----------
    operator : bpy.types.Operator
        The calling operator.
    start : callable
        The other one, for example `bpy.ops.isc.decompose`.
    **options
        Its properties.
    """
    try:
        start("INVOKE_DEFAULT", **options)
    except RuntimeError as error:
        operator.report({"ERROR"}, sentence(error_line(error)))


def advance_run(context: Any, run: WorkerRun) -> bool:
    """Advance a run by one tick.

    The result is imported as soon as the user is in Object Mode.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.
    run : WorkerRun
        The run.

    Returns
    -------
    bool
        Whether the run has ended.
    """
    began = time.perf_counter()
    ready = run.step().state == RunState.READY
    # Undo in an edit mode covers that mode alone: one step could not undo what is built then. And
    # what is built becomes active, which would end sculpting, painting or posing.
    editing = context.mode != "OBJECT"
    remark = "return to Object Mode to import the result" if ready and editing else ""
    update_display(context, run, remark)
    run.record_call(time.perf_counter() - began)
    if ready and not editing:
        run.import_result(context)
        if run.ended:
            update_display(context, run)
    return run.ended


def update_display(context: Any, run: WorkerRun, remark: str = "") -> None:
    """Update what the window shows of a run.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.
    run : WorkerRun
        The run.
    remark : str, optional
        Text to show instead of the stage.
    """
    shown, status = context.window_manager.isc, run.status
    stage = remark or stage_text(status.stage, status.seconds_left)
    shown.longest_call_ms, shown.import_ms = run.longest_call_ms, run.import_ms
    # Redraw only when something visible has changed, not ten times a second.
    message = sentence(status.message)
    now = (run.title, str(status.state), stage, round(status.fraction, 2), message)
    if now == (shown.title, shown.state, shown.stage, round(shown.fraction, 2), shown.message):
        return
    shown.title, shown.state, shown.stage, shown.fraction, shown.message = now
    shown.notes = "\n".join(status.notes)
    text = None if run.ended else progress_message(run.title, stage, status.fraction)
    _set_status_text(context, text)
    redraw_panels(context)


def _set_status_text(context: Any, text: str | None) -> None:
    """None clears the text in all workspaces, as the user may have changed the workspace."""
    for workspace in [context.workspace] if text else bpy.data.workspaces:
        if workspace is not None:
            workspace.status_text_set(text)


def redraw_panels(context: Any) -> None:
    """Redraw the panels in all windows.

    Parameters
    ----------
    context : bpy.types.Context
        Blender's context.
    """
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in _PANEL_EDITORS:
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


class ISC_OT_cancel(bpy.types.Operator):
    """Cancel the active run."""

    bl_idname = "isc.cancel"
    bl_label = "Cancel"
    bl_description = "Cancel the run and discard its result"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Return whether a run is active.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context; not used.

        Returns
        -------
        bool
        """
        del context
        return active_run() is not None

    def execute(self, context: Any) -> set[str]:
        """Cancel the run; its operator ends at its next tick.

        Parameters
        ----------
        context : bpy.types.Context
            Blender's context.

        Returns
        -------
        set of str
            {"FINISHED"}, or {"CANCELLED"} if no run is active.
        """
        run = active_run()
        if run is None:
            return {"CANCELLED"}
        run.cancel()
        update_display(context, run)
        return {"FINISHED"}
