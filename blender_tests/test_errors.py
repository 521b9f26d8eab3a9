# SPDX-License-Identifier: GPL-3.0-or-later
"""Wrong input: one message with object, name, number and fix; the file unchanged."""

import bodies
import bpy
import numpy as np
import pytest


def refuse(match, operator, **arguments):
    """Assert that the operator reports an error that matches, and that the file stays as it was."""
    before = bodies.everything()
    with pytest.raises(RuntimeError, match=match) as caught:
        operator(**arguments)
    assert "Traceback" not in str(caught.value)
    assert bodies.everything() == before


def with_handles():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    return bar


def test_no_object():
    for operator in (bpy.ops.supple.bake, bpy.ops.supple.prepare, bpy.ops.supple.check_mesh):
        refuse("No object is active. Select a mesh object", operator)


def test_not_a_mesh():
    camera = bpy.data.objects.new("Cam", bpy.data.cameras.new("Cam"))
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.view_layer.objects.active = camera
    refuse("Cam: this is not a mesh", bpy.ops.supple.handles_from_groups)


def test_no_groups():
    bodies.add_bar(groups=False)
    refuse("Bar: it has no vertex groups", bpy.ops.supple.handles_from_groups)


def test_missing_group():
    bodies.add_bar()
    refuse(
        "Bar: there is no vertex group 'tail'. Its groups are 'feet', 'middle', 'head'",
        bpy.ops.supple.handles_from_groups,
        groups="tail",
    )
    refuse("no vertex group 'tail'", bpy.ops.supple.handles_from_groups, held="tail")


def test_empty_group():
    bar = bodies.add_bar()
    bar.vertex_groups.new(name="tail")
    match = "Bar: vertex group 'tail' has no vertices.*Assign some in Edit Mode"
    refuse(match, bpy.ops.supple.handles_from_groups, groups="tail")
    refuse(match, bpy.ops.supple.handles_from_groups, held="tail")
    bpy.ops.supple.handles_from_groups()  # for all groups: the empty one is left out
    assert [row.name for row in bar.supple.handles] == ["feet", "middle", "head"]


def test_group_emptied_or_deleted_after_the_handle_was_made():
    bar = with_handles()
    bar.vertex_groups["head"].remove(range(len(bar.data.vertices)))
    refuse("vertex group 'head' has no vertices", bpy.ops.supple.bake, name="Wave")
    bar.vertex_groups.remove(bar.vertex_groups["head"])
    refuse("no vertex group 'head'", bpy.ops.supple.bake, name="Wave")


def test_vertex_in_two_handles():
    bar = bodies.add_bar()
    bodies.add_group(bar, "top", [200, 201, 202])
    match = r"Bar: 3 vertices are in both 'head' and 'top' \(first: vertex 200\)"
    refuse(match, bpy.ops.supple.handles_from_groups)
    bpy.ops.supple.handles_from_groups(groups="head,feet")
    refuse(match, bpy.ops.supple.handles_from_groups, groups="top")
    bar.vertex_groups["feet"].add([201], 1.0, "REPLACE")
    refuse("1 vertex is in both", bpy.ops.supple.bake, name="Wave")


def test_no_handles():
    bodies.add_bar()
    refuse("Bar: it has no handles. Press . Groups", bpy.ops.supple.bake, name="Wave")


def test_no_faces():
    wire = bodies.add_mesh("Wire", np.eye(3), [])
    bodies.add_group(wire, "all", [0, 1, 2])
    refuse(r"Wire: the mesh has no faces \(3 vertices\)", bpy.ops.supple.prepare)
    refuse("Wire: the mesh has no faces", bpy.ops.supple.handles_from_groups)


def test_not_a_number():
    bar = with_handles()
    bar.data.vertices[7].co.x = float("nan")
    with pytest.raises(RuntimeError, match=r"1 vertex has a position .*vertex 7"):
        bpy.ops.supple.bake(name="Wave")
    assert bar.data.shape_keys is None


def test_vertex_count_changed_since_prepare():
    bar = with_handles()
    bpy.ops.supple.prepare()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")
    count = len(bar.data.vertices)
    for operator in (bpy.ops.supple.bake, bpy.ops.supple.solve, bpy.ops.supple.prepare):
        refuse(f"it had 204 vertices when its handles were made and has {count} now", operator)


def test_empty_scaled_to_zero():
    with_handles()
    bpy.data.objects["head"].scale = (1, 0, 1)
    refuse("Bar: the Empty 'head' of handle 'head' is scaled to 0", bpy.ops.supple.bake, name="W")


def test_empty_scaled_to_infinity():
    with_handles()
    bpy.data.objects["head"].scale.x = float("inf")
    refuse("Empty 'head' of handle 'head' is scaled to 0 or", bpy.ops.supple.bake, name="W")


def test_object_scaled_to_zero():
    bar = with_handles()
    bar.scale.y = 0
    refuse("Bar: the object is scaled to zero along an axis", bpy.ops.supple.bake, name="Wave")


def test_deleted_empty():
    with_handles()
    bpy.data.objects.remove(bpy.data.objects["head"])
    refuse("Bar: the Empty of handle 'head' was deleted", bpy.ops.supple.bake, name="Wave")


def test_empty_deleted_from_the_scene_only():
    bar = with_handles()
    head = bpy.data.objects["head"]
    bar.supple.collection.objects.unlink(head)
    refuse("Bar: the Empty of handle 'head' was deleted", bpy.ops.supple.bake, name="Wave")
    refuse("has no Empty in this view layer", bpy.ops.supple.handle_select, name="head")


def test_disabled_collection():
    bar = with_handles()
    bar.supple.collection.hide_viewport = True
    refuse("disabled in viewports", bpy.ops.supple.bake, name="Wave")


def test_shared_mesh():
    bar = with_handles()
    other = bpy.data.objects.new("Other", bar.data)
    bpy.context.scene.collection.objects.link(other)
    refuse("Bar: its mesh 'Bar' is shared by 2 users.*single-user", bpy.ops.supple.bake, name="W")
    refuse("single-user", bpy.ops.supple.handles_from_groups)


def test_linked_mesh(tmp_path):
    bodies.add_bar()
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (source, target):
        target.objects = source.objects
    bar = target.objects[0]
    bpy.context.scene.collection.objects.link(bar)
    bpy.context.view_layer.objects.active = bar
    refuse("Bar: it is linked from another file. Make it local", bpy.ops.supple.bake, name="Wave")
    refuse("linked from another file", bpy.ops.supple.handles_from_groups)


def test_removing_a_handle_that_is_not_there():
    with_handles()
    refuse("Bar: there is no handle 'tail'", bpy.ops.supple.handle_remove, name="tail")


def test_cancelled_work_changes_nothing(addon):
    with_handles()
    stages = addon("stages").Stages()
    stages.cancel()
    addon("prepared").clear()
    before = bodies.everything()
    with pytest.raises(addon("api").CancelledError):
        addon("api").bake(bpy.data.objects["Bar"], "Wave", stages=stages)
    assert bodies.everything() == before


def test_errors_of_the_native_part_name_the_object(addon, monkeypatch):
    supple = addon("native").supple()

    def fail(*_arguments, **_options):
        raise supple.SuppleError("not_finite", "the sky fell")

    with_handles()
    monkeypatch.setattr(supple, "Editor", fail)
    addon("prepared").clear()
    refuse("Bar: the sky fell", bpy.ops.supple.bake, name="Wave")


def test_check_names_what_is_unusual(addon):
    bar = bodies.add_bar()
    bar.data.vertices.add(2)
    found = " ".join(addon("api").check_mesh(bar))
    assert "2 faces have more than 4 corners" in found
    assert "2 vert" in found
    assert bpy.ops.supple.check_mesh() == {"FINISHED"}
