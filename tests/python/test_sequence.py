# SPDX-License-Identifier: GPL-3.0-or-later
"""Corrections that travel with a moving surface, from Python."""

import numpy as np
import pytest
import supple

AROUND, ALONG, LENGTH = 12, 25, 4.0


def tube():
    """A closed tube along z, and the vertices of its ends."""
    z, angle = np.meshgrid(
        np.linspace(0, LENGTH, ALONG),
        np.linspace(0, 2 * np.pi, AROUND, endpoint=False),
        indexing="ij",
    )
    ring = np.stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), z], axis=-1).reshape(-1, 3)
    points = np.concatenate([ring, [[0, 0, 0], [0, 0, LENGTH]]])
    index = np.arange(AROUND * ALONG).reshape(ALONG, AROUND)
    following = np.roll(index, -1, axis=1)
    low, low_next = index[:-1].ravel(), following[:-1].ravel()
    high, high_next = index[1:].ravel(), following[1:].ravel()
    faces = np.concatenate(
        [
            np.stack([low, low_next, high_next], 1),
            np.stack([low, high_next, high], 1),
            np.stack([following[0], index[0], np.full(AROUND, len(ring))], 1),
            np.stack([index[-1], following[-1], np.full(AROUND, len(ring) + 1)], 1),
        ]
    )
    return points, faces, index[:2].ravel(), index[-2:].ravel()


def bent(points, angle):
    """The tube as a circular arc that ends turned by `angle`: what is beyond is straight."""
    x, y, z = points.T
    turn = angle * np.clip(z / (0.8 * LENGTH), 0, 1)
    radius, beyond = 0.8 * LENGTH / angle, np.maximum(z - 0.8 * LENGTH, 0)
    return np.stack(
        [
            radius - (radius - x) * np.cos(turn) + beyond * np.sin(turn),
            y,
            (radius - x) * np.sin(turn) + beyond * np.cos(turn),
        ],
        axis=1,
    )


@pytest.fixture(scope="module")
def shot():
    points, faces, low, high = tube()
    prepared = supple.PreparedMesh(points, faces, cache=False)
    handles = [supple.Handle("low", low), supple.Handle("high", high)]
    frames = [bent(points, angle) for angle in np.linspace(0.05, 1.5, 12)]
    return prepared, handles, frames


def moved_by(x, z):
    matrix = np.eye(4)
    matrix[0, 3], matrix[2, 3] = x, z
    return matrix


def test_a_correction_is_in_the_frame_of_the_surface(shot):
    """Known truth: the tube's end is rigid and turns by a known angle in each frame."""
    prepared, handles, frames = shot
    editor = supple.SequenceEditor(supple.Editor(prepared, handles), mode="natural")
    correction = moved_by(0.3, 0.2)
    given = [supple.SequenceFrame(frame, [None, correction]) for frame in frames]
    for angle, frame, got in zip(
        np.linspace(0.05, 1.5, 12), frames, editor.solve(given), strict=True
    ):
        high, low = handles[1].vertices, handles[0].vertices
        offset = [
            0.3 * np.cos(angle) + 0.2 * np.sin(angle),
            0,
            0.2 * np.cos(angle) - 0.3 * np.sin(angle),
        ]
        np.testing.assert_allclose(got[high], frame[high] + offset, atol=2e-3)
        np.testing.assert_array_equal(got[low], frame[low])


def test_frames_of_handles_are_rigid_and_known(shot):
    prepared, handles, frames = shot
    found = supple.handle_frames(prepared, handles, frames[-1])
    assert found.shape == (2, 4, 4)
    turn = found[1][:3, :3]
    expected = [[np.cos(1.5), 0, np.sin(1.5)], [0, 1, 0], [-np.sin(1.5), 0, np.cos(1.5)]]
    np.testing.assert_allclose(turn, expected, atol=1e-2)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)


def test_a_sequence_joins_without_a_jump(shot):
    """Position and velocity at the ends of a range, from the frames themselves."""
    prepared, handles, _ = shot
    points = np.asarray(prepared.vertices)
    editor = supple.SequenceEditor(supple.Editor(prepared, handles))
    numbers = np.arange(0, 41)
    frames = [bent(points, 0.4 + 0.3 * np.sin(0.2 * t)) for t in numbers]
    given = [
        supple.SequenceFrame(frame, [None, moved_by(0.5, 0)], supple.range_share(t, 5, 35))
        for t, frame in zip(numbers, frames, strict=True)
    ]
    away = np.stack(editor.solve(given)) - np.stack(frames)
    size = np.linalg.norm(away, axis=2).max()
    assert size == pytest.approx(0.5, abs=0.05)
    for end in (5, 35):
        assert np.all(away[end] == 0)
        velocity = np.linalg.norm(away[end + 1] - away[end - 1], axis=1).max()
        assert velocity <= 0.01 * size
    steps = np.linalg.norm(np.diff(away, axis=0), axis=2).max(axis=1)
    assert steps.max() < 0.25 * size  # nowhere a pop


def test_the_network_shapes_frames_and_the_identity_does_not_pass(shot):
    prepared, handles, frames = shot
    frame = [supple.SequenceFrame(frames[6], [None, moved_by(0.8, -0.4)])]
    editor = supple.Editor(prepared, handles)
    learned, plain = (
        supple.SequenceEditor(editor, network=network).solve(frame)[0] for network in (True, False)
    )
    assert np.linalg.norm(learned - plain, axis=1).max() > 1e-2


def test_part_of_motion_and_range_share():
    half = supple.part_of_motion(moved_by(2, 0), [0, 0, 0], 0.5)
    np.testing.assert_allclose(half, moved_by(1, 0), atol=1e-12)
    t = np.linspace(0, 1, 13)
    expected = 6 * t**5 - 15 * t**4 + 10 * t**3
    shares = [supple.range_share(frame, 0, 40) for frame in range(13)]
    np.testing.assert_allclose(shares, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("corrections", "message"),
    [
        ([None], "2 handles but 1 corrections"),
        ([None, np.zeros((4, 4))], "without an inverse"),
        ([None, np.eye(3)], r"correction 1 has shape \(3, 3\)"),
    ],
)
def test_bad_corrections_are_refused(shot, corrections, message):
    prepared, handles, frames = shot
    editor = supple.SequenceEditor(supple.Editor(prepared, handles))
    with pytest.raises(supple.SuppleError, match=message):
        editor.solve([supple.SequenceFrame(frames[0], corrections)])


def test_cancelling(shot):
    prepared, handles, frames = shot
    editor = supple.SequenceEditor(supple.Editor(prepared, handles))
    progress = supple.Progress()
    progress.cancel()
    with pytest.raises(supple.Cancelled):
        editor.solve([supple.SequenceFrame(frames[0], [None, moved_by(1, 0)])], progress=progress)
