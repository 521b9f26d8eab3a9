# SPDX-License-Identifier: GPL-3.0-or-later
"""Live without a window: what the depsgraph handler and the timer do, step by step."""

import addon_utils
import bodies
import bpy
import numpy as np
import pytest

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


def preview(obj):
    return bodies.key(obj, PREVIEW)


def head_moved(obj):
    head = bodies.members(obj, "head")
    return preview(obj)[head] - bodies.rest(obj)[head]


def move_head(height):
    bpy.data.objects["head"].location.z = height
    update()


def test_the_mesh_follows_in_the_frame_in_which_the_empty_moves(bar, live):
    assert bpy.ops.supple.live() == {"FINISHED"}
    assert np.allclose(preview(bar), bodies.rest(bar), atol=2e-6)
    for height in (0.2, 0.5):
        move_head(height)
        assert np.allclose(head_moved(bar), [0, 0, height], atol=1e-5)
    mesh = bar.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert np.isclose(max(v.co.z for v in mesh.vertices), bodies.HEIGHT + 0.5, atol=1e-5)
    feet = bodies.members(bar, "feet")
    assert np.array_equal(preview(bar)[feet], bodies.rest(bar)[feet])


def test_settled_is_what_bake_writes_and_then_nothing_is_done(bar, live, addon, monkeypatch):
    # However fast the machine is: a frame has time for the first pose alone.
    monkeypatch.setattr(live, "FRAME_MILLISECONDS", 0.0)
    bar.supple.stiffness = 1.0
    bpy.ops.supple.live()
    bpy.data.objects["head"].rotation_euler = (0, 1.2, 0.3)
    update()
    coarse = preview(bar)
    settle(live)
    settled = preview(bar)
    assert np.abs(settled - coarse).max() > 1e-5
    expected = addon("api").solve(bar).positions
    assert np.abs(settled - expected).max() < 1e-5 * bodies.HEIGHT
    assert not live.step(12.0)
    update()
    assert np.array_equal(preview(bar), settled)


def test_the_first_pose_is_there_when_live_starts(bar, live):
    bpy.data.objects["head"].location.z = 0.4
    bpy.ops.supple.live()
    assert np.allclose(head_moved(bar), [0, 0, 0.4], atol=1e-5)


def test_frames_and_what_depends_on_them_drive_it(bar, live):
    head = bpy.data.objects["head"]
    head.keyframe_insert("location", frame=1)
    head.location.x = 0.5
    head.keyframe_insert("location", frame=11)
    bpy.context.scene.frame_set(1)
    bpy.ops.supple.live()
    for frame, x in ((11, 0.5), (1, 0.0)):
        bpy.context.scene.frame_set(frame)
        live.step(12.0)
        assert np.allclose(head_moved(bar), [x, 0, 0], atol=1e-5)


def test_a_constraint_drives_it(bar, live):
    head = bpy.data.objects["head"]
    target = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(target)
    target.location = bodies.empty_matrix(head).translation
    head.constraints.new("COPY_LOCATION").target = target
    bpy.ops.supple.live()
    target.location.y += 0.5
    update()
    assert np.allclose(head_moved(bar), [0, 0.5, 0], atol=1e-5)


def test_modifiers_come_after_it(bar, live):
    bar.modifiers.new("Subdivision", "SUBSURF").levels = 1
    bpy.ops.supple.live()
    move_head(1.0)
    mesh = bar.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert len(mesh.vertices) > 4 * len(bar.data.vertices) - 100
    assert np.isclose(max(v.co.z for v in mesh.vertices), bodies.HEIGHT + 1, atol=0.05)


def test_other_keys_stay_bit_for_bit(bar, live):
    bar.shape_key_add(name="Basis")
    smile = bar.shape_key_add(name="Smile")
    smile.data[3].co.x += 0.25
    smile.value = 0.25
    before = bodies.everything()
    expected = bodies.key(bar, "Smile")
    bpy.ops.supple.live()
    move_head(0.5)
    assert np.array_equal(bodies.key(bar, "Smile"), expected)
    assert bar.data.shape_keys.key_blocks["Smile"].value == 0.25
    bpy.ops.supple.live_cancel()
    assert bodies.everything() == before


@pytest.mark.parametrize("had_preview", [False, True])
def test_cancel_restores_every_byte(bar, live, had_preview):
    bpy.data.objects["head"].rotation_euler = (0.1, 0.2, 0.3)
    if had_preview:
        bpy.ops.supple.solve()
        bar.data.shape_keys.key_blocks[PREVIEW].value = 0.5
    update()
    before = bodies.everything()
    bpy.ops.supple.live()
    for name in ("head", "middle"):
        empty = bpy.data.objects[name]
        empty.location, empty.rotation_euler = (0.3, 0.1, 0.2), (0.5, 0, 1)
        empty.scale = (1, 2, 1)
        update()
    assert bodies.everything() != before
    assert bpy.ops.supple.live_cancel() == {"FINISHED"}
    assert live.running is None
    assert bodies.everything() == before
    update()
    assert bodies.everything() == before


def test_keep_leaves_the_pose_and_the_operators_are_off_without_live(bar, live):
    bpy.ops.supple.live()
    move_head(0.5)
    assert bpy.ops.supple.live_keep() == {"FINISHED"}
    assert np.allclose(head_moved(bar), [0, 0, 0.5], atol=1e-5)
    move_head(0.7)
    assert np.allclose(head_moved(bar), [0, 0, 0.5], atol=1e-5)
    for operator in (bpy.ops.supple.live_keep, bpy.ops.supple.live_cancel):
        assert not operator.poll()
    bpy.ops.supple.handles_clear()
    assert bar.data.shape_keys is None


def test_the_button_is_a_toggle(bar, live):
    bpy.ops.supple.live()
    assert live.is_live(bar)
    bpy.ops.supple.live()
    assert live.running is None


def test_another_body_takes_over(bar, live):
    bpy.ops.supple.live()
    move_head(0.5)
    other = bodies.add_bar("Other")
    bpy.ops.supple.handles_from_groups()
    bpy.ops.supple.live()
    assert live.is_live(other) and not live.is_live(bar)
    assert np.allclose(head_moved(bar), [0, 0, 0.5], atol=1e-5)


def test_it_starts_from_edit_mode(bar, live):
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.data.objects["head"].location.z = 0.4
    bpy.ops.supple.live()
    assert bar.mode == "OBJECT"
    assert np.allclose(head_moved(bar), [0, 0, 0.4], atol=1e-5)


def test_bake_while_live_writes_the_pose_and_ends_it(bar, live):
    bpy.ops.supple.live()
    move_head(0.5)
    assert bpy.ops.supple.bake(name="Up") == {"FINISHED"}
    assert live.running is None
    assert [key.name for key in bar.data.shape_keys.key_blocks] == ["Basis", "Up"]


def test_clear_while_live_leaves_no_debris(live):
    bodies.add_bar()
    before = bodies.everything()
    bpy.ops.supple.handles_from_groups()
    bpy.ops.supple.live()
    move_head(0.5)
    bpy.ops.supple.handles_clear()
    assert live.running is None
    assert bodies.everything() == before


def test_a_removed_key_or_body_ends_it(bar, live):
    bpy.ops.supple.live()
    bar.shape_key_remove(bar.data.shape_keys.key_blocks[PREVIEW])
    update()
    live.step(12.0)
    assert live.running is None and "Bar: its key 'Supple Preview' is gone" in live.ended
    bpy.ops.supple.live()
    bpy.data.objects.remove(bar)
    live.step(12.0)
    assert live.running is None and "Bar: it is gone" in live.ended


def test_saved_and_opened_it_is_off_and_the_preview_can_go(bar, live, tmp_path):
    bpy.ops.supple.live()
    move_head(0.5)
    handlers = len(bpy.app.handlers.depsgraph_update_post)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    assert live.is_live(bar)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert live.running is None
    assert len(bpy.app.handlers.depsgraph_update_post) < handlers
    bar = bpy.data.objects["Bar"]
    bpy.context.view_layer.objects.active = bar
    assert np.allclose(head_moved(bar), [0, 0, 0.5], atol=1e-5)
    bpy.ops.supple.handles_clear()
    assert bar.data.shape_keys is None and "Supple Bar" not in bpy.data.collections


def test_disabling_the_add_on_ends_it(package, bar, live):
    before = len(bpy.app.handlers.depsgraph_update_post)
    bpy.ops.supple.live()
    addon_utils.disable(package)
    assert live.running is None
    assert len(bpy.app.handlers.depsgraph_update_post) == before
    addon_utils.enable(package)
