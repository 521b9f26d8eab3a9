# SPDX-License-Identifier: GPL-3.0-or-later
"""What a transfer leaves alone and what it refuses; modes, undo."""

import bodies
import bpy
import pairs
import pytest
import refusing


@pytest.fixture
def pair():
    return pairs.dressed_pair()


PARTS = ("UVS", "WEIGHTS", "COLOURS", "KEYS")


def refuse(match, *parts):
    bpy.context.scene.supple_match.transfer = set(parts)
    refusing.refuse(bpy.ops.supple.transfer, match)


def test_what_supple_made_is_written_again(pair):
    pairs.transfer(*PARTS)
    first = pairs.everything()
    pairs.transfer(*PARTS)
    assert pairs.everything()["Scan"] == first["Scan"]


def test_what_others_made_is_refused_unless_told(pair):
    _, scan, _ = pair
    scan.data.uv_layers.new(name="Map")
    bodies.add_group(scan, "up.L", [0, 1], 0.5)
    scan.data.color_attributes.new("Skin", "BYTE_COLOR", "CORNER")
    scan.shape_key_add(name="Basis")
    scan.shape_key_add(name="Bend").value = 0.5
    refuse("Scan: UV map 'Map' was made or changed by someone else. Rename or remove", "UVS")
    refuse("Scan: vertex group 'up.L' was made or changed", "WEIGHTS")
    refuse("Scan: colour attribute 'Skin' was made or changed", "COLOURS")
    refuse("Scan: shape key 'Bend' was made or changed by someone else", "KEYS")
    panel = bpy.context.scene.supple_match
    pairs.transfer(*PARTS, overwrite=True)
    assert not panel.overwrite  # meant for one transfer
    pairs.assert_same_uvs(*pair)
    layer = scan.data.color_attributes["Skin"]
    assert (layer.domain, layer.data_type) == ("POINT", "FLOAT_COLOR")
    assert scan.data.shape_keys.key_blocks["Bend"].value == 0.5
    scan.vertex_groups["up.L"].add([0], 0.123, "REPLACE")
    refuse("Scan: vertex group 'up.L' was made or changed", "WEIGHTS")
    scan.data.uv_layers["Map"].data[0].uv = (5, 5)
    refuse("Scan: UV map 'Map' was made or changed", "UVS")


def test_other_layers_stay_as_they_are(pair):
    _, scan, _ = pair
    scan.data.uv_layers.new(name="Mine")
    bodies.add_group(scan, "mine", [3], 0.25)
    scan.data.color_attributes.new("My Colours", "FLOAT_COLOR", "POINT")
    scan.data.color_attributes.active_color = scan.data.color_attributes["My Colours"]
    scan.shape_key_add(name="Basis")
    scan.shape_key_add(name="My Key").value = 0.5
    scan.active_shape_key_index = 1
    pairs.transfer(*PARTS)
    assert scan.data.uv_layers.active.name == "Mine"
    assert bodies.members(scan, "mine") == [3]
    assert scan.data.color_attributes.active_color.name == "My Colours"
    assert scan.active_shape_key.name == "My Key" and scan.active_shape_key.value == 0.5
    names = [key.name for key in scan.data.shape_keys.key_blocks]
    assert names == ["Basis", "My Key", "Bend", "Half"]


def test_target_in_edit_mode(pair):
    _, scan, _ = pair
    bpy.context.view_layer.objects.active = scan
    bpy.ops.object.mode_set(mode="EDIT")
    refuse("Scan: nothing|Body: nothing is chosen to be carried")
    assert scan.mode == "EDIT"
    pairs.transfer(*PARTS)
    assert scan.mode == "OBJECT"
    pairs.assert_same_uvs(*pair)
    bpy.ops.object.mode_set(mode="EDIT")
    assert pairs.transfer(*PARTS) == {"FINISHED"}  # its own are known in Edit Mode too


def test_source_in_edit_mode(pair):
    body = pair[0]
    bpy.context.view_layer.objects.active = body
    bpy.ops.object.mode_set(mode="EDIT")
    pairs.transfer(*PARTS, "FIT")
    pairs.assert_same_uvs(*pair)
    assert "Body on Scan" in bpy.data.objects
    assert sorted(mesh.name for mesh in bpy.data.meshes) == ["Body", "Body on Scan", "Scan"]


def test_modifiers_do_not_count(pair):
    pair[0].modifiers.new("Round", "SUBSURF")
    pair[1].modifiers.new("Round", "SUBSURF")
    pairs.transfer(*PARTS)
    pairs.assert_same_uvs(*pair)


def test_a_shared_source_is_fine_and_a_shared_target_is_not(pair):
    body, scan, _ = pair
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Twin", body.data))
    pairs.transfer("UVS")
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Twin 2", scan.data))
    refuse("Scan: its mesh 'Scan' is shared by 2 users", "WEIGHTS")


def test_what_the_source_does_not_have(pair):
    body, scan, _ = pair
    body.shape_key_clear()
    body.data.uv_layers.remove(body.data.uv_layers[0])
    refuse("Body: it has no UV maps and no shape keys to carry", "UVS", "KEYS")
    assert pairs.transfer("UVS", "WEIGHTS") == {"FINISHED"}
    assert len(scan.vertex_groups) == 2


def test_names_taken_by_other_attributes_and_too_many_maps(pair):
    _, scan, _ = pair
    scan.data.attributes.new("Skin", "INT", "FACE")
    refuse("Scan: the name of colour attribute 'Skin' is taken by an attribute", "COLOURS")
    for index in range(8):
        scan.data.uv_layers.new(name=f"Mine {index}")
    refuse("Scan: it would have 9 UV maps, and Blender keeps 8", "UVS")


def test_absolute_keys_are_refused(pair):
    pair[0].data.shape_keys.use_relative = False
    refuse("Body: its shape keys are absolute", "KEYS")


def test_a_changed_mesh_is_refused(pair):
    pair[0].data.shape_keys.key_blocks["Basis"].data[3].co.x += 0.1
    refuse("Body: it was changed since the match. Match again", "UVS")


def test_everything_in_one_undo_step(pair):
    scan = pair[1]
    bpy.ops.ed.undo_push(message="Before")
    pairs.transfer("UVS", "WEIGHTS", "COLOURS", "KEYS", "FIT")
    assert "Body on Scan" in bpy.data.objects and scan.data.shape_keys
    bpy.ops.ed.undo_push(message="Transfer")
    bpy.ops.ed.undo()
    scan = bpy.data.objects["Scan"]
    assert "Body on Scan" not in bpy.data.objects and not scan.data.shape_keys
    assert not scan.data.uv_layers and not scan.vertex_groups
