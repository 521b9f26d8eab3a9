# SPDX-License-Identifier: GPL-3.0-or-later
"""Training bodies, triangulations and pairs: correspondence, determinism, held-out bodies apart."""

from __future__ import annotations

import json

import numpy as np
import pytest

pytest.importorskip("anny", reason="anny is not installed; pip install ./training")
pytest.importorskip("igl", reason="libigl is not installed; pip install ./training")

from supple_training import bodies, pairs
from supple_training.remesh import (
    component_count,
    euler_characteristic,
    is_closed_manifold,
    remesh,
    triangle_quality,
    unit_normals,
)

SMALL = (1100, 1300)


@pytest.fixture(scope="module")
def body() -> np.ndarray:
    return bodies.sample_phenotype(np.random.default_rng(1))


def test_the_body_is_one_closed_surface_of_genus_0(body):
    faces = bodies.triangles()
    assert bodies.vertices(body).shape == (13_348, 3)
    assert len(np.unique(faces)) == 13_348
    assert euler_characteristic(faces) == 2
    assert component_count(faces) == 1
    assert is_closed_manifold(faces)


def test_the_topology_checks_notice_a_hole_a_second_piece_and_a_turned_face():
    faces = bodies.triangles()
    assert not is_closed_manifold(faces[1:])
    turned = faces.copy()
    turned[0] = turned[0, ::-1]
    assert not is_closed_manifold(turned)
    assert euler_characteristic(faces[1:]) == 1
    assert component_count(np.concatenate([faces, faces + len(faces)])) == 2


def test_poses_move_the_body_keep_its_size_and_hardly_cut_into_it(body):
    faces = bodies.triangles()
    rest = bodies.vertices(body)
    posed = bodies.sample_pose(body, np.random.default_rng(2))
    assert np.abs(posed - rest).max() > 0.1
    _, rest_areas = unit_normals(rest, faces)
    _, posed_areas = unit_normals(posed, faces)
    assert posed_areas.sum() == pytest.approx(rest_areas.sum(), rel=0.1)
    limit = bodies.self_intersection(rest, faces) + 0.015
    assert bodies.self_intersection(posed, faces) <= limit


def test_self_intersection_sees_an_arm_and_a_leg_inside_the_body(body):
    faces = bodies.triangles()
    inwards = {
        "upperarm01.L": bodies.rotation(np.array([0.0, 0.0, -75.0])),
        "upperleg01.R": bodies.rotation(np.array([0.0, 0.0, -25.0])),
    }
    at_rest = bodies.self_intersection(bodies.vertices(body), faces)
    assert bodies.self_intersection(bodies.vertices(body, inwards), faces) > at_rest + 0.05


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_new_triangulation_lies_on_the_surface_in_every_pose(body, seed):
    rng = np.random.default_rng(seed)
    faces = bodies.triangles()
    rest, posed = bodies.vertices(body), bodies.sample_pose(body, rng)
    surface = remesh(rest, faces, rng, vertex_count=(2400, 2600))

    assert 2400 <= len(surface.weights) <= 2600
    assert euler_characteristic(surface.faces) == 2
    assert component_count(surface.faces) == 1
    assert is_closed_manifold(surface.faces)
    assert np.all(surface.weights >= 0)
    assert np.allclose(surface.weights.sum(axis=1), 1.0)
    original_faces = {tuple(sorted(face)) for face in faces.tolist()}
    assert all(tuple(sorted(corners)) in original_faces for corners in surface.corners.tolist())
    assert triangle_quality(surface.carry(rest), surface.faces).min() > 0.02

    # The surface keeps its size in any pose: no vertex was matched to some other limb.
    for vertices in (rest, posed):
        _, areas = unit_normals(vertices, faces)
        _, new_areas = unit_normals(surface.carry(vertices), surface.faces)
        assert new_areas.sum() == pytest.approx(areas.sum(), rel=0.08)
    edges = np.concatenate([surface.faces[:, [i, (i + 1) % 3]] for i in range(3)])
    start, end = surface.carry(posed)[edges.T]
    assert np.linalg.norm(start - end, axis=1).max() < 0.2


def test_carrying_the_corners_gives_the_original_back(body):
    rest = bodies.vertices(body)
    surface = remesh(rest, bodies.triangles(), np.random.default_rng(6), vertex_count=1200)
    turn = bodies.rotation(np.array([20.0, 50.0, -70.0]))
    moved = rest @ turn.T + [1.0, -2.0, 3.0]
    assert np.allclose(surface.carry(moved), surface.carry(rest) @ turn.T + [1.0, -2.0, 3.0])


def test_two_sources_of_one_body_have_different_connectivity(body):
    rest, faces = bodies.vertices(body), bodies.triangles()
    one, two = (remesh(rest, faces, np.random.default_rng(s), vertex_count=1200) for s in (7, 8))
    assert not np.array_equal(one.faces, two.faces)


def test_a_seed_gives_the_same_pairs_each_apart_from_the_others():
    settings = pairs.PairSettings(pairs=2, seed=9, vertices=SMALL)
    first, again = pairs.make_pair(settings, 1), pairs.make_pair(settings, 1)
    for one, two in zip(first, again, strict=True):
        assert np.array_equal(one, two)
    # Global random state takes no part.
    np.random.seed(123)  # noqa: NPY002
    for one, two in zip(first, pairs.make_pair(settings, 1), strict=True):
        assert np.array_equal(one, two)
    other = pairs.make_pair(pairs.PairSettings(pairs=2, seed=10, vertices=SMALL), 1)
    assert first[0].shape != other[0].shape or not np.allclose(first[0], other[0])

    source, faces, target = first
    assert source.dtype == target.dtype == np.float64
    assert faces.dtype == np.int32
    assert source.shape == target.shape
    assert not np.allclose(source, target)


def test_held_out_bodies_are_never_training_bodies():
    def sample(seed: int, held_out: bool) -> np.ndarray:
        rng = np.random.default_rng(seed)
        return np.array([bodies.sample_phenotype(rng, held_out=held_out) for _ in range(200)])

    training, unseen = sample(11, False), sample(11, True)
    assert not any(bodies.is_held_out(phenotype) for phenotype in training)
    assert all(bodies.is_held_out(phenotype) for phenotype in unseen)
    assert np.abs(training[:, None] - unseen[None]).max(axis=2).min() > 0
    assert pairs.PairSettings(seed=3).digest() != pairs.PairSettings(seed=3, held_out=True).digest()


def test_pairs_are_kept_and_read_back(tmp_path):
    settings = pairs.PairSettings(pairs=1, seed=12, vertices=SMALL)
    made = pairs.cached(settings, tmp_path, processes=1)
    (path,) = tmp_path.iterdir()
    stamp = path.stat().st_mtime_ns
    read = pairs.cached(settings, tmp_path, processes=1)
    assert path.stat().st_mtime_ns == stamp
    for one, two in zip(made[0], read[0], strict=True):
        assert np.array_equal(one, two)
    with np.load(path) as data:
        about = json.loads(str(data["about"]))
    assert about["seed"] == 12
    assert "CC0" in about["origin"]

    small = tmp_path / "small.npz"
    pairs.save(small, made, settings, small=True)
    ((source, faces, _),) = pairs.load(small)
    assert np.array_equal(faces, made[0][1])
    assert np.abs(source - made[0][0]).max() < 1e-6


def test_bad_settings_and_empty_files_are_refused_in_words(tmp_path):
    with pytest.raises(ValueError, match="pairs must be at least 1"):
        pairs.PairSettings(pairs=0)
    with pytest.raises(ValueError, match="vertices must be a range"):
        pairs.PairSettings(vertices=(900, 600))
    np.savez(tmp_path / "empty.npz", about="nothing")
    with pytest.raises(ValueError, match="no pairs in this file"):
        pairs.load(tmp_path / "empty.npz")
