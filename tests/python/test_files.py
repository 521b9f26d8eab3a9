# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that the commands read and write: whole or not at all, and one clear message."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import supple
from supple import files, mesh_files
from supple.cli import app
from supple.match_sets import read_indices
from supple.shape_folders import read_shapes
from typer.testing import CliRunner

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 1\n"


def refused(call, *words: str, code: str | None = None) -> None:
    with pytest.raises(supple.SuppleError) as caught:
        call()
    for word in words:
        assert word in str(caught.value)
    assert code in (None, caught.value.code)


def run(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def grid_of(across: int, along: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) places in the unit square and (m, 3) triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, across), np.linspace(0, 1, along))
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.column_stack([x.ravel(), y.ravel()]), faces


# --- writing --------------------------------------------------------------------------------------


def test_a_failed_write_leaves_what_was_there(tmp_path):
    path = tmp_path / "kept.obj"
    path.write_text("before")

    def half(partial: Path) -> None:
        partial.write_text("half")
        raise OSError(28, "No space left on device")

    refused(lambda: files.replace_whole(path, half), "kept.obj", "No space", code="cannot_write")
    assert path.read_text() == "before"
    assert os.listdir(tmp_path) == ["kept.obj"]


def test_links_and_devices_stay_what_they_are(tmp_path):
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    real.write_text("before")
    link.symlink_to(real)
    files.write_whole(link, "after")
    assert link.is_symlink()
    assert real.read_text() == "after"
    real.chmod(0o600)
    files.write_whole(real, "more")
    assert real.stat().st_mode & 0o777 == 0o600
    files.write_whole("/dev/null", "nothing")
    command = "from supple.files import write_whole; write_whole('/dev/stdout', 'through')"
    piped = subprocess.run([sys.executable, "-c", command], capture_output=True, check=True)
    assert piped.stdout == b"through"
    assert Path("/dev/null").is_char_device()


def test_places_that_cannot_be_written_are_named(tmp_path):
    (tmp_path / "file").write_text("x")
    refused(lambda: files.check_output(tmp_path / "file" / "a.map"), "is a file, not a folder")
    refused(lambda: files.check_output(tmp_path), "is a folder")
    refused(lambda: files.check_output(""), "names no file")
    twice = [tmp_path / "a", tmp_path / "sub" / ".." / "a"]
    (tmp_path / "sub").mkdir()
    refused(lambda: files.check_outputs(twice), "two outputs")
    refused(lambda: files.check_outputs([tmp_path / "file"], [tmp_path / "file"]), "is read")
    files.check_outputs([tmp_path / "new" / "a", None], [tmp_path / "file", None])


def test_commands_check_their_outputs_first(tmp_path):
    mesh = tmp_path / "a.obj"
    mesh.write_text(QUAD + "f 1 2 3\nf 1 3 4\n")
    cases = {
        "is read": ["refine", mesh, mesh, "--out", mesh],
        "two outputs": ["match", mesh, mesh, "--out", tmp_path / "o", "--report", tmp_path / "o"],
        "must end in .obj": ["match", mesh, mesh, "--out", "o", "--deformed", tmp_path / "d.foo"],
        "--map, --landmarks and --start": [
            *("refine", mesh, mesh, "--out", tmp_path / "o", "--map", mesh, "--start", "nearest")
        ],
    }
    for words, arguments in cases.items():
        done = run(*arguments)
        assert done.exit_code == 1, words
        assert words in " ".join(done.output.split()), done.output
        assert "Traceback" not in done.output
    assert mesh.read_text().startswith("v 0 0 0")
    done = run("evaluate", "match", tmp_path, "--report", tmp_path / "x.md")
    assert done.exit_code == 1
    assert "two outputs" in " ".join(done.output.split())


def test_brackets_in_paths_are_no_markup(tmp_path):
    done = run("refine", tmp_path / "n[/x].obj", tmp_path / "b.obj", "--out", tmp_path / "o.map")
    assert done.exit_code == 1
    assert "n[/x].obj" in "".join(done.output.split())


# --- meshes ---------------------------------------------------------------------------------------


def test_obj_with_seams_and_indices_that_count_backwards(tmp_path):
    path = tmp_path / "seams.obj"
    path.write_text(
        QUAD
        + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 5 5\nvt 6 6\nvt 7 7\nvn 0 0 1\n"
        + "f 1/1/1 2/2/1 3/3/1 4/4/1\nf 2/5 -1/6 3/7\n"
    )
    vertices, faces = mesh_files.read_mesh(path)
    assert vertices.shape == (5, 3)
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [1, 4, 2]]
    uvs = mesh_files.read_uvs(path)
    expected = [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]], [[5, 5], [6, 6], [7, 7]]]
    assert np.array_equal(uvs, expected)
    path.write_text(QUAD + "vt 0 0\nf 1/1 2 3\n")
    refused(lambda: mesh_files.read_uvs(path), "no texture coordinates")
    for line in ("f 1/1 2/2 3/1", "f 1/0 2/1 3/1", "vt", "v 1 2", f"f 1 2 {2**32 + 2}"):
        path.write_text(QUAD + f"vt 0 0\n{line}\n")
        refused(lambda: mesh_files.read_uvs(path), "line 7", line)
        refused(lambda: mesh_files.read_mesh(path), "line 7", line)
    path.write_bytes("\ufeff# Cr\u00e9\u00e9\n".encode() + QUAD.encode() + b"# \xe9\nf 1 2 3\n")
    assert mesh_files.read_mesh(path)[0].shape == (5, 3)
    path.write_bytes(b"\xef\xbb\xbf" + QUAD.encode() + b"f 1 2 3\n")
    assert mesh_files.read_mesh(path)[0].shape == (5, 3)


@pytest.mark.parametrize(
    ("name", "content", "word"),
    [
        ("a.obj", "", "no vertices"),
        ("a.obj", QUAD + "f 1 x 3\n", "line 6"),
        ("a.stl", "", "no vertices"),
        ("a.off", "OFF\n", "three counts"),
        ("a.off", "", "three counts"),
        ("a.ply", "ply\n", "cannot be read"),
        ("a.foo", "1", "meshio reads"),
    ],
)
def test_what_is_no_mesh_is_named(tmp_path, name, content, word, capfd):
    path = tmp_path / name
    path.write_text(content)
    refused(lambda: mesh_files.read_mesh(path), name, word, code="bad_case")
    assert capfd.readouterr() == ("", "")


def test_solids_are_no_surfaces(tmp_path):
    import meshio

    points = np.eye(4, 3)
    meshio.write_points_cells(tmp_path / "t.vtk", points, [("tetra", [[0, 1, 2, 3]])])
    refused(lambda: mesh_files.read_mesh(tmp_path / "t.vtk"), "tetra", "triangles")
    cells = [("line", [[0, 1]]), ("triangle", [[0, 1, 2]])]
    meshio.write_points_cells(tmp_path / "l.vtk", points, cells)
    assert mesh_files.read_mesh(tmp_path / "l.vtk")[1].tolist() == [[0, 1, 2]]


def test_errors_and_notes_name_the_mesh(tmp_path):
    bad = tmp_path / "bad.obj"
    bad.write_text(QUAD.replace("v 2 0 1", "v nan 0 1") + "f 1 2 3\nf 2 5 3\n")
    done = run("refine", bad, bad, "--out", tmp_path / "o.map")
    assert done.exit_code == 1
    assert "bad.obj" in "".join(done.output.split())


# --- indices and folders --------------------------------------------------------------------------


@pytest.mark.parametrize("word", ["99999999999999999999", "²", "1_0", "-1", "0", "1.0"])
def test_only_whole_numbers_are_indices(tmp_path, word):
    path = tmp_path / "a.map"
    path.write_text(f"1\n{word}\n")
    refused(lambda: read_indices(path, 20, "vertices"), "entry 2", word[:10], code="bad_set")


def test_nearest_is_as_they_lie_and_aligned_after_laying_on(tmp_path):
    rng = np.random.default_rng(0)
    grid, faces = grid_of(24, 12)
    x, y = grid.T * [[2.0], [1.0]]
    vertices = np.column_stack([x, y, 0.3 * np.sin(3 * x) * y + 0.4 * x**2])
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    mesh_files.write_mesh(tmp_path / "a.obj", vertices, faces)
    mesh_files.write_mesh(tmp_path / "far.obj", 3 * vertices @ turn + [50, 0, 0], faces)
    right = {}
    for target in ("a.obj", "far.obj"):
        for start in ("nearest", "aligned"):
            paths = tmp_path / "a.obj", tmp_path / target, "--out", tmp_path / "o.map"
            done = run("refine", *paths, "--start", start, "--no-network")
            assert done.exit_code == 0, done.output
            found = np.loadtxt(tmp_path / "o.map", dtype=int) - 1
            away = np.linalg.norm(vertices[found] - vertices, axis=1)
            right[target, start] = np.mean(away < 0.15)
    assert right["a.obj", "nearest"] > 0.95, right
    assert right["far.obj", "aligned"] > 0.95, right
    assert right["far.obj", "nearest"] < 0.5, right


def test_landmarks_are_on_the_surface(pair_of_grids):
    source, target = pair_of_grids
    loose = source.vertex_count - 1
    refused(
        lambda: supple.landmark_map(source, target, [[0, 0], [loose, 3]]),
        "Landmark 1",
        "no face",
        code="bad_option",
    )
    refused(lambda: supple.landmark_map(source, target, [[0, 1], [2]]), code="wrong_shape")


@pytest.fixture
def pair_of_grids():
    """A wavy square with one vertex more than its faces have, twice."""
    grid, faces = grid_of(12, 12)
    x, y = grid.T
    vertices = np.column_stack([x, y, 0.2 * np.sin(5 * x) * y])
    vertices = np.concatenate([vertices, [[3.0, 3.0, 3.0]]])
    return [supple.PreparedMesh(vertices, faces, cache=False) for _ in range(2)]


def test_what_is_no_number_and_no_mesh_is_named(pair_of_grids):
    source, target = pair_of_grids
    cases = {
        "counts": lambda: supple.Refiner(source, target, counts="abc"),
        "pull": lambda: supple.Refiner(source, target, pull="x"),
        "settling_rounds": lambda: supple.Refiner(source, target, settling_rounds=1.5),
        "epochs is 1.5": lambda: supple.Matcher(source, target, epochs=1.5),
        "seed": lambda: supple.Matcher(source, target, seed=[1, 2]),
        "ndarray is no mesh": lambda: supple.closest_points(source.vertices, source.vertices),
        "NoneType is no mesh": lambda: supple.closest_points(None, source.vertices),
        "source_uvs": lambda: supple.uv_map(source, target, [["a"]], [["b"]]),
    }
    for words, call in cases.items():
        refused(call, words, code="wrong_shape")


def test_a_checkpoint_beside_the_meshes_is_no_group(tmp_path):
    for i in range(2):
        (tmp_path / f"{i}.obj").write_text(QUAD + "f 1 2 3\nf 1 3 4\nf 2 5 3\n")
    (tmp_path / "x.checkpoint").mkdir()
    refused(lambda: read_shapes(tmp_path), "beside folders")
    assert len(read_shapes(tmp_path, leave_out=tmp_path / "x.checkpoint")) == 2


def test_reports_have_null_for_what_cannot_be_measured():
    from supple.cli.evaluating import _finite

    text = json.dumps(_finite({"a": [float("nan"), 1.0], "b": (float("inf"), "c")}))
    assert json.loads(text) == {"a": [None, 1.0], "b": [None, "c"]}
