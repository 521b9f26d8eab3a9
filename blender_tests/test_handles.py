# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles: which groups become rows, where their Empties are, what follows what."""

import bodies
import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix


def kinds(obj):
    return {row.name: row.kind for row in obj.supple.handles}


def test_every_group_becomes_a_handle_and_the_lowest_is_held():
    bar = bodies.add_bar()
    assert bpy.ops.supple.handles_from_groups() == {"FINISHED"}
    assert kinds(bar) == {"feet": "HELD", "middle": "MOVED", "head": "MOVED"}


def test_lowest_means_lowest_in_the_world():
    bar = bodies.add_bar()
    bar.rotation_euler = (np.pi, 0, 0)
    bpy.ops.supple.handles_from_groups()
    assert kinds(bar) == {"feet": "MOVED", "middle": "MOVED", "head": "HELD"}


def test_both_feet_are_proposed_and_never_all_groups():
    bar = bodies.add_bar(groups=False)
    bodies.add_group(bar, "foot.L", [0, 1, 2])
    bodies.add_group(bar, "foot.R", [14, 15, 16])
    bpy.ops.supple.handles_from_groups()
    assert sorted(kinds(bar).values()) == ["HELD", "MOVED"]
    bpy.ops.supple.handles_clear()
    bodies.add_group(bar, "head", [200])
    bpy.ops.supple.handles_from_groups()
    assert kinds(bar) == {"foot.L": "HELD", "foot.R": "HELD", "head": "MOVED"}


def test_named_groups_and_held():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups(groups="head, feet", held="head")
    assert kinds(bar) == {"head": "HELD", "feet": "MOVED"}
    bpy.ops.supple.handles_from_groups(groups="middle")
    assert kinds(bar)["middle"] == "MOVED"
    bpy.ops.supple.handles_from_groups(groups="middle", held="middle")
    assert kinds(bar)["middle"] == "HELD"
    assert len(bar.supple.handles) == 3


def test_empties_are_named_grouped_and_at_the_centre():
    bar = bodies.add_bar()
    bar.location = (1, 2, 3)
    bpy.ops.supple.handles_from_groups()
    collection = bar.supple.collection
    assert collection.name == "Supple Bar"
    assert sorted(obj.name for obj in collection.objects) == ["feet", "head", "middle"]
    for row in bar.supple.handles:
        centre = bodies.to_world(bar, bodies.rest(bar)[bodies.members(bar, row.name)]).mean(axis=0)
        assert np.allclose(bodies.empty_matrix(row.empty).translation, centre, atol=1e-6)
        assert row.empty.parent == bar


def test_empties_have_the_worlds_axes_under_any_scale():
    bar = bodies.add_bar()
    bar.scale = (2.0, 0.5, -1.5)
    bar.rotation_euler = Euler((0.3, 0.2, 0.9))
    bpy.ops.supple.handles_from_groups()
    linear = np.array(bodies.empty_matrix(bpy.data.objects["head"]))[:3, :3]
    assert np.allclose(linear, np.eye(3), atol=1e-5)


def test_up_is_up_on_an_object_that_was_turned():
    bar = bodies.add_bar()
    bar.rotation_euler = (np.pi / 2, 0, 0)
    bpy.ops.supple.handles_from_groups(held="feet")
    bpy.data.objects["head"].location.z += 0.3
    bpy.ops.supple.bake(name="Up")
    head = bodies.members(bar, "head")
    before, after = (bodies.to_world(bar, bodies.key(bar, k))[head] for k in ("Basis", "Up"))
    assert np.allclose(after - before, [0, 0, 0.3], atol=1e-5)


def test_clearing_an_empty_puts_it_back_at_rest():
    bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    head = bpy.data.objects["head"]
    rest = bodies.empty_matrix(head)
    head.location, head.rotation_euler, head.scale = (1, 2, 3), (1, 1, 1), (2, 2, 2)
    assert bodies.empty_matrix(head) != rest
    head.matrix_basis = Matrix()
    assert bodies.empty_matrix(head) == rest


def test_empties_follow_the_object_and_that_is_no_pose():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    bar.matrix_world = bodies.rigid_motion()
    centre = bodies.to_world(bar, bodies.rest(bar)[bodies.members(bar, "head")]).mean(axis=0)
    assert np.allclose(bodies.empty_matrix(bpy.data.objects["head"]).translation, centre, atol=1e-6)
    bpy.ops.supple.bake(name="Still")
    assert np.allclose(bodies.key(bar, "Still"), bodies.rest(bar), atol=2e-6)


def test_held_empties_are_locked_and_moved_ones_are_not():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    feet, head = bpy.data.objects["feet"], bpy.data.objects["head"]
    assert all(feet.lock_location) and all(feet.lock_rotation) and all(feet.lock_scale)
    assert not any(head.lock_location)
    assert (feet.empty_display_type, head.empty_display_type) == ("CUBE", "SPHERE")
    bar.supple.handles["feet"].kind = "MOVED"
    assert not any(feet.lock_location)
    assert feet.empty_display_type == "SPHERE"


def test_remove_takes_the_empty_and_nothing_else():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    assert bpy.ops.supple.handle_remove(name="head") == {"FINISHED"}
    assert list(kinds(bar)) == ["feet", "middle"]
    assert "head" not in bpy.data.objects and "head" in bar.vertex_groups
    bar.supple.active_handle = 1
    bpy.ops.supple.handle_remove()
    assert list(kinds(bar)) == ["feet"]


def test_clear_leaves_no_debris():
    bar = bodies.add_bar()
    before = bodies.everything()
    bpy.ops.supple.handles_from_groups()
    bpy.ops.supple.solve()
    bpy.ops.supple.handles_clear()
    assert bodies.everything() == before
    assert bar.supple.collection is None


def test_removing_the_last_handle_leaves_no_collection():
    bodies.add_bar()
    bpy.ops.supple.handles_from_groups(groups="head")
    bpy.ops.supple.handle_remove(name="head")
    assert "Supple Bar" not in bpy.data.collections


def test_clear_keeps_what_the_user_put_into_the_collection():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    mine = bpy.data.objects.new("Mine", None)
    bar.supple.collection.objects.link(mine)
    bpy.ops.supple.handles_clear()
    assert [obj.name for obj in bpy.data.collections["Supple Bar"].objects] == ["Mine"]


def test_select_makes_the_empty_the_active_object():
    bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    bpy.ops.supple.handle_select(name="head")
    assert bpy.context.object.name == "head"
    assert [obj.name for obj in bpy.context.selected_objects] == ["head"]


def test_operators_work_on_the_body_while_an_empty_is_active():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    bpy.ops.supple.handle_select(name="head")
    bpy.data.objects["head"].location.z += 0.5
    assert bpy.ops.supple.bake(name="Up") == {"FINISHED"}
    assert np.isclose(bodies.key(bar, "Up")[:, 2].max(), bodies.HEIGHT + 0.5, atol=1e-5)


def test_a_taken_name_is_no_obstacle():
    other = bpy.data.objects.new("head", None)
    bpy.context.scene.collection.objects.link(other)
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    empty = bar.supple.handles["head"].empty
    assert empty != other
    empty.location.x = 1
    bpy.ops.supple.bake(name="Side")
    assert np.isclose(bodies.key(bar, "Side")[bodies.members(bar, "head")[0], 0], 1.3, atol=1e-5)


def test_weights_below_a_half_are_outside_the_handle():
    bar = bodies.add_bar(groups=False)
    bodies.add_group(bar, "low", range(24))
    bodies.add_group(bar, "high", range(180, 204))
    bar.vertex_groups["high"].add(list(range(12, 36)), 0.25, "REPLACE")
    assert bpy.ops.supple.handles_from_groups() == {"FINISHED"}
    bpy.data.objects["high"].location.z = 1
    bpy.ops.supple.bake(name="Up")
    assert np.array_equal(bodies.key(bar, "Up")[:24], bodies.rest(bar)[:24])


def test_duplicated_object_does_not_take_the_originals_handles():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    copy = bar.copy()
    copy.data = bar.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    bpy.context.view_layer.objects.active = copy
    with pytest.raises(RuntimeError, match=r"Bar\.001: its handles are those of 'Bar'"):
        bpy.ops.supple.bake(name="Wave")
    bpy.ops.supple.handles_clear()
    assert bpy.data.objects["head"].parent == bar and len(bar.supple.handles) == 3
    bpy.ops.supple.handles_from_groups()
    assert copy.supple.handles["head"].empty.parent == copy


def test_rebind_after_vertices_were_added():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    bpy.data.objects["head"].location.z = 0.5
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")
    with pytest.raises(RuntimeError, match=r"it had 204 vertices .* Press Rebind"):
        bpy.ops.supple.bake(name="Up")
    assert bar.data.shape_keys is None
    assert bpy.ops.supple.rebind() == {"FINISHED"}
    bpy.ops.supple.bake(name="Up")
    expected = bodies.rest(bar)[bodies.members(bar, "head")] + np.float32([0, 0, 0.5])
    assert np.allclose(bodies.key(bar, "Up")[bodies.members(bar, "head")], expected, atol=1e-5)
    centre = bodies.rest(bar)[bodies.members(bar, "middle")].mean(axis=0)
    assert np.allclose(
        bodies.empty_matrix(bpy.data.objects["middle"]).translation, centre, atol=1e-6
    )


def test_rebind_leaves_an_empty_with_another_parent_where_it_is():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    head = bpy.data.objects["head"]
    where = bodies.empty_matrix(head)
    head.parent = None
    head.matrix_world = where
    bpy.ops.supple.rebind()
    assert bodies.empty_matrix(head) == where
    bpy.ops.supple.bake(name="Still")
    assert np.allclose(bodies.key(bar, "Still"), bodies.rest(bar), atol=2e-6)


def test_handles_in_edit_mode_see_what_is_being_edited():
    bar = bodies.add_bar()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0, 0, 5))
    bpy.ops.supple.handles_from_groups()
    assert bar.mode == "OBJECT"
    height = bodies.empty_matrix(bpy.data.objects["feet"]).translation.z
    assert np.isclose(height, 5 + 0.5 * bodies.HEIGHT / (bodies.RINGS - 1), atol=1e-5)
