# SPDX-License-Identifier: GPL-3.0-or-later
"""What bake and preview write, and above all what they do not touch."""

import bodies
import bpy
import numpy as np
import pytest


@pytest.fixture
def bar():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    bpy.data.objects["head"].location.z = 0.5
    return bar


def add_user_keys(obj):
    obj.shape_key_add(name="Basis")
    for number, name in enumerate(("Smile", "Frown")):
        key = obj.shape_key_add(name=name)
        for point in key.data:
            point.co.y += 0.1 * (number + 1)
        key.value = 0.25 + 0.5 * number
    obj.data.shape_keys.key_blocks["Frown"].mute = True


def user_keys(obj):
    blocks = obj.data.shape_keys.key_blocks
    return [
        (k.name, k.value, k.mute, k.slider_min, k.slider_max, bodies.key(obj, k.name).tobytes())
        for k in blocks
        if k.name in ("Basis", "Smile", "Frown")
    ]


def test_bake_adds_the_basis_and_a_key_that_shows(bar):
    rest = bodies.rest(bar)
    assert bpy.ops.supple.bake(name="Wave") == {"FINISHED"}
    blocks = bar.data.shape_keys.key_blocks
    assert [key.name for key in blocks] == ["Basis", "Wave"]
    assert blocks["Wave"].value == 1.0
    assert blocks["Wave"].relative_key == blocks["Basis"]
    assert np.array_equal(bodies.key(bar, "Basis"), rest)
    mesh = bar.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    seen = np.array([v.co for v in mesh.vertices])
    assert np.allclose(seen, bodies.key(bar, "Wave"), atol=1e-6)


def test_a_rewritten_key_is_seen_at_once(bar):
    for height in (0.5, 0.8):
        bpy.data.objects["head"].location.z = height
        bpy.ops.supple.bake(name="Wave")
        mesh = bar.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        assert np.isclose(max(v.co.z for v in mesh.vertices), bodies.HEIGHT + height, atol=1e-5)


def test_other_keys_stay_bit_for_bit(bar):
    add_user_keys(bar)
    before = user_keys(bar)
    bpy.ops.supple.solve()
    assert user_keys(bar) == before
    bpy.ops.supple.bake(name="Wave")
    bpy.ops.supple.bake(name="Wave")
    assert user_keys(bar) == before
    assert [k.name for k in bar.data.shape_keys.key_blocks] == ["Basis", "Smile", "Frown", "Wave"]


def test_a_foreign_key_is_not_overwritten_unless_told(bar):
    add_user_keys(bar)
    before = bodies.everything()
    with pytest.raises(RuntimeError, match="Bar: shape key 'Smile' was made or changed by someone"):
        bpy.ops.supple.bake(name="Smile")
    assert bodies.everything() == before
    assert bpy.ops.supple.bake(name="Smile", overwrite=True) == {"FINISHED"}
    smile = bar.data.shape_keys.key_blocks["Smile"]
    assert smile.value == 0.25
    assert np.isclose(bodies.key(bar, "Smile")[:, 2].max(), bodies.HEIGHT + 0.5, atol=1e-5)


def test_our_key_that_the_user_changed_is_the_users(bar):
    bpy.ops.supple.bake(name="Wave")
    bar.data.shape_keys.key_blocks["Wave"].data[100].co.x += 0.1
    with pytest.raises(RuntimeError, match="made or changed by someone else"):
        bpy.ops.supple.bake(name="Wave")


def test_rewriting_our_key_keeps_its_value(bar):
    bpy.ops.supple.bake(name="Wave")
    bar.data.shape_keys.key_blocks["Wave"].value = 0.5
    bpy.data.objects["head"].location.z = 0.7
    bpy.ops.supple.bake(name="Wave")
    assert bar.data.shape_keys.key_blocks["Wave"].value == 0.5


def test_the_basis_is_never_written(bar):
    bpy.ops.supple.bake(name="Wave")
    for overwrite in (False, True):
        with pytest.raises(RuntimeError, match="'Basis' is the rest shape"):
            bpy.ops.supple.bake(name="Basis", overwrite=overwrite)


def test_absolute_keys_are_refused(bar):
    add_user_keys(bar)
    bar.data.shape_keys.use_relative = False
    with pytest.raises(RuntimeError, match="absolute"):
        bpy.ops.supple.bake(name="Wave")


def test_bake_without_a_name_uses_the_panels(bar):
    bar.supple.key_name = "Pose 7"
    bpy.ops.supple.bake()
    assert "Pose 7" in bar.data.shape_keys.key_blocks
    bar.supple.key_name = "  "
    with pytest.raises(RuntimeError, match="has no name"):
        bpy.ops.supple.bake()


def test_preview_shows_and_goes_with_the_bake(bar):
    bpy.ops.supple.solve()
    assert [k.name for k in bar.data.shape_keys.key_blocks] == ["Basis", "Supple Preview"]
    bpy.ops.supple.bake(name="Wave")
    assert [k.name for k in bar.data.shape_keys.key_blocks] == ["Basis", "Wave"]
    bpy.ops.supple.handles_clear()
    assert [k.name for k in bar.data.shape_keys.key_blocks] == ["Basis", "Wave"]


def test_preview_that_the_user_changed_is_kept(bar):
    bpy.ops.supple.solve()
    bar.data.shape_keys.key_blocks["Supple Preview"].data[0].co.x = 9
    bpy.ops.supple.handles_clear()
    assert [k.name for k in bar.data.shape_keys.key_blocks] == ["Basis", "Supple Preview"]


def test_a_foreign_preview_is_not_overwritten(bar):
    add_user_keys(bar)
    bar.shape_key_add(name="Supple Preview")
    with pytest.raises(RuntimeError, match="Rename or remove it"):
        bpy.ops.supple.solve()


def test_a_name_too_long_for_blender_is_refused(bar):
    bpy.ops.supple.bake(name="x" * 63)
    with pytest.raises(RuntimeError, match="at most 63 bytes"):
        bpy.ops.supple.bake(name="x" * 64)


def test_saved_and_opened_again(bar, tmp_path):
    bpy.ops.supple.bake(name="Wave")
    baked = bodies.key(bar, "Wave")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    bar = bpy.data.objects["Bar"]
    bpy.context.view_layer.objects.active = bar
    assert np.array_equal(bodies.key(bar, "Wave"), baked)
    assert bpy.ops.supple.bake(name="Wave") == {"FINISHED"}  # still known as ours
    assert np.array_equal(bodies.key(bar, "Wave"), baked)
