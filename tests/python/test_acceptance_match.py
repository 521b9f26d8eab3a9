# SPDX-License-Identifier: GPL-3.0-or-later
"""The shipped features and their network must earn their place on bodies they were not trained on.

Pairs of held-out bodies (tests/meshes/held_out_bodies.npz, CC0), matched from their shapes alone:
the target's vertices are in a random order, and it is turned. Were the network replaced by the
identity, both figures of the second test would be equal and it would fail.
"""

from pathlib import Path

import numpy as np
import pytest
import supple

FIXTURE = Path(__file__).parents[1] / "meshes" / "held_out_bodies.npz"
COUNT = 4


@pytest.fixture(scope="module")
def pairs():
    """(source, target, truth): two PreparedMesh, and the target vertex of each source vertex."""
    found = []
    with np.load(FIXTURE) as data:
        for i in range(COUNT):
            rng = np.random.default_rng(i)
            source, faces = data[f"s{i}"].astype(np.float64), data[f"f{i}"].astype(np.int32)
            place = rng.permutation(len(source))
            target = np.empty_like(source)
            turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
            target[place] = data[f"t{i}"] @ (turn * np.sign(np.linalg.det(turn)))
            meshes = (supple.PreparedMesh(source, faces), supple.PreparedMesh(target, place[faces]))
            found.append((*meshes, place))
    return found


def error(target: supple.PreparedMesh, found: np.ndarray, truth: np.ndarray) -> float:
    """Mean distance to the truth, x100 of the root of the area."""
    away = np.linalg.norm(target.vertices[found] - target.vertices[truth], axis=1).mean()
    corners = target.vertices[target.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return 100 * away / np.sqrt(np.linalg.norm(normals, axis=1).sum() / 2)


def test_features_alone_tell_the_whole_body_and_left_from_right(pairs):
    for i, (source, target, truth) in enumerate(pairs):
        matcher = supple.Matcher(source, target, epochs=0, automatic=False)
        assert error(target, matcher.features_map().point_map, truth) < 4.0, f"pair {i}"


def test_the_network_makes_matches_more_accurate_than_the_identity(pairs):
    errors = np.empty((2, COUNT))
    for i, (source, target, truth) in enumerate(pairs):
        result = supple.match(source, target, epochs=0, automatic=False)
        without = supple.refine(source, target, result.initial.point_map, model=None)
        errors[:, i] = [error(target, m, truth) for m in (result.point_map, without.point_map)]
    assert errors[0].mean() < 2.0
    assert errors[0].mean() < errors[1].mean()


def test_adaptation_lowers_the_loss(pairs):
    source, target, truth = pairs[0]
    losses = []
    result = supple.match(
        source, target, epochs=3, automatic=False, callback=lambda e: losses.append(e.loss["total"])
    )
    assert len(losses) == 3
    assert losses[-1] < losses[0]
    assert error(target, result.point_map, truth) < 2.0
