# SPDX-License-Identifier: GPL-3.0-or-later
"""Posed positions against truths that need no solver."""

import bodies
import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

PLACES = {
    "plain": Matrix(),
    "turned": Matrix.LocRotScale((1, -2, 0.5), Euler((0.4, 1.0, -0.7)), (1, 1, 1)),
    "scaled": Matrix.LocRotScale((0, 3, 0), Euler((0.4, 1.0, -0.7)), (0.01, 0.01, 0.01)),
    "stretched": Matrix.LocRotScale((1, 0, 0), Euler((0.4, 1.0, -0.7)), (3.0, 0.5, 1.2)),
    "mirrored": Matrix.LocRotScale((1, 0, 0), Euler((0.1, 0.2, 0.3)), (-1.0, 1.0, 2.0)),
}


@pytest.fixture(params=PLACES)
def placed_bar(request):
    """A bar with handles, somewhere in the world."""
    bar = bodies.add_bar()
    bar.matrix_world = PLACES[request.param]
    bpy.ops.supple.handles_from_groups()
    for row in bar.supple.handles:
        row.kind = "MOVED"
    return bar


def size(obj):
    return np.linalg.norm(np.ptp(bodies.to_world(obj, bodies.rest(obj)), axis=0))


def test_rigid_motion_of_all_handles_is_the_rigid_motion_of_the_mesh(placed_bar):
    motion = bodies.rigid_motion()
    for row in placed_bar.supple.handles:
        row.empty.matrix_world = motion @ bodies.empty_matrix(row.empty)
    bpy.ops.supple.bake(name="Moved")
    expected = bodies.transform(motion, bodies.to_world(placed_bar, bodies.rest(placed_bar)))
    found = bodies.to_world(placed_bar, bodies.key(placed_bar, "Moved"))
    assert np.abs(found - expected).max() < 2e-5 * max(size(placed_bar), 1.0)


def test_handle_vertices_land_where_their_empties_say(placed_bar):
    world_rest = bodies.to_world(placed_bar, bodies.rest(placed_bar))
    expected = {}
    for number, row in enumerate(placed_bar.supple.handles):
        at_rest = bodies.empty_matrix(row.empty)
        row.empty.location = 0.1 * size(placed_bar) * np.array([number, 0.5, -number])
        row.empty.rotation_euler = (0.3 * number, 0.2, -0.4 * number)
        row.empty.scale = (1 + 0.2 * number, 1, 0.9)
        motion = bodies.empty_matrix(row.empty) @ at_rest.inverted()
        vertices = bodies.members(placed_bar, row.name)
        expected[row.name] = bodies.transform(motion, world_rest[vertices])
    bpy.ops.supple.bake(name="Posed")
    found = bodies.to_world(placed_bar, bodies.key(placed_bar, "Posed"))
    for name, positions in expected.items():
        error = np.abs(found[bodies.members(placed_bar, name)] - positions).max()
        assert error < 1e-5 * max(size(placed_bar), 1.0), name


def test_turning_an_empty_turns_its_vertices_without_shear(placed_bar):
    head = placed_bar.supple.handles["head"].empty
    head.rotation_euler = (0.0, 0.6, 0.0)
    bpy.ops.supple.bake(name="Turned")
    vertices = bodies.members(placed_bar, "head")
    before = bodies.to_world(placed_bar, bodies.rest(placed_bar))[vertices]
    after = bodies.to_world(placed_bar, bodies.key(placed_bar, "Turned"))[vertices]
    distances = [np.linalg.norm(p[:, None] - p[None], axis=-1) for p in (before, after)]
    assert np.abs(distances[0] - distances[1]).max() < 1e-5 * max(size(placed_bar), 1.0)
    assert np.abs(before - after).max() > 0.01 * size(placed_bar)


def test_untouched_handles_leave_the_rest_shape(placed_bar):
    bpy.ops.supple.bake(name="Still")
    difference = np.abs(bodies.key(placed_bar, "Still") - bodies.rest(placed_bar))
    assert difference.max() < 1e-5 * bodies.HEIGHT


def test_held_vertices_stay_bit_for_bit():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    bpy.data.objects["head"].location = (0.5, 0.2, -0.3)
    bpy.ops.supple.bake(name="Bent")
    feet = bodies.members(bar, "feet")
    assert np.array_equal(bodies.key(bar, "Bent")[feet], bodies.rest(bar)[feet])


def test_scaled_object_bends_as_an_object_of_that_size_does():
    """Scale on the object and scale in the mesh are one thing to the eye, so to the pose."""
    results = []
    for applied in (False, True):
        bpy.ops.wm.read_homefile(use_empty=True)
        bar = bodies.add_bar()
        if applied:
            bar.data.transform(Matrix.Diagonal((2.0, 0.7, 1.0, 1.0)))
        else:
            bar.scale = (2.0, 0.7, 1.0)
        bpy.ops.supple.handles_from_groups(held="feet,middle")
        head = bpy.data.objects["head"]
        head.location, head.rotation_euler = (0.4, 0.1, -0.1), (0.1, 0.7, 0.0)
        bpy.ops.supple.bake(name="Bent")
        results.append(bodies.to_world(bar, bodies.key(bar, "Bent")))
    assert np.abs(results[0] - results[1]).max() < 1e-4


def test_parents_of_the_object_count():
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.scale = (1.0, 1.0, 2.5)
    bar = bodies.add_bar()
    bar.parent = parent
    bar.rotation_euler = (0.5, 0.2, 0.0)  # under the parent's scale: a shear
    bpy.ops.supple.handles_from_groups()
    head = bpy.data.objects["head"]
    at_rest = bodies.empty_matrix(head)
    head.location = (0.2, 0.3, 0.4)
    head.rotation_euler = (0.5, 0.0, 0.3)
    motion = bodies.empty_matrix(head) @ at_rest.inverted()
    bpy.ops.supple.bake(name="Bent")
    vertices = bodies.members(bar, "head")
    expected = bodies.transform(motion, bodies.to_world(bar, bodies.rest(bar))[vertices])
    found = bodies.to_world(bar, bodies.key(bar, "Bent"))[vertices]
    assert np.abs(found - expected).max() < 2e-5


def drive_by_animation(head):
    head.keyframe_insert("location", frame=1)
    head.location.x = 0.5
    head.keyframe_insert("location", frame=11)
    bpy.context.scene.frame_set(11)


def drive_by_constraint(head):
    target = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(target)
    target.location = bodies.empty_matrix(head).translation
    target.location.x += 0.5
    head.constraints.new("COPY_LOCATION").target = target


def drive_by_driver(head):
    driver = head.driver_add("location", 0).driver
    driver.type = "SCRIPTED"
    driver.expression = "0.25 * 2"


def drive_by_parent(head):
    parent = bpy.data.objects.new("Grip", None)
    bpy.context.scene.collection.objects.link(parent)
    world = bodies.empty_matrix(head)
    head.parent = parent
    head.matrix_parent_inverse = Matrix()
    head.matrix_basis = world
    parent.location.x = 0.5


@pytest.mark.parametrize(
    "drive", [drive_by_animation, drive_by_constraint, drive_by_driver, drive_by_parent]
)
@pytest.mark.parametrize("hidden", [False, True])
def test_whatever_drives_the_empty_drives_the_handle(drive, hidden):
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    head = bpy.data.objects["head"]
    head.hide_set(hidden)
    drive(head)
    bpy.ops.supple.bake(name="Side")
    vertices = bodies.members(bar, "head")
    expected = bodies.rest(bar)[vertices] + np.float32([0.5, 0, 0])
    assert np.allclose(bodies.key(bar, "Side")[vertices], expected, atol=1e-5)


def test_edit_mode_poses_what_is_being_edited():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    bpy.data.objects["head"].location.z = 0.5
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.translate(value=(0, 0, 3))
    bpy.ops.supple.bake(name="Up")
    assert bar.mode == "OBJECT"
    assert np.isclose(bodies.key(bar, "Up")[:, 2].max(), 3 + bodies.HEIGHT + 0.5, atol=1e-5)
    assert np.isclose(bodies.key(bar, "Basis")[:, 2].max(), 3 + bodies.HEIGHT, atol=1e-6)


def test_basis_is_the_rest_shape_whatever_other_keys_show():
    bar = bodies.add_bar()
    bar.shape_key_add(name="Basis")
    other = bar.shape_key_add(name="Fat")
    for point in other.data:
        point.co.x *= 3
    other.value = 1
    bpy.ops.supple.handles_from_groups()
    bpy.ops.supple.bake(name="Still")
    assert np.allclose(bodies.key(bar, "Still"), bodies.rest(bar), atol=2e-6)


def test_stale_geometry_is_prepared_again():
    """The same vertex count at other places must not meet what was prepared before."""
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    bpy.ops.supple.prepare()
    bar.data.transform(Matrix.Diagonal((1, 1, 2, 1)))
    bpy.ops.supple.rebind()
    bpy.ops.supple.bake(name="Still")
    assert np.allclose(bodies.key(bar, "Still"), bodies.rest(bar), atol=5e-6)


def test_the_modes_differ_and_repeat_bit_for_bit():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    bpy.data.objects["head"].rotation_euler = (0, 1.2, 0)
    results = {}
    for mode in ("NATURAL", "STIFF"):
        bar.supple.stiffness = {"NATURAL": 0.0, "STIFF": 1.0}[mode]
        bpy.ops.supple.bake(name=mode)
        bpy.ops.supple.bake(name=f"{mode} again")
        results[mode] = bodies.key(bar, mode)
        assert np.array_equal(results[mode], bodies.key(bar, f"{mode} again"))
    assert np.abs(results["NATURAL"] - results["STIFF"]).max() > 1e-4


def test_python_api_does_the_same_and_solve_changes_nothing(addon):
    api = addon("api")
    bar = bodies.add_bar()
    assert api.handles_from_groups(bar, held=["feet"]) == ["feet", "middle", "head"]
    bpy.data.objects["head"].location.z = 0.3
    before = bodies.everything()
    pose = api.solve(bar)
    assert bodies.everything() == before
    api.bake(bar, "Wave")
    assert np.array_equal(bodies.key(bar, "Wave"), pose.positions.astype(np.float32))
    assert api.prepare(bar).vertex_count == 204


def test_prepared_mesh_is_kept(addon):
    api = addon("api")
    bar = bodies.add_bar()
    assert api.prepare(bar) is api.prepare(bar)
    bar.data.vertices[0].co.x += 0.1
    changed = api.prepare(bar)
    bar.data.vertices[0].co.x -= 0.1
    assert changed is not api.prepare(bar)
