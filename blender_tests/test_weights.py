# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles that pull instead of hold, and the volume that a bend keeps."""

import bmesh
import bodies
import bpy
import numpy as np


def posed(bar, key):
    bpy.ops.supple.bake(name=key)
    return bodies.key(bar, key)


def behind(bar, key, motion):
    """Return the mean distance of the head from where `motion` takes it."""
    head = bodies.members(bar, "head")
    goal = bodies.transform(motion, bodies.rest(bar)[head])
    return np.linalg.norm(posed(bar, key)[head] - goal, axis=1).mean()


def volume(obj, positions):
    """Return the volume that Blender finds inside obj with these positions."""
    mesh = bmesh.new()
    mesh.from_mesh(obj.data)
    for vertex, position in zip(mesh.verts, positions, strict=True):
        vertex.co = position
    bmesh.ops.triangulate(mesh, faces=mesh.faces[:])
    found = mesh.calc_volume(signed=True)
    mesh.free()
    return found


def test_a_handle_of_less_weight_stays_farther_behind():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups(held="feet,middle")
    empty = bpy.data.objects["head"]
    at_rest = bodies.empty_matrix(empty)
    empty.location = (0.3, 0.2, 0.4)
    motion = bodies.empty_matrix(empty) @ at_rest.inverted()
    found = []
    for weight in (1.0, 0.9, 0.5, 0.1, 0.01):
        bar.supple.handles["head"].weight = weight
        found.append(behind(bar, f"{weight}", motion))
    assert found[0] < 1e-5
    assert (np.diff(found) > 0.005).all(), found
    assert found[-1] > 0.35  # of 0.54: hardly pulled
    feet = bodies.members(bar, "feet")
    assert np.array_equal(bodies.key(bar, "0.5")[feet], bodies.rest(bar)[feet])


def test_soft_handles_that_agree_move_the_mesh_as_one():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    motion = bodies.rigid_motion()
    for number, row in enumerate(bar.supple.handles):
        row.kind, row.weight = "MOVED", 0.2 + 0.3 * number
        row.empty.matrix_world = motion @ bodies.empty_matrix(row.empty)
    expected = bodies.transform(motion, bodies.rest(bar))
    assert np.abs(posed(bar, "Moved") - expected).max() < 2e-5


def test_a_weight_changed_while_live_shows():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups(held="feet,middle")
    bpy.ops.supple.live()
    bpy.data.objects["head"].location.x = 0.5
    bpy.context.view_layer.update()
    head = bodies.members(bar, "head")
    hard = bodies.key(bar, "Supple Preview")[head]
    assert np.allclose(hard, bodies.rest(bar)[head] + np.float32([0.5, 0, 0]), atol=1e-5)
    bar.supple.handles["head"].weight = 0.3
    bpy.data.objects["head"].location.x = 0.501
    bpy.context.view_layer.update()
    soft = bodies.key(bar, "Supple Preview")[head]
    assert (soft[:, 0] < hard[:, 0] - 0.05).all()
    bpy.ops.supple.live_cancel()


def test_a_bend_keeps_its_volume_and_can_be_told_not_to():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups(held="feet")
    bpy.ops.supple.handle_remove(name="middle")
    head = bpy.data.objects["head"]
    head.location, head.rotation_euler = (0.9, 0.0, -0.5), (0.0, 1.5, 0.0)
    before = volume(bar, bodies.rest(bar))
    kept = {}
    for stiffness in (0.0, 1.0):
        for keep in (True, False):
            bar.supple.stiffness, bar.supple.keep_volume = stiffness, keep
            kept[keep] = volume(bar, posed(bar, f"{stiffness} {keep}")) / before
        # At the stiff end the least distortion counts for more.
        assert abs(kept[True] - 1) < (0.04 if stiffness == 0 else 0.15), kept
        assert abs(kept[False] - 1) > 1.5 * abs(kept[True] - 1), kept
