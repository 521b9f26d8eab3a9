# SPDX-License-Identifier: GPL-3.0-or-later
"""Live as a person has it: the mouse drags an Empty, and the mesh is there before the click."""

import sys

import bodies
import bpy
import numpy as np

# As in scenario.py: pixels from the window's lower left corner.
SELECT_HEAD = (974, 535)
LIVE = (897, 350)
BAKE_WHILE_LIVE = (982, 269)
DISTORTION = (881, 210)
DISTORTION_ARROW = (864, 210)
VIEW_IT = (930, 134)
FAR = 0.05  # of the bar's height of 2


def say(text):
    print(f"scenario: {text}", flush=True)


def bar():
    return bpy.data.objects["Bar"]


def live():
    return sys.modules["supple_blender.live"]


def preview():
    """Return where the head's vertices are in the preview key, less where they were at rest."""
    head = bodies.members(bar(), "head")
    return (bodies.key(bar(), "Supple Preview") - bodies.rest(bar()))[head].mean(axis=0)


def empty():
    return np.array(bpy.data.objects["head"].matrix_basis.translation)


def undo(robot, *, redo=False):
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("Z", ctrl=True, shift=redo)
    yield from robot.wait(0.5)


def drag(robot, x, y):
    """Press G and move the mouse; the mesh must follow while the mouse moves."""
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("G")
    before = preview()
    steps = []
    for _ in range(4):
        yield from robot.move(robot.x + x, robot.y + y)
        yield from robot.wait(0.3)
        steps.append(preview())
        assert np.allclose(steps[-1], empty(), atol=1e-4), (steps[-1], empty())
    moved = np.linalg.norm(np.diff([before, *steps], axis=0), axis=1)
    assert (moved > FAR).all(), f"the mesh did not follow the mouse: {moved}"


def fresh_bar(robot):
    """Back to a bar without handles or keys, one undo step each."""
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = bar()
    bar().select_set(True)
    bpy.ops.supple.handles_clear()
    if bar().data.shape_keys:
        bar().shape_key_clear()
    bpy.ops.supple.handles_from_groups()
    bar().supple.key_name = "Pose 1"
    bpy.ops.ed.undo_push(message="Fresh")
    yield from robot.wait(0.5)


def follow_the_drag(robot):
    yield from fresh_bar(robot)
    yield from robot.click(*SELECT_HEAD)
    yield from robot.wait_for(lambda: bpy.context.object.name == "head", 3, "the Empty selected")
    yield from robot.click(*LIVE)
    yield from robot.wait_for(lambda: live().running is not None, 3, "Live")
    yield from robot.wait_for(lambda: live().running.doing == "Following", 30, "Live at rest")
    yield from drag(robot, 12, 5)
    robot.screenshot("live_drag.png")
    yield from robot.press("LEFTMOUSE")
    yield from robot.wait(0.5)
    assert live().running.doing == "Following"
    say("G, then the mouse: the mesh followed at every move, before the click")


def take_back_a_drag(robot):
    here = preview()
    for cancel in ("ESC", "RIGHTMOUSE"):
        yield from drag(robot, -12, 4)
        yield from robot.press(cancel)
        yield from robot.wait(0.5)
        assert np.allclose(preview(), here, atol=1e-5)
        assert live().running is not None, f"{cancel} in a drag ended Live"
    say("Esc and right click in a drag took back that drag, and Live went on")


def undo_while_live(robot):
    here = preview()
    yield from undo(robot)
    assert np.allclose(empty(), 0) and np.allclose(preview(), 0, atol=1e-5)
    yield from undo(robot, redo=True)
    assert np.allclose(preview(), here, atol=1e-5)
    assert live().running is not None
    yield from drag(robot, 4, 10)
    yield from robot.press("LEFTMOUSE")
    yield from robot.wait(0.5)
    yield from undo(robot)
    assert np.allclose(preview(), here, atol=1e-5)
    say("Ctrl+Z and redo while live: one step a drag, and the mesh followed")


def enter_keeps(robot):
    here = preview()
    assert np.linalg.norm(here) > FAR
    yield from robot.press("RET")
    yield from robot.wait_for(lambda: live().running is None, 3, "Live ended by Enter")
    assert np.allclose(preview(), here, atol=1e-5)
    assert np.allclose(empty(), here, atol=1e-4)
    robot.screenshot("live_kept.png")
    say("Enter ended Live and kept the pose")


def escape_restores(robot):
    before = bodies.everything()
    yield from robot.click(*LIVE)
    yield from robot.wait_for(lambda: live().running is not None, 3, "Live")
    yield from robot.wait_for(lambda: live().running.doing == "Following", 30, "Live at rest")
    yield from drag(robot, 8, -8)
    yield from robot.press("LEFTMOUSE")
    yield from robot.wait(0.5)
    yield from robot.press("ESC")
    yield from robot.wait_for(lambda: live().running is None, 3, "Live ended by Esc")
    assert bodies.everything() == before
    say("Esc ended Live and put everything back, byte for byte")


def undo_past_the_start(robot):
    yield from fresh_bar(robot)
    bpy.ops.supple.handle_select(name="head")
    bpy.ops.ed.undo_push(message="Again")
    yield from robot.click(*LIVE)
    yield from robot.wait_for(lambda: live().running is not None, 3, "Live")
    yield from undo(robot)
    yield from robot.wait_for(lambda: live().running is None, 3, "Live ended by undo")
    assert bar().data.shape_keys is None
    assert len(bar().supple.handles) == 3
    yield from undo(robot, redo=True)
    assert live().running is None
    yield from undo(robot)
    say("Ctrl+Z past the start of Live ended it and left nothing")


def distort_and_bake(robot):
    yield from robot.click(*LIVE)
    yield from robot.wait_for(lambda: live().running is not None, 3, "Live")
    yield from robot.click(*DISTORTION)
    colours = bar().data.color_attributes
    yield from robot.wait_for(lambda: "Supple Distortion" in colours, 3, "the colour attribute")
    yield from robot.click(*DISTORTION_ARROW)
    yield from robot.wait(0.5)
    yield from robot.click(*VIEW_IT)
    yield from robot.wait(0.5)
    assert robot.view.spaces.active.shading.color_type == "VERTEX"

    def shown():
        found = bar().data.color_attributes["Supple Distortion"].data
        return np.array([c.color[:] for c in found])

    at_rest = shown()
    yield from drag(robot, 10, 3)
    assert np.abs(shown() - at_rest).max() > 0.1, "the colours did not follow the drag"
    robot.screenshot("distortion.png")
    yield from robot.press("LEFTMOUSE")
    yield from robot.wait(0.5)
    where = preview()
    yield from robot.click(*BAKE_WHILE_LIVE)
    yield from robot.wait_for(lambda: live().running is None, 30, "the bake")
    yield from robot.wait(0.5)
    names = [key.name for key in bar().data.shape_keys.key_blocks]
    assert names == ["Basis", "Pose 1"], names
    head = bodies.members(bar(), "head")
    baked = (bodies.key(bar(), "Pose 1") - bodies.rest(bar()))[head].mean(axis=0)
    assert np.allclose(baked, where, atol=1e-4)
    bpy.ops.supple.distortion(show=False)
    assert robot.view.spaces.active.shading.color_type == "MATERIAL"
    say("Distortion was shown live, and Bake while live wrote the pose and ended it")


PARTS = (
    follow_the_drag,
    take_back_a_drag,
    undo_while_live,
    enter_keeps,
    escape_restores,
    undo_past_the_start,
    distort_and_bake,
)
