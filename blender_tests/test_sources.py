# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles from the selection, from bones, and proposed ones."""

import bodies
import bpy
import numpy as np
import pytest
from mathutils import Matrix
from test_errors import refuse


def select(obj, vertices):
    obj.data.vertices.foreach_set("select", np.isin(np.arange(len(obj.data.vertices)), vertices))


def test_selection_in_edit_mode_becomes_a_group_and_a_handle():
    bar = bodies.add_bar()
    ring = list(range(60, 72))
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    select(bar, ring)
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.supple.handles_from_selection(name="belt") == {"FINISHED"}
    assert bar.mode == "OBJECT"
    assert bodies.members(bar, "belt") == ring
    row = bar.supple.handles["belt"]
    centre = bodies.rest(bar)[ring].mean(axis=0)
    assert row.kind == "MOVED"
    assert np.allclose(bodies.empty_matrix(row.empty).translation, centre, atol=1e-6)
    bpy.ops.supple.handles_from_groups(groups="feet", held="feet")
    row.empty.location.x = 0.4
    bpy.ops.supple.bake(name="Side")
    moved = bodies.key(bar, "Side")[ring] - bodies.rest(bar)[ring]
    assert np.allclose(moved, [0.4, 0, 0], atol=1e-5)


def test_a_second_selection_gets_a_name_of_its_own_and_may_be_held():
    bar = bodies.add_bar(groups=False)
    for ring in (range(12), range(48, 60)):
        select(bar, list(ring))
        bpy.ops.supple.handles_from_selection(kind="HELD")
    assert [(row.name, row.kind) for row in bar.supple.handles] == [
        ("Handle", "HELD"),
        ("Handle.001", "HELD"),
    ]


def test_selections_that_are_refused():
    bar = bodies.add_bar()
    select(bar, [])
    refuse("Bar: no vertices are selected", bpy.ops.supple.handles_from_selection)
    bpy.ops.supple.handles_from_groups()
    select(bar, [5, 6, 60])
    refuse(
        r"Bar: 2 vertices are in a handle already \(first: vertex 5\)",
        bpy.ops.supple.handles_from_selection,
    )


def test_proposed_handles_are_spread_apart_and_the_lowest_held():
    bar = bodies.add_bar(groups=False)
    assert bpy.ops.supple.propose_handles(count=6) == {"FINISHED"}
    rows = bar.supple.handles
    assert [row.name for row in rows] == [f"Handle {index}" for index in range(1, 7)]
    assert {row.kind for row in rows} == {"HELD", "MOVED"}
    every = np.concatenate([bodies.members(bar, row.name) for row in rows])
    assert len(every) == len(set(every)) and len(every) > 3 * len(rows)
    centres = np.array([bodies.empty_matrix(row.empty).translation for row in rows])
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=-1)
    assert apart[np.triu_indices(6, 1)].min() > 0.4
    assert np.ptp(centres[:, 2]) > 0.8 * bodies.HEIGHT
    bpy.ops.supple.bake(name="Still")
    assert np.allclose(bodies.key(bar, "Still"), bodies.rest(bar), atol=2e-6)


def test_more_are_proposed_around_those_that_are_there():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    bpy.ops.supple.propose_handles(count=3)
    assert len(bar.supple.handles) == 6
    assert [row.kind for row in bar.supple.handles][3:] == ["MOVED"] * 3
    bpy.ops.supple.bake(name="Still")


def test_too_many_are_refused():
    bodies.add_bar(groups=False)
    match = "Bar: it has 204 vertices that are in no handle yet. Ask for fewer than 500"
    refuse(match, bpy.ops.supple.propose_handles, count=500)


JOINT = 1.0  # the height at which the bar's two bones meet


def add_armature(bar, place=None):
    """Add two bones, 'lower' and 'upper', that meet at JOINT, with groups that fade there."""
    data = bpy.data.armatures.new("Rig")
    rig = bpy.data.objects.new("Rig", data)
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    lower, upper = data.edit_bones.new("lower"), data.edit_bones.new("upper")
    lower.head, lower.tail = (0, 0, 0), (0, 0, JOINT)
    upper.head, upper.tail = (0, 0, JOINT), (0, 0, 2)
    upper.parent = lower
    bpy.ops.object.mode_set(mode="OBJECT")
    heights = bodies.rest(bar)[:, 2]
    for name in ("lower", "upper"):
        bar.vertex_groups.new(name=name)
    for index, weight in enumerate(np.clip((heights - JOINT) / 0.6 + 0.5, 0, 1)):
        bar.vertex_groups["lower"].add([index], 1 - weight, "REPLACE")
        bar.vertex_groups["upper"].add([index], weight, "REPLACE")
    modifier = bar.modifiers.new("Armature", "ARMATURE")
    modifier.object, modifier.show_viewport = rig, False
    if place is not None:
        bar.matrix_world = rig.matrix_world = place
    bpy.context.view_layer.objects.active = bar
    bpy.context.view_layer.update()
    return rig


def bend(rig, angle):
    bone = rig.pose.bones["upper"]
    bone.rotation_mode = "XYZ"
    bone.rotation_euler.x = angle
    bpy.context.view_layer.update()


def of_bone(bar, name):
    group = bar.vertex_groups[name].index
    return [
        vertex.index
        for vertex in bar.data.vertices
        if any(g.group == group and g.weight > 0.95 for g in vertex.groups)
    ]


PLACES = {
    "plain": None,
    "placed": Matrix.LocRotScale(
        (1, 2, 3), Matrix.Rotation(0.8, 3, "Y").to_quaternion(), (2, 2, 2)
    ),
}


@pytest.mark.parametrize("place", PLACES)
def test_bones_turn_their_vertices_about_the_joint(place):
    bar = bodies.add_bar(groups=False)
    rig = add_armature(bar, PLACES[place])
    assert bpy.ops.supple.handles_from_bones() == {"FINISHED"}
    assert [(row.name, row.bone, row.empty) for row in bar.supple.handles] == [
        ("lower", "lower", None),
        ("upper", "upper", None),
    ]
    bend(rig, 0.9)
    bpy.ops.supple.bake(name="Bent")
    rest, bent = bodies.rest(bar), bodies.key(bar, "Bent")
    lower, upper = of_bone(bar, "lower"), of_bone(bar, "upper")
    assert np.allclose(bent[lower], rest[lower], atol=1e-6)
    joint = Matrix.Translation((0, 0, JOINT))
    # The bone's own X is the world's here: its Z-up bone has no roll.
    turn = joint @ Matrix.Rotation(0.9, 4, "X") @ joint.inverted()
    assert np.allclose(bent[upper], bodies.transform(turn, rest[upper]), atol=1e-5)


def test_bones_agree_with_the_armature_modifier_where_it_is_rigid():
    bar = bodies.add_bar(groups=False)
    rig = add_armature(bar)
    rig.location.x = 0.3  # an armature aside from the mesh turns it about an axis aside from it
    bpy.ops.supple.handles_from_bones(held="lower")
    bend(rig, 0.7)
    bpy.ops.supple.bake(name="Bent")
    bar.data.shape_keys.key_blocks["Bent"].value = 0
    bar.modifiers["Armature"].show_viewport = True
    mesh = bar.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    expected = np.array([v.co for v in mesh.vertices])
    upper = of_bone(bar, "upper")
    assert np.allclose(bodies.key(bar, "Bent")[upper], expected[upper], atol=1e-5)


def test_live_follows_a_bone_and_cancel_restores_it(addon):
    bar = bodies.add_bar(groups=False)
    rig = add_armature(bar)
    bpy.ops.supple.handles_from_bones()
    live = addon("live")
    before = bodies.everything()
    bpy.ops.supple.live()
    bend(rig, 0.5)
    bend(rig, 0.9)
    upper = of_bone(bar, "upper")
    top = max(upper, key=lambda index: bodies.rest(bar)[index, 2])
    posed = bodies.key(bar, "Supple Preview")[top]
    assert posed[2] < bodies.HEIGHT - 0.2
    bpy.ops.supple.live_cancel()
    assert live.running is None
    bpy.context.view_layer.update()
    assert rig.pose.bones["upper"].rotation_euler.x == 0
    assert bodies.everything() == before


def test_selected_bones_of_an_armature_in_pose_mode():
    bar = bodies.add_bar(groups=False)
    rig = add_armature(bar)
    bpy.ops.supple.handles_from_bones(bones="upper")
    bpy.ops.supple.handle_select(name="upper")
    assert (bpy.context.object, rig.mode) == (rig, "POSE")
    bpy.ops.supple.handles_clear()
    assert bpy.ops.supple.handles_from_bones() == {"FINISHED"}
    assert [row.name for row in bar.supple.handles] == ["upper"]
    assert rig.name in bpy.data.objects  # no Empty of ours: Clear left it


def test_a_modifier_that_moves_it_too_is_said(addon):
    bar = bodies.add_bar(groups=False)
    add_armature(bar)
    bar.modifiers["Armature"].show_viewport = True
    bpy.ops.supple.handles_from_bones()
    assert addon("handle_sources").also_deformed_by(bar) == ["Armature"]


def test_bones_that_are_refused():
    bar = bodies.add_bar(groups=False)
    refuse("Bar: it has no armature", bpy.ops.supple.handles_from_bones)
    add_armature(bar)
    refuse("'Rig' has no bone 'tail'", bpy.ops.supple.handles_from_bones, bones="tail")
    refuse("there is no armature 'Bar'", bpy.ops.supple.handles_from_bones, armature="Bar")
    bar.vertex_groups["upper"].remove(range(len(bar.data.vertices)))
    refuse(
        "no vertex has a weight of 0.9 or more in 'upper'",
        bpy.ops.supple.handles_from_bones,
        bones="upper",
    )


def test_a_deleted_bone_or_armature_is_said():
    bar = bodies.add_bar(groups=False)
    rig = add_armature(bar)
    bpy.ops.supple.handles_from_bones()
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    rig.data.edit_bones.remove(rig.data.edit_bones["upper"])
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.objects.active = bar
    refuse("Bar: 'Rig' has no bone 'upper' any more", bpy.ops.supple.bake, name="Bent")
    bpy.data.objects.remove(rig)
    refuse("Bar: the armature of handle 'lower' was deleted", bpy.ops.supple.bake, name="Bent")
