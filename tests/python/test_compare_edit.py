# SPDX-License-Identifier: GPL-3.0-or-later
"""The comparison of edits: figures with known values, verdicts that planted results must get, and
cases that are made. No test depends on how long anything takes."""

import json
from functools import partial

import numpy as np
import pytest

pytest.importorskip("igl", reason="libigl is not installed; pip install ./training")

import igl
import supple
from supple.cases import EditCase, read_case
from supple_training import edit_cases, motions, tubes
from supple_training.compare import shapes
from supple_training.compare.__main__ import app
from supple_training.compare.contender import Contender, NotAvailable
from supple_training.compare.edits import (
    contenders,
    figures,
    measure,
    pictures,
    raster,
    report,
    summary,
)
from typer.testing import CliRunner

ITERATIONS = 30
TORUS = shapes.bumpy_torus(400)
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def torus_case(truth=None) -> EditCase:
    """One end held, the other lifted and turned a little."""
    held, lifted = shapes.two_ends(TORUS.vertices)
    lift = np.eye(4)
    lift[2, 3] = 0.2
    handles = [supple.Handle("held", held), supple.Handle("lifted", lifted, matrix=lift)]
    return EditCase("torus", TORUS.vertices, TORUS.faces, handles, truth)


def measured(case: EditCase, table) -> dict[str, dict]:
    settings = measure.Settings(runs=1, iterations=ITERATIONS)
    rows, _ = measure.measure_case(case, table, settings, supple.load_model("rotation"))
    return rows


def fixed(name: str, vertices: np.ndarray, *, ours: bool = True) -> Contender:
    """A contender that always answers with these vertices."""

    def setup(*_) -> contenders.Work:
        return contenders.Work(lambda: vertices, stages=lambda: iter([(0, 0.1, vertices)]))

    return Contender(name, setup, ours=ours)


def as_cases(rows: dict[str, dict], count: int = 1, handles: int = 2) -> dict[str, dict]:
    return {f"case{i}": {"rows": rows, "handles": handles} for i in range(count)}


def verdict(made: dict, beginning: str) -> str:
    return next(v["verdict"] for v in made["verdicts"] if v["what"].startswith(beginning))


# --- figures --------------------------------------------------------------------------------------


def test_a_rigid_motion_gives_zeros():
    moved = TORUS.vertices @ TURN.T + [1.0, 2.0, 3.0]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = TURN, [1.0, 2.0, 3.0]
    handle = supple.Handle("all of it", np.arange(50), matrix=matrix)
    found = figures.figures(EditCase("", TORUS.vertices, TORUS.faces, [handle], moved), moved)
    assert found.pop("volume_ratio") == pytest.approx(1)
    assert all(value == pytest.approx(0, abs=1e-9) for value in found.values()), found
    assert figures.ArapEnergy(TORUS.vertices, TORUS.faces)(moved) == pytest.approx(0, abs=1e-9)


def test_volume_goes_with_the_cube_of_the_size_and_needs_a_closed_mesh():
    grown = figures.volume_ratio(TORUS.vertices, TORUS.faces, 2 * TORUS.vertices)
    assert grown == pytest.approx(8)
    assert figures.volume_ratio(TORUS.vertices, TORUS.faces[1:], TORUS.vertices) is None


def test_new_defects_are_those_that_the_library_counts():
    rng = np.random.default_rng(3)
    moved = TORUS.vertices + rng.normal(0, 0.02, TORUS.vertices.shape)
    moved[TORUS.faces[0]] = moved[TORUS.faces[0, 0]]
    over, degenerate = figures.new_defects(TORUS.vertices, TORUS.faces, moved)
    assert over > 5 and degenerate >= 1
    total = supple.flipped_faces(TORUS.vertices, TORUS.faces, moved)
    assert total <= over + degenerate <= total + degenerate  # a face may be both
    assert figures.new_defects(moved, TORUS.faces, moved)[0] == 0


def test_arap_energy_is_its_definition():
    rest, faces = TORUS.vertices, TORUS.faces
    moved = rest + np.random.default_rng(4).normal(0, 0.02, rest.shape)
    total = 0.0
    for i in range(len(rest)):
        before, after, weights = [], [], []
        for face in faces[(faces == i).any(axis=1)]:
            for k in range(3):
                a, b, c = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
                u, v = rest[b] - rest[a], rest[c] - rest[a]
                weights.append(u @ v / np.linalg.norm(np.cross(u, v)) / 2)
                before.append(rest[c] - rest[b])
                after.append(moved[c] - moved[b])
        before, after, weights = np.array(before), np.array(after), np.array(weights)
        u, _, vt = np.linalg.svd((weights[:, None] * before).T @ after)
        sign = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
        total += weights @ np.sum((after - before @ (u @ sign @ vt)) ** 2, axis=1)
    area = igl.doublearea(rest, faces.astype(np.int64)).sum() / 2
    assert figures.ArapEnergy(rest, faces)(moved) == pytest.approx(total / area, rel=1e-9)


# --- contenders -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rows() -> dict[str, dict]:
    return measured(torus_case(), contenders.table(ITERATIONS))


def test_all_hold_their_handles_and_libigl_lowers_the_energy_it_is_judged_by(rows):
    present = {name: row for name, row in rows.items() if row["status"] == measure.MEASURED}
    assert present.keys() >= {
        contenders.ARAP,
        contenders.NATURAL,
        contenders.NO_NETWORK,
        contenders.STIFF,
    }
    for row in present.values():
        assert row["handle_error"] < 1e-6
        assert row["pose_error"] is None
    energies = [energy for *_, energy in rows[contenders.ARAP]["trace"]]
    assert energies == sorted(energies, reverse=True)
    assert rows[contenders.ARAP]["trace"][-1][0] == ITERATIONS
    assert rows[contenders.ARAP]["converged_seconds"] <= rows[contenders.ARAP]["solve_seconds"]


def test_what_cannot_be_had_is_reported_and_leaves_the_others_alone():
    def fails_with(error):
        def setup(*_):
            raise error

        return setup

    table = (
        Contender("no package", fails_with(ImportError("no module 'peer'"))),
        Contender("other build", fails_with(NotAvailable("Editor.solve(mode='new')"))),
        Contender("broken", fails_with(RuntimeError("did not factor"))),
        Contender("unknown mode", partial(contenders._supple, mode="no such mode"), ours=True),
        fixed("good", TORUS.vertices),
    )
    found = measured(torus_case(), table)
    assert [row["status"] for row in found.values()] == [
        "not installed",
        "not available in this build",
        "failed",
        "not available in this build",
        measure.MEASURED,
    ]
    assert found["good"]["converged_seconds"] is None
    cases = {"torus": {"rows": found, "handles": 2, "vertices": 400, "truth": False}}
    result = summary.summary(cases, ["good"])
    made = report.document(cases, {}, result, measure.Settings(), commit=None)
    text = report.markdown(made, [])
    assert "no package: not installed: no module 'peer'" in text
    assert "other build: not available in this build" in text
    assert verdict(result, "stiff: distortion") == summary.UNJUDGED
    assert report.exit_code(made) == 1  # one is broken
    lift = 0.2 / figures.diagonal(TORUS.vertices)
    assert found["good"]["handle_error"] == pytest.approx(lift)


def test_growing_effort_is_tried_with_the_first_option_that_there_is(monkeypatch):
    monkeypatch.setattr(contenders, "CHECKPOINTS", (1, 2, 4))
    setup = partial(contenders._supple, mode="stiff", growing=("no_such_option", "passes"))
    row = measured(torus_case(), [Contender("ours", setup, ours=True)])["ours"]
    assert [iterations for iterations, *_ in row["trace"]] == [0, 1, 2, 4]
    assert row["arap_energy"] == row["trace"][0][2]


def test_a_planted_bad_result_ranks_last_and_misses_the_targets(rows):
    assert verdict(summary.summary(as_cases(rows), [contenders.STIFF]), "ours") == summary.MET
    noise = np.random.default_rng(5).normal(0, 0.05, TORUS.vertices.shape)
    bad = measured(torus_case(), [fixed(contenders.STIFF, TORUS.vertices + noise)])
    result = summary.summary(as_cases(rows | bad), [contenders.STIFF])
    assert list(result["contenders"])[-1] == contenders.STIFF
    for what in ("stiff: distortion", "stiff: newly", "ours: largest"):
        assert verdict(result, what) == summary.MISSED


def test_the_truth_itself_has_no_pose_error_and_meets_the_aim(rows):
    moved = TORUS.vertices * [1.0, 1.0, 1.1]
    truth = torus_case(moved)
    table = [fixed(contenders.ARAP, TORUS.vertices), fixed(contenders.NATURAL, moved)]
    table.append(fixed(contenders.NO_NETWORK, (moved + TORUS.vertices) / 2))
    found = measured(truth, table)
    assert found[contenders.NATURAL]["pose_error"] == 0
    assert found[contenders.ARAP]["pose_error"] > 0
    result = summary.summary(as_cases(found, 3), [])
    assert verdict(result, "natural: pose") == summary.AIM_MET
    assert result["contenders"][contenders.NATURAL]["pose_error_ratio_by_handles"] == {"2": 0}
    assert result["network"]["gain"] == result["network"]["low"] == 1


def test_network_gain_is_the_ratio_of_means_and_its_interval_holds_it():
    rng = np.random.default_rng(6)
    cases = {}
    for i, without in enumerate(rng.uniform(1, 3, 20)):
        near = without * (0.9 + rng.normal(0, 0.02))
        row = {"status": measure.MEASURED}
        cases[str(i)] = {
            "rows": {
                contenders.NATURAL: {**row, "pose_error": near},
                contenders.NO_NETWORK: {**row, "pose_error": without},
            },
            "handles": 8,
        }
    gain = summary.network_gain(cases)
    assert gain["low"] < gain["gain"] < gain["high"]
    assert gain["gain"] == pytest.approx(0.1, abs=0.02)
    assert gain["high"] - gain["low"] < 0.04
    assert summary.network_gain({"one": cases["0"]})["low"] is None
    assert summary.network_gain({}) is None


# --- pictures -------------------------------------------------------------------------------------


def test_what_is_nearer_hides_what_is_behind_it():
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    points = np.concatenate([square, 0.5 * square + [0, 0, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    colours = np.array([[1.0, 0, 0]] * 2 + [[0, 0, 1.0]] * 2)
    view = raster.Camera(np.eye(3), np.zeros(2), np.array([4.0, 4.0]))
    for order in (slice(None), slice(None, None, -1)):
        image = raster.render(points, faces[order], colours[order], view, 64)
        assert image.shape == (64, 64, 4)
        assert image[..., 3].sum() == pytest.approx(32 * 32)
        assert image[32, 32, 2] > image[32, 32, 0]  # the small one in front
        assert image[32, 20, 0] > image[32, 20, 2]
        assert image[4, 4, 3] == 0


# --- the command ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def case_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cases")
    case = torus_case()
    about = {"origin": "a test"}
    made = edit_cases.Made("torus", case.vertices, case.faces, case.handles)
    edit_cases.write_case(made, folder / "torus", about)
    posed = supple.edit(case.vertices, case.faces, case.handles).vertices
    handles = [
        supple.Handle(h.name, h.vertices, positions=posed[np.asarray(h.vertices)])
        for h in case.handles
    ]
    made = edit_cases.Made("known", case.vertices, case.faces, handles, posed)
    edit_cases.write_case(made, folder / "known", about)
    return folder


def test_command_writes_the_layout_of_reports_with_pictures(case_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "PIXELS", 120)
    arguments = ["edit", case_folder, "--out", tmp_path, "--runs", 1, "--iterations", 20]
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert done.exception is None or isinstance(done.exception, SystemExit), done.output
    made = json.loads((tmp_path / "edit.json").read_text())
    assert made["schema"] == report.SCHEMA
    assert done.exit_code == report.exit_code(made)
    layout = {
        "symmetric_dirichlet",
        "flipped_faces",
        "handle_error",
        "pose_error",
        "prepare_seconds",
        "frame_milliseconds",
    }
    for contender in (contenders.ARAP, contenders.NATURAL, contenders.STIFF):
        for name, row in made["contenders"][contender]["cases"].items():
            assert layout <= row.keys()
            assert (row["pose_error"] is None) == (name == "torus")
    assert made["cases"] == made["contenders"][contenders.NATURAL]["cases"]
    assert made["cases"].keys() == {"known", "torus"}
    assert made["cases"]["known"]["pose_error"] < 0.1
    for name in ("known", "torus"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert f"![{name}]({name}.png)" in (tmp_path / "edit.md").read_text()


def test_command_says_what_is_wrong_with_folders(tmp_path, case_folder, monkeypatch):
    monkeypatch.delenv("SUPPLE_DATA", raising=False)

    def says(*arguments: object) -> str:
        done = CliRunner().invoke(app, ["edit", *map(str, arguments)], env={"COLUMNS": "200"})
        assert done.exit_code == 2
        return done.output

    assert "SUPPLE_DATA" in says()
    assert "no edit case" in says(tmp_path)
    assert "two cases" in says(case_folder, case_folder / "torus")
    assert "there is no 'x'" in says(case_folder, "--only", "x")


# --- making cases ---------------------------------------------------------------------------------


def test_tubes_are_closed_point_outwards_and_can_be_posed(tmp_path):
    arguments = [str(tmp_path), "--count", "2", "--motion", "bend90,elbow120"]
    done = CliRunner().invoke(edit_cases.app, arguments)
    assert done.exit_code == 0, done.output
    found = [read_case(folder) for folder in measure.case_folders([tmp_path])]
    assert [case.name for case in found] == [
        *("bend90_00", "bend90_01", "elbow120_00", "elbow120_01")
    ]
    for case in found:
        assert supple.Mesh(case.vertices, case.faces).notes == []
        assert igl.centroid(case.vertices, case.faces.astype(np.int64))[1] > 0  # the volume
        held, moved = case.handles
        degrees = 90 if case.name.startswith("bend") else 120
        turn = np.asarray(moved.matrix)[:3, :3]
        assert np.trace(turn) == pytest.approx(1 + 2 * np.cos(np.radians(degrees)))
        assert len(held.vertices) > 100 and len(moved.vertices) > 100
        assert case.truth is None


def test_same_seed_same_tube():
    one, again, other = (edit_cases.tube_case(seed, 0, "bend90") for seed in (1, 1, 2))
    assert (one.vertices == again.vertices).all() and (one.faces == again.faces).all()
    assert np.abs(one.vertices - other.vertices).max() > 1e-3


def test_a_bend_keeps_the_length_of_the_axis():
    _, _, (_, moved) = tubes.bend(np.random.default_rng(1), square=False)
    start, end = np.array([0, tubes.HELD, 0]), np.asarray(moved.matrix) @ [0, 1 - tubes.HELD, 0, 1]
    chord = np.linalg.norm(end[:3] - start)
    assert chord == pytest.approx(2 * (1 - 2 * tubes.HELD) / (np.pi / 2) * np.sin(np.pi / 4))


@pytest.mark.slow
def test_body_cases_have_their_handles_at_the_truth():
    pytest.importorskip("anny")
    made = list(edit_cases.body_cases(0, 0, sorted(motions.MOTIONS), [8, 16], 2000))
    assert [case.name for case in made] == [
        f"{name}_00_{count}" for name in sorted(motions.MOTIONS) for count in (8, 16)
    ]
    for case in made:
        assert len(case.handles) == int(case.name.rsplit("_", 1)[1])
        assert np.ptp(case.vertices[:, 1]) > 0.9 * np.ptp(case.vertices, axis=0).max()  # Y up
        for handle in case.handles:
            assert (handle.positions == case.truth[handle.vertices]).all()
        assert supple.pose_error(case.vertices, case.faces, case.vertices, case.truth) > 1
