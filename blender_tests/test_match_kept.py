# SPDX-License-Identifier: GPL-3.0-or-later
"""A match that is kept: with the file, in a file of its own, turned round, and no longer true."""

import bodies
import bpy
import numpy as np
import pairs
import pytest


def test_a_changed_mesh_is_named(pair):
    body, scan, _ = pair
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    scan.scale, scan.location = (2, 1, 1), (1, 1, 1)
    assert bpy.ops.supple.refine_match() == {"FINISHED"}  # places and scales are no change
    for obj in (body, scan):
        kept = obj.data.vertices[5].co.copy()
        obj.data.vertices[5].co.x += 0.01
        before = pairs.everything()
        with pytest.raises(RuntimeError, match=rf"{obj.name}: it was changed since the match. Mat"):
            bpy.ops.supple.refine_match()
        with pytest.raises(RuntimeError, match=rf"{obj.name}: it was changed since the match"):
            bpy.ops.supple.match_show()
        assert pairs.everything() == before
        obj.data.vertices[5].co = kept
    bpy.ops.supple.refine_match()


def test_another_source_is_named(pair):
    body, scan, _ = pair
    pairs.choose(body, scan, refine=False)
    with pytest.raises(RuntimeError, match=r"Scan: it is not matched yet. Press Match"):
        bpy.ops.supple.refine_match()
    bpy.ops.supple.match()
    pairs.choose(pairs.add_lump("Other"), scan)
    with pytest.raises(RuntimeError, match=r"Scan: it was matched to 'Body', not to 'Other'"):
        bpy.ops.supple.refine_match()
    bpy.data.objects.remove(body)
    with pytest.raises(RuntimeError, match=r"matched to an object that is gone"):
        bpy.ops.supple.refine_match()


def test_kept_with_the_file(pair, tmp_path):
    pairs.choose(pair[0], pair[1], refine=False)
    bpy.ops.supple.match()
    before = pairs.attribute(pair[1], "Supple Match Weights")
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    scan = bpy.data.objects["Scan"]
    assert np.array_equal(pairs.attribute(scan, "Supple Match Weights"), before)
    assert bpy.ops.supple.refine_match() == {"FINISHED"}


def test_saved_and_loaded(pair, tmp_path):
    body, scan, _ = pair
    pairs.choose(body, scan)
    bpy.ops.supple.match()
    where, found = pairs.partners(scan, body), scan.supple_map.confidence
    path = str(tmp_path / "source and target.supplemap")
    bpy.ops.supple.match_save(filepath=path)
    scan.location.x = 5
    bpy.ops.supple.match()
    assert bpy.ops.supple.match_load(filepath=path) == {"FINISHED"}
    assert np.allclose(pairs.partners(scan, body), where, atol=1e-6)
    assert found > 0.5 and 0.5 < scan.supple_map.confidence <= 1
    pairs.choose(body, scan, "FILE", file=path, refine=False)
    bpy.ops.supple.match()
    assert np.allclose(pairs.partners(scan, body), where, atol=1e-6)


def test_a_file_of_other_meshes_is_refused(pair, tmp_path):
    body, scan, _ = pair
    pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    path = str(tmp_path / "source.supplemap")
    bpy.ops.supple.match_save(filepath=path)
    bpy.context.view_layer.update()
    before = pairs.everything()
    with pytest.raises(RuntimeError, match=r"Scan: there is no file .*nowhere"):
        bpy.ops.supple.match_load(filepath=str(tmp_path / "nowhere"))
    with pytest.raises(RuntimeError, match=r"Scan: no file is named"):
        bpy.ops.supple.match_load(filepath=str(tmp_path))
    (tmp_path / "bad.supplemap").write_bytes(b"no map")
    with pytest.raises(RuntimeError, match=r"Scan: .*bad.supplemap"):
        bpy.ops.supple.match_load(filepath=str(tmp_path / "bad.supplemap"))
    with pytest.raises(RuntimeError, match=r"Scan: .*can't be made"):
        bpy.ops.supple.match_save(filepath=str(tmp_path / "no folder" / "x.supplemap"))
    assert pairs.everything() == before
    scan.data.vertices[0].co.x += 1
    with pytest.raises(RuntimeError, match=r"source\.supplemap was made for another target: its "):
        bpy.ops.supple.match_load(filepath=path)


def test_swap_turns_the_match_round(pair):
    body, scan, order = pair
    panel = pairs.choose(body, scan, refine=False)
    bpy.ops.supple.match()
    bpy.ops.supple.landmark_add(source_vertex=3, target_vertex=7)
    assert bpy.ops.supple.match_swap() == {"FINISHED"}
    assert (panel.source, panel.target) == (scan, body)
    assert (panel.pairs[0].source_vertex, panel.pairs[0].target_vertex) == (7, 3)
    truth = bodies.rest(scan)[np.argsort(order)]
    assert np.allclose(pairs.partners(body, scan), truth, atol=1e-4)
    assert body.supple_map.confidence > 0.9
    assert not [a.name for a in scan.data.attributes if a.name.startswith("Supple")]
    bpy.ops.supple.refine_match()
    bpy.ops.supple.match_swap()
    assert pairs.error(pair) < 0.05


def test_swap_without_a_match(pair):
    panel = pairs.choose(pair[0], pair[1])
    bpy.ops.supple.match_swap()
    assert (panel.source, panel.target) == (pair[1], pair[0])


def test_undo_takes_back_one_match(pair):
    bpy.context.view_layer.update()
    pairs.choose(pair[0], pair[1], refine=False)
    bpy.ops.ed.undo_push(message="Before")
    before = pairs.everything()
    bpy.ops.supple.match()
    bpy.ops.ed.undo_push(message="Match")
    assert "Supple Match Face" in bpy.data.objects["Scan"].data.attributes
    bpy.ops.ed.undo()
    assert "Supple Match Face" not in bpy.data.objects["Scan"].data.attributes
    after = pairs.everything()
    assert {k: v for k, v in after.items() if k != "panel"} == {
        k: v for k, v in before.items() if k != "panel"
    }
