# SPDX-License-Identifier: GPL-3.0-or-later
"""Sequences from a job file: whole, in parts, and killed in the middle."""

import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import bodies
import bpy
import moving
import numpy as np
import pytest

JOB = """
[input]
blend = "shot.blend"
object = "Bar"

[sequence]
frames = [5, 35]
ease = [10, 10]

[[handles]]
group = "feet"
held = true

[[handles]]
group = "head"
keys = [
  { frame = 15, translate = [0.2, 0.1, 0.0] },
  { frame = 25, translate = [0.2, 0.1, 0.1], rotate = { axis = [0, 0, 1], degrees = 20 } },
]

[output]
cache = "out/shot.pc2"
blend = "out/shot.blend"
report = "out/report.json"
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with a moving bar and a job, and the bar's frames as they were."""
    bar = bodies.add_bar()
    moving.add_armature(bar)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    (tmp_path / "job.toml").write_text(JOB)
    return tmp_path


def frames_of(path):
    """Return the samples of a PC2 file, (f, n, 3), and its first frame. Independent of ours."""
    data = Path(path).read_bytes()
    assert data[:12] == b"POINTCACHE2\0"
    points = int.from_bytes(data[16:20], "little")
    start = np.frombuffer(data[20:24], "<f4")[0]
    count = int.from_bytes(data[28:32], "little")
    samples = np.frombuffer(data[32 : 32 + 12 * points * count], "<f4")
    return samples.reshape(count, points, 3), start


def test_a_job_corrects_a_shot(addon, folder):
    bar = bpy.data.objects["Bar"]
    before = moving.every_frame(bar)
    rest = bodies.rest(bar)
    head = bodies.members(bar, "head")
    assert addon("job").main([str(folder / "job.toml")]) == 0
    samples, start = frames_of(folder / "out/shot.pc2")
    assert len(samples) == 31 and start == 5
    bpy.ops.wm.open_mainfile(filepath=str(folder / "out/shot.blend"))
    bar = bpy.data.objects["Bar"]
    for frame in moving.FRAMES:
        shown = moving.at(bar, frame)
        if 5 <= frame <= 35:
            assert np.array_equal(shown, samples[frame - 5]), frame
        if not 5 < frame < 35:
            assert np.array_equal(shown, before[frame]), frame
    motion = moving.nearest_motion(rest[head], before[15][head])
    expected = before[15][head] + motion[:3, :3] @ [0.2, 0.1, 0.0]
    assert np.abs(samples[10][head] - expected).max() < 5e-3
    report = json.loads((folder / "out/report.json").read_text())
    assert report["frames"] == [5, 35] and report["kept"] == 0
    assert report["handles"] == {"feet": "held", "head": "moved"}


def test_parts_by_several_processes_are_put_together(addon, folder):
    main = addon("job").main
    job = str(folder / "job.toml")
    for part in ("1/3", "3/3"):
        assert main([job, "--part", part]) == 0
    assert sorted(p.name for p in (folder / "out").glob("*.pc2")) == [
        "shot.1-of-3.pc2",
        "shot.3-of-3.pc2",
    ]
    assert main([job]) == 0
    assert json.loads((folder / "out/report.json").read_text())["kept"] == 10 + 11
    parts = (folder / "out/shot.pc2").read_bytes()
    for file in (folder / "out").iterdir():
        file.unlink()
    assert main([job]) == 0
    assert (folder / "out/shot.pc2").read_bytes() == parts


def test_the_objects_own_handles_and_settings_are_used(addon, folder):
    bar = bpy.data.objects["Bar"]
    bpy.ops.supple.handles_from_groups(groups="feet,head", held="feet")
    bpy.context.scene.frame_set(20)
    bpy.data.objects["head"].location = (0.3, 0, 0)
    bpy.ops.supple.sequence_key()
    bar.supple.network = False
    bpy.ops.wm.save_mainfile()
    text = JOB[: JOB.index("[[handles]]")] + JOB[JOB.index("[output]") :]
    (folder / "job.toml").write_text(text)
    before = moving.at(bar, 20)
    assert addon("job").main([str(folder / "job.toml")]) == 0
    head = bodies.members(bpy.data.objects["Bar"], "head")
    moved = np.float64(frames_of(folder / "out/shot.pc2")[0][15] - before)[head].mean(axis=0)
    assert np.linalg.norm(moved) == pytest.approx(0.3, abs=1e-4)
    assert bpy.data.objects["Bar"].supple.network is False


@pytest.mark.skipif(
    not hasattr(bpy.ops.wm, "alembic_export") or "alembic_export" not in dir(bpy.ops.wm),
    reason="this Blender is built without Alembic",
)
def test_alembic_holds_the_corrected_frames(addon, folder):
    text = JOB.replace("report =", 'alembic = "out/shot.abc"\nreport =')
    (folder / "job.toml").write_text(text)
    assert addon("job").main([str(folder / "job.toml")]) == 0
    samples, _ = frames_of(folder / "out/shot.pc2")
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.alembic_import(filepath=str(folder / "out/shot.abc"), as_background_job=False)
    mesh = next(obj for obj in bpy.data.objects if obj.type == "MESH")
    assert np.abs(moving.at(mesh, 20) - samples[15]).max() < 1e-5
    # And an Alembic cache is corrected like any other animation.
    before = moving.every_frame(mesh, range(5, 36))
    for name, vertices in (("feet", range(24)), ("head", range(180, 204))):
        bodies.add_group(mesh, name, vertices)
    bpy.context.view_layer.objects.active = mesh
    bpy.ops.supple.handles_from_groups(groups="feet,head", held="feet")
    bpy.data.objects["head"].location = (0.1, 0, 0)
    settings = mesh.supple_sequence
    settings.first, settings.last, settings.ease_in, settings.ease_out = 10, 30, 8, 8
    bpy.ops.supple.sequence_bake(file=str(folder / "again.pc2"))
    after = moving.every_frame(mesh, range(5, 36))
    for frame in range(5, 36):
        assert np.array_equal(before[frame], after[frame]) == (not 10 < frame < 30), frame


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("frames = [5, 35]", "frames = [35, 5]", "sequence.frames: ends at 5, before its start"),
        ("frames = [5, 35]", "frames = [5, 35.5]", "sequence.frames: must be 2 whole numbers"),
        ("frames = [5, 35]", "", "sequence.frames: missing"),
        ("ease = [10, 10]", "ease = [-1, 2]", "sequence.ease: must be 0 frames or more"),
        ("ease = [10, 10]", "speed = 1", "sequence.speed: unknown"),
        ("held = true", "", r"handles\[0\].group: 'feet' needs one of: held = true, keys"),
        ("frame = 15, ", "", r"handles\[1\].keys\[0\].frame: missing"),
        ('"head"', '"tail"', "no vertex group 'tail'"),
        ('cache = "out/shot.pc2"', "", "output.cache: give either cache, or shape_keys"),
        ("shot.pc2", "shot.abc", "output.cache: must end in .pc2"),
        ('object = "Bar"', 'object = "Bus"', "input.object: there is no object 'Bus'"),
        ("[output]", "[options]\nmode = 'soft'\n[output]", "options.mode: must be one of"),
        ("[output]", "[options]\nstiffness = 2\n[output]", "options.stiffness: must be 0"),
        (
            "[output]",
            "[options]\nmode = 'stiff'\nstiffness = 0.5\n[output]",
            "options.stiffness: give either mode or stiffness",
        ),
        ("report =", 'alembic = "a.usd"\nreport =', "output.alembic: must end in .abc"),
    ],
)
def test_wrong_job_files_are_refused(addon, folder, capfd, old, new, message):
    assert old in JOB
    (folder / "job.toml").write_text(JOB.replace(old, new, 1))
    assert addon("job").main([str(folder / "job.toml")]) == 1
    assert not list((folder / "out").glob("*")) if (folder / "out").exists() else True
    error = capfd.readouterr().err
    assert "Traceback" not in error
    assert re.search(message, error), error


def test_a_wrong_part_is_refused(addon, folder, capfd):
    assert addon("job").main([str(folder / "job.toml"), "--part", "3/2"]) == 1
    assert "--part: must be such as 2/4, not '3/2'" in capfd.readouterr().err


def command(addon, folder):
    """Return the command that runs the job in a process of its own."""
    script = Path(addon("job").__file__)
    job = ["-P", str(script), "--", str(folder / "job.toml")]
    if bpy.app.binary_path and Path(bpy.app.binary_path).is_file():
        return [bpy.app.binary_path, "-b", "--python-exit-code", "1", *job]
    code = (
        "import sys, bpy, runpy; sys.argv = ['job', '--', sys.argv[1]]; "
        f"runpy.run_path({str(script)!r}, run_name='__main__')"
    )
    return [sys.executable, "-c", code, str(folder / "job.toml")]


def test_a_killed_bake_leaves_every_finished_frame_and_goes_on(addon, folder):
    """SIGKILL when some frames are written, whichever; nothing here depends on how many."""
    assert addon("job").main([str(folder / "job.toml")]) == 0
    expected = [(folder / f"out/shot.pc2{s}").read_bytes() for s in ("", ".keys")]
    samples, _ = frames_of(folder / "out/shot.pc2")
    chance = random.Random(3)
    part = folder / "out/shot.pc2.part"
    for _ in range(3):
        for file in (folder / "out").iterdir():
            file.unlink()
        after = chance.randrange(1, 20)
        process = subprocess.Popen(
            command(addon, folder), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        wanted = 32 + 12 * samples.shape[1] * after
        while process.poll() is None and not (part.exists() and part.stat().st_size >= wanted):
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
        process.wait()
        left = part if part.exists() else folder / "out/shot.pc2"
        whole = frames_of(left)[0]
        assert np.array_equal(whole, samples[: len(whole)])
        assert addon("job").main([str(folder / "job.toml")]) == 0
        assert [(folder / f"out/shot.pc2{s}").read_bytes() for s in ("", ".keys")] == expected
        assert os.listdir(folder / "out") and not list((folder / "out").glob("*.part*"))
