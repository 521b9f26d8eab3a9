# SPDX-License-Identifier: GPL-3.0-or-later
"""An animation corrected from two keyed frames: handles that follow, a preview, and a bake."""

import os
import sys
from pathlib import Path

import bodies
import bpy
import moving
import numpy as np
from bpy_extras import view3d_utils
from live_parts import bar, say, undo
from match_parts import in_view
from mathutils import Vector

# As in scenario.py: pixels from the window's lower left corner. A click with Ctrl on a panel's
# header opens that panel and closes all others, so that what is above does not matter.
MESH_HEADER = (930, 703)
SEQUENCE_HEADER = (930, 584)
FOLLOW = (950, 570)
KEY = (890, 544)
PREVIEW = (950, 492)
BAKE = (950, 414)
BEFORE = (870, 388)
AFTER = (930, 388)
# The timeline's bar of numbers: where frame 20 is, and how wide a frame.
FRAME_20 = (115, 37)
FRAME_WIDTH = 3.918

FIRST, LAST = 5, 245
FAR = 0.05  # of the bar's height of 2


def module(name):
    return sys.modules[f"supple_blender.{name}"]


def at_work():
    return module("background").running is not None


def frame():
    return bpy.context.scene.frame_current


def shown():
    """Return the vertices (n, 3) float32 that the viewport shows."""
    evaluated = bar().evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([vertex.co for vertex in evaluated.data.vertices], dtype=np.float32)


def picture():
    """Return what a bake must leave as it was until it is done."""
    curves = module("compat").curves_of(bar())
    return (
        bodies.everything(),
        [(m.name, m.show_viewport, m.show_render) for m in bar().modifiers],
        [(curve.data_path, curve.mute) for curve in curves],
        frame(),
    )


def last_report(robot):
    """Return the last message, read in an Info editor that takes the timeline's place meanwhile."""
    area = next(area for area in robot.window.screen.areas if area.type == "DOPESHEET_EDITOR")
    before = area.ui_type
    area.type = "INFO"
    with bpy.context.temp_override(window=robot.window, area=area, region=area.regions[-1]):
        bpy.ops.info.select_all(action="SELECT")
        bpy.ops.info.report_copy()
    area.ui_type = before
    return bpy.context.window_manager.clipboard.strip().splitlines()[-1]


def on_timeline(number):
    return FRAME_20[0] + FRAME_WIDTH * (number - 20), FRAME_20[1]


def go_to(robot, number):
    """Click on a frame of the timeline; one beside it will do."""
    yield from robot.click(*on_timeline(number))
    yield from robot.wait_for(lambda: abs(frame() - number) <= 1, 3, f"frame {number}")


def open_the_panel(robot):
    """A bar that bones bend, its feet held, and its head to be corrected."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    body = bodies.add_bar()
    moving.add_armature(body)
    bpy.context.scene.frame_set(1)
    bpy.ops.supple.handles_from_groups(groups="feet,head", held="feet")
    body.supple.stiffness = 1.0  # so that a bake takes long enough to be stopped
    settings = body.supple_sequence
    settings.first, settings.last = FIRST, LAST
    with in_view(robot):
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_all()
    folder = os.environ["BLENDER_USER_RESOURCES"]  # it goes when Blender has ended
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / "shot.blend"))
    bpy.ops.ed.undo_push(message="Body")
    yield from robot.wait(1)
    for header in (MESH_HEADER, SEQUENCE_HEADER):
        yield from robot.move(*header)
        yield from robot.press("LEFTMOUSE", ctrl=True)
        yield from robot.wait(1)
    robot.screenshot("sequence_panel.png")


def let_handles_follow(robot):
    before = picture()
    yield from robot.click(*FOLLOW)
    yield from robot.wait_for(lambda: bar().supple.handles["head"].frame, 30, "a frame")
    yield from robot.wait_for(lambda: not at_work(), 5, "the end of it")
    carrier = bar().supple.handles["head"].frame
    assert bpy.data.objects["head"].parent == carrier
    assert picture()[1:] == before[1:]
    yield from undo(robot)
    assert bar().supple.handles["head"].frame is None
    yield from undo(robot, redo=True)
    assert bar().supple.handles["head"].frame is not None
    head = bodies.members(bar(), "head")
    for number in (20, 60):
        yield from go_to(robot, number)
        yield from robot.wait(0.3)
        where = bodies.empty_matrix(bpy.data.objects["head"]).translation
        assert np.allclose(where, shown()[head].mean(axis=0), atol=1e-3), (number, where)
    say("Handles Follow put the Empty on the moving head; Ctrl+Z and redo of that")


def key_by_mouse(robot):
    keyed = module("sequence_keys").frames
    for number, x, y in ((20, 40, 10), (60, 30, -15)):
        yield from go_to(robot, number)
        yield from robot.wait(0.3)
        empty = bpy.data.objects["head"]
        region = robot.region("WINDOW")
        on_it = bodies.empty_matrix(empty) @ Vector((0, 0, empty.empty_display_size))
        at = view3d_utils.location_3d_to_region_2d(
            region, robot.view.spaces.active.region_3d, on_it
        )
        yield from robot.click(region.x + at.x, region.y + at.y)
        yield from robot.wait_for(lambda: bpy.context.object.name == "head", 3, "the Empty")
        before = np.array(bpy.data.objects["head"].location)
        yield from robot.press("G")
        for _ in range(3):
            yield from robot.move(robot.x + x / 3, robot.y + y / 3)
        yield from robot.press("LEFTMOUSE")
        yield from robot.wait(0.5)
        moved = np.linalg.norm(np.array(bpy.data.objects["head"].location) - before)
        assert moved > FAR, f"the mouse moved the Empty by {moved}"
        yield from robot.click(*KEY)
        yield from robot.wait_for(lambda: frame() in keyed(bar()), 3, "a key")
    assert len(keyed(bar())) == 2, keyed(bar())
    robot.screenshot("sequence_keyed.png")
    say(f"The mouse moved the Empty, and Key Handles keyed it at frames {keyed(bar())}")


def scrub(robot, numbers):
    """Drag through the timeline; yield from it gives {frame: what was shown}."""
    seen = {}
    yield from robot.move(*on_timeline(numbers[0]))
    for number in numbers:
        value = "PRESS" if number == numbers[0] else "NOTHING"
        kind = "LEFTMOUSE" if value == "PRESS" else "MOUSEMOVE"
        robot.x, robot.y = map(int, on_timeline(number))
        robot.window.event_simulate(kind, value, x=robot.x, y=robot.y)
        yield from robot.wait(0.6)
        seen[frame()] = shown()
    robot.window.event_simulate("LEFTMOUSE", "RELEASE", x=robot.x, y=robot.y)
    yield
    return seen


def preview_while_scrubbing(robot):
    numbers = (50, 40, 30)
    plain = yield from scrub(robot, numbers)
    before = picture()[1]
    yield from robot.click(*PREVIEW)
    preview = module("sequence_preview")
    yield from robot.wait_for(lambda: preview.running, 30, "the preview")
    corrected = yield from scrub(robot, numbers)
    assert len(corrected) == len(numbers) and corrected.keys() == plain.keys(), corrected.keys()
    for number in corrected:
        assert np.abs(corrected[number] - plain[number]).max() > FAR, number
    yield from robot.move(*robot.middle_of_view())
    start, last = frame(), corrected[frame()]
    for _ in range(3):
        yield from robot.press("RIGHT_ARROW")
        yield from robot.wait(0.5)
        assert not np.array_equal(shown(), last), f"frame {frame()} looks like the one before"
        last = shown()
    assert frame() == start + 3
    robot.screenshot("sequence_preview.png")
    yield from robot.click(*PREVIEW)
    yield from robot.wait_for(lambda: preview.running is None, 3, "the preview's end")
    assert picture()[1] == before
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("S", ctrl=True)
    yield from robot.wait_for(lambda: not bpy.data.is_dirty, 5, "the file saved")
    say(f"The preview showed frames {sorted(corrected)} corrected, by the mouse and the arrow keys")


def pause_and_stop(robot):
    before = picture()
    yield from robot.click(*BAKE)
    background = module("background")
    yield from robot.wait_for(at_work, 5, "the bake at work")
    yield from robot.wait_for(lambda: background.running.fraction > 0.1, 30, "some frames")
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("P")
    yield from robot.wait(1)  # the batches that were begun
    stages = background.running
    assert stages.paused, "too quick to be paused; give this step more frames"
    done = stages.fraction
    robot.screenshot("sequence_paused.png")
    yield from robot.wait(2)
    assert stages.fraction == done < 1, (done, stages.fraction)
    yield from robot.press("P")
    yield from robot.wait_for(lambda: stages.fraction > done, 10, "it going on")
    yield from robot.press("ESC")
    yield from robot.wait_for(lambda: not at_work(), 10, "the bake stopped")
    yield from robot.wait(0.5)
    assert stages.fraction < 1
    message = last_report(robot)
    assert "frames that are done are kept" in message, message
    yield from robot.wait(0.5)
    assert picture() == before
    say(f"P paused a bake at {done:.0%} and let it go on; Esc stopped it: {message}")


def bake_to_the_end(robot):
    before = picture()
    plain = shown()
    yield from robot.click(*BAKE)
    yield from robot.wait_for(lambda: "Supple Sequence" in bar().modifiers, 120, "the bake")
    yield from robot.wait_for(lambda: not at_work(), 5, "the end of it")
    yield from robot.wait(0.5)
    message = last_report(robot)
    assert "as they were baked before" in message, message
    assert frame() == before[-1]
    corrected = shown()
    assert np.abs(corrected - plain).max() > FAR, "the baked result is not shown at once"
    robot.screenshot("sequence_baked.png")
    yield from undo(robot)
    assert picture()[:-1] == before[:-1]
    yield from undo(robot, redo=True)
    assert "Supple Sequence" in bar().modifiers
    say(f"Bake went on to the end, and Ctrl+Z took exactly that back: {message}")


def before_and_after(robot):
    yield from go_to(robot, 40)
    corrected = shown()
    yield from robot.click(*BEFORE)
    yield from robot.wait(0.5)
    plain = shown()
    assert np.abs(corrected - plain).max() > FAR
    yield from robot.click(*AFTER)
    yield from robot.wait(0.5)
    assert np.array_equal(shown(), corrected)
    robot.screenshot("sequence_after.png")
    for _ in range(2):
        yield from undo(robot)
    assert "Supple Sequence" in bar().modifiers
    say("Before showed the animation as it was, After the result again")


PARTS = (
    open_the_panel,
    let_handles_follow,
    key_by_mouse,
    preview_while_scrubbing,
    pause_and_stop,
    bake_to_the_end,
    before_and_after,
)
