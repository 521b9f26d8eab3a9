# SPDX-License-Identifier: GPL-3.0-or-later
"""What is carried along a match, against what is known to be right."""

import bodies
import bpy
import numpy as np
import pairs
import pytest
from mathutils import Matrix


@pytest.fixture
def pair():
    return pairs.dressed_pair()


def test_uvs_come_back_corner_by_corner_with_their_seam(pair):
    assert pairs.transfer("UVS") == {"FINISHED"}
    pairs.assert_same_uvs(*pair)
    scan = pair[1]
    assert scan.data.uv_layers.active.name == "Map"
    assert not scan.vertex_groups and scan.data.shape_keys is None


def test_uvs_on_another_triangulation_do_not_span_the_seam(pair):
    body = pair[0]
    other = pairs.add_lump("Other", 41, 23)
    pairs.choose(body, other, refine=False)
    bpy.ops.supple.match()
    pairs.transfer("UVS")
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
    pairs.transfer("UVS")
    pairs.assert_same_uvs(body, scan, order)


def test_weights_are_the_permuted_ones(pair):
    body, scan, order = pair
    pairs.transfer("WEIGHTS")
    names, found = pairs.weights(scan)
    assert names == ["up.L", "down.R"]
    assert np.abs(found - pairs.weights(body)[1][order]).max() < 1e-3
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
    pairs.transfer("WEIGHTS")
    assert np.array_equal(pairs.weights(scan)[1].round(6), pairs.weights(body)[1][order])


def test_colours_keep_their_kind(pair):
    body, scan, order = pair
    pairs.transfer("COLOURS")
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
        assert pairs.is_pole(body, key[0]) or np.abs(value - corner["Body"][key]).max() < 0.01, key


def test_shape_keys_move_what_they_moved(pair):
    body, scan, order = pair
    pairs.transfer("KEYS")
    assert [k.name for k in scan.data.shape_keys.key_blocks] == ["Basis", "Bend", "Half"]
    for name in ("Bend", "Half"):
        truth = bodies.key(body, name)[order]
        assert np.abs(bodies.key(scan, name) - truth).max() < 5e-3
        assert scan.data.shape_keys.key_blocks[name].value == 0.25
    assert np.array_equal(bodies.key(scan, "Basis"), bodies.rest(body)[order])


def test_shape_keys_on_a_target_of_uneven_scale(pair):
    """It is the body turned, seen at the same place, but its mesh is squeezed by its scale."""
    body, scan, order = pair
    turn, scale = bodies.rigid_motion(), Matrix.Diagonal((0.5, 2.0, 1.0, 1.0))
    body.matrix_world = turn
    scan.data.transform(scale.inverted() @ turn)
    scan.matrix_world = scale
    bpy.context.view_layer.update()
    bpy.ops.supple.match()
    assert pairs.match_error(scan, body, order) < 1e-3
    pairs.transfer("KEYS")
    truth = bodies.transform(scale.inverted() @ turn, bodies.key(body, "Bend")[order])
    assert np.abs(bodies.key(scan, "Bend") - truth).max() < 1e-2


def test_only_the_active_key(pair):
    body, scan, _ = pair
    body.active_shape_key_index = 2
    pairs.transfer("KEYS", only_active_key=True)
    assert [k.name for k in scan.data.shape_keys.key_blocks] == ["Basis", "Half"]


def test_a_key_on_another_key_is_carried_as_what_it_adds(pair):
    body, scan, order = pair
    blocks = body.data.shape_keys.key_blocks
    blocks["Half"].relative_key = blocks["Bend"]
    pairs.transfer("KEYS")
    added = bodies.key(body, "Half") - bodies.key(body, "Bend")
    found = bodies.key(scan, "Half") - bodies.key(scan, "Basis")
    assert np.abs(found - added[order]).max() < 5e-3


def test_drivers_only_when_asked(pair):
    body, scan, _ = pair
    driver = body.data.shape_keys.key_blocks["Bend"].driver_add("value").driver
    driver.expression = "0.75"
    pairs.transfer("KEYS")
    assert scan.data.shape_keys.animation_data is None
    pairs.transfer("KEYS", drivers=True)
    (copied,) = scan.data.shape_keys.animation_data.drivers
    assert copied.data_path == 'key_blocks["Bend"].value' and copied.driver.expression == "0.75"
    pairs.transfer("KEYS", drivers=True)
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
    assert pairs.transfer("FIT") == {"FINISHED"}
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
    pairs.transfer("FIT")  # ours: written again
    assert sum(obj.name.startswith("Body on") for obj in bpy.data.objects) == 1
    fit = bpy.data.objects["Body on Thin"]
    fit.data.vertices[0].co.x += 0.5
    with pytest.raises(RuntimeError, match=r"Body on Thin: object 'Body on Thin' was made or chan"):
        pairs.transfer("FIT")
    assert pairs.transfer("FIT", overwrite=True) == {"FINISHED"}


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
    pairs.transfer("UVS", "WEIGHTS", "FIT")
    on_faces = sorted({int(v) for p in scan.data.polygons for v in p.vertices})
    assert np.abs(pairs.weights(scan)[1][on_faces] - 1).max() < 1e-5
    error = np.linalg.norm(pairs.partners(scan, body) - bodies.rest(body)[order], axis=1)
    assert error[on_faces].mean() < 0.05
