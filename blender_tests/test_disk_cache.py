# SPDX-License-Identifier: GPL-3.0-or-later
"""Prepared meshes on disk: a second session finds them, and a damaged one is made again."""

import json
import os
import subprocess
from types import SimpleNamespace
from unittest.mock import MagicMock

import bodies
import bpy
import numpy as np
import pytest


@pytest.fixture
def folder(addon, tmp_path, monkeypatch):
    """An empty folder as the disk cache, and nothing in memory."""
    monkeypatch.setenv("SUPPLE_CACHE_DIR", str(tmp_path / "prepared"))
    addon("prepared").clear()
    yield tmp_path / "prepared"
    addon("prepared").clear()


@pytest.fixture
def preferences(package):
    """The add-on's preferences, as they were again afterwards."""
    found = bpy.context.preferences.addons[package].preferences
    before = found.disk_cache, found.cache_mebibytes
    yield found
    found.disk_cache, found.cache_mebibytes = before


def posed_bar():
    bar = bodies.add_bar()
    bpy.ops.supple.handles_from_groups()
    head = bpy.data.objects["head"]
    head.location, head.rotation_euler = (0.4, 0.1, -0.1), (0.1, 0.7, 0.0)
    return bar


def cache_notes(pose):
    return [note for note in pose.notes if "disk cache" in note]


def test_a_second_session_finds_it_and_poses_bit_for_bit(addon, folder):
    api, bar = addon("api"), posed_bar()
    first = api.bake(bar, "First")
    assert len(list(folder.glob("*.supple"))) == 1
    addon("prepared").clear()
    second = api.bake(bar, "Second")
    assert (first.report["from_cache"], second.report["from_cache"]) == (False, True)
    assert np.array_equal(first.positions, second.positions)
    assert np.array_equal(bodies.key(bar, "First"), bodies.key(bar, "Second"))
    assert np.abs(bodies.key(bar, "First") - bodies.rest(bar)).max() > 0.1
    assert not cache_notes(second)


def test_a_damaged_file_is_made_again_and_said(addon, folder):
    api, bar = addon("api"), posed_bar()
    first = api.solve(bar)
    (file,) = folder.iterdir()
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    addon("prepared").clear()
    rebuilt = api.solve(bar)
    assert not rebuilt.report["from_cache"]
    assert len(cache_notes(rebuilt)) == 1
    assert file.name in cache_notes(rebuilt)[0]
    assert np.array_equal(first.positions, rebuilt.positions)
    addon("prepared").clear()
    again = api.solve(bar)
    assert again.report["from_cache"]
    assert not cache_notes(again)


def test_a_folder_that_cannot_be_written_stops_nothing(addon, folder, monkeypatch):
    api, bar = addon("api"), posed_bar()
    expected = api.solve(bar)
    (folder / "file").write_text("")
    monkeypatch.setenv("SUPPLE_CACHE_DIR", str(folder / "file" / "below"))
    addon("prepared").clear()
    found = api.solve(bar)
    assert len(cache_notes(found)) == 1
    assert np.array_equal(expected.positions, found.positions)


def test_another_process_finds_it(addon, package, folder, tmp_path):
    bar = posed_bar()
    addon("api").bake(bar, "Here")
    here = bodies.key(bar, "Here")
    path, result = tmp_path / "bar.blend", tmp_path / "there.json"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    script = (
        "import importlib, json, bpy, addon_utils;"
        f"addon_utils.enable({package!r}, default_set=True);"
        f"api = importlib.import_module({package + '.api'!r});"
        "pose = api.solve(bpy.data.objects['Bar']);"
        "answer = [pose.report['from_cache'], pose.positions.tolist()];"
        f"json.dump(answer, open({str(result)!r}, 'w'))"
    )
    binary = bpy.app.binary_path
    if not binary:
        pytest.skip("the bpy module has no Blender to start")
    subprocess.run(
        [binary, "-b", str(path), "--python-exit-code", "1", "--python-expr", script],
        env=os.environ,
        check=True,
        capture_output=True,
    )
    from_cache, positions = json.loads(result.read_text())
    assert from_cache
    assert np.array_equal(np.array(positions).astype(np.float32), here)


def test_preferences_switch_it_off_and_bound_it(addon, folder, preferences):
    api, bar = addon("api"), posed_bar()
    preferences.disk_cache = False
    api.solve(bar)
    assert not folder.exists()
    preferences.disk_cache = True
    preferences.cache_mebibytes = 1
    for height in range(1, 8):  # each takes a quarter of a MiB
        bar.data.vertices[0].co.z = -0.01 * height
        api.prepare(bar)
    files = list(folder.glob("*.supple"))
    assert len(files) > 1
    assert sum(path.stat().st_size for path in files) <= 1 << 20


def test_preferences_show_folder_and_size(addon, folder):
    addon("api").prepare(posed_bar())
    layout = MagicMock()  # background Blender draws nothing
    drawn = SimpleNamespace(layout=layout, disk_cache=True, cache_mebibytes=2048)
    addon("preferences").SUPPLE_AP_preferences.draw(drawn, bpy.context)
    texts = [call.kwargs["text"] for call in layout.label.mock_calls]
    assert texts == [str(folder)]
    row = layout.row.return_value
    (text,) = [call.kwargs["text"] for call in row.label.mock_calls]
    assert text.startswith("1 mesh, 0.")
    row.operator.assert_called_once_with("supple.cache_clear", icon="TRASH")


def test_clear_empties_the_folder(addon, folder):
    addon("api").prepare(posed_bar())
    (folder / "notes.txt").write_text("mine")
    assert bpy.ops.supple.cache_clear() == {"FINISHED"}
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]
