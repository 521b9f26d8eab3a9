# SPDX-License-Identifier: GPL-3.0-or-later
"""What is carried along a match, against what is known to be right, and what is left alone."""

import bodies
import bpy
import numpy as np
import pairs
import pytest


@pytest.fixture
def pair():
    """A dressed body, its bare copy in another order, matched exactly; and that order."""
    body = pairs.dress(pairs.add_lump())
    scan, order = pairs.add_shuffled(body)
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    return body, scan, order


def transfer(*parts, **settings):
    panel = bpy.context.scene.supple_match
    panel.transfer = set(parts)
    for name, value in settings.items():
        setattr(panel, name, value)
    return bpy.ops.supple.transfer()


def weights(obj):
    names = [group.name for group in obj.vertex_groups]
    found = np.zeros((len(obj.data.vertices), len(names)))
    for vertex in obj.data.vertices:
        for element in vertex.groups:
            found[vertex.index, element.group] = element.weight
    return names, found


def is_pole(body, face):
    """Return whether a face is one of a lump's fans, whose edges all are seams at the pole."""
    return len(body.data.vertices) == 610 and not {0, 1}.isdisjoint(face)


def assert_same_uvs(body, scan, order):
    truth = pairs.uv_by_corner(body)
    for (face, vertex), uv in pairs.uv_by_corner(scan).items():
        if is_pole(body, [int(order[v]) for v in face]):
            continue
        wanted = truth[frozenset(int(order[v]) for v in face), int(order[vertex])]
        assert np.abs(uv - wanted).max() < 2e-3, (face, vertex, uv, wanted)


def test_uvs_come_back_corner_by_corner_with_their_seam(pair):
    assert transfer("UVS") == {"FINISHED"}
    assert_same_uvs(*pair)
    scan = pair[1]
    assert scan.data.uv_layers.active.name == "Map"
    assert not scan.vertex_groups and scan.data.shape_keys is None


def test_uvs_on_another_triangulation_do_not_span_the_seam(pair):
    body = pair[0]
    other = pairs.add_lump("Other", 41, 23)
    pairs.choose(body, other, refine=False)
    bpy.ops.supple.match()
    transfer("UVS")
    _, _, corners = pairs.lump(41, 23)
    layer = np.array([loop.uv for loop in other.data.uv_layers["Map"].data])
    start = 0
    for wanted in corners:
        found = layer[start : start + len(wanted)]
        start += len(wanted)
        heights = np.array(wanted)[:, 1]
        if heights.min() == 0 or heights.max() == 1:
            continue  # at a pole u is anything
        assert np.ptp(found[:, 0]) < 0.1
        difference = found - np.array(wanted)
        difference[:, 0] -= np.round(difference[:, 0].mean())
        assert np.abs(difference).max() < 0.05


def test_polygons_keep_one_uv_a_corner():
    body = bodies.add_bar("Body")
    layer = body.data.uv_layers.new(name="Map")
    for polygon in body.data.polygons:
        for loop in polygon.loop_indices:
            x, y, z = body.data.vertices[body.data.loops[loop].vertex_index].co
            is_cap = len(polygon.vertices) > 4
            layer.data[loop].uv = (x, y) if is_cap else (x + 2 * y, z)
    scan, order = pairs.add_shuffled(body)
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    transfer("UVS")
    assert_same_uvs(body, scan, order)


def test_weights_are_the_permuted_ones(pair):
    body, scan, order = pair
    transfer("WEIGHTS")
    names, found = weights(scan)
    assert names == ["up.L", "down.R"]
    assert np.abs(found - weights(body)[1][order]).max() < 1e-3
    assert np.abs(found.sum(axis=1) - 1).max() < 1e-5


def test_weights_do_not_bleed_between_islands():
    """Two boxes that touch: each group is one box's alone."""
    verts, faces, _ = [], [], []
    for step in (0, 1.02):
        bpy.ops.mesh.primitive_cube_add(size=1, location=(step, 0, 0))
        cube = bpy.context.object
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.subdivide(number_cuts=4)
        bpy.ops.object.mode_set(mode="OBJECT")
        base = len(verts)
        verts += [tuple(cube.matrix_world @ v.co) for v in cube.data.vertices]
        faces += [[base + v for v in p.vertices] for p in cube.data.polygons]
        bpy.data.objects.remove(cube)
    body = bodies.add_mesh("Body", verts, faces)
    half = len(verts) // 2
    bodies.add_group(body, "one", range(half))
    bodies.add_group(body, "two", range(half, 2 * half))
    scan, order = pairs.add_shuffled(body)
    for vertex in scan.data.vertices:
        if abs(vertex.co.x - 0.5) < 1e-6:
            vertex.co.x += 0.015  # nearer to the other box than to its own
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    transfer("WEIGHTS")
    assert np.array_equal(weights(scan)[1].round(6), weights(body)[1][order])


def test_colours_keep_their_kind(pair):
    body, scan, order = pair
    transfer("COLOURS")
    layers = scan.data.color_attributes
    kinds = {layer.name: (layer.domain, layer.data_type) for layer in layers}
    assert kinds == {"Skin": ("POINT", "FLOAT_COLOR"), "Paint": ("CORNER", "BYTE_COLOR")}
    skin = pairs.attribute(body, "Skin")[order]
    assert np.abs(pairs.attribute(scan, "Skin") - skin).max() < 1e-3
    corner = {}
    for obj, name in ((body, lambda v: v), (scan, lambda v: int(order[v]))):
        paint = pairs.attribute(obj, "Paint")
        corner[obj.name] = {
            (frozenset(name(v) for v in p.vertices), name(v)): paint[loop]
            for p in obj.data.polygons
            for loop, v in zip(p.loop_indices, p.vertices, strict=True)
        }
    for key, value in corner["Scan"].items():
        assert is_pole(body, key[0]) or np.abs(value - corner["Body"][key]).max() < 0.01, key


def test_shape_keys_move_what_they_moved(pair):
    body, scan, order = pair
    transfer("KEYS")
    assert [k.name for k in scan.data.shape_keys.key_blocks] == ["Basis", "Bend", "Half"]
    for name in ("Bend", "Half"):
        truth = bodies.key(body, name)[order]
        assert np.abs(bodies.key(scan, name) - truth).max() < 5e-3
        assert scan.data.shape_keys.key_blocks[name].value == 0.25
    assert np.array_equal(bodies.key(scan, "Basis"), bodies.rest(body)[order])


def test_shape_keys_on_a_scaled_turned_target(pair):
    body, scan, order = pair
    scan.data.transform(bodies.rigid_motion())
    scan.matrix_world = bodies.rigid_motion().inverted()
    scan.scale = (0.5, 2.0, 1.0)
    body.scale = scan.scale  # then both are seen in the same shape, and lie at the same place
    scan.data.transform(bodies.rigid_motion().inverted())
    scan.matrix_world = body.matrix_world
    scan.scale = body.scale
    bpy.context.view_layer.update()
    bpy.ops.supple.match()
    transfer("KEYS")
    assert np.abs(bodies.key(scan, "Bend") - bodies.key(body, "Bend")[order]).max() < 1e-2


def test_only_the_active_key(pair):
    body, scan, _ = pair
    body.active_shape_key_index = 2
    transfer("KEYS", only_active_key=True)
    assert [k.name for k in scan.data.shape_keys.key_blocks] == ["Basis", "Half"]


def test_a_key_on_another_key_is_carried_as_what_it_adds(pair):
    body, scan, order = pair
    blocks = body.data.shape_keys.key_blocks
    blocks["Half"].relative_key = blocks["Bend"]
    transfer("KEYS")
    added = bodies.key(body, "Half") - bodies.key(body, "Bend")
    found = bodies.key(scan, "Half") - bodies.key(scan, "Basis")
    assert np.abs(found - added[order]).max() < 5e-3


def test_drivers_only_when_asked(pair):
    body, scan, _ = pair
    driver = body.data.shape_keys.key_blocks["Bend"].driver_add("value").driver
    driver.expression = "0.75"
    transfer("KEYS")
    assert scan.data.shape_keys.animation_data is None
    transfer("KEYS", drivers=True)
    (copied,) = scan.data.shape_keys.animation_data.drivers
    assert copied.data_path == 'key_blocks["Bend"].value' and copied.driver.expression == "0.75"
    transfer("KEYS", drivers=True)
    assert len(scan.data.shape_keys.animation_data.drivers) == 1


def test_shrink_fit_makes_an_object_on_the_target(pair, addon):
    body = pair[0]
    scan = pairs.add_lump("Thin", 41, 23)
    for vertex in scan.data.vertices:
        vertex.co.x *= 0.8
    scan.location = (3, 0, 0)
    bpy.context.view_layer.update()
    pairs.choose(body, scan, "ALIGNED")
    bpy.ops.supple.match()
    before = pairs.everything()
    assert transfer("FIT") == {"FINISHED"}
    fit = bpy.data.objects["Body on Thin"]
    assert [tuple(p.vertices) for p in fit.data.polygons] == [
        tuple(p.vertices) for p in body.data.polygons
    ]
    assert fit.data.shape_keys is None and fit.data.uv_layers["Map"]
    assert [group.name for group in fit.vertex_groups] == ["up.L", "down.R"]
    assert fit.matrix_world == scan.matrix_world
    supple = addon("native").supple()
    scan.data.calc_loop_triangles()
    triangles = np.array([t.vertices for t in scan.data.loop_triangles])
    points = bodies.rest(fit).astype(float)
    distance = supple.closest_points((bodies.rest(scan), triangles), points).distance
    assert np.quantile(distance, 0.98) < 1e-4 and distance.max() < 0.1
    after = pairs.everything()
    for name in ("Body", "Thin", "Scan"):
        assert after[name] == before[name]
    transfer("FIT")  # ours: written again
    assert sum(obj.name.startswith("Body on") for obj in bpy.data.objects) == 1
    fit = bpy.data.objects["Body on Thin"]
    fit.data.vertices[0].co.x += 0.5
    with pytest.raises(RuntimeError, match=r"Body on Thin: object 'Body on Thin' was made or chan"):
        transfer("FIT")
    assert transfer("FIT", overwrite=True) == {"FINISHED"}


def test_everything_in_one_undo_step(pair):
    scan = pair[1]
    bpy.ops.ed.undo_push(message="Before")
    transfer("UVS", "WEIGHTS", "COLOURS", "KEYS", "FIT")
    assert "Body on Scan" in bpy.data.objects and scan.data.shape_keys
    bpy.ops.ed.undo_push(message="Transfer")
    bpy.ops.ed.undo()
    scan = bpy.data.objects["Scan"]
    assert "Body on Scan" not in bpy.data.objects and not scan.data.shape_keys
    assert not scan.data.uv_layers and not scan.vertex_groups


PARTS = ("UVS", "WEIGHTS", "COLOURS", "KEYS")


def test_what_supple_made_is_written_again(pair):
    transfer(*PARTS)
    first = pairs.everything()
    transfer(*PARTS)
    assert pairs.everything()["Scan"] == first["Scan"]


def refuse(match, *parts):
    bpy.context.scene.supple_match.transfer = set(parts)
    before = pairs.everything()
    with pytest.raises(RuntimeError, match=match) as caught:
        bpy.ops.supple.transfer()
    assert "Traceback" not in str(caught.value)
    assert pairs.everything() == before


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
    transfer(*PARTS, overwrite=True)
    assert not panel.overwrite  # meant for one transfer
    assert_same_uvs(*pair)
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
    transfer(*PARTS)
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
    transfer(*PARTS)
    assert scan.mode == "OBJECT"
    assert_same_uvs(*pair)
    bpy.ops.object.mode_set(mode="EDIT")
    assert transfer(*PARTS) == {"FINISHED"}  # its own are known in Edit Mode too


def test_source_in_edit_mode(pair):
    body = pair[0]
    bpy.context.view_layer.objects.active = body
    bpy.ops.object.mode_set(mode="EDIT")
    transfer(*PARTS, "FIT")
    assert_same_uvs(*pair)
    assert "Body on Scan" in bpy.data.objects
    assert sorted(mesh.name for mesh in bpy.data.meshes) == ["Body", "Body on Scan", "Scan"]


def test_modifiers_do_not_count(pair):
    pair[0].modifiers.new("Round", "SUBSURF")
    pair[1].modifiers.new("Round", "SUBSURF")
    transfer(*PARTS)
    assert_same_uvs(*pair)


def test_a_shared_source_is_fine_and_a_shared_target_is_not(pair):
    body, scan, _ = pair
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Twin", body.data))
    transfer("UVS")
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Twin 2", scan.data))
    refuse("Scan: its mesh 'Scan' is shared by 2 users", "WEIGHTS")


def test_what_the_source_does_not_have(pair):
    body, scan, _ = pair
    body.shape_key_clear()
    body.data.uv_layers.remove(body.data.uv_layers[0])
    refuse("Body: it has no UV maps and no shape keys to carry", "UVS", "KEYS")
    assert transfer("UVS", "WEIGHTS") == {"FINISHED"}
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


def test_imperfect_meshes():
    """Loose vertices, a hole and an edge of three faces, on both sides."""
    uv, faces, _ = pairs.lump()
    points = np.concatenate([pairs.place(*uv.T), [(5, 5, 5), (6, 6, 6)]])
    faces = [*faces[:300], *faces[303:], [2, 3, 4]]  # a hole, and a face that leaves the surface
    body = bodies.add_mesh("Body", points, faces)
    bodies.add_group(body, "all", range(len(points)))
    body.data.uv_layers.new(name="Map")
    scan, order = pairs.add_shuffled(body)
    pairs.choose(body, scan)
    bpy.ops.supple.match()
    transfer("UVS", "WEIGHTS", "FIT")
    on_faces = sorted({int(v) for p in scan.data.polygons for v in p.vertices})
    assert np.abs(weights(scan)[1][on_faces] - 1).max() < 1e-5
    error = np.linalg.norm(pairs.partners(scan, body) - bodies.rest(body)[order], axis=1)
    assert error[on_faces].mean() < 0.05


def select(*objects):
    for obj in bpy.data.objects:
        obj.select_set(obj in objects)


def test_to_many_with_a_bad_one(pair):
    body, scan, _ = pair
    other = pairs.add_lump("Other", 41, 23)
    wire = bodies.add_mesh("Wire", np.eye(3), [])
    mine = pairs.add_lump("Mine")
    mine.data.uv_layers.new(name="Map")
    select(body, scan, other, wire, mine)
    bpy.context.scene.supple_match.transfer = {"UVS", "WEIGHTS"}
    before = pairs.everything()
    assert bpy.ops.supple.match_transfer_many() == {"FINISHED"}
    assert_same_uvs(*pair)
    assert len(other.vertex_groups) == 2 and other.supple_map.source == body
    after = pairs.everything()
    assert after["Wire"] == before["Wire"] and after["Mine"] == before["Mine"]
    select(body, wire)
    with pytest.raises(RuntimeError, match=r"Wire: the mesh has no faces"):
        bpy.ops.supple.match_transfer_many()
    select(body)
    with pytest.raises(RuntimeError, match=r"Body: no other mesh is selected"):
        bpy.ops.supple.match_transfer_many()


def test_without_operators(addon):
    api = addon("api")
    body = pairs.dress(pairs.add_lump())
    scan, order = pairs.add_shuffled(body)
    found = api.match(body, scan, "NEAREST", refine=False)
    assert found.confidence.mean() > 0.9
    assert api.match(body, scan, "CURRENT").confidence.shape == (610,)
    api.match(body, scan, "NEAREST", refine=False)
    layers = api.transfer(body, scan, {"UVS", "KEYS"})
    assert list(layers.uvs) == ["Map"] and [key.name for key in layers.keys] == ["Bend", "Half"]
    assert_same_uvs(body, scan, order)
    with pytest.raises(api.UserError, match=r"There is no start 'LUCK'"):
        api.match(body, scan, "LUCK")
