# SPDX-License-Identifier: GPL-3.0-or-later
"""How the add-on calls the native solver: with a stand-in that notes what it is asked."""

from typing import ClassVar

import bodies
import bpy
import numpy as np
import pytest


class Session:
    """Needs three calls after each aim; every call moves all vertices up by one more tenth."""

    def __init__(self, editor):
        self.editor, self.calls = editor, 0

    def aim(self, handles):
        self.handles, self.calls = handles, 0

    def advance(self, milliseconds):
        self.calls += 1
        return self.editor.prepared.vertices + np.array([0, 0, 0.1 * self.calls])

    @property
    def settled(self):
        return self.calls >= 3


class Editor:
    made: ClassVar[list] = []

    def __init__(self, prepared, handles, *, model, progress):
        self.prepared, self.handles, self.asked = prepared, handles, []
        Editor.made.append(self)

    def rebind(self, handles, *, progress):
        other = Editor(self.prepared, handles, model=None, progress=progress)
        other.former = self
        return other

    def session(self, **options):
        self.asked.append(options)
        return Session(self)


@pytest.fixture
def native(addon, monkeypatch):
    monkeypatch.setattr(addon("native").supple(), "Editor", Editor)
    monkeypatch.setattr(Editor, "made", [])
    addon("prepared").clear()
    yield addon("native").supple()
    addon("live").forget()
    addon("prepared").clear()


@pytest.fixture
def bar(native):
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    return bar


def height(obj):
    return round(float((bodies.key(obj, "Supple Preview") - bodies.rest(obj))[0, 2]), 3)


def test_refining_ends_when_settled_and_begins_anew_at_every_move(bar, addon):
    live = addon("live")
    bpy.ops.supple.live()
    (editor,) = Editor.made
    assert editor.asked == [
        {"stiffness": 0.0, "method": "supple", "network": True, "keep_volume": True}
    ]
    while live.step(12.0):
        pass
    assert height(bar) == 0.3
    bpy.data.objects["head"].location.x = 0.1
    bpy.context.view_layer.update()
    assert height(bar) == 0.1
    bpy.context.view_layer.update()
    assert height(bar) == 0.1  # only the timer refines
    assert live.step(12.0) and height(bar) == 0.2


def test_settings_start_a_session_and_strength_does_not(bar, addon):
    live = addon("live")
    bpy.ops.supple.live()
    while live.step(12.0):
        pass
    bar.supple.strength = 0.5
    live.step(12.0)
    (editor,) = Editor.made
    assert len(editor.asked) == 1 and height(bar) == 0.15
    bar.supple.stiffness, bar.supple.method, bar.supple.network = 0.5, "ARAP", False
    live.step(12.0)
    assert editor.asked[1:] == [
        {"stiffness": 0.5, "method": "arap", "network": False, "keep_volume": True}
    ]
    assert height(bar) == 0.05


def test_another_set_of_handles_is_bound_from_the_one_before(bar, addon):
    live = addon("live")
    bpy.ops.supple.live()
    bpy.ops.supple.handle_remove(name="middle")
    live.step(12.0)
    first, second = Editor.made
    assert second.former is first
    assert [handle.name for handle in second.handles] == ["feet", "head"]


def test_targets_are_those_of_the_empties(bar, addon):
    live = addon("live")
    bpy.ops.supple.handles_clear()
    bar.scale = (2, 1, 1)
    bpy.ops.supple.handles_from_groups()
    bpy.ops.supple.live()
    motion = bodies.rigid_motion()
    head = bpy.data.objects["head"]
    head.matrix_world = motion @ bodies.empty_matrix(head)
    bpy.context.view_layer.update()
    given = {h.name: h for h in live.running._warm._session.handles}
    assert given["feet"].matrix is None
    # In solve space, the stretched copy of the mesh, a rigid motion is rigid.
    linear = np.array(given["head"].matrix)[:3, :3]
    assert np.allclose(linear.T @ linear, np.eye(3), atol=1e-4)
    assert sorted(given["head"].vertices) == bodies.members(bar, "head")
