# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles from a motion, and the command that estimates the motion from them."""

import json

import numpy as np
import pytest
import supple
from supple import SuppleError
from supple.cli import app
from supple.mesh_files import read_mesh, write_mesh
from supple_training.compare import shapes
from typer.testing import CliRunner

SHAPE = shapes.bumpy_torus(900)


def bent() -> np.ndarray:
    """The torus bent about y, along x: as far as it reaches, by a right angle."""
    x, y, z = SHAPE.vertices.T
    radius = np.ptp(x) / (np.pi / 2)
    angle = x / radius
    return np.stack([(radius - z) * np.sin(angle), y, radius - (radius - z) * np.cos(angle)], 1)


@pytest.fixture
def files(tmp_path):
    write_mesh(tmp_path / "before.off", SHAPE.vertices, SHAPE.faces)
    write_mesh(tmp_path / "after.off", bent(), SHAPE.faces)
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(app, ["estimate", *map(str, arguments)], env={"COLUMNS": "200"})


def test_handles_are_lists_of_vertices_of_the_mesh():
    prepared = supple.PreparedMesh(SHAPE.vertices, SHAPE.faces, cache=False)
    handles = supple.propose_motion_handles(prepared, bent(), 7)
    assert len(handles) == 7
    together = np.concatenate(handles)
    assert together.dtype == np.int32 and len(np.unique(together)) == len(together)
    single = supple.propose_motion_handles(prepared, bent(), 7, radius=0)
    assert [len(handle) for handle in single] == [1] * 7
    with pytest.raises(SuppleError) as error:
        supple.propose_motion_handles(prepared, SHAPE.vertices + np.arange(3))
    assert error.value.code == "no_handles"


def test_estimate_writes_the_pose_and_the_figures(files):
    out, path = files / "out" / "pose.off", files / "report.json"
    result = run(files / "before.off", files / "after.off", "--out", out, "--report", path)
    assert result.exit_code == 0, (result.output, result.exc_info)
    report = json.loads(path.read_text())
    assert list(report["rows"]) == ["natural", "no_network", "stiff", "arap"]
    assert report["handles"] == 16 and report["mode"] == "natural" and report["network"] is True
    posed, faces = read_mesh(out)
    truth, _ = read_mesh(files / "after.off")
    vertices, _ = read_mesh(files / "before.off")
    error = supple.pose_error(vertices, faces, posed, truth)
    assert error == pytest.approx(report["rows"]["natural"]["pose_error"], rel=1e-3)
    still = supple.pose_error(vertices, faces, vertices, truth)
    for name, row in report["rows"].items():
        assert row["pose_error"] < 0.5 * still, name
    assert "no_network" in result.output and "16 handles" in result.output


def test_the_chosen_way_is_written(files):
    poses = {}
    for name, options in {
        "natural": [],
        "no_network": ["--no-network"],
        "arap": ["--mode", "arap"],
    }.items():
        out = files / f"{name}.off"
        result = run(
            *(files / "before.off", files / "after.off", "--out", out, "--handles", 5),
            *("--report", files / f"{name}.json", *options),
        )
        assert result.exit_code == 0, (result.output, result.exc_info)
        report = json.loads((files / f"{name}.json").read_text())
        poses[name], faces = read_mesh(out)
        truth, _ = read_mesh(files / "after.off")
        error = supple.pose_error(read_mesh(files / "before.off")[0], faces, poses[name], truth)
        assert error == pytest.approx(report["rows"][name]["pose_error"], rel=1e-3)
    assert not np.array_equal(poses["natural"], poses["no_network"])


def test_errors_are_said_and_nothing_is_written(files):
    write_mesh(files / "fewer.off", SHAPE.vertices[:4], np.array([[0, 1, 2], [0, 2, 3]]))
    out = files / "pose.off"
    for target, words in {"fewer.off": "4 vertices", "missing.off": "no file"}.items():
        result = run(files / "before.off", files / target, "--out", out)
        assert result.exit_code == 1
        assert words in " ".join(result.output.split())
        assert not out.exists()
    same = run(files / "before.off", files / "before.off", "--out", out)
    assert same.exit_code == 1 and "nothing moves" in " ".join(same.output.split())
