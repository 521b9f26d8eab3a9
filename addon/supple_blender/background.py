# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for long work: synchronous from scripts, over a worker thread from the panel.

The same three steps either way: `collect` reads the scene, `compute` touches no bpy, `write`
writes it. So a failed or cancelled operator leaves the file as it was.
"""

import threading

import bpy

from .errors import CancelledError, UserError
from .stages import Stages

TICK_SECONDS = 0.05

# Looking around changes nothing, so it goes on during the work; every other event waits.
NAVIGATION = {
    *("MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE"),
    *("TRACKPADPAN", "TRACKPADZOOM", "NDOF_MOTION"),
}

# The Stages of the operator that runs in the window, for the panel; None when none does.
running = None


class Worker:
    """Runs compute(stages) on a thread and keeps its result or exception."""

    def __init__(self, compute, stages):
        self._result = None
        self._error = None
        self._thread = threading.Thread(target=self._run, args=(compute, stages), daemon=True)
        self._thread.start()

    def _run(self, compute, stages):
        try:
            self._result = compute(stages)
        except BaseException as error:  # handed to the main thread, which raises it
            self._error = error

    def is_alive(self):
        return self._thread.is_alive()

    def wait(self):
        self._thread.join()

    def result(self):
        """Wait for the end; return what compute returned or raise what it raised."""
        self.wait()
        if self._error is not None:
            raise self._error
        return self._result


class ModalWork:
    """Mixin for operators that work while the window lives: its timer, status line and reports."""

    _timer = None

    def _require_idle(self):
        if running is not None:
            raise UserError("Supple is at work already. Wait for it, or press Esc.")

    def _begin(self, context, stages, seconds):
        """Become modal: `modal` is called every so many seconds."""
        global running
        running = stages
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self._timer = manager.event_timer_add(seconds, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _say(self, level, message):
        self.report({level}, message)
        return {"FINISHED"}

    def _fail(self, error):
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}

    def _show(self, context, stages, name, keys):
        """Show how far it is, and what `keys` do."""
        keys = "stopping" if stages.cancelled else keys
        parts = [f"{name}: {stages.doing()}", stages.left(), keys]
        context.window_manager.progress_update(int(100 * stages.fraction))
        context.workspace.status_text_set("   ".join(part for part in parts if part))
        redraw_sidebars(context)

    def _leave(self, context):
        global running
        running = None
        manager = context.window_manager
        manager.event_timer_remove(self._timer)
        manager.progress_end()
        context.workspace.status_text_set(None)
        redraw_sidebars(context)


class LongOperator(ModalWork):
    """Mixin for operators. Subclasses define `collect`, `compute` and `write`.

    collect(context) -> inputs; compute(inputs, stages) -> result; write(context, inputs, result) ->
    message. Inputs have `.name`, the object's. All three may raise UserError. watch(context) is
    called while a window waits; what it shows must be gone after `_leave`.
    """

    _worker = None
    _stages = None
    _inputs = None

    def execute(self, context):
        try:
            inputs = self.collect(context)
            return self._finish(context, inputs, self.compute(inputs, Stages()))
        except UserError as error:
            return self._fail(error)

    def invoke(self, context, event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        try:
            self._require_idle()
            self._inputs = inputs = self.collect(context)
        except UserError as error:
            return self._fail(error)
        self._stages = Stages()
        self._worker = Worker(lambda stages: self.compute(inputs, stages), self._stages)
        return self._begin(context, self._stages, TICK_SECONDS)

    def watch(self, context):
        pass

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self._stages.cancel()
        if event.type in NAVIGATION:
            return {"PASS_THROUGH"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        if self._worker.is_alive():
            self.watch(context)
            self._show(context, self._stages, self._inputs.name, "Esc cancels")
            return {"RUNNING_MODAL"}
        self._leave(context)
        try:
            return self._finish(context, self._inputs, self._worker.result())
        except CancelledError:
            self.report({"INFO"}, f"{self._inputs.name}: cancelled, nothing was changed")
            return {"CANCELLED"}
        except UserError as error:
            return self._fail(error)

    def cancel(self, context):
        """Blender ends the operator, for instance because its window closes."""
        self._stages.cancel()
        self._worker.wait()
        self._leave(context)

    def _finish(self, context, inputs, result):
        return self._say(*self.write(context, inputs, result))


def redraw_sidebars(context):
    """Show the panel anew in every window."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
