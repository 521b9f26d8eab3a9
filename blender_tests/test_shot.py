# SPDX-License-Identifier: GPL-3.0-or-later
"""The sample shot: a walk that cuts into a step, and the sample job that corrects it."""

import importlib
import sys
from dataclasses import dataclass
from pathlib import Path

import bodies
import bpy
import moving
import numpy as np
import pytest

SAMPLES = Path(__file__).resolve().parent.parent / "samples"

FRAMES = range(24, 71)  # a few more than the job's, on both sides
CHANGED = range(27, 68)  # between the ends of the job's range
ON_STEP = range(38, 57)  # from heel strike to push-off
FLAT = range(41, 49)


@dataclass(frozen=True)
class Shot:
    """The same frames, {number: (n, 3)}, without and with the correction, and what is in them."""

    before: dict
    after: dict
    step: tuple  # two corners
    rest: np.ndarray
    edges: np.ndarray
    weights: dict  # {group: (n,)}

    def members(self, name):
        return np.flatnonzero(self.weights[name])

    @property
    def sole(self):
        """The vertices of the right foot on which it stands."""
        foot = self.members("foot.R")
        return foot[self.rest[foot, 2] < 0.02]

    def inside(self, points):
        """Return which of points (n, 3) are inside the step."""
        return np.all((points > self.step[0]) & (points < self.step[1]), axis=1)

    def above(self, points):
        """Return how far the lowest of the points that are over the step are above it."""
        low, high = self.step
        over = np.all((points[:, :2] > low[:2]) & (points[:, :2] < high[:2]), axis=1)
        return points[over, 2].min() - high[2]

    def knee(self, points):
        """Return the bend of the right knee, degrees, and the lengths of thigh and shin.

        A joint is the mean of the vertices that follow both of its bones.
        """
        hip, knee, ankle = (
            points[(self.weights[a] > 0.3) & (self.weights[b] > 0.3)].mean(axis=0)
            for a, b in (
                ("DEF-hips", "DEF-thigh.R"),
                ("DEF-thigh.R", "DEF-shin.R"),
                ("DEF-shin.R", "DEF-foot.R"),
            )
        )
        thigh, shin = knee - hip, ankle - knee
        lengths = np.linalg.norm(thigh), np.linalg.norm(shin)
        return np.degrees(np.arccos(thigh @ shin / np.prod(lengths))), lengths


def weights_of(obj):
    found = {group.name: np.zeros(len(obj.data.vertices)) for group in obj.vertex_groups}
    names = [group.name for group in obj.vertex_groups]
    for vertex in obj.data.vertices:
        for entry in vertex.groups:
            found[names[entry.group]][vertex.index] = entry.weight
    return found


def correct(package, folder, frames, changes):
    """Return the sample shot of some frames, corrected by the sample job with changes of its text:
    pairs of what is there and what is to be.
    """
    sys.path.insert(0, str(SAMPLES / "shot"))
    make_shot = importlib.import_module("make_shot")
    text = (SAMPLES / "jobs" / "walk.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "walk.toml").write_text(text, encoding="utf-8")
    bpy.ops.wm.read_homefile(use_empty=True)
    before = moving.every_frame(make_shot.build(frames), frames)
    job = importlib.import_module(f"{package}.job")
    assert job.main([str(folder / "walk.toml")]) == 0
    bpy.ops.wm.open_mainfile(filepath=str(folder / "walk_corrected.blend"))
    assert (folder / "report.json").is_file()
    human, step = bpy.data.objects["Human"], bpy.data.objects["Step"]
    corners = bodies.to_world(step, bodies.rest(step))
    return Shot(
        before,
        moving.every_frame(human, frames),
        (corners.min(axis=0), corners.max(axis=0)),
        bodies.rest(human),
        np.array([edge.vertices[:] for edge in human.data.edges]),
        weights_of(human),
    )


@pytest.fixture(scope="module")
def shot(package, tmp_path_factory):
    """All frames of the job, natural: its handles do the same, in an eighth of the time."""
    return correct(package, tmp_path_factory.mktemp("shot"), FRAMES, [('"stiff"', '"natural"')])


@pytest.fixture(scope="module")
def stiff_shot(package, tmp_path_factory):
    """Frames 44 to 46 alone, as the job has them."""
    changes = [("frames = [26, 68]", "frames = [44, 46]"), ("ease = [9, 10]", "ease = [0, 0]")]
    return correct(package, tmp_path_factory.mktemp("stiff"), range(43, 48), changes)


def test_standing_feet_of_the_walk_neither_slide_nor_sink(shot):
    assert min(points[:, 2].min() for points in shot.before.values()) > -0.001
    standing = np.array([shot.before[frame][shot.sole] for frame in FLAT])
    assert np.ptp(standing, axis=0).max() < 0.001
    assert np.abs(standing.min(axis=1)[:, 2]).max() < 0.001


def test_frames_outside_the_range_are_as_they_were_bit_for_bit(shot):
    for frame in FRAMES:
        same = np.array_equal(shot.after[frame], shot.before[frame])
        assert same == (frame not in CHANGED), frame


def test_the_other_foot_stays(shot):
    foot = shot.members("foot.L")
    assert all(np.array_equal(shot.after[f][foot], shot.before[f][foot]) for f in FRAMES)


def test_the_foot_lands_on_the_step_instead_of_in_it(shot):
    foot = shot.members("foot.R")
    for frame in ON_STEP:
        assert shot.inside(shot.before[frame][foot]).mean() > 0.75, frame
        assert 0 < shot.above(shot.after[frame][foot]) < 0.01, frame  # it does not hover
    assert not any(shot.inside(points).any() for points in shot.after.values())
    standing = np.array([shot.after[frame][shot.sole] for frame in FLAT])
    assert np.ptp(standing, axis=0).max() < 0.002  # nor slide


def test_the_knee_bends_and_the_leg_keeps_its_length(stiff_shot):
    (before, lengths), (after, new_lengths) = (
        stiff_shot.knee(np.float64(of[45])) for of in (stiff_shot.before, stiff_shot.after)
    )
    assert after > before + 5
    assert np.allclose(new_lengths, lengths, rtol=0.03)


def test_the_rest_of_the_body_follows_in_its_shape(stiff_shot):
    before, after = (np.float64(of[45]) for of in (stiff_shot.before, stiff_shot.after))
    length = [
        np.linalg.norm(np.diff(points[stiff_shot.edges], axis=1)[:, 0], axis=1)
        for points in (before, after)
    ]
    assert np.abs(np.percentile(length[1] / length[0], (1, 99)) - 1).max() < 0.05
    rise = (after - before)[stiff_shot.members("head")]
    assert np.abs(rise - [0, 0, 0.055]).max() < 0.01  # as the hips do
