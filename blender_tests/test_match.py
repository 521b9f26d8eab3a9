# SPDX-License-Identifier: GPL-3.0-or-later
"""Matching two meshes whose true map is known, from every start, and refining."""

import bodies
import bpy
import numpy as np
import pairs
import pytest


def move(obj):
    obj.matrix_world = bodies.rigid_motion()
    obj.scale = (1.7, 1.7, 1.7)


def test_nearest_as_they_lie_is_exact(pair):
    body, scan, order = pair
    pairs.choose(body, scan, refine=False)
    assert bpy.ops.supple.match() == {"FINISHED"}
    assert pairs.error(pair) < 1e-5
    assert scan.supple_map.source == body
    assert scan.supple_map.confidence > 0.9
    assert bodies.rest(scan).tobytes() == bodies.rest(body)[order].tobytes()


def test_nearest_takes_the_objects_places_and_scales(pair):
    body, scan, _ = pair
    for obj in (body, scan):
        obj.matrix_world = bodies.rigid_motion()
    scan.data.transform(bodies.rigid_motion().inverted())
    scan.matrix_world = bodies.rigid_motion() @ bodies.rigid_motion()
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    assert pairs.error(pair) < 1e-4


@pytest.mark.parametrize("start", ["AUTOMATIC", "ALIGNED"])
def test_starts_that_need_nothing_find_a_moved_copy(pair, start):
    move(pair[1])
    pairs.choose(pair[0], pair[1], start)
    bpy.ops.supple.match()
    assert pairs.error(pair) < 0.05
    assert pair[1].supple_map.confidence > 0.8


def test_landmarks_find_a_posed_copy(pair):
    body, scan, order = pair
    move(scan)
    for vertex in scan.data.vertices:
        vertex.co.x += 0.3 * np.sin(1.5 * vertex.co.z)
    panel = pairs.choose(body, scan, "LANDMARKS")
    for source_vertex in (1, 100, 300, 420):
        target_vertex = int(np.flatnonzero(order == source_vertex)[0])
        bpy.ops.supple.landmark_add(source_vertex=source_vertex, target_vertex=target_vertex)
    assert len(panel.pairs) == 4
    bpy.ops.supple.match()
    assert pairs.error(pair) < 0.1


def test_shared_uvs(pair):
    body, scan, order = pair
    pairs.dress(body)
    by_corner = pairs.uv_by_corner(body)
    layer = scan.data.uv_layers.new(name="Other Name")
    for polygon in scan.data.polygons:
        face = frozenset(int(order[v]) for v in polygon.vertices)
        for loop, vertex in zip(polygon.loop_indices, polygon.vertices, strict=True):
            layer.data[loop].uv = by_corner[face, int(order[vertex])]
    move(scan)
    pairs.choose(body, scan, "UVS", refine=False)
    bpy.ops.supple.match()
    assert pairs.error(pair) < 0.05


def test_another_triangulation():
    body, scan = pairs.add_lump(), pairs.add_lump("Scan", 41, 23)
    truth = bodies.rest(scan)
    move(scan)
    pairs.choose(body, scan, "ALIGNED")
    bpy.ops.supple.match()
    assert np.linalg.norm(pairs.partners(scan, body) - truth, axis=1).mean() < 0.08


def test_a_shape_that_fits_two_ways_is_told():
    """A lump is nearly symmetric: the report says so, and the panel keeps it."""
    body, scan = pairs.add_lump(), pairs.add_lump("Scan", 41, 23)
    pairs.choose(body, scan, "AUTOMATIC")
    bpy.ops.supple.match()
    assert "the shapes may be symmetric" in scan.supple_map.notes
    pairs.choose(body, scan, "NEAREST")
    bpy.ops.supple.match()
    assert scan.supple_map.notes == ""


def test_refining_makes_a_rough_match_better(pair):
    body, scan, _ = pair
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    where = pairs.partners(scan, body)
    random, faces = np.random.default_rng(1), pairs.attribute(scan, "Supple Match Face")
    for vertex in range(len(faces)):
        near = np.flatnonzero(np.linalg.norm(where - where[vertex], axis=1) < 0.5)
        faces[vertex] = faces[random.choice(near)]
    scan.data.attributes["Supple Match Face"].data.foreach_set("value", faces)
    rough = pairs.error(pair)
    assert bpy.ops.supple.refine_match() == {"FINISHED"}
    assert rough > 0.2 and pairs.error(pair) < 0.5 * rough


def test_ngons_and_edit_mode():
    body = bodies.add_bar("Body")
    scan, order = pairs.add_shuffled(body)
    pairs.choose(body, scan, refine=False)
    bpy.ops.object.mode_set(mode="EDIT")  # the active one: the target
    assert bpy.ops.supple.match() == {"FINISHED"}
    assert scan.mode == "OBJECT"
    assert pairs.match_error(scan, body, order) < 1e-5


def test_a_modifier_comes_after_the_match(pair):
    body, scan, _ = pair
    scan.modifiers.new("Round", "SUBSURF").levels = 1
    body.modifiers.new("Mirror", "MIRROR")
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    assert pairs.error(pair) < 1e-5


def test_shape_keys_that_are_on_do_not_count(pair):
    body, scan, _ = pair
    pairs.dress(body)
    body.data.shape_keys.key_blocks["Bend"].value = 1.0
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    assert pairs.error(pair) < 1e-5


def test_what_is_not_chosen_is_taken_from_the_selection(pair):
    body, scan, _ = pair
    bpy.context.view_layer.objects.active = body
    panel = pairs.choose(None, None, refine=False)
    bpy.ops.supple.match()
    assert scan.supple_map.source == body and panel.source is None
    scan.select_set(False)
    with pytest.raises(RuntimeError, match=r"Body: it has no target. Choose the mesh that gets"):
        bpy.ops.supple.match()
