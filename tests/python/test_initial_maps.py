# SPDX-License-Identifier: GPL-3.0-or-later
"""First maps between poses of bodies, whose left and right must not be exchanged, and errors."""

from pathlib import Path

import numpy as np
import pytest
import supple
from supple import SuppleError
from supple_training.compare import shapes

BODIES = Path(__file__).parents[1] / "meshes" / "held_out_bodies.npz"
COUNT = 6


def turned_copy(vertices, faces, seed):
    """In another order, turned, moved and three times as large, with each vertex's new index."""
    random = np.random.default_rng(seed)
    order = random.permutation(len(vertices))
    rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    moved = np.empty_like(vertices)
    moved[order] = 3.0 * vertices @ rotation + 1.0
    return moved, order[faces], order


@pytest.fixture(scope="module")
def pairs():
    """Each body in two poses, the second one a turned copy: both prepared, and the truth."""
    bodies = np.load(BODIES)
    made = []
    for i in range(COUNT):
        vertices, faces = bodies[f"s{i}"].astype(float), bodies[f"f{i}"].astype(np.int32)
        moved, other, truth = turned_copy(bodies[f"t{i}"].astype(float), faces, i)
        made.append(
            (
                supple.PreparedMesh(vertices, faces, cache=False),
                supple.PreparedMesh(moved, other, cache=False),
                truth,
            )
        )
    return made


def error(pair, point_map):
    return supple.geodesic_errors(pair[1], pair[2], point_map)[0].mean


def mirrored(pair):
    """The true map with left and right exchanged, through the nearest mirrored vertex of the source
    (bodies stand along z, x is sideways)."""
    vertices = pair[0].vertices * [-1, 1, 1]
    apart = ((vertices[:, None] - pair[0].vertices[None]) ** 2).sum(2)
    return pair[2][apart.argmin(1)]


def test_automatic_maps_tell_left_from_right(pairs):
    for pair in pairs:
        found = supple.automatic_map(*pair[:2])
        assert error(pair, found.point_map) < 6
        assert found.score.orientation > 0.7
        assert not any(note.code == "mirrored" for note in found.notes)


def test_the_score_sees_a_mirrored_map(pairs):
    for pair in pairs:
        right = supple.map_score(*pair[:2], pair[2])
        wrong = supple.map_score(*pair[:2], mirrored(pair))
        assert right.orientation > 0.9
        assert wrong.orientation < 0.3
        assert right.value > 3 * wrong.value


def test_landmarks_are_kept_and_what_is_between_is_right(pairs):
    for pair in pairs:
        chosen = np.asarray(supple.farthest_points(pair[0].vertices, 5))
        landmarks = np.stack([chosen, pair[2][chosen]], axis=1)
        found = supple.landmark_map(*pair[:2], landmarks)
        assert np.array_equal(found.point_map[chosen], pair[2][chosen])
        assert error(pair, found.point_map) < 5


def test_nearest_points_of_a_turned_copy(pairs):
    source = pairs[0][0]
    moved, faces, truth = turned_copy(source.vertices, source.faces, 9)
    target = supple.PreparedMesh(moved, faces, cache=False)
    found = supple.nearest_map(source, target)
    assert np.mean(found.point_map == truth) > 0.99
    aligned = supple.nearest_map(source, source, aligned=True)
    assert np.array_equal(aligned.point_map, np.arange(source.vertex_count))


def test_shared_uvs():
    torus = shapes.bumpy_torus(600)
    angles = np.stack(
        [
            np.arctan2(torus.vertices[:, 1], torus.vertices[:, 0]) / (2 * np.pi) + 0.5,
            (torus.vertices[:, 2] - torus.vertices[:, 2].min()) / np.ptp(torus.vertices[:, 2]),
        ],
        axis=1,
    )
    corners = angles[torus.faces]
    # Only the upper outside: there the two are a chart.
    radius = np.linalg.norm(torus.vertices[:, :2], axis=1)
    chart = (radius > np.median(radius))[torus.faces].all(1) & (
        np.ptp(corners[..., 0], axis=1) < 0.5
    )
    faces = torus.faces[chart]
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3)
    vertices = torus.vertices[used]
    uvs = corners[chart]
    source = supple.PreparedMesh(vertices, faces, cache=False)
    target = supple.PreparedMesh(vertices * [1, 1, -1], faces[:, ::-1], cache=False)
    found = supple.uv_map(source, target, uvs, uvs[:, ::-1])
    assert np.mean(found.point_map == np.arange(len(vertices))) > 0.99
    assert not any(note.code == "partial_overlap" for note in found.notes)
    half = supple.uv_map(source, target, uvs + np.array([0.3, 0.0]), uvs[:, ::-1])
    assert any(note.code == "partial_overlap" for note in half.notes)
    with pytest.raises(SuppleError) as apart:
        supple.uv_map(source, target, uvs + 5.0, uvs[:, ::-1])
    assert apart.value.code == "bad_option"
    assert "overlap" in str(apart.value)


def test_bad_landmarks(pairs):
    source, target, _ = pairs[0]
    for landmarks, code in (
        (np.zeros((0, 2)), "wrong_shape"),
        ([1, 2], "wrong_shape"),
        ([[0, target.vertex_count]], "index_out_of_range"),
        ([[0, 1], [0, 2]], "bad_option"),
    ):
        with pytest.raises(SuppleError) as caught:
            supple.landmark_map(source, target, landmarks)
        assert caught.value.code == code
