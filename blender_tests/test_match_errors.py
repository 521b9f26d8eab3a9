# SPDX-License-Identifier: GPL-3.0-or-later
"""What matching refuses: one message with object, number and fix; the file unchanged."""

import bodies
import bpy
import numpy as np
import pairs
import pytest
import refusing


def refuse(match):
    refusing.refuse(bpy.ops.supple.match, match)


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
    refusing.refuse(
        bpy.ops.supple.match,
        "Body: pair 1 names vertex 5000, but it has 610 vertices. Remove that pair",
    )
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
    refusing.refuse(
        bpy.ops.supple.match,
        "Scan: its mesh 'Scan' is shared by 2 users. Make it single-user first",
    )
    pairs.choose(other, body, refine=False)
    assert bpy.ops.supple.match() == {"FINISHED"}


def test_an_attribute_of_the_same_name_is_kept(pair):
    body, scan, _ = pair
    scan.data.attributes.new("Supple Confidence", "INT", "FACE")
    pairs.choose(body, scan)
    refusing.refuse(
        bpy.ops.supple.match,
        "Scan: it has an attribute 'Supple Confidence' of another kind. Rename or remove it",
    )


def test_meshes_too_coarse_for_automatic():
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    first = bodies.add_mesh("First", square, [(0, 1, 2, 3)])
    second = bodies.add_mesh("Second", square, [(0, 1, 2, 3)])
    pairs.choose(first, second, "AUTOMATIC")
    refuse("Second: ")


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
