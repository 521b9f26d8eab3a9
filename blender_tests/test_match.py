# SPDX-License-Identifier: GPL-3.0-or-later
"""Matching two meshes whose true map is known; keeping, refining, turning, saving the match."""

import bodies
import bpy
import numpy as np
import pairs
import pytest


@pytest.fixture
def pair():
    """A body, its copy in another order, and that order; the copy turned, moved and scaled."""
    body = pairs.add_lump()
    scan, order = pairs.add_shuffled(body)
    return body, scan, order


def error(body, scan, order):
    """Return the mean distance of the map from the truth; the body is about 4 long."""
    truth = bodies.rest(body)[order]
    return float(np.linalg.norm(pairs.partners(scan, body) - truth, axis=1).mean())


def move(obj):
    obj.matrix_world = bodies.rigid_motion()
    obj.scale = (1.7, 1.7, 1.7)


def test_nearest_as_they_lie_is_exact(pair):
    body, scan, order = pair
    pairs.choose(body, scan, refine=False)
    assert bpy.ops.supple.match() == {"FINISHED"}
    assert error(*pair) < 1e-5
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
    assert error(*pair) < 1e-4


@pytest.mark.parametrize("start", ["AUTOMATIC", "ALIGNED"])
def test_starts_that_need_nothing_find_a_moved_copy(pair, start):
    move(pair[1])
    pairs.choose(pair[0], pair[1], start)
    bpy.ops.supple.match()
    assert error(*pair) < 0.05
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
    assert error(*pair) < 0.1


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
    assert error(*pair) < 0.05


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
    rough = error(*pair)
    assert bpy.ops.supple.refine_match() == {"FINISHED"}
    assert rough > 0.2 and error(*pair) < 0.5 * rough


def test_ngons_and_edit_mode():
    body = bodies.add_bar("Body")
    scan, order = pairs.add_shuffled(body)
    pairs.choose(body, scan, refine=False)
    bpy.ops.object.mode_set(mode="EDIT")  # the active one: the target
    assert bpy.ops.supple.match() == {"FINISHED"}
    assert scan.mode == "OBJECT"
    assert error(body, scan, order) < 1e-5


def test_a_modifier_comes_after_the_match(pair):
    body, scan, _ = pair
    scan.modifiers.new("Round", "SUBSURF").levels = 1
    body.modifiers.new("Mirror", "MIRROR")
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    assert error(*pair) < 1e-5


def test_shape_keys_that_are_on_do_not_count(pair):
    body, scan, _ = pair
    pairs.dress(body)
    body.data.shape_keys.key_blocks["Bend"].value = 1.0
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    assert error(*pair) < 1e-5


def test_what_is_not_chosen_is_taken_from_the_selection(pair):
    body, scan, _ = pair
    bpy.context.view_layer.objects.active = body
    panel = pairs.choose(None, None, refine=False)
    bpy.ops.supple.match()
    assert scan.supple_map.source == body and panel.source is None
    scan.select_set(False)
    with pytest.raises(RuntimeError, match=r"Body: it has no target. Choose the mesh that gets"):
        bpy.ops.supple.match()


def test_a_changed_mesh_is_named(pair):
    body, scan, _ = pair
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    scan.scale, scan.location = (2, 1, 1), (1, 1, 1)
    assert bpy.ops.supple.refine_match() == {"FINISHED"}  # places and scales are no change
    for obj in (body, scan):
        kept = obj.data.vertices[5].co.copy()
        obj.data.vertices[5].co.x += 0.01
        before = pairs.everything()
        with pytest.raises(RuntimeError, match=rf"{obj.name}: it was changed since the match. Mat"):
            bpy.ops.supple.refine_match()
        with pytest.raises(RuntimeError, match=rf"{obj.name}: it was changed since the match"):
            bpy.ops.supple.match_show()
        assert pairs.everything() == before
        obj.data.vertices[5].co = kept
    bpy.ops.supple.refine_match()


def test_another_source_is_named(pair):
    body, scan, _ = pair
    pairs.choose(body, scan, refine=False)
    with pytest.raises(RuntimeError, match=r"Scan: it is not matched yet. Press Match"):
        bpy.ops.supple.refine_match()
    bpy.ops.supple.match()
    pairs.choose(pairs.add_lump("Other"), scan)
    with pytest.raises(RuntimeError, match=r"Scan: it was matched to 'Body', not to 'Other'"):
        bpy.ops.supple.refine_match()
    bpy.data.objects.remove(body)
    with pytest.raises(RuntimeError, match=r"matched to an object that is gone"):
        bpy.ops.supple.refine_match()


def test_kept_with_the_file(pair, tmp_path):
    pairs.choose(pair[0], pair[1], refine=False)
    bpy.ops.supple.match()
    before = pairs.attribute(pair[1], "Supple Match Weights")
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    scan = bpy.data.objects["Scan"]
    assert np.array_equal(pairs.attribute(scan, "Supple Match Weights"), before)
    assert bpy.ops.supple.refine_match() == {"FINISHED"}


def test_saved_and_loaded(pair, tmp_path):
    body, scan, _ = pair
    pairs.choose(body, scan)
    bpy.ops.supple.match()
    where, found = pairs.partners(scan, body), scan.supple_map.confidence
    path = str(tmp_path / "source and target.supplemap")
    bpy.ops.supple.match_save(filepath=path)
    scan.location.x = 5
    bpy.ops.supple.match()
    assert bpy.ops.supple.match_load(filepath=path) == {"FINISHED"}
    assert np.allclose(pairs.partners(scan, body), where, atol=1e-6)
    assert found > 0.5 and 0.5 < scan.supple_map.confidence <= 1
    pairs.choose(body, scan, "FILE", file=path, refine=False)
    bpy.ops.supple.match()
    assert np.allclose(pairs.partners(scan, body), where, atol=1e-6)


def test_a_file_of_other_meshes_is_refused(pair, tmp_path):
    body, scan, _ = pair
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    path = str(tmp_path / "source.supplemap")
    bpy.ops.supple.match_save(filepath=path)
    bpy.context.view_layer.update()
    before = pairs.everything()
    with pytest.raises(RuntimeError, match=r"Scan: there is no file .*nowhere"):
        bpy.ops.supple.match_load(filepath=str(tmp_path / "nowhere"))
    with pytest.raises(RuntimeError, match=r"Scan: no file is named"):
        bpy.ops.supple.match_load(filepath=str(tmp_path))
    (tmp_path / "bad.supplemap").write_bytes(b"no map")
    with pytest.raises(RuntimeError, match=r"Scan: .*bad.supplemap"):
        bpy.ops.supple.match_load(filepath=str(tmp_path / "bad.supplemap"))
    with pytest.raises(RuntimeError, match=r"Scan: .*can't be made"):
        bpy.ops.supple.match_save(filepath=str(tmp_path / "no folder" / "x.supplemap"))
    assert pairs.everything() == before
    scan.data.vertices[0].co.x += 1
    with pytest.raises(RuntimeError, match=r"source\.supplemap was made for another target: its "):
        bpy.ops.supple.match_load(filepath=path)


def test_swap_turns_the_match_round(pair):
    body, scan, order = pair
    panel = pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    bpy.ops.supple.landmark_add(source_vertex=3, target_vertex=7)
    assert bpy.ops.supple.match_swap() == {"FINISHED"}
    assert (panel.source, panel.target) == (scan, body)
    assert (panel.pairs[0].source_vertex, panel.pairs[0].target_vertex) == (7, 3)
    truth = bodies.rest(scan)[np.argsort(order)]
    assert np.allclose(pairs.partners(body, scan), truth, atol=1e-4)
    assert body.supple_map.confidence > 0.9
    assert not [a.name for a in scan.data.attributes if a.name.startswith("Supple")]
    bpy.ops.supple.refine_match()
    bpy.ops.supple.match_swap()
    assert error(*pair) < 0.05


def test_swap_without_a_match(pair):
    panel = pairs.choose(pair[0], pair[1])
    bpy.ops.supple.match_swap()
    assert (panel.source, panel.target) == (pair[1], pair[0])


def test_pairs_are_added_and_removed(pair):
    body, scan, _ = pair
    panel = pairs.choose(body, scan)
    for obj, vertex in ((body, 11), (scan, 12)):
        for index, item in enumerate(obj.data.vertices):
            item.select = index == vertex
    bpy.ops.supple.landmark_add()
    bpy.ops.supple.landmark_add(source_vertex=20, target_vertex=21)
    rows = [(row.source_vertex, row.target_vertex) for row in panel.pairs]
    assert rows == [(11, 12), (20, 21)]
    before = pairs.everything()
    with pytest.raises(RuntimeError, match=r"Scan: vertex 12 is in pair 1 already"):
        bpy.ops.supple.landmark_add(source_vertex=30, target_vertex=12)
    with pytest.raises(RuntimeError, match=r"Body: it has no vertex 9999; its last is 609"):
        bpy.ops.supple.landmark_add(source_vertex=9999, target_vertex=1)
    scan.data.vertices[40].select = True
    with pytest.raises(RuntimeError, match=r"Scan: 2 vertices are selected. Select exactly one"):
        bpy.ops.supple.landmark_add()
    with pytest.raises(RuntimeError, match=r"There is no pair 3; there are 2"):
        bpy.ops.supple.landmark_remove(number=3)
    assert pairs.everything() == before
    bpy.ops.supple.landmark_remove(number=1)
    assert [row.source_vertex for row in panel.pairs] == [20]
    bpy.ops.supple.landmarks_clear()
    assert not panel.pairs


def test_undo_takes_back_one_match(pair):
    bpy.context.view_layer.update()
    pairs.choose(pair[0], pair[1], refine=False)
    bpy.ops.ed.undo_push(message="Before")
    before = pairs.everything()
    bpy.ops.supple.match()
    bpy.ops.ed.undo_push(message="Match")
    assert "Supple Match Face" in bpy.data.objects["Scan"].data.attributes
    bpy.ops.ed.undo()
    assert "Supple Match Face" not in bpy.data.objects["Scan"].data.attributes
    after = pairs.everything()
    assert {k: v for k, v in after.items() if k != "panel"} == {
        k: v for k, v in before.items() if k != "panel"
    }


def refuse(match, **settings):
    before = pairs.everything()
    with pytest.raises(RuntimeError, match=match) as caught:
        bpy.ops.supple.match()
    assert "Traceback" not in str(caught.value)
    assert pairs.everything() == before


def test_bad_input(pair):
    body, scan, _ = pair
    pairs.choose(body, body)
    refuse("Body: it is both source and target. Choose two objects")
    pairs.choose(body, bodies.add_mesh("Wire", np.eye(3), []))
    refuse(r"Wire: the mesh has no faces \(3 vertices\)")
    pairs.choose(bpy.data.objects["Wire"], scan)
    refuse("Wire: the mesh has no faces")
    pairs.choose(body, scan, "LANDMARKS")
    refuse("Scan: there are no landmarks. Select a vertex of each")
    bpy.context.scene.supple_match.pairs.add().source_vertex = 5000
    refuse("Body: pair 1 names vertex 5000, but it has 610 vertices. Remove that pair")
    pairs.choose(body, scan, "UVS")
    refuse("Body: it has no UV map. Add one, or choose another start")
    pairs.choose(body, scan, "FILE")
    refuse("Scan: no file is chosen to start from")
    pairs.choose(body, scan, "FILE", file="//nowhere.supplemap")
    refuse("Scan: there is no file .*nowhere.supplemap")
    scan.scale.x = 0
    pairs.choose(body, scan)
    refuse("Scan: the object is scaled to zero")
    scan.scale.x = 1
    scan.data.vertices[0].co.x = float("nan")
    with pytest.raises(RuntimeError, match=r"Scan: 1 vertex has a position that is not a number"):
        bpy.ops.supple.match()


def test_a_deleted_object_is_told(pair):
    pairs.choose(pair[0], pair[1])
    bpy.context.scene.collection.objects.unlink(pair[0])
    refuse("Body: it was deleted from the scene. Choose another object")


def test_a_shared_target_is_refused_and_a_shared_source_is_not(pair):
    body, scan, _ = pair
    other = bpy.data.objects.new("Twin", scan.data)
    bpy.context.scene.collection.objects.link(other)
    pairs.choose(body, scan, refine=False)
    refuse("Scan: its mesh 'Scan' is shared by 2 users. Make it single-user first")
    pairs.choose(other, body, refine=False)
    assert bpy.ops.supple.match() == {"FINISHED"}


def test_an_attribute_of_the_same_name_is_kept(pair):
    body, scan, _ = pair
    scan.data.attributes.new("Supple Confidence", "INT", "FACE")
    pairs.choose(body, scan)
    refuse("Scan: it has an attribute 'Supple Confidence' of another kind. Rename or remove it")


def test_meshes_too_coarse_for_automatic():
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    first = bodies.add_mesh("First", square, [(0, 1, 2, 3)])
    second = bodies.add_mesh("Second", square, [(0, 1, 2, 3)])
    pairs.choose(first, second, "AUTOMATIC")
    refuse("Second: ")
