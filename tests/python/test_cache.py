# SPDX-License-Identifier: GPL-3.0-or-later
"""Prepared meshes on disk: supple.cache, PreparedMesh(cache=...) and the command line."""

import json
import os
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest
import supple

MEBIBYTE = 1 << 20


def tube(rings=20, around=16, height=3.0):
    """An open tube along z: 320 vertices, enough to be kept."""
    z, angle = np.meshgrid(
        np.linspace(0, height, rings),
        np.linspace(0, 2 * np.pi, around, endpoint=False),
        indexing="ij",
    )
    points = np.stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), z], axis=-1).reshape(-1, 3)
    index = np.arange(rings * around).reshape(rings, around)
    low, high = index[:-1].ravel(), index[1:].ravel()
    low_next, high_next = (np.roll(part, -1, axis=1).ravel() for part in (index[:-1], index[1:]))
    faces = np.concatenate(
        [np.stack([low, low_next, high_next], 1), np.stack([low, high_next, high], 1)]
    )
    return points, faces


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The cache's folder, this test's own; it does not exist yet."""
    path = tmp_path / "cache" / "prepared"
    monkeypatch.setenv("SUPPLE_CACHE_DIR", str(path))
    return path


def cache_codes(notes):
    return [note.code for note in notes if note.code.startswith("cache")]


def solve(prepared):
    lift = np.eye(4)
    lift[2, 3] = 0.4
    count = prepared.vertex_count
    handles = [
        supple.Handle("low", np.arange(16)),
        supple.Handle("high", np.arange(count - 16, count), matrix=lift),
    ]
    return supple.Editor(prepared, handles).solve().vertices


# --- where, and how much --------------------------------------------------------------------------


def test_the_folder_is_the_named_one_or_the_platforms(monkeypatch, tmp_path):
    monkeypatch.setenv("SUPPLE_CACHE_DIR", str(tmp_path / "own"))
    assert supple.cache.folder() == tmp_path / "own"
    monkeypatch.delenv("SUPPLE_CACHE_DIR")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert supple.cache.folder() == tmp_path / "xdg" / "supple" / "prepared"
    for ignored in ("relative", ""):
        monkeypatch.setenv("XDG_CACHE_HOME", ignored)
        assert supple.cache.folder() == tmp_path / ".cache" / "supple" / "prepared"
    monkeypatch.setattr(sys, "platform", "darwin")
    assert supple.cache.folder() == tmp_path / "Library" / "Caches" / "supple" / "prepared"
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    assert supple.cache.folder() == tmp_path / "local" / "supple" / "prepared"


def test_the_cap_is_in_mebibytes(monkeypatch):
    assert supple.cache.max_bytes() == 2048 * MEBIBYTE
    monkeypatch.setenv("SUPPLE_CACHE_MAX", "3")
    assert supple.cache.max_bytes() == 3 * MEBIBYTE
    assert supple.cache.default().max_bytes == 3 * MEBIBYTE
    assert supple.cache.default(max_mebibytes=7).max_bytes == 7 * MEBIBYTE
    for wrong in ("-1", "2 GB", "1.5", "9" * 30):
        monkeypatch.setenv("SUPPLE_CACHE_MAX", wrong)
        with pytest.raises(supple.SuppleError, match="SUPPLE_CACHE_MAX") as caught:
            supple.cache.max_bytes()
        assert caught.value.code == "bad_option"


def test_it_can_be_switched_off(folder, monkeypatch):
    monkeypatch.setenv("SUPPLE_CACHE", "0")
    assert not supple.cache.enabled()
    assert supple.cache.default() is None
    supple.PreparedMesh(*tube())
    assert not folder.exists()


# --- prepared meshes ------------------------------------------------------------------------------


def test_the_second_is_the_first_bit_for_bit(folder):
    plain = supple.PreparedMesh(*tube(), cache=False)
    assert not folder.exists()
    first, second = supple.PreparedMesh(*tube()), supple.PreparedMesh(*tube())
    assert (plain.from_cache, first.from_cache, second.from_cache) == (False, False, True)
    assert second.residual == plain.residual
    assert np.array_equal(solve(second), solve(plain))
    assert cache_codes(first.notes) == cache_codes(second.notes) == []


def test_size_and_clear(folder):
    assert supple.cache.size() == (0, 0)
    supple.PreparedMesh(*tube())
    supple.PreparedMesh(*tube(height=4.0))
    (folder / "notes.txt").write_text("mine")
    files = list(folder.glob("*.supple"))
    assert supple.cache.size() == (2, sum(path.stat().st_size for path in files))
    assert supple.cache.clear().files == 2
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]
    assert not supple.PreparedMesh(*tube()).from_cache


def test_a_cache_of_ones_own(tmp_path, folder):
    own = supple.PreparedCache(tmp_path / "own", 100 * MEBIBYTE)
    supple.PreparedMesh(*tube(), cache=own)
    assert supple.PreparedMesh(*tube(), cache=own).from_cache
    assert own.size()[0] == 1
    assert not folder.exists()


def test_a_corrupt_file_is_rebuilt_and_noted(folder):
    expected = solve(supple.PreparedMesh(*tube()))
    (file,) = folder.iterdir()
    content = bytearray(file.read_bytes())
    content[len(content) // 3] ^= 1
    file.write_bytes(content)
    rebuilt = supple.PreparedMesh(*tube())
    assert not rebuilt.from_cache
    assert cache_codes(rebuilt.notes) == ["cache_rebuilt"]
    assert file.name in rebuilt.notes[-1].message
    assert np.array_equal(solve(rebuilt), expected)
    again = supple.PreparedMesh(*tube())
    assert again.from_cache
    assert cache_codes(again.notes) == []


def test_no_folder_no_room_and_wrong_settings_are_notes(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SUPPLE_CACHE_DIR", str(tmp_path / "file" / "cache"))
    assert cache_codes(supple.PreparedMesh(*tube()).notes) == ["cache_unwritable"]
    monkeypatch.setenv("SUPPLE_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("SUPPLE_CACHE_MAX", "0")
    assert cache_codes(supple.PreparedMesh(*tube()).notes) == ["cache_too_small"]
    monkeypatch.setenv("SUPPLE_CACHE_MAX", "lots")
    notes = supple.PreparedMesh(*tube()).notes
    assert cache_codes(notes) == ["cache_unwritable"]
    assert "'lots'" in notes[-1].message


def test_nobody_at_home(monkeypatch):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("SUPPLE_CACHE_DIR")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    with pytest.raises(supple.SuppleError, match="SUPPLE_CACHE_DIR"):
        supple.cache.folder()
    assert cache_codes(supple.PreparedMesh(*tube()).notes) == ["cache_unwritable"]


WORKER = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np, supple
from test_cache import cache_codes, solve, tube
for turn in range(4):
    for height in (3.0, 3.5):
        prepared = supple.PreparedMesh(*tube(height=height))
        assert not cache_codes(prepared.notes), prepared.notes
print(solve(prepared).tobytes().hex())
"""


def test_processes_at_once(folder):
    start = [sys.executable, "-c", WORKER, str(Path(__file__).parent)]
    workers = [
        subprocess.Popen(start, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    outputs = [worker.communicate(timeout=300) for worker in workers]
    assert [worker.returncode for worker in workers] == [0, 0, 0], outputs
    assert len({text for text, _ in outputs}) == 1
    assert supple.cache.size().files == 2
    assert all(path.suffix == ".supple" for path in folder.iterdir())


# --- the command line -----------------------------------------------------------------------------


def command(*arguments, code=0):
    result = subprocess.run(
        [sys.executable, "-m", "supple.cli", *map(str, arguments)],
        env={**os.environ, "COLUMNS": "40"},
        capture_output=True,
        text=True,
    )
    assert result.returncode == code, result.stderr
    return result.stdout + result.stderr


@pytest.fixture
def case(tmp_path):
    points, faces = tube()
    path = tmp_path / "case"
    path.mkdir()
    meshio.write_points_cells(path / "mesh.obj", points, [("triangle", faces)])
    lift = np.eye(4)
    lift[2, 3] = 0.4
    handles = [
        {"name": "low", "vertices": list(range(16))},
        {"name": "high", "vertices": list(range(304, 320)), "matrix": lift.tolist()},
    ]
    (path / "case.json").write_text(json.dumps({"handles": handles}))
    return path


def test_edit_says_what_came_from_the_cache(case, folder, tmp_path):
    def edit(*more):
        command("edit", case, "--out", tmp_path, "--report", tmp_path / "report.json", *more)
        figures = json.loads((tmp_path / "report.json").read_text())["cases"]["case"]
        vertices = meshio.read(tmp_path / "case.obj").points.tobytes()
        return figures["from_cache"], vertices, figures["notes"]

    plain = edit("--no-cache")
    assert not folder.exists()
    first, second = edit(), edit()
    assert [first[0], second[0], edit("--no-cache")[0]] == [False, True, False]
    assert plain[1] == first[1] == second[1]
    (file,) = folder.iterdir()
    file.write_bytes(b"not what it was")
    rebuilt = edit()
    assert not rebuilt[0]
    assert [note["code"] for note in rebuilt[2]][-1] == "cache_rebuilt"
    assert rebuilt[1] == plain[1]
    assert edit()[0]


def test_cache_shows_and_clears(folder, monkeypatch):
    supple.PreparedMesh(*tube())
    shown = dict(line.split(maxsplit=1) for line in command("cache").splitlines() if line)
    assert shown["folder"] == str(folder)
    assert shown["meshes"] == "1"
    assert shown["cap"] == "2048.0 MiB"
    assert "removed  1" in command("cache", "--clear")
    assert supple.cache.size().files == 0
    monkeypatch.setenv("SUPPLE_CACHE_MAX", "lots")
    assert "SUPPLE_CACHE_MAX" in command("cache", code=1)
