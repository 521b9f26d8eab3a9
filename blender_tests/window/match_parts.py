# SPDX-License-Identifier: GPL-3.0-or-later
"""Two meshes matched from clicked pairs, the match shown, cancelled work, and undo of each."""

import sys

import bodies
import bpy
import numpy as np
import pairs
from bpy_extras import view3d_utils
from live_parts import say, undo


def settings():
    return bpy.context.scene.supple_match


def scan():
    return bpy.data.objects["Scan"]


def in_view(robot):
    """Return a context in which a button of the 3D View was pressed."""
    region = robot.region("WINDOW")
    return bpy.context.temp_override(window=robot.window, area=robot.view, region=region)


def pixel_of(robot, obj, vertex):
    region = robot.region("WINDOW")
    place = obj.matrix_world @ obj.data.vertices[vertex].co
    at = view3d_utils.location_3d_to_region_2d(region, robot.view.spaces.active.region_3d, place)
    return region.x + at.x, region.y + at.y


def add_pair_of_bodies(robot):
    """A body and its copy in another order, side by side and seen from the front."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    body = pairs.dress(pairs.add_lump())
    copy, order = pairs.add_shuffled(body)
    copy.location.x = 3.2
    pairs.choose(body, copy, "LANDMARKS")
    bpy.context.view_layer.objects.active = copy
    with in_view(robot):
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_all()
    bpy.ops.ed.undo_push(message="Two bodies")
    yield from robot.wait(1)
    return order


def click_pairs(robot):
    order = yield from add_pair_of_bodies(robot)
    with in_view(robot):
        assert bpy.ops.supple.landmark_click("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    body = bpy.data.objects["Body"]
    for vertex in (187, 254, 347):  # on the front, wide apart
        partner = int(np.flatnonzero(order == vertex)[0])
        yield from robot.click(*pixel_of(robot, body, vertex))
        yield from robot.wait(0.3)
        yield from robot.click(*pixel_of(robot, scan(), partner))
        yield from robot.wait(0.3)
    robot.screenshot("pairs.png")
    yield from robot.press("ESC")
    yield from robot.wait(0.5)
    where, rest = bodies.rest(scan()), bodies.rest(body)
    assert len(settings().pairs) == 3, len(settings().pairs)
    for row in settings().pairs:  # a click may take a neighbour
        assert np.linalg.norm(rest[row.source_vertex] - where[row.target_vertex]) < 0.3
    yield from undo(robot)
    assert len(settings().pairs) == 2
    yield from robot.press("Z", ctrl=True, shift=True)
    yield from robot.wait(0.5)
    assert len(settings().pairs) == 3
    say("Three pairs were clicked; Ctrl+Z took exactly the last one back")


def match_and_show(robot):
    shading = robot.view.spaces.active.shading
    before = shading.color_type
    with in_view(robot):
        bpy.ops.supple.match("INVOKE_DEFAULT")
    yield from robot.wait_for(lambda: scan().supple_map.confidence > 0.8, 60, "the match")
    yield from robot.wait(0.5)
    with in_view(robot):
        bpy.ops.supple.match_show("INVOKE_DEFAULT")
    yield from robot.wait(0.5)
    assert shading.color_type == "VERTEX"
    robot.screenshot("match.png")
    with in_view(robot):
        bpy.ops.supple.match_show("INVOKE_DEFAULT", show=False)
    yield from robot.wait(0.5)
    assert shading.color_type == before
    say("Match found the partners; Show coloured both meshes and went back")


def transfer_and_undo(robot):
    settings().transfer = {"UVS", "WEIGHTS", "COLOURS", "KEYS", "FIT"}
    bpy.ops.ed.undo_push(message="All")
    with in_view(robot):
        bpy.ops.supple.transfer("INVOKE_DEFAULT")
    yield from robot.wait_for(lambda: "Body on Scan" in bpy.data.objects, 60, "the transfer")
    yield from robot.wait(0.5)
    assert scan().data.shape_keys and scan().data.uv_layers and scan().vertex_groups
    robot.screenshot("transfer.png")
    yield from undo(robot)
    assert "Body on Scan" not in bpy.data.objects
    assert not scan().data.shape_keys and not scan().data.uv_layers and not scan().vertex_groups
    assert scan().supple_map.confidence > 0.8
    say("Transfer carried everything; Ctrl+Z took exactly that back")


def cancel_a_match(robot):
    with in_view(robot):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=256, ring_count=200, radius=1)
    settings().target, settings().start = bpy.context.object, "AUTOMATIC"
    bpy.ops.ed.undo_push(message="Ball")
    background = sys.modules["supple_blender.background"]
    before = pairs.everything()
    with in_view(robot):
        bpy.ops.supple.match("INVOKE_DEFAULT")
    yield from robot.wait_for(lambda: background.running is not None, 5, "the match at work")
    yield from robot.wait(0.2)
    assert background.running, "too quick to be cancelled; give this step a larger mesh"
    robot.screenshot("matching.png")
    yield from robot.press("ESC")
    yield from robot.wait_for(lambda: background.running is None, 20, "the match cancelled")
    yield from robot.wait(0.5)
    assert pairs.everything() == before
    say("Esc ended a match and left everything as it was")


PARTS = (click_pairs, match_and_show, transfer_and_undo, cancel_a_match)
