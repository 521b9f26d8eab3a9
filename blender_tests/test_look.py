# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of a pose is taken and where; the methods; the colours of distortion."""

import bodies
import bpy
import numpy as np
import pytest

ATTRIBUTE = "Supple Distortion"


@pytest.fixture
def bar():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    head = bpy.data.objects["head"]
    head.location, head.rotation_euler = (0.4, 0.1, 0.2), (0.1, 0.7, 0.0)
    return bar


def bake(obj, name):
    bpy.ops.supple.bake(name=name)
    return bodies.key(obj, name)


def test_strength_goes_from_the_rest_shape_to_the_pose(bar):
    rest, full = bodies.rest(bar), bake(bar, "Full")
    bar.supple.strength = 0.0
    assert np.array_equal(bake(bar, "None"), rest)
    bar.supple.strength = 0.25
    part = bake(bar, "Part")
    head = bodies.members(bar, "head")
    moved = np.linalg.norm((full - rest)[head].mean(axis=0))
    part_moved = np.linalg.norm((part - rest)[head].mean(axis=0))
    assert 0.15 * moved < part_moved < 0.4 * moved


def test_a_mask_leaves_what_it_does_not_cover(bar):
    rest, full = bodies.rest(bar), bake(bar, "Full")
    half = np.flatnonzero(rest[:, 0] > 0)
    bodies.add_group(bar, "mask", half)
    bar.supple.mask = "mask"
    found = bake(bar, "Half")
    outside = np.setdiff1d(np.arange(len(rest)), half)
    assert np.array_equal(found[outside], rest[outside])
    assert np.allclose(found[half], full[half], atol=1e-6)


def test_falloff_reaches_as_far_as_it_says_in_the_world(bar):
    bar.scale = (2, 2, 2)
    rest = bodies.rest(bar)
    bar.supple.falloff = 1.0  # half a unit of the mesh
    moved = np.linalg.norm(bake(bar, "Near") - rest, axis=1)
    handles = [*bodies.members(bar, "head"), *bodies.members(bar, "middle")]
    distance = np.linalg.norm(rest[:, None] - rest[handles][None], axis=-1).min(axis=1)
    assert moved[bodies.members(bar, "head")].min() > 0.1
    # Along the surface nothing is nearer than through the body.
    assert moved[distance > 0.51].max() == 0


def test_methods_network_and_stiffness_differ(bar):
    bpy.data.objects["head"].rotation_euler = (0, 1.2, 0)
    found = {}
    for name, method, network, stiffness in (
        ("natural", "SUPPLE", True, 0.0),
        ("identity", "SUPPLE", False, 0.0),
        ("halfway", "SUPPLE", True, 0.5),
        ("stiff", "SUPPLE", True, 1.0),
        ("arap", "ARAP", True, 0.0),
    ):
        bar.supple.method, bar.supple.network = method, network
        bar.supple.stiffness = stiffness
        found[name] = bake(bar, name)
        assert np.array_equal(found[name], bake(bar, name)), name
    for one, other in (("natural", "identity"), ("natural", "stiff"), ("natural", "arap")):
        assert np.abs(found[one] - found[other]).max() > 1e-5, (one, other)


def colours(obj):
    data = obj.data.color_attributes[ATTRIBUTE].data
    return np.array([colour.color[:] for colour in data])


def test_distortion_is_grey_at_rest_and_coloured_where_it_bends(bar, addon):
    distortion = addon("distortion")
    assert bpy.ops.supple.distortion() == {"FINISHED"}
    assert np.allclose(colours(bar)[:, :3], distortion.COLOURS[0], atol=1e-3)
    bake(bar, "Bent")
    found = colours(bar)
    feet = [v for v in bodies.members(bar, "feet") if bodies.rest(bar)[v, 2] == 0]
    assert np.abs(found - colours(bar)[feet[0]]).max() > 0.1
    rest = addon("api").rest_mesh(bar)
    expected = distortion.at_vertices(rest, bodies.key(bar, "Bent").astype(float))
    assert np.allclose(found, distortion.colours(expected), atol=1e-5)
    assert bpy.ops.supple.distortion(show=False) == {"FINISHED"}
    assert ATTRIBUTE not in bar.data.color_attributes


def test_distortion_of_a_known_stretch(addon):
    """Twice as wide and high: singular values 2, 2 give 2*4 + 2/4 - 4 = 4.5."""
    square = bodies.add_mesh("Square", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    rest = addon("api").rest_mesh(square)
    distortion = addon("distortion")
    assert np.allclose(distortion.at_vertices(rest, 2 * rest.positions), 4.5)
    assert np.allclose(distortion.at_vertices(rest, rest.positions), 0, atol=1e-9)
    assert np.allclose(distortion.colours(np.array(distortion.LEVELS))[:, :3], distortion.COLOURS)


def test_distortion_follows_the_preview_and_clear(bar, addon):
    bpy.ops.supple.distortion()
    at_rest = colours(bar)
    bpy.ops.supple.solve()
    assert np.abs(colours(bar) - at_rest).max() > 0.1
    bpy.ops.supple.handles_clear()
    assert np.allclose(colours(bar), at_rest, atol=1e-6)


def test_distortion_follows_live(bar, addon):
    live = addon("live")
    bpy.ops.supple.distortion()
    at_rest = colours(bar)
    bpy.ops.supple.live()
    bpy.data.objects["head"].location.x = 0.8
    bpy.context.view_layer.update()
    assert np.abs(colours(bar) - at_rest).max() > 0.1
    bpy.ops.supple.live_cancel()
    assert live.running is None


def test_the_users_colours_stay_active_and_untouched(bar):
    mine = bar.data.color_attributes.new("Mine", "BYTE_COLOR", "CORNER")
    mine.data[0].color = (1, 0, 0, 1)
    bar.data.color_attributes.active_color = mine
    bpy.ops.supple.distortion()
    assert bar.data.color_attributes.active_color.name == "Mine"
    bpy.ops.supple.distortion(show=False)
    assert [a.name for a in bar.data.color_attributes] == ["Mine"]
    assert bar.data.color_attributes.active_color.name == "Mine"
    assert tuple(bar.data.color_attributes["Mine"].data[0].color) == (1, 0, 0, 1)


def test_distortion_needs_faces():
    bodies.add_mesh("Wire", np.eye(3), [])
    with pytest.raises(RuntimeError, match="Wire: the mesh has no faces"):
        bpy.ops.supple.distortion()
