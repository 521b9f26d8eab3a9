# SPDX-License-Identifier: GPL-3.0-or-later
"""Correcting an animation from keys on a few frames, baked to a cache."""

import bodies
import bpy
import moving
import numpy as np
import pytest
from mathutils import Matrix

SIZE = float(np.linalg.norm([0.6, 0.6, bodies.HEIGHT]))


@pytest.fixture(params=["armature", "keys"])
def bar(request):
    """A moving bar: feet held, head to be corrected."""
    bar = bodies.add_bar()
    (moving.add_armature if request.param == "armature" else moving.add_key_action)(bar)
    return correctable(bar)


def correctable(bar):
    bpy.context.scene.frame_set(1)
    bpy.ops.supple.handles_from_groups(groups="feet,head", held="feet")
    settings = bar.supple_sequence
    settings.first, settings.last, settings.ease_in, settings.ease_out = 5, 35, 12, 12
    return bar


def key_head(frames=(18, 22), location=(0.25, 0.1, 0.05)):
    """Key a correction of the head, the same at all frames."""
    empty = bpy.data.objects["head"]
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        empty.location = location
        bpy.ops.supple.sequence_key()


def bake(bar, path):
    assert bpy.ops.supple.sequence_bake(file=str(path)) == {"FINISHED"}
    return moving.every_frame(bar)


def test_outside_the_range_every_frame_is_as_it_was_bit_for_bit(bar, tmp_path):
    before = moving.every_frame(bar)
    key_head()
    after = bake(bar, tmp_path / "shot.pc2")
    for frame in moving.FRAMES:
        changed = not np.array_equal(after[frame], before[frame])
        assert changed == (5 < frame < 35), frame


def test_the_ends_of_the_range_join_without_a_jump(bar, tmp_path):
    before = moving.every_frame(bar)
    key_head()
    after = bake(bar, tmp_path / "shot.pc2")
    moved = {f: np.linalg.norm(np.float64(after[f]) - before[f], axis=1) for f in moving.FRAMES}
    whole = max(away.max() for away in moved.values())
    assert whole > 0.2
    for end, inner in ((5, 6), (35, 34)):
        assert moved[end].max() == 0  # position
        assert moved[inner].max() <= 0.01 * whole  # velocity, a frame


def test_a_correction_travels_with_the_body(bar, tmp_path):
    """Where the correction is whole, the head is where its own frame takes it."""
    before = moving.every_frame(bar)
    head = bodies.members(bar, "head")
    rest = bodies.rest(bar)[head]
    location = np.array([0.25, 0.1, 0.05])
    key_head(location=location)
    after = bake(bar, tmp_path / "shot.pc2")
    for frame in range(17, 24):
        motion = moving.nearest_motion(rest, before[frame][head])
        expected = before[frame][head] + motion[:3, :3] @ location
        assert np.abs(after[frame][head] - expected).max() < 2e-3 * SIZE, frame
        feet = bodies.members(bar, "feet")
        assert np.array_equal(after[frame][feet], before[frame][feet])


def test_between_keys_blenders_own_curves_count(bar, tmp_path):
    before = moving.every_frame(bar)
    head = bodies.members(bar, "head")
    empty = bpy.data.objects["head"]
    for frame, x in ((16, 0.0), (24, 0.3)):
        bpy.context.scene.frame_set(frame)
        empty.location = (x, 0, 0)
        bpy.ops.supple.sequence_key()
    after = bake(bar, tmp_path / "shot.pc2")
    for frame in range(17, 24):
        bpy.context.scene.frame_set(frame)
        asked = empty.evaluated_get(bpy.context.evaluated_depsgraph_get()).location.x
        moved = (np.float64(after[frame]) - before[frame])[head].mean(axis=0)
        assert np.linalg.norm(moved) == pytest.approx(asked, abs=1e-4), frame


def test_the_interior_follows_smoothly_and_keeps_its_shape(bar, tmp_path):
    """Beside an independent measure: edges keep their length, neighbours move alike."""
    before = moving.every_frame(bar)
    key_head()
    after = bake(bar, tmp_path / "shot.pc2")
    edges = np.array([edge.vertices[:] for edge in bar.data.edges])
    for frame in (12, 20, 28):
        length = [
            np.linalg.norm(np.diff(np.float64(p)[edges], axis=1)[:, 0], axis=1)
            for p in (before[frame], after[frame])
        ]
        assert np.abs(length[1] / length[0] - 1).mean() < 0.12
        away = np.linalg.norm(np.float64(after[frame]) - before[frame], axis=1)
        assert np.abs(np.diff(away[edges], axis=1)).max() < 0.35 * away.max()


def test_the_result_is_native_data(package, bar, tmp_path):
    """With the add-on disabled, every frame is as it was with it."""
    key_head()
    after = bake(bar, tmp_path / "shot.pc2")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.preferences.addon_disable(module=package)
    try:
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
        again = bpy.data.objects["Bar"]
        modifier = again.modifiers["Supple Sequence"]
        assert modifier.filepath == "//shot.pc2" or modifier.filepath == str(tmp_path / "shot.pc2")
        for frame, expected in after.items():
            assert np.array_equal(moving.at(again, frame), expected), frame
            assert modifier.show_render == modifier.show_viewport == (5 <= frame < 35)
    finally:
        bpy.ops.preferences.addon_enable(module=package)


def picture(path):
    """Render the scene from a fixed camera; return the pixels."""
    scene = bpy.context.scene
    if scene.camera is None:
        scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        scene.collection.objects.link(scene.camera)
        scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 4.0
        scene.camera.matrix_world = Matrix.Translation((0.5, -6, 1)) @ Matrix.Rotation(
            np.radians(90), 4, "X"
        )
        light = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
        scene.collection.objects.link(light)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 4, False
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path), check_existing=False)
    return np.array(image.pixels[:])


def test_a_render_shows_the_baked_frame(package, bar, tmp_path):
    """Without the add-on: the same pixels as a still mesh of the baked positions."""
    key_head(location=(0.6, 0, 0.2))
    after = bake(bar, tmp_path / "shot.pc2")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.preferences.addon_disable(module=package)
    try:
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
        bar = bpy.data.objects["Bar"]
        bpy.context.scene.frame_set(20)
        shown = picture(tmp_path / "after.png")
        bar.modifiers["Supple Sequence"].filepath = str(tmp_path / "none.pc2")
        without = picture(tmp_path / "before.png")
        still = bodies.add_mesh("Still", after[20], [p.vertices[:] for p in bar.data.polygons])
        still.matrix_world = bar.matrix_world
        bar.hide_render = True
        assert np.abs(picture(tmp_path / "still.png") - shown).max() <= 1 / 255
        assert np.abs(without - shown).mean() > 0.01
    finally:
        bpy.ops.preferences.addon_enable(module=package)


def test_before_and_after(bar, tmp_path):
    before = moving.every_frame(bar)
    key_head()
    after = bake(bar, tmp_path / "shot.pc2")
    bpy.ops.supple.sequence_show(show=False)
    assert all(np.array_equal(moving.at(bar, f), before[f]) for f in moving.FRAMES)
    bpy.ops.supple.sequence_show(show=True)
    assert all(np.array_equal(moving.at(bar, f), after[f]) for f in moving.FRAMES)
    bpy.ops.supple.sequence_remove()
    assert "Supple Sequence" not in bar.modifiers
    assert all(np.array_equal(moving.at(bar, f), before[f]) for f in moving.FRAMES)
    assert (tmp_path / "shot.pc2").is_file()


def test_baking_again_solves_only_what_changed(addon, bar, tmp_path):
    key_head()
    path = tmp_path / "shot.pc2"
    bake(bar, path)
    first = path.read_bytes()
    run = addon("frame_work").run
    to_output, stages = addon("sequence_bake").to_output, addon("stages").FrameStages
    baked = run(to_output(bpy.context, bar, stages(31)))
    assert baked.kept == 31 and path.read_bytes() == first
    key_head(frames=(30,), location=(0.4, 0, 0))
    baked = run(to_output(bpy.context, bar, stages(31)))
    assert 10 < baked.kept < 25 and path.read_bytes() != first
    path.unlink()
    path.with_name("shot.pc2.keys").unlink()
    changed = bake(bar, path)
    run(to_output(bpy.context, bar, stages(31)))
    assert all(np.array_equal(moving.at(bar, f), changed[f]) for f in moving.FRAMES)


def test_following_handles_are_on_the_mesh_and_change_nothing(bar, tmp_path):
    key_head()
    plain = bake(bar, tmp_path / "plain.pc2")
    bpy.ops.supple.sequence_remove()
    before = moving.every_frame(bar)
    assert bpy.ops.supple.sequence_follow() == {"FINISHED"}
    head, empty = bodies.members(bar, "head"), bpy.data.objects["head"]
    for frame in (5, 14, 20, 33):
        expected = bodies.to_world(bar, before[frame][head].mean(axis=0)[None])[0]
        bpy.context.scene.frame_set(frame)
        frame_of = bodies.empty_matrix(bar.supple.handles["head"].frame)
        assert np.allclose(np.array(frame_of)[:3, 3], expected, atol=1e-4), frame
        motion = np.linalg.inv(np.array(frame_of)) @ np.array(bodies.empty_matrix(empty))
        asked = empty.evaluated_get(bpy.context.evaluated_depsgraph_get()).location
        assert np.allclose(motion[:3, 3], asked, atol=1e-4)
    carried = bake(bar, tmp_path / "carried.pc2")
    for frame in moving.FRAMES:
        assert np.abs(carried[frame] - plain[frame]).max() < 1e-4 * SIZE, frame
    bpy.ops.supple.handles_clear()
    assert not any("frame" in obj.name for obj in bpy.data.objects)


def test_where_the_object_is_and_how_it_is_scaled_does_not_matter(bar, tmp_path):
    """A motion of the object moves the result; an uneven scale leaves the head exact in world."""
    bar.matrix_world = bodies.rigid_motion()
    bar.scale = (1.0, 1.6, 0.8)
    bpy.context.view_layer.update()
    bpy.ops.supple.handles_clear()
    correctable(bar)
    before = moving.every_frame(bar)
    key_head(location=(0.2, 0.1, 0.0))
    after = bake(bar, tmp_path / "shot.pc2")
    head = bodies.members(bar, "head")
    rest = bodies.to_world(bar, bodies.rest(bar)[head])
    for frame in (18, 20, 22):
        was = bodies.to_world(bar, before[frame][head])
        motion = moving.nearest_motion(rest, was)
        expected = was + motion[:3, :3] @ np.array([0.2, 0.1, 0.0])
        got = bodies.to_world(bar, after[frame][head])
        assert np.abs(got - expected).max() < 6e-3 * SIZE, frame


def test_modifiers_after_go_on_after_the_result(bar, tmp_path):
    subdivision = bar.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels = subdivision.render_levels = 1
    before = moving.every_frame(bar, (3, 20))
    key_head()
    after = bake(bar, tmp_path / "shot.pc2")
    names = [modifier.name for modifier in bar.modifiers]
    assert names.index("Supple Sequence") == len(names) - 2
    assert subdivision.show_viewport and len(after[20]) > 204
    assert np.array_equal(after[3], before[3])
    assert np.abs(after[20] - before[20]).max() > 0.2


def test_a_point_cache_is_corrected_like_any_animation(bar, tmp_path):
    key_head()
    bake(bar, tmp_path / "input.pc2")
    bar.modifiers["Supple Sequence"].name = "Input"
    before = moving.every_frame(bar)
    key_head(frames=(20,), location=(-0.2, 0, 0))
    after = bake(bar, tmp_path / "shot.pc2")
    assert [modifier.name for modifier in bar.modifiers][-2:] == ["Input", "Supple Sequence"]
    for frame in moving.FRAMES:
        assert np.array_equal(after[frame], before[frame]) == (not 5 < frame < 35), frame


def test_a_change_of_the_vertex_count_is_found_first(bar, tmp_path):
    key_head()
    build = bar.modifiers.new("Build", "BUILD")
    build.frame_start, build.frame_duration = 2, 20
    bpy.context.scene.frame_set(40)
    state = bodies.everything()
    with pytest.raises(RuntimeError, match=r"at frame 5 it has \d+ vertices and 204 at rest"):
        bpy.ops.supple.sequence_bake(file=str(tmp_path / "shot.pc2"))
    assert bodies.everything() == state
    assert not list(tmp_path.iterdir())
    assert bpy.context.scene.frame_current == 40


def test_as_shape_keys(bar, tmp_path):
    """The same frames as in the cache, and the mesh moves as before in all others."""
    before = moving.every_frame(bar)
    key_head()
    cached = bake(bar, tmp_path / "shot.pc2")
    bar.supple_sequence.output = "KEYS"
    assert bpy.ops.supple.sequence_bake() == {"FINISHED"}
    keyed = moving.every_frame(bar)
    for frame in moving.FRAMES:
        expected = cached[frame] if 5 <= frame <= 35 else before[frame]
        assert np.abs(keyed[frame] - expected).max() < 1e-4 * SIZE, frame
    assert "Sequence 0005" in bar.data.shape_keys.key_blocks
    assert "Supple Sequence" not in bar.modifiers
    # Again, over fewer frames: from the animation alone, and no key of before is left.
    bar.supple_sequence.first, bar.supple_sequence.last = 10, 30
    assert bpy.ops.supple.sequence_bake() == {"FINISHED"}
    keys = [key.name for key in bar.data.shape_keys.key_blocks if "Sequence" in key.name]
    assert keys == [f"Sequence {frame:04}" for frame in range(10, 31)]
    bar.supple_sequence.output = "CACHE"
    bpy.ops.supple.sequence_show(show=False)
    assert all(np.array_equal(moving.at(bar, f), before[f]) for f in moving.FRAMES)
    bpy.ops.supple.sequence_show(show=True)
    bpy.ops.supple.sequence_remove()
    assert not any("Sequence" in key.name for key in bar.data.shape_keys.key_blocks)
    assert all(np.allclose(moving.at(bar, f), before[f], atol=1e-6) for f in moving.FRAMES)


def test_shape_keys_that_fail_leave_those_of_before(addon, bar, tmp_path):
    key_head()
    bar.supple_sequence.output = "KEYS"
    bpy.ops.supple.sequence_bake()
    shown, state = moving.every_frame(bar), bodies.everything()
    key_head(frames=(25,), location=(-0.3, 0, 0))
    stages = addon("stages").FrameStages(31)
    work = addon("sequence_bake").to_output(bpy.context, bar, stages)
    for step, future in enumerate(work):
        if future is not None:
            future.exception()
        if step == 50:
            work.close()
            break
    bpy.ops.supple.sequence_clear()
    assert {f: p.tobytes() for f, p in moving.every_frame(bar).items()} == {
        f: p.tobytes() for f, p in shown.items()
    }
    bpy.context.scene.frame_set(22)
    assert sorted(bodies.everything()) == sorted(state)


def test_what_comes_after_stays_after_in_a_second_bake(bar, tmp_path):
    key_head()
    bake(bar, tmp_path / "shot.pc2")
    bar.modifiers.new("Cast", "CAST").factor = 0.3
    before = [modifier.name for modifier in bar.modifiers]
    once = moving.at(bar, 20)
    bake(bar, tmp_path / "shot.pc2")
    assert [m.name for m in bar.modifiers] == [*before[:-2], "Cast", "Supple Sequence"]
    plain = bar.modifiers["Supple Sequence"].show_viewport = False
    assert plain is False and not np.array_equal(once, moving.at(bar, 3))


def test_files_of_others_are_not_written_over(bar, tmp_path):
    key_head()
    bake(bar, tmp_path / "input.pc2")
    bar.modifiers["Supple Sequence"].name = "Input"
    content = (tmp_path / "input.pc2").read_bytes()
    with pytest.raises(RuntimeError, match="is read by modifier 'Input' of 'Bar'"):
        bpy.ops.supple.sequence_bake(file=str(tmp_path / "input.pc2"))
    (tmp_path / "other.pc2").write_bytes(b"another program's")
    with pytest.raises(RuntimeError, match="was not baked by Supple"):
        bpy.ops.supple.sequence_bake(file=str(tmp_path / "other.pc2"))
    assert (tmp_path / "input.pc2").read_bytes() == content


def test_a_duplicate_does_not_take_the_originals_handles(bar):
    key_head()
    bpy.ops.supple.sequence_follow()
    copy = bar.copy()
    copy.data = bar.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    bpy.context.view_layer.objects.active = copy
    with pytest.raises(RuntimeError, match="its handles are those of 'Bar'"):
        bpy.ops.supple.sequence_bake(file="/tmp/none.pc2")
    bpy.ops.supple.handles_clear()
    assert "head" in bpy.data.objects and bar.supple.handles["head"].frame
    assert bpy.data.objects["head"].animation_data.action


def test_an_undo_brings_no_preview_back(bar, tmp_path):
    key_head()
    bpy.ops.supple.sequence_preview()
    bpy.context.scene.frame_set(20)
    bpy.ops.ed.undo_push(message="with the preview")
    bpy.ops.supple.sequence_preview()
    bpy.ops.ed.undo_push(message="without")
    bpy.ops.ed.undo()
    assert "Supple Sequence Preview" not in bpy.data.objects["Bar"].modifiers


def test_what_is_unusual_is_said(bar, tmp_path, capfd):
    key_head(frames=(8,))
    bar.supple_sequence.last = 15
    bpy.ops.supple.sequence_bake(file=str(tmp_path / "shot.pc2"))
    assert "The eases leave no frame of the range its whole correction" in capfd.readouterr().out
    scene = bpy.context.scene
    scene.render.frame_map_new = 200
    with pytest.raises(RuntimeError, match="the scene's time is remapped"):
        bpy.ops.supple.sequence_bake(file=str(tmp_path / "shot.pc2"))


def test_the_preview_shows_what_the_bake_will(bar, tmp_path):
    key_head()
    bpy.ops.supple.sequence_preview()
    previewed = moving.every_frame(bar)
    bpy.data.objects["head"].location = (0.1, 0, 0)
    bpy.context.view_layer.update()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"), copy=True)
    bpy.ops.supple.sequence_preview()
    assert "Supple Sequence Preview" not in bar.modifiers
    baked = bake(bar, tmp_path / "shot.pc2")
    for frame in moving.FRAMES:
        assert np.abs(previewed[frame] - baked[frame]).max() < 1e-5, frame
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert "Supple Sequence Preview" not in bpy.data.objects["Bar"].modifiers


def test_the_network_shapes_the_frames(bar, tmp_path):
    key_head(location=(0.5, 0.3, -0.2))
    learned = bake(bar, tmp_path / "learned.pc2")
    bar.supple.network = False
    plain = bake(bar, tmp_path / "plain.pc2")
    assert np.abs(learned[20] - plain[20]).max() > 1e-3 * SIZE


def test_from_python_without_operators(addon, bar, tmp_path):
    """The same bytes as the panel's, and the handles follow."""
    key_head()
    bake(bar, tmp_path / "panel.pc2")
    api = addon("api")
    api.follow_animation(bar)
    assert bar.supple.handles["head"].frame
    baked = api.bake_sequence(bar, tmp_path / "script.pc2")
    assert (baked.first, baked.last, baked.kept) == (5, 35, 0)
    for frame, shown in moving.every_frame(bar, (8, 20, 30)).items():
        other = np.frombuffer((tmp_path / "panel.pc2").read_bytes()[32:], "<f4").reshape(31, -1, 3)
        assert np.abs(shown - other[frame - 5]).max() < 1e-4 * SIZE


def test_clear_removes_the_keys_of_this_frame(bar):
    key_head(frames=(10, 20))
    bpy.context.scene.frame_set(20)
    bpy.ops.supple.sequence_clear()
    with pytest.raises(RuntimeError, match="no key at frame 20"):
        bpy.ops.supple.sequence_clear()
    bpy.context.scene.frame_set(10)
    bpy.ops.supple.sequence_clear()


def test_refusals_name_what_is_wrong_and_change_nothing(bar, tmp_path):
    key_head()
    state = bodies.everything()
    settings = bar.supple_sequence

    def refused(message, **arguments):
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.supple.sequence_bake(**arguments)

    refused("not saved yet")
    refused("must end in .pc2", file=str(tmp_path / "shot.abc"))
    refused(
        "No such file or directory. Make its folder first",
        file=str(tmp_path / "missing" / "shot.pc2"),
    )
    settings.last = 2
    refused("ends at frame 2, before its start at 5", file=str(tmp_path / "shot.pc2"))
    settings.last = 35
    bar.hide_set(True)
    refused("is hidden", file=str(tmp_path / "shot.pc2"))
    bar.hide_set(False)
    bar.modifiers.new("Supple Sequence", "CAST")
    refused("is not Supple's", file=str(tmp_path / "shot.pc2"))
    bar.modifiers.remove(bar.modifiers["Supple Sequence"])
    settings.output, settings.last = "KEYS", 400
    refused("396 frames would be as many shape keys; 120 are the most")
    assert bodies.everything() == state
    assert not list(tmp_path.iterdir())


def test_bones_as_handles_are_refused():
    bar = bodies.add_bar()
    moving.add_armature(bar)
    bpy.ops.supple.handles_from_bones(bones="upper,lower", held="lower")
    with pytest.raises(RuntimeError, match="'upper' is moved by a bone"):
        bpy.ops.supple.sequence_bake(file="/tmp/none.pc2")


def test_a_cancelled_bake_leaves_everything_and_goes_on(addon, bar, tmp_path):
    key_head()
    path = tmp_path / "shot.pc2"
    bar.supple_sequence.file = str(path)
    whole = bake(bar, path)
    expected = path.read_bytes(), path.with_name("shot.pc2.keys").read_bytes()
    bpy.ops.supple.sequence_remove()
    for file in tmp_path.iterdir():
        file.unlink()
    stages = addon("stages").FrameStages(31)
    work = addon("sequence_bake").to_output(bpy.context, bar, stages)
    state = bodies.everything()
    frame = bpy.context.scene.frame_current
    for _ in range(28):
        future = next(work)
        if future is not None:
            future.result()
    stages.cancel()
    with pytest.raises(addon("errors").CancelledError):
        for future in work:
            if future is not None:
                future.exception()
    assert bodies.everything() == state and bpy.context.scene.frame_current == frame
    assert not path.exists() and path.with_name("shot.pc2.part").exists()
    stages = addon("stages").FrameStages(31)
    baked = addon("frame_work").run(addon("sequence_bake").to_output(bpy.context, bar, stages))
    assert baked.kept >= 8
    assert (path.read_bytes(), path.with_name("shot.pc2.keys").read_bytes()) == expected
    assert all(np.array_equal(moving.at(bar, f), whole[f]) for f in moving.FRAMES)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["shot.pc2", "shot.pc2.keys"]
