# SPDX-License-Identifier: GPL-3.0-or-later
"""Background jobs: what a job file does, what it refuses, and that a failure saves nothing."""

import json
import os
import re
import subprocess
from pathlib import Path

import bodies
import bpy
import numpy as np
import pytest

GROUPS = {"feet": range(24), "head": range(180, 204)}

JOB = """
[input]
mesh = "bar.obj"
up = "Y"
groups = "groups.json"

[[handles]]
group = "feet"
held = true

[[handles]]
group = "head"
translate = [0.3, 0.0, 0.1]
rotate = { axis = [0, 2, 0], degrees = 90 }

[output]
shape_key = "Wave"
blend = "out/bar.blend"
report = "out/report.json"
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with a bar as an OBJ with Y up, its groups, and a job."""
    bar = bodies.add_bar()
    lines = [f"v {x:.8g} {z:.8g} {-y:.8g}" for x, y, z in bodies.rest(bar).tolist()]
    for polygon in bar.data.polygons:
        lines.append("f " + " ".join(str(v + 1) for v in polygon.vertices))
    (tmp_path / "bar.obj").write_text("\n".join(lines) + "\n")
    groups = {name: list(vertices) for name, vertices in GROUPS.items()}
    (tmp_path / "groups.json").write_text(json.dumps(groups))
    (tmp_path / "job.toml").write_text(JOB)
    bpy.ops.wm.read_homefile(use_empty=True)
    return tmp_path


def test_z_up(addon, folder):
    bar = bodies.add_bar()
    lines = [f"v {x:.8g} {y:.8g} {z:.8g}" for x, y, z in bodies.rest(bar).tolist()]
    faces = [line for line in (folder / "bar.obj").read_text().splitlines() if line[0] == "f"]
    (folder / "bar.obj").write_text("\n".join([*lines, *faces]))
    (folder / "job.toml").write_text(JOB.replace('up = "Y"', 'up = "Z"'))
    assert addon("job").main([str(folder / "job.toml")]) == 0
    check_result(folder / "out/bar.blend")


def files(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def opened(path):
    """Open a saved file and return its only mesh object."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return next(obj for obj in bpy.data.objects if obj.type == "MESH")


def turned_head(rest_world):
    """The truth: the head turned by 90 degrees about its centre and the world's Y, then moved."""
    head = rest_world[180:204]
    x, y, z = (head - head.mean(axis=0)).T
    return np.stack([z, y, -x], axis=1) + head.mean(axis=0) + [0.3, 0.0, 0.1]


def check_result(path):
    bar = opened(path)
    rest, wave = (bodies.to_world(bar, bodies.key(bar, name)) for name in ("Basis", "Wave"))
    assert len(rest) == 204
    assert np.isclose(rest[:, 2].max(), bodies.HEIGHT, atol=1e-6)  # Y up became Z up
    assert np.array_equal(wave[:24], rest[:24])
    assert np.allclose(wave[180:204], turned_head(rest), atol=1e-5)
    assert bar.data.shape_keys.key_blocks["Wave"].value == 1.0
    assert [group.name for group in bar.vertex_groups] == ["feet", "head"]


def test_mesh_file_to_blend_and_report(addon, folder):
    assert addon("job").main([str(folder / "job.toml")]) == 0
    assert files(folder) == [
        "bar.obj",
        "groups.json",
        "job.toml",
        "out/bar.blend",
        "out/report.json",
    ]
    report = json.loads((folder / "out/report.json").read_text())
    assert report["vertices"] == 204
    assert report["handles"] == {"feet": "held", "head": "moved"}
    assert report["shape_key"] == "Wave"
    assert report["figures"]["handle_error"] <= 1e-6
    check_result(folder / "out/bar.blend")


def test_out_moves_relative_outputs_and_nothing_else(addon, folder):
    other = folder / "elsewhere"
    assert addon("job").main([str(folder / "job.toml"), "--out", str(other)]) == 0
    assert (other / "out/bar.blend").is_file() and not (folder / "out").exists()


def test_twice_gives_the_same_shape(addon, folder):
    waves = []
    for _ in range(2):
        assert addon("job").main([str(folder / "job.toml")]) == 0
        waves.append(bodies.key(opened(folder / "out/bar.blend"), "Wave"))
    assert np.array_equal(*waves)


def save_bar(path):
    bar = bodies.add_bar()
    bar.location = (5, 0, 0)
    bar.scale = (1, 2, 1)
    bodies.add_mesh("Other", np.eye(3), [(0, 1, 2)])
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


OBJECT_JOB = """
[input]
blend = "scene.blend"
object = "Bar"
[[handles]]
group = "feet"
held = true
[[handles]]
group = "head"
matrix = [[1, 0, 0, 0.5], [0, 1, 0, 0.25], [0, 0, 1, 0], [0, 0, 0, 1]]
[options]
mode = "stiff"
network = false
[output]
shape_key = "Wave"
blend = "posed.blend"
"""


def check_object_result(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    bar = bpy.data.objects["Bar"]
    rest, wave = (bodies.to_world(bar, bodies.key(bar, name)) for name in ("Basis", "Wave"))
    assert np.allclose(wave[180:204], rest[180:204] + np.array([0.5, 0.25, 0]), atol=1e-5)
    assert bpy.data.objects["Other"].data.shape_keys is None


def test_object_of_a_blend_by_a_world_matrix(addon, tmp_path):
    save_bar(tmp_path / "scene.blend")
    (tmp_path / "job.toml").write_text(OBJECT_JOB)
    assert addon("job").main([str(tmp_path / "job.toml")]) == 0
    check_object_result(tmp_path / "posed.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert bpy.data.objects["Bar"].data.shape_keys is None


def test_object_of_the_open_file_saved_over_itself(addon, tmp_path):
    save_bar(tmp_path / "scene.blend")
    text = OBJECT_JOB.replace('blend = "scene.blend"', "").replace("posed.blend", "scene.blend")
    (tmp_path / "job.toml").write_text(text)
    assert addon("job").main([str(tmp_path / "job.toml")]) == 0
    check_object_result(tmp_path / "scene.blend")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[output]", "[output]\nbackup = true", "job.toml: output.backup: unknown; the keys here"),
        ("[input]", "[inputs]", "job.toml: inputs: unknown"),
        ("held = true", 'held = "yes"', r"handles\[0\].held: must be a true or false, not 'yes'"),
        ("held = true", "", r"handles\[0\].group: 'feet' needs one of: held = true, matrix"),
        ("held = true", "held = true\nweight = 0", r"handles\[0\].weight: must be more than 0"),
        ("degrees = 90", "degrees = true", r"handles\[1\].rotate.degrees: must be a number"),
        ("[0, 2, 0]", "[0, 0, 0]", r"handles\[1\].rotate.axis: .* not all 0"),
        ("[0.3, 0.0, 0.1]", "[0.3, 0.0]", r"handles\[1\].translate: must be 3 finite numbers"),
        ("[0.3, 0.0, 0.1]", "[0.3, nan, 0]", r"handles\[1\].translate: must be 3 finite numbers"),
        ('group = "head"', 'group = "feet"', r"handles\[1\].group: 'feet' is there twice"),
        ('group = "head"', 'group = "tail"', "no vertex group 'tail'"),
        ("bar.obj", "foo.obj", r"input.mesh: there is no file .*foo.obj"),
        ('up = "Y"', 'up = "X"', "input.up: must be one of Y, Z, not 'X'"),
        ('up = "Y"', 'object = "Bar"', "input.mesh: give either mesh, or blend and object"),
        ("out/bar.blend", "out/bar.obj", "output.blend: must end in .blend"),
        ('shape_key = "Wave"', "", "output.shape_key: missing"),
        ('shape_key = "Wave"', "shape_key = 1", "output.shape_key: must be a text, not 1"),
        ("[output]", "[options]\nmode = 'soft'\n[output]", "options.mode: must be one of natural"),
        ("[input]", "[input", "not a TOML file"),
        (
            "translate = [0.3, 0.0, 0.1]\nrotate = { axis = [0, 2, 0], degrees = 90 }",
            "matrix = [[0,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
            r"handles\[1\].matrix: flattens group 'head'",
        ),
        ("[output]", "[render]\nsize = [1, 1]\n[output]", "render.size: must be"),
    ],
)
def test_wrong_job_files_are_refused(addon, folder, capfd, old, new, message):
    assert old in JOB
    (folder / "job.toml").write_text(JOB.replace(old, new))
    before = files(folder)
    assert addon("job").main([str(folder / "job.toml")]) == 1
    assert files(folder) == before
    error = capfd.readouterr().err
    assert "Traceback" not in error
    assert re.search(message, error), error


@pytest.mark.parametrize(
    ("groups", "message"),
    [
        ({"feet": [0, 204], "head": [5]}, "'feet' in .* has vertex 204, but bar has vertices 0 to"),
        ({"feet": [0, -1], "head": [5]}, "has vertex -1"),
        ({"feet": [0.5], "head": [5]}, "'feet' in .* must be a list of integers"),
        ({"feet": [], "head": [5]}, "vertex group 'feet' has no vertices"),
        ({"feet": [5, 6], "head": [5]}, "1 vertex is in both 'feet' and 'head'"),
        ([1, 2], "must hold"),
    ],
)
def test_wrong_groups_are_refused(addon, folder, capfd, groups, message):
    (folder / "groups.json").write_text(json.dumps(groups))
    assert addon("job").main([str(folder / "job.toml")]) == 1
    assert not (folder / "out").exists()
    assert re.search(message, capfd.readouterr().err)


def test_groups_that_would_be_shifted_are_refused(addon, folder, capfd):
    text = (folder / "bar.obj").read_text()
    (folder / "bar.obj").write_text("v 9 9 9\n" + text)
    assert addon("job").main([str(folder / "job.toml")]) == 1
    assert "has 205 vertices, but Blender imports only the 204" in capfd.readouterr().err


def test_missing_job_file(addon, tmp_path, capfd):
    assert addon("job").main([str(tmp_path / "none.toml")]) == 1
    assert "none.toml: can't be read" in capfd.readouterr().err


def test_what_is_there_already_survives_a_failure(addon, folder, capfd):
    """The report can't be written, after the .blend was: the old .blend must still be there."""
    assert addon("job").main([str(folder / "job.toml")]) == 0
    before = (folder / "out/bar.blend").read_bytes()
    (folder / "out/report.json").unlink()
    (folder / "out/report.json").mkdir()
    assert addon("job").main([str(folder / "job.toml")]) == 1
    assert (folder / "out/bar.blend").read_bytes() == before
    assert sorted(os.listdir(folder / "out")) == ["bar.blend", "report.json"]
    assert "report.json" in capfd.readouterr().err


def pixels(path):
    image = bpy.data.images.load(str(path))
    array = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return array


def test_pictures_before_and_after(addon, folder):
    render = (
        '[render]\nbefore = "out/before.png"\nafter = "out/after.png"\nsize = [80, 120]\n'
        "samples = 4\n"
    )
    (folder / "job.toml").write_text(JOB + render)
    assert addon("job").main([str(folder / "job.toml")]) == 0
    before, after = (pixels(folder / "out" / name) for name in ("before.png", "after.png"))
    assert before.shape == after.shape == (120, 80, 4)
    for picture in (before, after):
        background = picture[0, 0, :3]
        seen = np.abs(picture[..., :3] - background).max(axis=-1) > 0.1
        assert seen.mean() > 0.05  # the body is in the frame
        edge = np.concatenate([seen[0], seen[-1], seen[:, 0], seen[:, -1]])
        assert not edge.any()  # all of it
    assert (np.abs(before - after).max(axis=-1) > 0.1).mean() > 0.02
    bpy.ops.wm.open_mainfile(filepath=str(folder / "out/bar.blend"))
    assert [scene.name for scene in bpy.data.scenes] == ["Scene"]
    assert not [obj.name for obj in bpy.data.objects if obj.name.startswith("Supple")]


needs_binary = pytest.mark.skipif(not bpy.app.binary_path, reason="bpy has no program to start")


def start(addon, *arguments):
    job = Path(addon("job").__file__)
    return subprocess.run(
        [bpy.app.binary_path, "-b", "--python-exit-code", "1", "-P", job, "--", *arguments],
        capture_output=True,
        text=True,
        timeout=300,
    )


@needs_binary
def test_as_a_process_of_its_own(addon, folder):
    result = start(addon, folder / "job.toml")
    assert result.returncode == 0, result.stderr
    assert "Supple: wrote" in result.stdout
    check_result(folder / "out/bar.blend")


@needs_binary
def test_failing_process_says_why_and_exits_with_1(addon, folder):
    (folder / "bar.obj").write_text("v 0 0 0\nv 1 0 0\n")
    result = start(addon, folder / "job.toml")
    assert result.returncode == 1
    assert "Supple: " in result.stderr and "Traceback" not in result.stderr
    assert not (folder / "out").exists()


@pytest.mark.skipif(bpy.app.version < (4, 2, 0), reason="--command came with 4.2")
def test_command_line_command_is_registered(package, folder):
    import importlib

    module = importlib.import_module(package)
    assert module._cli_commands
    assert module._run_command([str(folder / "job.toml")]) == 0
    check_result(folder / "out/bar.blend")
