# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that go through frames: synchronous from scripts, a part each tick from the panel.

Blender evaluates a scene on its main thread only. So the work is a generator that reads frames
there and hands what it read to another thread; where it has to wait, it yields a Future, after a
frame None. Closing it puts everything back.
"""

import concurrent.futures
import time

import bpy

from . import background
from .errors import CancelledError, UserError

TICK_SECONDS = 0.02
# Of these, the interface keeps some for itself.
WORK_SECONDS = 0.1


def run(work):
    """Run a generator of frame work to its end; return what it returned."""
    while True:
        try:
            future = next(work)
        except StopIteration as end:
            return end.value
        if future is not None:
            concurrent.futures.wait([future])


class FrameOperator(background.ModalWork):
    """Mixin for operators. Subclasses define `start` and `write`.

    start(context) -> (name of the object, its FrameStages, generator); write(context, result) ->
    (level, message), with what the generator returned. `stopped` is the message after Esc. Both may
    raise UserError.
    """

    stopped = "cancelled, nothing was changed"
    _name = _stages = _work = _waits = _result = None

    def execute(self, context):
        try:
            self._name, self._stages, work = self.start(context)
            return self._finish(context, run(work))
        except UserError as error:
            return self._fail(error)

    def invoke(self, context, event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        try:
            self._require_idle()
            self._name, self._stages, self._work = self.start(context)
        except UserError as error:
            return self._fail(error)
        return self._begin(context, self._stages, TICK_SECONDS)

    def modal(self, context, event):
        stages = self._stages
        if event.type == "ESC" and event.value == "PRESS":
            stages.cancel()
            stages.paused = False
        if event.type == "P" and event.value == "PRESS" and not stages.cancelled:
            stages.paused = not stages.paused
            self._show_frames(context)
        if event.type in background.NAVIGATION:
            return {"PASS_THROUGH"}
        if event.type != "TIMER" or stages.paused:
            return {"RUNNING_MODAL"}
        try:
            if not self._advance():
                self._show_frames(context)
                return {"RUNNING_MODAL"}
            self._leave(context)
            return self._finish(context, self._result)
        except CancelledError:
            self._leave(context)
            self.report({"INFO"}, f"{self._name}: {self.stopped}")
            return {"CANCELLED"}
        except UserError as error:
            self._leave(context)
            return self._fail(error)
        except BaseException:  # a fault of ours: Blender says so, and all goes on
            self._work.close()
            self._leave(context)
            raise

    def cancel(self, context):
        """Blender ends the operator, for instance because its window closes."""
        self._stages.cancel()
        self._work.close()
        self._leave(context)

    def _advance(self):
        """Work until this tick's time is over or there is something to wait for."""
        until = time.monotonic() + WORK_SECONDS
        while time.monotonic() < until:
            if self._waits is not None and not self._waits.done():
                return False
            try:
                self._waits = next(self._work)
            except StopIteration as end:
                self._result = end.value
                return True
        return False

    def _finish(self, context, result):
        return self._say(*self.write(context, result))

    def _show_frames(self, context):
        keys = "P goes on, Esc stops" if self._stages.paused else "P pauses, Esc stops"
        self._show(context, self._stages, self._name, keys)
