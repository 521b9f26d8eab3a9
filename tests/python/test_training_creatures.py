# SPDX-License-Identifier: GPL-3.0-or-later
"""Random creatures: one closed skin, natural poses, determinism, held-out creatures apart."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("anny", reason="anny is not installed; pip install ./training")
pytest.importorskip("igl", reason="libigl is not installed; pip install ./training")

from supple_training import creatures, pairs
from supple_training.bodies import self_intersection
from supple_training.creatures.families import FAMILIES
from supple_training.creatures.poses import follow, joint_motions, sample_turns
from supple_training.remesh import (
    component_count,
    euler_characteristic,
    is_closed_manifold,
    triangle_quality,
    unit_normals,
)

NAMES = [maker.__name__ for maker in FAMILIES]


@pytest.fixture(scope="module", params=NAMES)
def creature(request) -> creatures.Creature:
    return creatures.sample_creature(np.random.default_rng(1), family=request.param)


@pytest.fixture(scope="module")
def quadruped() -> creatures.Creature:
    return creatures.sample_creature(np.random.default_rng(2), family="quadruped")


def test_a_creature_is_one_closed_surface_of_about_a_bodys_area(creature):
    rest, faces = creature.vertices, creature.faces
    assert 3500 <= len(rest) <= 6500
    assert is_closed_manifold(faces)
    assert component_count(faces) == 1
    assert euler_characteristic(faces) == 2
    assert creatures.volume(rest, faces) > 0.005
    assert triangle_quality(rest, faces).min() > 0.02
    _, areas = unit_normals(rest, faces)
    assert 1.0 < areas.sum() < 3.5
    assert self_intersection(rest, faces) < 0.02


def test_weights_are_shares_that_vary_smoothly(creature):
    weights = creature.weights
    assert weights.min() >= 0
    assert np.allclose(weights.sum(axis=1), 1.0)
    edges = np.concatenate([creature.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    jump = np.abs(weights[edges[:, 0]] - weights[edges[:, 1]]).sum(axis=1) / 2
    assert np.quantile(jump, 0.99) < 0.75
    assert jump.mean() < 0.2


def test_poses_move_a_creature_and_collapse_nothing(creature):
    rest, faces = creature.vertices, creature.faces
    posed = creatures.sample_pose(creature, np.random.default_rng(3))
    assert np.linalg.norm(posed - rest, axis=1).max() > 0.1
    assert creatures.volume(posed, faces) == pytest.approx(creatures.volume(rest, faces), rel=0.12)
    assert creatures.collapsed_share(rest, posed, faces) < 0.002
    assert self_intersection(posed, faces) <= self_intersection(rest, faces) + 0.015
    edges = np.concatenate([faces[:, [i, (i + 1) % 3]] for i in range(3)])
    stretch = np.linalg.norm(posed[edges[:, 0]] - posed[edges[:, 1]], axis=1)
    stretch /= np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1)
    assert np.quantile(stretch, 0.001) > 0.1
    assert np.quantile(stretch, 0.999) < 4.0


def test_no_turn_leaves_a_creature_at_rest(quadruped):
    joints = quadruped.weights.shape[1]
    assert np.allclose(quadruped.posed(np.zeros((joints, 3))), quadruped.vertices)


def test_the_first_joint_carries_the_whole_creature_rigidly(quadruped):
    turns = np.zeros((quadruped.weights.shape[1], 3))
    turns[0] = [20.0, -40.0, 15.0]
    moved = quadruped.posed(turns)
    far = [0, len(moved) // 3, len(moved) - 1]
    for point in far:
        before = np.linalg.norm(quadruped.vertices - quadruped.vertices[point], axis=1)
        assert np.allclose(np.linalg.norm(moved - moved[point], axis=1), before)
    assert np.abs(moved - quadruped.vertices).max() > 0.1


def test_blended_dual_quaternions_keep_a_twisted_tube_round():
    angle = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    height = np.linspace(0, 1, 11)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tube = np.concatenate([np.column_stack([ring, np.full(20, h)]) for h in height])
    weights = np.stack([1 - tube[:, 2], tube[:, 2]], axis=1)
    half_turn = np.radians(160.0) / 2
    quaternions = np.array([[0, 0, 0, 1.0], [0, 0, np.sin(half_turn), np.cos(half_turn)]])
    twisted = follow(tube, weights, quaternions, np.zeros((2, 3)))
    assert np.allclose(np.linalg.norm(twisted[:, :2], axis=1), 1.0)
    # The sign of a quaternion means nothing.
    again = follow(tube, weights, quaternions * [[1], [-1]], np.zeros((2, 3)))
    assert np.allclose(again, twisted)


def test_limbs_mirror_each_other(quadruped):
    skeleton = quadruped.skeleton
    limbs = [i for i, chain in enumerate(skeleton.chains) if chain.kind == "limb"]
    firsts = skeleton.first_joints()
    left, right = (
        next(i for i in limbs if skeleton.chains[i].mirrored is m) for m in (False, True)
    )
    turns = np.zeros((quadruped.weights.shape[1], 3))
    for i, sign in ((left, [1, 1, 1]), (right, [1, -1, -1])):
        k = skeleton.chains[i].joints
        turns[firsts[i] : firsts[i] + k] = np.array([25.0, 10.0, -15.0]) * sign
    quaternions, shifts = joint_motions(skeleton, turns)
    ends = []
    for i in (left, right):
        last = firsts[i] + skeleton.chains[i].joints - 1
        one = np.ones((1, 1))
        foot = skeleton.chains[i].points[-1:]
        ends.append(follow(foot, one, quaternions[[last]], shifts[[last]])[0])
    assert np.allclose(ends[0], ends[1] * [-1, 1, 1])


def test_turns_stay_within_about_the_joints_ranges(creature):
    turns = np.abs(sample_turns(creature.skeleton, np.random.default_rng(4)))
    limits = [
        np.abs(c.ranges[: c.joints]).max(axis=2) for c in creature.skeleton.chains if c.joints
    ]
    assert np.all(turns <= 1.4 * np.concatenate(limits) + 1e-9)


def test_a_pair_of_creatures_is_reproducible_and_in_correspondence():
    settings = pairs.PairSettings(pairs=2, seed=5, creature_share=1.0)
    source, faces, target = pairs.make_pair(settings, 0)
    for one, two in zip((source, faces, target), pairs.make_pair(settings, 0), strict=True):
        assert np.array_equal(one, two)
    assert source.dtype == target.dtype == np.float64
    assert faces.dtype == np.int32
    assert source.shape == target.shape
    assert not np.allclose(source, target)
    _, before = unit_normals(source, faces)
    _, after = unit_normals(target, faces)
    assert after.sum() == pytest.approx(before.sum(), rel=0.2)
    other, _, _ = pairs.make_pair(settings, 1)
    assert other.shape != source.shape or not np.allclose(other, source)


def test_the_share_of_creatures_decides_and_bad_ones_are_refused(monkeypatch):
    made = []

    def note(rng, **options):
        made.append(options)
        raise RuntimeError("a creature")

    monkeypatch.setattr(pairs, "make_creature_pair", note)
    settings = pairs.PairSettings(creature_share=1.0, held_out=True, rest_share=1.0)
    with pytest.raises(RuntimeError, match="a creature"):
        pairs.make_pair(settings, 0)
    expected = {"held_out": True, "at_rest": True, "other_proportions": False}
    assert made == [{**expected, "vertices": (3500, 6500)}]
    with pytest.raises(ValueError, match="creature_share"):
        pairs.PairSettings(creature_share=1.5)


def test_held_out_creatures_are_never_training_creatures():
    rng = np.random.default_rng(6)
    training = [creatures.sample_traits(rng) for _ in range(200)]
    unseen = [creatures.sample_traits(rng, held_out=True) for _ in range(200)]
    assert not any(creatures.is_held_out(traits) for traits in training)
    assert all(creatures.is_held_out(traits) for traits in unseen)
    assert creatures.is_held_out(np.array([0.1, 0.9]))
    assert not creatures.is_held_out(np.array([0.1, 0.1]))


def test_other_proportions_grow_parts_by_different_factors_and_stay_one_surface(quadruped):
    other = quadruped.other_proportions(np.random.default_rng(5))
    assert np.array_equal(other.faces, quadruped.faces)
    assert len(other.vertices) == len(quadruped.vertices)
    before, after = (unit_normals(c.vertices, c.faces)[1] for c in (quadruped, other))
    growth = np.sqrt(after / before)
    low, high = np.quantile(growth, [0.1, 0.9])
    assert high / low > 1.2
    assert growth.max() < 4
    # Its joints went with the skin: a pose still turns limbs about their own joints.
    posed = creatures.sample_pose(other, np.random.default_rng(6))
    assert np.isfinite(posed).all()
