# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles of a selection, proposed ones, and Live by playback and by a bone."""

import bodies
import bpy
import numpy as np
from live_parts import FAR, LIVE, bar, fresh_bar, live, preview, say, undo

# As in scenario.py: pixels from the window's lower left corner.
SELECTION = (974, 473)
PROPOSE = (974, 452)
CLEAR = (1008, 555)


def handles_of_a_selection(robot):
    yield from fresh_bar(robot)
    yield from robot.click(*CLEAR)
    yield from robot.wait_for(lambda: len(bar().supple.handles) == 0, 3, "no handles")
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("TAB")
    yield from robot.wait(0.5)
    yield from robot.press("A")
    yield from robot.wait(0.3)
    yield from robot.click(*SELECTION)
    yield from robot.wait_for(lambda: len(bar().supple.handles) == 1, 3, "a handle")
    assert len(bodies.members(bar(), "Handle")) == len(bar().data.vertices)
    yield from undo(robot)
    assert bar().mode == "EDIT" and "Handle" not in bar().vertex_groups
    yield from robot.press("TAB")
    yield from robot.wait(0.5)
    yield from robot.click(*PROPOSE)
    yield from robot.wait_for(lambda: len(bar().supple.handles) == 12, 3, "twelve handles")
    robot.screenshot("proposed.png")
    yield from undo(robot)
    assert len(bar().supple.handles) == 0 and len(bar().vertex_groups) == 3
    say("+ Selection in Edit Mode and Propose 12 made handles; Ctrl+Z took exactly those back")


def play_the_animation(robot):
    yield from fresh_bar(robot)
    head = bpy.data.objects["head"]
    for frame, x in ((1, 0.0), (41, 0.8)):
        head.location.x = x
        head.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_end = 41
    bpy.context.scene.frame_set(1)
    bpy.ops.ed.undo_push(message="Animated")
    yield from robot.click(*LIVE)
    yield from robot.wait_for(lambda: live().running is not None, 3, "Live")
    yield from robot.wait_for(lambda: live().running.doing == "Following", 30, "Live at rest")
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("SPACE")
    seen = set()
    for _ in range(20):
        yield
        seen.add(round(float(preview()[0]), 3))
    yield from robot.press("ESC")
    yield from robot.wait(0.5)
    assert len(seen) > 5, f"the mesh did not follow the playback: {seen}"
    assert not robot.window.screen.is_animation_playing
    assert live().running is not None, "Esc ended Live instead of the playback"
    assert np.allclose(preview(), 0, atol=1e-5)  # Esc went back to the frame before
    yield from robot.press("ESC")
    yield from robot.wait_for(lambda: live().running is None, 3, "Live ended by Esc")
    say("The mesh followed the playback; Esc ended that first, and then Live")


def drag_a_bone(robot):
    yield from fresh_bar(robot)
    bpy.ops.supple.handles_clear()
    bpy.ops.object.armature_add(location=(0, 0, 1.5))
    rig = bpy.context.object
    rig.data.bones["Bone"].name = "head"
    for obj in (rig, bar()):
        obj.select_set(True)
    bpy.ops.supple.handles_from_bones(armature=rig.name, bones="head")
    bpy.ops.supple.handles_from_groups(groups="feet", held="feet")
    bpy.ops.supple.handle_select(name="head")
    bpy.ops.ed.undo_push(message="Bone")
    yield from robot.wait(0.5)
    assert rig.mode == "POSE"
    before = bodies.rest(bar())
    yield from robot.click(*LIVE)
    yield from robot.wait_for(lambda: live().running is not None, 3, "Live")
    yield from robot.wait_for(lambda: live().running.doing == "Following", 30, "Live at rest")
    yield from robot.move(*robot.middle_of_view())
    yield from robot.press("G")
    steps = []
    for _ in range(3):
        yield from robot.move(robot.x + 12, robot.y + 5)
        yield from robot.wait(0.3)
        steps.append(preview())
    moved = np.linalg.norm(np.diff([np.zeros(3), *steps], axis=0), axis=1)
    assert (moved > FAR).all(), f"the mesh did not follow the bone: {moved}"
    robot.screenshot("bone.png")
    yield from robot.press("LEFTMOUSE")
    yield from robot.wait(0.5)
    yield from robot.press("ESC")
    yield from robot.wait_for(lambda: live().running is None, 3, "Live ended by Esc")
    assert np.allclose(rig.pose.bones["head"].location, 0)
    assert bar().data.shape_keys is None and np.array_equal(bodies.rest(bar()), before)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.supple.handles_clear()
    bpy.data.objects.remove(rig)
    bpy.ops.ed.undo_push(message="No bone")
    say("The mesh followed a bone in Pose Mode; Esc put the bone and the mesh back")


PARTS = (handles_of_a_selection, play_the_animation, drag_a_bone)
