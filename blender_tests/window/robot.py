# SPDX-License-Identifier: GPL-3.0-or-later
"""A user of a Blender window: moves the mouse, clicks and types through event simulation."""

import os
import sys
import traceback
from pathlib import Path

import bpy

# Blender takes one simulated event a main-loop turn or so; a person is slower than this.
STEP_SECONDS = 0.15

DIGITS = {
    "0": "ZERO",
    "1": "ONE",
    "2": "TWO",
    "3": "THREE",
    "4": "FOUR",
    "5": "FIVE",
    "6": "SIX",
    "7": "SEVEN",
    "8": "EIGHT",
    "9": "NINE",
    ".": "PERIOD",
    "-": "MINUS",
}


class Robot:
    """The simulated user; methods are generators: `yield from robot.click(x, y)`."""

    def __init__(self, out):
        self.out = Path(out)

    @property
    def window(self):
        return bpy.context.window_manager.windows[0]

    @property
    def view(self):
        return next(area for area in self.window.screen.areas if area.type == "VIEW_3D")

    def region(self, kind):
        return next(region for region in self.view.regions if region.type == kind)

    def middle_of_view(self):
        region = self.region("WINDOW")
        return region.x + region.width // 3, region.y + region.height // 2

    def move(self, x, y):
        self.window.event_simulate("MOUSEMOVE", "NOTHING", x=int(x), y=int(y))
        self.x, self.y = int(x), int(y)
        yield

    def press(self, key, *, text="", **modifiers):
        for value in ("PRESS", "RELEASE"):
            unicode = text if value == "PRESS" else ""
            self.window.event_simulate(
                key,
                value,
                x=self.x,
                y=self.y,
                **({"unicode": unicode} if unicode else {}),
                **modifiers,
            )
            yield

    def type_number(self, text):
        for digit in text:
            yield from self.press(DIGITS[digit], text=digit)

    def click(self, x, y):
        yield from self.move(x, y)
        yield from self.move(x + 1, y)
        yield from self.press("LEFTMOUSE")
        yield

    def wait(self, seconds):
        for _ in range(max(1, round(seconds / STEP_SECONDS))):
            yield

    def wait_for(self, condition, seconds, what):
        for _ in range(round(seconds / STEP_SECONDS)):
            if condition():
                return
            yield
        raise AssertionError(f"waited {seconds} s for: {what}")

    def screenshot(self, name):
        with bpy.context.temp_override(window=self.window):
            bpy.ops.screen.screenshot(filepath=str(self.out / name))

    def run(self, steps):
        """Run a generator of steps from a timer; end Blender with 0, or with 1 at an exception."""

        def tick():
            try:
                next(steps)
            except StopIteration:
                print("scenario: done", flush=True)
                self._end(0)
            except BaseException:
                traceback.print_exc()
                self.screenshot("failed.png")
                self._end(1)
            return STEP_SECONDS

        bpy.app.timers.register(tick, first_interval=2.0)

    def _end(self, code):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)  # quitting by operator asks about unsaved changes
