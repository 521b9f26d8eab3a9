# SPDX-License-Identifier: GPL-3.0-or-later
"""The comparison of sequences: figures beside NumPy's own, files that are refused in words, and
sequences that are made. No test depends on how long anything takes."""

import json
import re
import struct
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("anny", reason="anny is not installed; pip install ./training")
pytest.importorskip("igl", reason="libigl is not installed; pip install ./training")

import igl
import supple
from supple_training import creatures, motions, sequence_cases, sequences
from supple_training.bodies import rotation
from supple_training.compare import shapes
from supple_training.compare.__main__ import app
from supple_training.compare.contender import Contender
from supple_training.compare.edits import contenders as edits
from supple_training.compare.edits import summary as edit_summary
from supple_training.compare.edits.measure import MEASURED
from supple_training.compare.edits.report import exit_code
from supple_training.compare.sequences import (
    contenders,
    figures,
    measure,
    pictures,
    report,
    summary,
)
from supple_training.creatures.families import FAMILIES
from supple_training.creatures.poses import sample_gait
from typer.testing import CliRunner

ITERATIONS = 15
FRAMES = 5
SIZE = 1500
TORUS = shapes.bumpy_torus(400)


def twisted() -> np.ndarray:
    """A torus that is twisted about x, forth and back: (frames, n, 3)."""
    x, y, z = TORUS.vertices.T
    angle = np.sin(np.linspace(0, np.pi, FRAMES))[:, None] * 1.5 * x
    turned = (np.cos(angle) * y - np.sin(angle) * z, np.sin(angle) * y + np.cos(angle) * z)
    return np.stack([np.broadcast_to(x, angle.shape), *turned], axis=2)


def write_torus(folder, truth=None, **options):
    """A sequence of the torus with a few handles."""
    truth = twisted() if truth is None else truth
    moving = (TORUS.vertices, TORUS.faces, truth)
    sequence_cases.write_sequence(folder, moving, options.get("count", 6), {"origin": "a test"})
    return folder


@pytest.fixture(scope="module")
def torus(tmp_path_factory) -> sequences.Sequence:
    return sequences.read_sequence(write_torus(tmp_path_factory.mktemp("sequences") / "torus"))


def pose_error(rest: np.ndarray, faces: np.ndarray, posed: np.ndarray, truth: np.ndarray) -> float:
    """Its definition: each face's area times the mean of its corners' squared distances."""
    areas = igl.doublearea(rest, faces.astype(np.int64)) / 2
    squares = ((posed - truth) ** 2).sum(axis=1)[faces].mean(axis=1)
    return 100 * np.sqrt((areas @ squares) / areas.sum() / areas.sum())


def acceleration_error(rest, faces, posed, truth) -> float:
    """Its definition, in loops."""
    size = np.sqrt(igl.doublearea(rest, faces.astype(np.int64)).sum() / 2)
    found = []
    for t in range(1, len(truth) - 1):
        for i in range(len(rest)):
            own = posed[t + 1, i] - 2 * posed[t, i] + posed[t - 1, i]
            true = truth[t + 1, i] - 2 * truth[t, i] + truth[t - 1, i]
            found.append(100 * np.linalg.norm(own - true) / size)
    return float(np.mean(found))


# --- files ----------------------------------------------------------------------------------------


def test_a_sequence_comes_back_with_its_handles_at_the_truth(torus):
    assert torus.case.name == "torus"
    assert np.allclose(torus.case.vertices, TORUS.vertices)
    assert (torus.case.faces == TORUS.faces).all()
    assert np.abs(torus.truth - twisted()).max() < 1e-7  # single precision
    assert len(torus.case.handles) == 6
    for frame in range(FRAMES):
        for handle in torus.handles(frame):
            assert (handle.positions == torus.truth[frame][handle.vertices]).all()


def test_a_point_cache_has_the_layout_that_others_read(tmp_path):
    positions = np.arange(24, dtype=np.float64).reshape(2, 4, 3)
    sequences.write_pc2(tmp_path / "a.pc2", positions)
    content = (tmp_path / "a.pc2").read_bytes()
    assert content[:12] == b"POINTCACHE2\0"
    assert struct.unpack("<ii", content[12:20]) == (1, 4)
    assert struct.unpack("<i", content[28:32]) == (2,)
    assert struct.unpack("<24f", content[32:]) == tuple(range(24))
    assert (sequences.read_pc2(tmp_path / "a.pc2") == positions).all()


def _cut(folder):
    path = folder / "frames.pc2"
    path.write_bytes(path.read_bytes()[:-4])


def _no_cache(folder):
    (folder / "frames.pc2").write_bytes(b"something else, and long enough for a header")


def _version(folder):
    path = folder / "frames.pc2"
    content = bytearray(path.read_bytes())
    content[12:16] = struct.pack("<i", 2)
    path.write_bytes(content)


def _not_finite(folder):
    path = folder / "frames.pc2"
    content = bytearray(path.read_bytes())
    frames, points, _ = twisted().shape
    at = len(content) - 12 * points * (frames - 3) + 12 * 7
    content[at : at + 4] = struct.pack("<f", np.nan)
    path.write_bytes(content)


def _handles(*handles):
    def change(folder):
        (folder / "case.json").write_text(json.dumps({"handles": list(handles)}))

    return change


HELD = {"name": "a", "vertices": [0]}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda folder: (folder / "frames.pc2").unlink(), "There is no file .*frames.pc2"),
        (lambda folder: (folder / "mesh.obj").unlink(), "There is no file .*mesh.obj"),
        (_no_cache, "no point cache"),
        (_version, "version 2"),
        (_cut, "promises 5 frames of .* points and has only 4"),
        (_not_finite, "sample 3 has a position that is not finite"),
        (
            lambda folder: sequences.write_pc2(folder / "frames.pc2", twisted()[:, 1:]),
            "they must be the same vertices",
        ),
        (
            lambda folder: sequences.write_pc2(folder / "frames.pc2", twisted()[:2]),
            "has 2 frames; accelerations need 3 or more",
        ),
        (_handles(), "has no handles"),
        (_handles({**HELD, "positions": [[0, 0, 0]]}), "'a' has targets of its own"),
        (_handles({**HELD, "vertices": [100000]}), "'a' has a vertex outside 0 to"),
    ],
)
def test_what_is_wrong_with_a_folder_is_said(tmp_path, change, words):
    folder = write_torus(tmp_path / "torus")
    change(folder)
    with pytest.raises(supple.SuppleError, match=re.compile(words, re.DOTALL)) as caught:
        sequences.read_sequence(folder)
    assert caught.value.code == "bad_case"


# --- figures --------------------------------------------------------------------------------------


def test_the_truth_has_no_error_and_figures_are_their_definitions(torus):
    found = figures.figures(torus, torus.truth)
    assert found["pose_error"] == found["acceleration_error"] == found["handle_error"] == 0
    rng = np.random.default_rng(1)
    posed = torus.truth + rng.normal(0, 0.01, torus.truth.shape)
    found = figures.figures(torus, posed)
    rest, faces = torus.case.vertices, torus.case.faces
    near = [pose_error(rest, faces, *pair) for pair in zip(posed, torus.truth, strict=True)]
    assert found["pose_errors"] == pytest.approx(near)
    assert found["pose_error"] == pytest.approx(np.mean(near))
    expected = acceleration_error(rest, faces, posed, torus.truth)
    assert found["acceleration_error"] == pytest.approx(expected)
    assert len(found["acceleration_errors"]) == FRAMES - 2


def test_a_steady_drift_is_no_acceleration_but_a_jump_is(torus):
    drift = torus.truth + np.arange(FRAMES)[:, None, None] * [0.1, -0.2, 0.3]
    assert figures.figures(torus, drift)["acceleration_error"] == pytest.approx(0, abs=1e-9)
    jump = torus.truth.copy()
    jump[2] += [0.03, 0.04, 0.0]
    found = figures.figures(torus, jump)["acceleration_errors"]
    # The area is 1: the jumping frame is felt twice, those beside it once.
    assert found == pytest.approx([5, 10, 5], rel=1e-6)


# --- contenders and summary -----------------------------------------------------------------------


def test_every_frame_is_made_by_itself_from_the_rest_shape(torus):
    settings = measure.Settings(iterations=ITERATIONS)
    model = supple.load_model("rotation")
    table = contenders.table(ITERATIONS, stiff=True)
    rows, motions_made = measure.measure_sequence(torus, table, settings, model)
    assert list(rows) == [edits.ARAP, edits.NATURAL, edits.NO_NETWORK, edits.STIFF]
    assert all(row["status"] == MEASURED for row in rows.values()), rows
    rest, faces = torus.case.vertices, torus.case.faces
    prepared = supple.PreparedMesh(rest, faces, cache=False)
    for frame in (1, 3):
        handles = torus.handles(frame)
        held = np.concatenate([h.vertices for h in handles])
        wanted = np.concatenate([h.positions for h in handles])
        data = igl.ARAPData()
        data.energy = igl.ARAPEnergyType.ARAP_ENERGY_TYPE_SPOKES_AND_RIMS
        data.max_iter = ITERATIONS
        igl.arap_precomputation(rest, faces.astype(np.int64), 3, held.astype(np.int32), data)
        guess = rest.copy()
        guess[held] = wanted
        alone = igl.arap_solve(wanted, data, guess)
        assert np.allclose(motions_made[edits.ARAP][frame], alone, atol=1e-9)
        for name, options in (
            (edits.NATURAL, {}),
            (edits.NO_NETWORK, {"network": False}),
            (edits.STIFF, {"mode": "stiff"}),
        ):
            alone = supple.Editor(prepared, handles, model=model).solve(**options).vertices
            assert np.allclose(motions_made[name][frame], alone, atol=1e-6)


def fixed(name: str, motion: np.ndarray) -> Contender:
    """A contender that answers with these frames, one after the other."""

    def setup(*_):
        frames = iter(motion)
        return lambda _: next(frames)

    return Contender(name, setup)


def test_targets_are_judged_by_ratios_of_means_over_sequences(torus):
    def measured(noise: dict[str, float]) -> dict:
        rng = np.random.default_rng(2)
        table = [
            fixed(name, torus.truth + rng.normal(0, size, torus.truth.shape))
            for name, size in noise.items()
        ]
        settings, model = measure.Settings(), supple.load_model("rotation")
        return {"rows": measure.measure_sequence(torus, table, settings, model)[0]}

    names = (edits.ARAP, edits.NATURAL, edits.NO_NETWORK)
    cases = {
        "one": measured(dict(zip(names, (0.02, 0.01, 0.015), strict=True))),
        "two": measured(dict(zip(names, (0.04, 0.03, 0.035), strict=True))),
    }
    made = summary.summary(cases)
    words = [verdict["verdict"] for verdict in made["verdicts"]]
    assert words == [edit_summary.AIM_MET, edit_summary.MET, edit_summary.MET]
    assert list(made["contenders"]) == [edits.NATURAL, edits.NO_NETWORK, edits.ARAP]
    row = made["contenders"][edits.NATURAL]
    for figure in ("pose_error", "acceleration_error"):
        ours, theirs = (
            [case["rows"][name][figure] for case in cases.values()]
            for name in (edits.NATURAL, edits.ARAP)
        )
        assert row[f"{figure}_ratio"] == pytest.approx(sum(ours) / sum(theirs))
        assert row[figure] == pytest.approx(np.mean(ours))

    worse = measured(dict(zip(names, (0.02, 0.021, 0.02), strict=True)))
    made = summary.summary({"one": worse})
    assert [v["verdict"] for v in made["verdicts"]] == [edit_summary.MISSED] * 3
    nothing = summary.summary({})
    assert [v["verdict"] for v in nothing["verdicts"]] == [edit_summary.UNJUDGED] * 3


def test_a_contender_that_fails_in_a_frame_leaves_the_others_alone(torus):
    def fails(*_):
        raise RuntimeError("did not factor")

    broken = Contender("broken", lambda *_: fails)
    settings, model = measure.Settings(), supple.load_model("rotation")
    table = [broken, fixed("good", torus.truth)]
    rows, made = measure.measure_sequence(torus, table, settings, model)
    assert rows["broken"] == {"status": "failed", "message": "did not factor"}
    assert rows["good"]["pose_error"] == 0
    assert list(made) == ["good"]


# --- the command ----------------------------------------------------------------------------------


def test_command_writes_figures_plots_and_strips(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "PIXELS", 60)
    write_torus(tmp_path / "in" / "good")
    (write_torus(tmp_path / "in" / "bad") / "frames.pc2").unlink()
    out = tmp_path / "out"
    arguments = ["sequence", tmp_path / "in", "--out", out, "--iterations", ITERATIONS]
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert done.exception is None or isinstance(done.exception, SystemExit), done.output
    made = json.loads((out / "sequence.json").read_text())
    assert made["schema"] == report.SCHEMA
    assert done.exit_code == exit_code(made) == 1  # one cannot be read
    assert made["settings"]["iterations"] == ITERATIONS
    assert list(made["errors"]) == ["bad"]
    assert "There is no file" in made["errors"]["bad"]
    (case,) = made["measured"].values()
    assert case["frames"] == FRAMES and case["handles"] == 6
    second = np.diff(twisted(), 2, axis=0)
    assert case["acceleration"] == pytest.approx(
        100 * np.linalg.norm(second, axis=2).mean(), rel=1e-4
    )
    assert list(case["rows"]) == [edits.ARAP, edits.NATURAL, edits.NO_NETWORK]
    for row in case["rows"].values():
        assert row["status"] == MEASURED
        assert len(row["pose_errors"]) == FRAMES
        assert row["handle_error"] < 1e-6
    text = (out / "sequence.md").read_text()
    assert "![good](good.png)" in text and "- bad: There is no file" in text
    for name in ("good.png", "good.errors.png"):
        assert (out / name).read_bytes().startswith(b"\x89PNG")


def test_command_says_what_is_wrong(tmp_path, monkeypatch):
    monkeypatch.delenv("SUPPLE_DATA", raising=False)

    def says(command, *arguments: object) -> str:
        done = CliRunner().invoke(command, list(map(str, arguments)), env={"COLUMNS": "200"})
        assert done.exit_code == 2
        return done.output

    assert "'sequences'" in says(app, "sequence")
    assert "no sequence case" in says(app, "sequence", tmp_path)
    folder = write_torus(tmp_path / "torus")
    assert "no network" in says(app, "sequence", folder, "--model", "none such").lower()
    assert "walk, reach, creature" in says(sequence_cases.app, tmp_path, "--kind", "fly")
    assert "--frames" in says(sequence_cases.app, tmp_path, "--frames", "2")


# --- making sequences -----------------------------------------------------------------------------


def angle_between(one: np.ndarray, other: np.ndarray) -> float:
    """Degrees of the turn from one rotation (3, 3) to another."""
    return float(np.degrees(np.arccos(np.clip((np.trace(one.T @ other) - 1) / 2, -1, 1))))


def largest_turn(frames: list[dict[str, np.ndarray]]) -> float:
    """Degrees that any bone turns between two consecutive frames."""
    return max(
        angle_between(before[name], after[name])
        for before, after in pairwise(frames)
        for name in before
    )


def test_a_walk_is_a_moment_of_its_cycle():
    cycle = motions.walk_cycle(np.random.default_rng(3), 12)
    single = motions.walk(np.random.default_rng(3))
    assert cycle[0].keys() == single.keys()
    assert all((cycle[0][name] == single[name]).all() for name in single)
    # Half a stride later the right leg is where the left one was.
    assert np.allclose(cycle[6]["upperleg01.R"], cycle[0]["upperleg01.L"])


@pytest.mark.parametrize("motion", sorted(motions.SEQUENCES))
def test_motions_are_smooth_twice_as_many_frames_turn_half_as_far(motion):
    make = motions.SEQUENCES[motion]
    few, many = 25, 49
    if motion == "walk":  # closed: the first frame follows the last
        few, many = 24, 48
    coarse = make(np.random.default_rng(4), few)
    fine = make(np.random.default_rng(4), many)
    for one, other in zip(coarse, fine[::2], strict=True):
        assert all(np.allclose(one[name], other[name]) for name in one)
    if motion == "walk":
        coarse, fine = [*coarse, coarse[0]], [*fine, fine[0]]
    assert largest_turn(coarse) < 20
    assert largest_turn(fine) < 0.6 * largest_turn(coarse)


def test_a_blend_goes_evenly_from_one_pose_to_the_other():
    start = {"arm": rotation(np.array([80.0, 0, 0])), "leg": rotation(np.array([0, 30.0, 0]))}
    end = {"arm": rotation(np.array([-40.0, 0, 0]))}
    for share in (0.0, 0.25, 1.0):
        between = motions.blend(start, end, share)
        assert np.allclose(between["arm"], rotation(np.array([80 - 120 * share, 0, 0])))
        assert np.allclose(between["leg"], rotation(np.array([0, 30 * (1 - share), 0])))


@pytest.mark.parametrize("family", creatures.WALKERS)
def test_gaits_are_smooth_close_and_stay_in_the_joints_ranges(family):
    maker = next(maker for maker in FAMILIES if maker.__name__ == family)
    skeleton = maker(0.5, 0.5, np.random.default_rng(5))
    coarse = sample_gait(skeleton, np.random.default_rng(6), 24)
    fine = sample_gait(skeleton, np.random.default_rng(6), 48)
    assert np.allclose(coarse, fine[::2])
    ranges = np.concatenate([chain.ranges for chain in skeleton.chains if chain.joints])
    span = ranges[..., 1] - ranges[..., 0]
    for frames, most in ((coarse, np.sin(np.pi / 24)), (fine, np.sin(np.pi / 48))):
        step = np.abs(np.roll(frames, -1, axis=0) - frames)  # the last goes on to the first
        assert (step <= span * most + 1e-9).all()  # of a sinusoid as wide as the range
    moved = np.ptp(coarse, axis=0)
    assert (moved <= span + 1e-9).all()
    assert moved.max() > 15
    signs = np.concatenate([np.full(c.joints, c.mirrored) for c in skeleton.chains if c.joints])
    plain = np.where(signs[:, None] & (np.arange(3) > 0), -coarse, coarse)
    assert (plain >= ranges[..., 0] - 1e-9).all() and (plain <= ranges[..., 1] + 1e-9).all()


@pytest.mark.slow
@pytest.mark.parametrize("kind", sequence_cases.KINDS)
def test_made_sequences_are_reproducible_smooth_and_read_back(kind, tmp_path):
    def made(seed: int) -> sequence_cases.Moving:
        if kind == sequence_cases.CREATURE:
            return sequence_cases.moving_creature(seed, 0, 12, SIZE)
        return sequence_cases.moving_body(seed, 0, kind, 12, SIZE)

    rest, faces, frames = made(7)
    for one, again in zip((rest, faces, frames), made(7), strict=True):
        assert (one == again).all()
    other = made(8)
    assert other[0].shape != rest.shape or np.abs(other[0] - rest).max() > 1e-3
    assert supple.Mesh(rest, faces).notes == []
    size = np.linalg.norm(np.ptp(rest, axis=0))
    step = np.linalg.norm(np.diff(frames, axis=0), axis=2).max()
    assert 0.01 * size < step < 0.2 * size
    sequence_cases.write_sequence(tmp_path / kind, (rest, faces, frames), 16, {})
    read = sequences.read_sequence(tmp_path / kind)
    assert len(read.case.handles) == 16
    assert np.abs(read.truth - frames).max() < 1e-5
    largest = max(len(handle.vertices) for handle in read.case.handles)
    assert largest < 0.02 * len(rest)
