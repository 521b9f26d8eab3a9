# SPDX-License-Identifier: GPL-3.0-or-later
"""Live without a window: what the depsgraph handler and the timer do, step by step."""

import bodies
import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

PREVIEW = "Supple Preview"


@pytest.fixture
def bar():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    return bar


@pytest.fixture
def live(addon):
    module = addon("live")
    yield module
    module.forget()


def update():
    """As a frame does: evaluate, and so call the handlers."""
    bpy.context.view_layer.update()


def settle(live):
    for _ in range(100):
        if not live.step(12.0):
            return
    raise AssertionError("it never settled")


def head_moved(obj, name=PREVIEW):
    head = bodies.members(obj, "head")
    return bodies.key(obj, name)[head] - bodies.rest(obj)[head]


def test_the_mesh_follows_in_the_frame_in_which_the_empty_moves(bar, live):
    assert bpy.ops.supple.live() == {"FINISHED"}
    assert np.allclose(bodies.key(bar, PREVIEW), bodies.rest(bar), atol=2e-6)
    for height in (0.2, 0.5):
        bpy.data.objects["head"].location.z = height
        update()
        assert np.allclose(head_moved(bar), [0, 0, height], atol=1e-5)
    mesh = bar.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert np.isclose(max(v.co.z for v in mesh.vertices), bodies.HEIGHT + 0.5, atol=1e-5)
    feet = bodies.members(bar, "feet")
    assert np.array_equal(bodies.key(bar, PREVIEW)[feet], bodies.rest(bar)[feet])


def test_settled_is_what_bake_writes(bar, live, addon):
    bar.supple.stiffness = 1.0
    bpy.ops.supple.live()
    bpy.data.objects["head"].rotation_euler = (0, 1.2, 0.3)
    update()
    coarse = bodies.key(bar, PREVIEW)
    settle(live)
    settled = bodies.key(bar, PREVIEW)
    assert np.abs(settled - coarse).max() > 1e-5
    expected = addon("api").solve(bar).positions
    assert np.abs(settled - expected).max() < 1e-3 * bodies.HEIGHT
    assert not live.step(12.0)
    assert np.array_equal(bodies.key(bar, PREVIEW), settled)
