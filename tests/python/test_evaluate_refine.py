# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets on disk, their evaluation and the commands over them; no test depends on a duration."""

import json
import shutil

import numpy as np
import pytest
import supple
from supple import SuppleError, evaluation, match_sets
from supple.cli import app
from supple.mesh_files import write_mesh
from supple_training.compare import shapes
from typer.testing import CliRunner

SOURCE = shapes.bumpy_torus(700)
N = len(SOURCE.vertices)
# An edge, in the units of the geodesic error (two faces a vertex).
EDGE = 100 / np.sqrt(N)


@pytest.fixture
def folder(tmp_path):
    """A torus and a turned, larger copy in another order; the map is right but for a tenth."""
    random = np.random.default_rng(1)
    order = random.permutation(N)
    turned = np.empty_like(SOURCE.vertices)
    turned[order] = 4.0 * SOURCE.vertices @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    for part in ("shapes", "corres", "init"):
        (tmp_path / part).mkdir()
    write_mesh(tmp_path / "shapes" / "a.off", SOURCE.vertices, SOURCE.faces)
    write_mesh(tmp_path / "shapes" / "b.off", turned, order[SOURCE.faces].astype(np.int32))
    rough = order.copy()
    near = random.random(N) < 0.1
    rough[near] = order[(np.flatnonzero(near) + 1) % N]
    points = np.arange(0, N, 3)
    np.savetxt(tmp_path / "corres" / "a.vts", points + 1, fmt="%d")
    np.savetxt(tmp_path / "corres" / "b.vts", order[points] + 1, fmt="%d")
    np.savetxt(tmp_path / "init" / "a__b.map", rough + 1, fmt="%d")
    np.savetxt(tmp_path / "init" / "b__a.map", np.argsort(order) + 1, fmt="%d")
    (tmp_path / "pairs.txt").write_text("a b\nb a\n")
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_the_report_has_the_rows_and_columns(folder, tmp_path):
    path = tmp_path / "out" / "report.json"
    result = run("evaluate", "refine", folder, "--report", path)
    assert result.exit_code == 0, (result.output, result.exc_info)
    report = json.loads(path.read_text())
    assert report["pairs"] == 2
    assert list(report["rows"]) == [
        "initial",
        "spectral_projection",
        "no_network",
        "ljn",
        "zoomout",
        "zoomout_samples",
    ]
    for name, row in report["rows"].items():
        for column in (*evaluation.COLUMNS, evaluation.SECONDS):
            assert np.isfinite(row[column])
        change = row["change_percent"]["geodesic"]
        first = report["rows"]["initial"]["geodesic"]
        assert change == pytest.approx(100 * (row["geodesic"] / first - 1)), name
    # The means are of the two pairs; the second one's map is right.
    exact = report["measured"]["b a"]["initial"]
    assert exact["geodesic"] == exact["inversion"] == 0
    assert exact["dirichlet"] == pytest.approx(2)
    assert exact["coverage"] == pytest.approx(100)
    rough = report["measured"]["a b"]["initial"]
    assert report["rows"]["initial"]["geodesic"] == pytest.approx(rough["geodesic"] / 2)
    table = path.with_suffix(".md").read_text()
    assert "| zoomout |" in table and "geodesic" in table


def test_own_methods_are_measured_like_ours(folder):
    order = match_sets.read_match_set(folder).initial["b", "a"]

    def bind(source, target):
        assert isinstance(source, supple.PreparedMesh)
        return lambda initial: np.argsort(order).astype(np.int32)

    match_set = match_sets.read_match_set(folder)
    del match_set.pairs[1:]
    made = evaluation.Evaluation(match_set, [evaluation.Method("truth", bind)], cache=False).run()
    assert made["rows"]["truth"]["geodesic"] == 0
    assert made["rows"]["truth"]["change_percent"]["geodesic"] == -100


@pytest.mark.parametrize(
    ("spoil", "parts"),
    [
        (lambda f: (f / "pairs.txt").unlink(), ["no file", "pairs.txt"]),
        (lambda f: (f / "pairs.txt").write_text("a b c\n"), ["pairs.txt", "line 1"]),
        (lambda f: (f / "pairs.txt").write_text("\n"), ["pairs.txt", "no pairs"]),
        (lambda f: (f / "shapes" / "b.off").unlink(), ["b.off"]),
        (lambda f: (f / "corres" / "a.vts").unlink(), ["no file", "a.vts"]),
        (lambda f: (f / "init" / "b__a.map").unlink(), ["no file", "b__a.map"]),
        (lambda f: (f / "corres" / "a.vts").write_text("1\n2\n"), ["a.vts has 2", "b.vts"]),
        (lambda f: (f / "init" / "a__b.map").write_text("1\n2\n"), ["a__b.map has 2", str(N)]),
        (
            lambda f: (f / "init" / "a__b.map").write_text("0\n" * N),
            ["a__b.map, entry 1", "from 1"],
        ),
        (lambda f: (f / "corres" / "b.vts").write_text("one\n"), ["b.vts, entry 1", "one"]),
    ],
)
def test_bad_sets_name_the_file(folder, spoil, parts):
    spoil(folder)
    with pytest.raises(SuppleError) as caught:
        match_sets.read_match_set(folder)
    assert caught.value.code == "bad_set"
    for part in parts:
        assert part in str(caught.value)
    assert run("evaluate", "refine", folder).exit_code == 1


def test_sets_to_match_need_no_maps(folder):
    np.savetxt(folder / "corres" / "b.mirror.vts", np.arange(1, N + 1, 3)[::-1], fmt="%d")
    with_maps = match_sets.read_match_set(folder, refine=False)
    assert with_maps.initial["a", "b"] is not None
    shutil.rmtree(folder / "init")
    found = match_sets.read_match_set(folder, refine=False)
    assert found.initial == {("a", "b"): None, ("b", "a"): None}
    assert found.shapes["a"].mirror is None
    assert np.array_equal(found.shapes["b"].mirror, np.arange(0, N, 3)[::-1])
    with pytest.raises(SuppleError, match=r"a__b\.map"):
        match_sets.read_match_set(folder)
    (folder / "corres" / "b.mirror.vts").write_text("1\n")
    with pytest.raises(SuppleError, match=r"b\.mirror\.vts has 1 lines") as caught:
        match_sets.read_match_set(folder, refine=False)
    assert caught.value.code == "bad_set"


# --- supple refine --------------------------------------------------------------------------------


def refined(folder, tmp_path, *options):
    out = tmp_path / "refined.map"
    result = run(
        "refine", folder / "shapes" / "a.off", folder / "shapes" / "b.off", "--out", out, *options
    )
    return result, out


def error_of(folder, out):
    match_set = match_sets.read_match_set(folder)
    a, b = (match_set.shapes[name] for name in "ab")
    found = np.loadtxt(out, dtype=int) - 1
    mesh = supple.Mesh(b.vertices, b.faces)
    return supple.geodesic_errors(mesh, b.template, found[a.template])[0].mean


def test_refine_from_a_map_and_from_aligned_points(folder, tmp_path):
    for options in (["--map", folder / "init" / "a__b.map"], ["--start", "aligned"]):
        result, out = refined(folder, tmp_path, *options)
        assert result.exit_code == 0, (result.output, result.exc_info)
        assert len(out.read_text().split()) == N
        assert error_of(folder, out) < EDGE, options


def test_refine_from_landmarks(folder, tmp_path):
    match_set = match_sets.read_match_set(folder)
    truth = np.argsort(match_set.initial["b", "a"])
    chosen = supple.farthest_points(SOURCE.vertices, 6)
    lines = [f"{i + 1} {truth[i] + 1}" for i in np.asarray(chosen)]
    (tmp_path / "landmarks.txt").write_text("\n".join(lines))
    result, out = refined(folder, tmp_path, "--landmarks", tmp_path / "landmarks.txt")
    assert result.exit_code == 0, (result.output, result.exc_info)
    assert error_of(folder, out) < EDGE


def test_refine_says_what_is_wrong(folder, tmp_path):
    (tmp_path / "bad.txt").write_text("1 2 3\n")
    result, out = refined(folder, tmp_path, "--landmarks", tmp_path / "bad.txt")
    assert result.exit_code == 1
    assert not out.exists()
    result, _ = refined(folder, tmp_path, "--map", tmp_path / "missing.map")
    assert result.exit_code == 1
    result, _ = refined(folder, tmp_path, "--start", "uv")
    assert result.exit_code == 1
