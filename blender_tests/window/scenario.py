# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person does in their first minutes, and what must have come of it.

Started by run_window.py in a window of 1280 x 800.
"""

import faulthandler
import sys
from pathlib import Path

faulthandler.enable()  # a crash shows where every thread was
sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent)]

import bodies  # noqa: E402
import bpy  # noqa: E402
import carrier_parts  # noqa: E402
import install  # noqa: E402
import live_parts  # noqa: E402
import match_parts  # noqa: E402
import numpy as np  # noqa: E402
import sequence_parts  # noqa: E402
from robot import Robot  # noqa: E402

# Pixels from the window's lower left corner, in Blender 3.4 with its default layout. A click that
# misses fails the check that follows it, and leaves a screenshot.
TAB = (1044, 552)
PREPARE = (887, 647)
SELECT_HEAD = (974, 535)
GROUPS = (887, 473)
PREVIEW = (974, 350)
BAKE = (982, 321)
OVERWRITE = (860, 295)


def say(text):
    print(f"scenario: {text}", flush=True)


def bar():
    """The body; fetched anew each time, as undo replaces it."""
    return bpy.data.objects["Bar"]


def key_names(obj):
    return [k.name for k in obj.data.shape_keys.key_blocks] if obj.data.shape_keys else []


def at_work():
    return sys.modules["supple_blender.background"].running is not None


def start():
    bpy.context.preferences.view.show_splash = False
    install.install()
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    bodies.add_bar()


def undo(robot):
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("Z", ctrl=True)
    yield from robot.wait(0.5)


def open_the_tab(robot):
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("N")
    yield from robot.wait(0.5)
    yield from robot.click(*TAB)
    yield from robot.wait(0.5)


def make_handles(robot):
    yield from robot.click(*GROUPS)
    yield from robot.wait_for(lambda: len(bar().supple.handles) == 3, 3, "three handles")
    kinds = {row.name: row.kind for row in bar().supple.handles}
    assert kinds == {"feet": "HELD", "middle": "MOVED", "head": "MOVED"}, kinds
    robot.screenshot("handles.png")
    say("+ Groups made three handles, the lowest held")


def drag_the_head(robot):
    yield from robot.click(*SELECT_HEAD)
    yield from robot.wait_for(lambda: bpy.context.object.name == "head", 3, "the Empty selected")
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("G")
    yield from robot.press("X")
    yield from robot.type_number("0.8")
    yield from robot.press("RET")
    yield from robot.wait(0.5)
    assert np.isclose(bpy.data.objects["head"].location.x, 0.8, atol=1e-6)
    say("G X 0.8 moved the head's Empty")


def assert_baked(name):
    obj = bar()
    rest, posed = bodies.key(obj, "Basis"), bodies.key(obj, name)
    head, feet = bodies.members(obj, "head"), bodies.members(obj, "feet")
    assert np.array_equal(posed[feet], rest[feet])
    assert np.allclose(posed[head], rest[head] + np.float32([0.8, 0, 0]), atol=1e-5)
    assert obj.data.shape_keys.key_blocks[name].value == 1.0


def bake(robot):
    yield from robot.click(*BAKE)
    yield from robot.wait_for(lambda: "Pose 1" in key_names(bar()), 30, "the baked key")
    yield from robot.wait(1)
    assert_baked("Pose 1")
    robot.screenshot("baked.png")
    say("Bake wrote 'Pose 1'; the head is where its Empty is, the feet did not move")


def undo_step_by_step(robot):
    yield from undo(robot)
    assert key_names(bar()) == [], key_names(bar())
    assert np.isclose(bpy.data.objects["head"].location.x, 0.8, atol=1e-6)
    yield from undo(robot)
    assert bpy.data.objects["head"].location.x == 0
    assert len(bar().supple.handles) == 3
    for _ in range(2):
        yield from robot.press("Z", ctrl=True, shift=True)
        yield from robot.wait(0.5)
    assert_baked("Pose 1")
    say("Ctrl+Z took back the bake, then the move; redo brought both again")


def preview_and_undo(robot):
    yield from robot.click(*PREVIEW)
    yield from robot.wait_for(lambda: "Supple Preview" in key_names(bar()), 30, "the preview key")
    assert key_names(bar()) == ["Basis", "Pose 1", "Supple Preview"]
    yield from undo(robot)
    assert key_names(bar()) == ["Basis", "Pose 1"]
    say("Preview added its key and Ctrl+Z took exactly that back")


def overwrite_only_when_told(robot):
    smile = bar().shape_key_add(name="Smile")
    bar().supple.key_name = "Smile"
    before = bodies.key(bar(), "Smile")
    assert smile.value in (0, 1)
    bpy.ops.ed.undo_push(message="Smile")
    yield from robot.wait(0.5)
    yield from robot.click(*BAKE)
    yield from robot.wait(2)
    assert np.array_equal(bodies.key(bar(), "Smile"), before)
    robot.screenshot("refused.png")
    yield from robot.move(*robot.middle_of_view())  # off the message, which then goes
    yield from robot.wait(0.5)
    yield from robot.click(*OVERWRITE)
    yield from robot.wait_for(lambda: bar().supple.overwrite, 2, "Overwrite switched on")
    yield from robot.click(*BAKE)
    yield from robot.wait_for(lambda: not bar().supple.overwrite, 30, "the bake over Smile")
    assert not np.array_equal(bodies.key(bar(), "Smile"), before)
    for _ in range(3):
        yield from undo(robot)
    assert key_names(bar()) == ["Basis", "Pose 1"], key_names(bar())
    say("A key of another maker was refused, and written once Overwrite was on")


def bake_in_edit_mode(robot):
    bpy.context.view_layer.objects.active = bar()
    bar().select_set(True)
    bar().supple.key_name = "Edit"
    bpy.ops.ed.undo_push(message="Name")
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("TAB")
    yield from robot.wait(0.5)
    assert bar().mode == "EDIT"
    yield from robot.click(*BAKE)
    yield from robot.wait_for(lambda: "Edit" in key_names(bar()), 30, "the key baked in Edit Mode")
    yield from robot.wait(1)
    assert bar().mode == "OBJECT"
    robot.screenshot("edit_mode.png")
    yield from undo(robot)
    assert (bar().mode, key_names(bar())) == ("EDIT", ["Basis", "Pose 1"])
    yield from robot.press("TAB")
    yield from robot.wait(0.5)
    assert (bar().mode, key_names(bar())) == ("OBJECT", ["Basis", "Pose 1"])
    assert_baked("Pose 1")
    say("Bake in Edit Mode wrote its key; Ctrl+Z took exactly that back, into Edit Mode")


def handles_in_edit_mode(robot):
    bpy.ops.supple.handles_clear()
    bpy.ops.ed.undo_push(message="Cleared")
    yield from robot.press("TAB")
    yield from robot.wait(0.5)
    yield from robot.click(*GROUPS)
    yield from robot.wait_for(lambda: len(bar().supple.handles) == 3, 3, "three handles")
    yield from undo(robot)
    assert bar().mode == "EDIT"
    assert len(bar().supple.handles) == 0 and "head" not in bpy.data.objects
    yield from robot.press("TAB")
    yield from robot.wait(0.5)
    say("+ Groups in Edit Mode made handles; Ctrl+Z took exactly that back")


def cancel_long_work(robot):
    with bpy.context.temp_override(window=robot.window, area=robot.view):
        bpy.ops.object.select_all(action="DESELECT")
        bpy.ops.mesh.primitive_uv_sphere_add(segments=256, ring_count=200, radius=1)
    ball = bpy.context.object
    count = len(ball.data.vertices)
    bodies.add_group(ball, "top", range(100))
    bodies.add_group(ball, "low", range(count - 100, count))
    bpy.ops.supple.handles_from_groups(held="low")
    bpy.ops.ed.undo_push(message="Ball")
    before = bodies.everything()
    yield from robot.click(*BAKE)
    yield from robot.wait_for(at_work, 5, "the bake at work")
    yield from robot.wait(0.2)
    robot.screenshot("working.png")
    assert at_work(), "too quick to be cancelled; give this step a larger mesh"
    yield from robot.press("ESC")
    yield from robot.wait_for(lambda: not at_work(), 10, "the bake cancelled")
    yield from robot.wait(0.5)
    assert bodies.everything() == before
    say(f"Esc ended a bake of {count} vertices and left everything as it was")


# Those of a name go on from where the ones before them ended.
PARTS = {
    "pose": (
        make_handles,
        drag_the_head,
        bake,
        undo_step_by_step,
        preview_and_undo,
        overwrite_only_when_told,
        bake_in_edit_mode,
        handles_in_edit_mode,
    ),
    "live": live_parts.PARTS,
    "carrier": carrier_parts.PARTS,
    "cancel": (cancel_long_work,),
    "match": match_parts.PARTS,
    "sequence": sequence_parts.PARTS,
}


def scenario(robot, names):
    yield from robot.wait(2)
    bpy.ops.ed.undo_push(message="Start")
    yield from open_the_tab(robot)
    for name in names or PARTS:
        for part in PARTS[name]:
            yield from part(robot)


start()
out, *names = sys.argv[sys.argv.index("--") + 1 :]
robot = Robot(out)
robot.run(scenario(robot, names))
