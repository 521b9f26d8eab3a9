# SPDX-License-Identifier: GPL-3.0-or-later
"""What changes under Live while it runs: settings, handles, the mesh, modes, mistakes."""

import bodies
import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix
from test_live import bar, head_moved, live, move_head, preview, settle, update

__all__ = ["bar", "live"]

PLACES = {
    "turned": Matrix.LocRotScale((1, -2, 0.5), Euler((0.4, 1.0, -0.7)), (1, 1, 1)),
    "stretched": Matrix.LocRotScale((1, 0, 0), Euler((0.4, 1.0, -0.7)), (3.0, 0.5, 1.2)),
    "mirrored": Matrix.LocRotScale((1, 0, 0), Euler((0.1, 0.2, 0.3)), (-1.0, 1.0, 2.0)),
}


@pytest.mark.parametrize("place", PLACES)
def test_rigid_motion_of_all_handles_is_that_of_the_mesh(live, place):
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.location, parent.rotation_euler = (1, 2, 3), (0.2, 0.4, 0.6)
    bar = bodies.add_bar()
    bar.parent, bar.matrix_basis = parent, PLACES[place]
    bpy.ops.supple.handles_from_groups()
    for row in bar.supple.handles:
        row.kind = "MOVED"
    bpy.ops.supple.live()
    motion = bodies.rigid_motion()
    for row in bar.supple.handles:
        row.empty.matrix_world = motion @ bodies.empty_matrix(row.empty)
    update()
    settle(live)
    expected = bodies.transform(motion, bodies.to_world(bar, bodies.rest(bar)))
    found = bodies.to_world(bar, preview(bar))
    assert np.abs(found - expected).max() < 1e-4


def test_moving_or_turning_the_object_is_no_pose(bar, live):
    bpy.ops.supple.live()
    bar.matrix_world = bodies.rigid_motion()
    update()
    assert np.allclose(preview(bar), bodies.rest(bar), atol=2e-6)


def test_scaling_the_object_while_live(bar, live):
    bpy.ops.supple.live()
    move_head(0.5)
    bar.scale = (1, 1, 2)
    update()
    settle(live)
    assert np.allclose(head_moved(bar)[:, 2], 0.5, atol=1e-5)  # its Empty was scaled with it
    bpy.data.objects["head"].location.z = 1.0
    update()
    assert np.allclose(head_moved(bar)[:, 2], 1.0, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "value"), [("strength", 0.5), ("stiffness", 1.0), ("method", "ARAP"), ("falloff", 0.6)]
)
def test_settings_show_at_once(bar, live, addon, name, value):
    bpy.ops.supple.live()
    bpy.data.objects["head"].rotation_euler.y = 1.2
    update()
    settle(live)
    before = preview(bar)
    setattr(bar.supple, name, value)
    settle(live)
    assert np.abs(preview(bar) - before).max() > 1e-4
    expected = addon("api").solve(bar).positions
    assert np.abs(preview(bar) - expected).max() < 1e-5 * bodies.HEIGHT


def test_held_and_moved_while_live(bar, live):
    bpy.ops.supple.live()
    move_head(0.5)
    bar.supple.handles["head"].kind = "HELD"
    live.step(12.0)
    assert np.array_equal(head_moved(bar), np.zeros_like(head_moved(bar)))
    bar.supple.handles["head"].kind = "MOVED"
    live.step(12.0)
    assert np.allclose(head_moved(bar), [0, 0, 0.5], atol=1e-5)


def test_handles_added_and_removed_while_live(live):
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups(groups="feet,head")
    bpy.ops.supple.live()
    move_head(0.5)
    bpy.ops.supple.handles_from_groups(groups="middle")
    live.step(12.0)
    middle = bodies.members(bar, "middle")
    assert np.allclose(preview(bar)[middle], bodies.rest(bar)[middle], atol=1e-5)
    bpy.data.objects["middle"].location.x = 0.3
    update()
    assert np.allclose(preview(bar)[middle] - bodies.rest(bar)[middle], [0.3, 0, 0], atol=1e-5)
    bpy.ops.supple.handle_remove(name="middle")
    settle(live)
    assert np.abs(preview(bar)[middle] - bodies.rest(bar)[middle])[:, 0].max() < 0.2


def edit(obj, change):
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    update()
    bpy.ops.mesh.select_all(action="SELECT")
    change()
    bpy.ops.object.mode_set(mode="OBJECT")
    update()


def test_edit_mode_pauses_it_and_a_new_basis_is_followed(bar, live):
    bpy.ops.supple.live()
    move_head(0.5)
    bar.active_shape_key_index = 0
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.data.objects["head"].location.z = 0.8
    update()
    assert "Paused: Bar" in live.running.doing
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.resize(value=(2, 1, 1))
    bpy.ops.object.mode_set(mode="OBJECT")
    update()
    settle(live)
    assert np.isclose(np.ptp(bodies.rest(bar)[:, 0]), 1.2, atol=1e-5)
    assert np.allclose(head_moved(bar), [0, 0, 0.8], atol=1e-5)
    assert "Paused" not in live.running.doing


def test_a_preview_edited_by_hand_is_left_alone(bar, live):
    bpy.ops.supple.live()
    move_head(0.5)
    edit(bar, lambda: bpy.ops.transform.translate(value=(0, 0, 3)))
    live.step(12.0)
    assert live.running is None
    assert "Bar: key 'Supple Preview' was edited" in live.ended
    assert np.isclose(preview(bar)[:, 2].max(), bodies.HEIGHT + 0.5 + 3, atol=1e-4)


def test_a_changed_vertex_count_is_said_and_rebind_goes_on(bar, live, addon, monkeypatch):
    bpy.ops.supple.live()
    move_head(0.5)
    bar.active_shape_key_index = 0
    edit(bar, bpy.ops.mesh.subdivide)
    live.step(12.0)
    assert "Press Rebind to go on" in live.running.problem
    bpy.ops.supple.rebind()
    monkeypatch.setattr(addon("follower"), "CHECK_SECONDS", 0.0)
    settle(live)
    assert live.running.problem == ""
    assert np.allclose(head_moved(bar), [0, 0, 0.5], atol=1e-5)


def test_an_empty_scaled_to_zero_is_said_and_the_rest_goes_on(bar, live):
    bpy.ops.supple.live()
    move_head(0.5)
    bpy.data.objects["head"].scale.x = 0
    update()
    assert "Empty 'head' of handle 'head' is scaled to 0" in live.running.problem
    assert np.allclose(head_moved(bar), [0, 0, 0.5], atol=1e-5)
    bpy.data.objects["head"].scale.x = 1
    move_head(0.7)
    assert live.running.problem == ""
    assert np.allclose(head_moved(bar), [0, 0, 0.7], atol=1e-5)


def test_a_deleted_empty_is_said(bar, live):
    bpy.ops.supple.live()
    bpy.data.objects.remove(bpy.data.objects["head"])
    update()
    assert "Bar: the Empty of handle 'head' was deleted" in live.running.problem


def test_wrong_input_starts_nothing(live):
    bar = bodies.add_bar()
    with pytest.raises(RuntimeError, match="Bar: it has no handles"):
        bpy.ops.supple.live()
    bpy.ops.supple.handles_from_groups()
    bar.supple.mask = "nobody"
    before = bodies.everything()
    with pytest.raises(RuntimeError, match="Bar: the mask 'nobody' is no vertex group"):
        bpy.ops.supple.live()
    assert bodies.everything() == before and live.running is None
