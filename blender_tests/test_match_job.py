# SPDX-License-Identifier: GPL-3.0-or-later
"""Background jobs that match: what they write, what they refuse, and a target that fails."""

import json
import re
import subprocess
from pathlib import Path

import bodies
import bpy
import numpy as np
import pairs
import pytest

JOB = """
[input]
blend = "scene.blend"
[match]
source = "Body"
targets = ["Scan", "Other"]
start = "nearest"
refine = false
transfer = ["uvs", "weights", "keys"]
[output]
blend = "out/carried.blend"
report = "out/report.json"
"""


@pytest.fixture
def folder(tmp_path):
    body = pairs.dress(pairs.add_lump())
    pairs.add_shuffled(body)
    pairs.add_lump("Other", 41, 23)
    bodies.add_mesh("Wire", np.eye(3), [])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    (tmp_path / "job.toml").write_text(JOB)
    return tmp_path


def run(addon, folder, text):
    (folder / "job.toml").write_text(text)
    return addon("job").main([str(folder / "job.toml")])


def check_targets(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    for name in ("Scan", "Other"):
        obj = bpy.data.objects[name]
        assert [layer.name for layer in obj.data.uv_layers] == ["Map"]
        assert [group.name for group in obj.vertex_groups] == ["up.L", "down.R"]
        assert [k.name for k in obj.data.shape_keys.key_blocks] == ["Basis", "Bend", "Half"]
        assert obj.supple_map.source == bpy.data.objects["Body"]
        uv = pairs.lump(41, 23)[0] if name == "Other" else None
        if uv is not None:
            assert np.abs(bodies.key(obj, "Bend") - pairs.bent_at(uv)).max() < 0.05


def test_to_two_targets(addon, folder):
    assert run(addon, folder, JOB) == 0
    check_targets(folder / "out/carried.blend")
    report = json.loads((folder / "out/report.json").read_text())
    assert list(report["targets"]) == ["Scan", "Other"] and report["failed"] == {}
    assert report["targets"]["Scan"]["confidence"] > 0.9
    assert report["targets"]["Scan"]["carried"] == ["1 UV map", "2 vertex groups", "2 shape keys"]


def test_a_target_that_fails_is_named_and_the_others_are_saved(addon, folder, capfd):
    assert run(addon, folder, JOB.replace('"Scan",', '"Wire", "Scan",')) == 1
    error = capfd.readouterr().err
    assert "1 target left out, the others are saved: Wire: the mesh has no faces" in error
    assert "Traceback" not in error
    check_targets(folder / "out/carried.blend")
    report = json.loads((folder / "out/report.json").read_text())
    assert list(report["failed"]) == ["Wire"] and "no faces" in report["failed"]["Wire"]


def test_landmarks_and_all_options(addon, folder):
    text = JOB.replace('["Scan", "Other"]', '["Other"]').replace(
        'start = "nearest"',
        'start = "landmarks"\nlandmarks = [[0, 0], [1, 1], [210, 300]]\nonly_active_key = true\n'
        "drivers = true\noverwrite = true",
    )
    assert run(addon, folder, text.replace('"keys"]', '"fit"]')) == 0
    bpy.ops.wm.open_mainfile(filepath=str(folder / "out/carried.blend"))
    assert "Body on Other" in bpy.data.objects


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"Body"', '"Nobody"', "match.source: there is no object 'Nobody' in the scene"),
        ('"Scan",', '"Nobody",', "match.targets: there is no object 'Nobody'"),
        ('"Scan",', '"Body",', "match.targets: 'Body' is the source"),
        ('"Scan",', '"Other",', "match.targets: 'Other' is there twice"),
        ('["Scan", "Other"]', "[]", "match.targets: must be a list of names, at least one"),
        ('"nearest"', '"luck"', "match.start: must be one of automatic, landmarks"),
        ('"nearest"', '"file"', 'match.file: must be given with start = "file"'),
        ('"nearest"', '"landmarks"\nlandmarks = [[1, 2]]', "match.landmarks: fits one target, no"),
        ('"nearest"', '"nearest"\nlandmarks = [[1, 2]]', "match.landmarks: must be given with"),
        ('"nearest"', '"landmarks"\nlandmarks = [[1]]', "match.landmarks: must be pairs"),
        (
            '"nearest"',
            '"nearest"\nepochs = 3',
            'match.epochs: may be given with start = "features"',
        ),
        ('"nearest"', '"features"\nepochs = -1', "match.epochs: must be 0 or more, not -1"),
        ('"nearest"', '"features"\nmodel = "no"', "Scan: There is no network 'no'.*; Other: There"),
        ('"uvs"', '"hair"', "match.transfer: must be some of uvs, weights, colours, keys, fit"),
        ("refine", "refined", "match.refined: unknown; the keys here are targets, source"),
        ("scene.blend", "none.blend", "input.blend: there is no file"),
        ("carried.blend", "carried", "output.blend: must end in .blend"),
        ('["Scan", "Other"]', '["Wire"]', "Wire: the mesh has no faces"),
    ],
)
def test_wrong_job_files_are_refused(addon, folder, capfd, old, new, message):
    assert old in JOB
    assert run(addon, folder, JOB.replace(old, new)) == 1
    assert not (folder / "out").exists()
    error = capfd.readouterr().err
    assert "Traceback" not in error
    assert re.search(message, error), error


@pytest.mark.skipif(not bpy.app.binary_path, reason="needs a blender to start")
def test_in_a_process_of_its_own(addon, folder):
    job = Path(addon("job").__file__)
    command = [bpy.app.binary_path, "-b", "--python-exit-code", "1", "-P", str(job), "--"]
    done = subprocess.run(
        [*command, str(folder / "job.toml")], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    check_targets(folder / "out/carried.blend")
