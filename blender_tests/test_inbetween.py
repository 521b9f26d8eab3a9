# SPDX-License-Identifier: GPL-3.0-or-later
"""In-betweens of shape keys, and handles proposed from a motion."""

import itertools

import bodies
import bpy
import moving
import numpy as np
import pytest

BEND = np.radians(120)
SIZE = float(np.linalg.norm([0.6, 0.6, bodies.HEIGHT]))


def arc(points, angle):
    """Bend a bar that stands on the origin to a circular arc that ends turned by `angle`."""
    x, y, z = np.float64(points).T
    radius, turn = bodies.HEIGHT / angle, angle * z / bodies.HEIGHT
    return np.stack([radius - (radius - x) * np.cos(turn), y, (radius - x) * np.sin(turn)], axis=1)


def volume(obj, points):
    """Return the volume that n-gons enclose, by fans from each polygon's first corner."""
    points = np.float64(points)
    total = 0.0
    for polygon in obj.data.polygons:
        a, *rest = points[list(polygon.vertices)]
        total += sum(np.dot(a, np.cross(b, c)) for b, c in itertools.pairwise(rest))
    return total / 6


@pytest.fixture
def bar():
    """A bar with the keys Straight and Bent, the latter an arc of 120 degrees."""
    bar = bodies.add_bar()
    bar.shape_key_add(name="Basis")
    for name, angle in (("Straight", None), ("Bent", BEND)):
        positions = bodies.rest(bar) if angle is None else arc(bodies.rest(bar), angle)
        bar.shape_key_add(name=name).data.foreach_set("co", np.float32(positions).ravel())
        bar.data.shape_keys.key_blocks[name].value = 0.0
    bar.supple_sequence.first, bar.supple_sequence.last = 1, 25
    return bar


@pytest.mark.parametrize("output", ["CACHE", "KEYS"])
def test_the_middle_is_the_half_arc_and_keeps_its_volume(bar, tmp_path, output):
    bar.supple_sequence.output = output
    bar.supple_sequence.file = str(tmp_path / "bar.pc2")
    before = moving.at(bar, 30)
    assert bpy.ops.supple.inbetween(keys="Straight,Bent") == {"FINISHED"}
    straight, bent = (bodies.key(bar, name) for name in ("Straight", "Bent"))
    shown = moving.every_frame(bar, (1, 13, 25, 30))
    tolerance = 0 if output == "CACHE" else 1e-6
    assert np.abs(shown[1] - straight).max() <= tolerance
    assert np.abs(shown[25] - bent).max() <= tolerance
    assert np.array_equal(shown[30], before)
    ends = 0.5 * (volume(bar, straight) + volume(bar, bent))
    assert volume(bar, shown[13]) == pytest.approx(ends, rel=0.03)
    assert volume(bar, 0.5 * (straight + bent)) < 0.9 * ends  # what a blend of keys gives
    # The known middle, wherever it stands: its shape.
    middle = arc(bodies.rest(bar), 0.5 * BEND)
    motion = moving.nearest_motion(middle, shown[13])
    assert np.abs(bodies.transform(motion, middle) - shown[13]).max() < 0.02 * SIZE


def test_three_keys_at_given_frames_and_a_modifier_after(bar, tmp_path):
    moving.add_armature(bar)
    bar.supple_sequence.file = str(tmp_path / "bar.pc2")
    assert bpy.ops.supple.inbetween(keys="Straight,Bent,Basis", frames="2,10,30") == {"FINISHED"}
    assert bar.modifiers[0].name == "Supple In-betweens"
    bar.modifiers["Armature"].show_viewport = False
    for frame, name in ((2, "Straight"), (10, "Bent"), (30, "Basis")):
        assert np.array_equal(moving.at(bar, frame), bodies.key(bar, name)), name
    away = [np.abs(moving.at(bar, f + 1) - moving.at(bar, f)).max() for f in range(2, 30)]
    assert max(away) < 0.3 * SIZE  # no jump
    bpy.ops.supple.inbetween_remove()
    assert not any(modifier.type == "MESH_CACHE" for modifier in bar.modifiers)


def test_refusals(bar, tmp_path):
    bar.supple_sequence.file = str(tmp_path / "bar.pc2")
    state = bodies.everything()
    for message, arguments in (
        ("no shape key 'Wave'", {"keys": "Straight,Wave"}),
        ("need 2 or more shape keys", {"keys": "Straight"}),
        ("must ascend", {"keys": "Straight,Bent", "frames": "5,5"}),
        ("must be whole numbers", {"keys": "Straight,Bent", "frames": "5,six"}),
    ):
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.supple.inbetween(**arguments)
    assert bodies.everything() == state
    assert not list(tmp_path.iterdir())


def test_handles_from_a_motion_take_their_vertices_there():
    """The paper's second experiment: from the largest displacements alone, near the whole pose."""
    bar = bodies.add_bar()
    moving.add_key_action(bar)
    target = moving.at(bar, 20)
    assert bpy.ops.supple.handles_from_motion(count=6) == {"FINISHED"}
    names = [row.name for row in bar.supple.handles]
    assert len(names) == 6
    bpy.ops.supple.bake(name="Estimate")
    estimate = bodies.key(bar, "Estimate")
    patches = np.concatenate([bodies.members(bar, name) for name in names])
    assert np.abs(estimate[patches] - target[patches]).max() < 0.02 * SIZE
    rest = bodies.rest(bar)
    error = np.linalg.norm(estimate - target, axis=1).mean()
    assert error < 0.12 * np.linalg.norm(rest - target, axis=1).mean()


def test_handles_from_another_mesh():
    bar = bodies.add_bar()
    other = bodies.add_bar("Other", groups=False)
    turned = np.float32(arc(bodies.rest(other), 0.8))
    other.data.vertices.foreach_set("co", turned.ravel())
    other.data.update()
    bpy.context.view_layer.objects.active = bar
    assert bpy.ops.supple.handles_from_motion(count=5) == {"FINISHED"}
    with pytest.raises(RuntimeError, match="has handles already"):
        bpy.ops.supple.handles_from_motion()
    bpy.ops.supple.handles_clear()
    with pytest.raises(RuntimeError, match="204 vertices and 'Small' 3"):
        other.select_set(False)
        bodies.add_mesh("Small", np.eye(3), [(0, 1, 2)])
        bpy.context.view_layer.objects.active = bar
        bpy.ops.supple.handles_from_motion()
