# SPDX-License-Identifier: GPL-3.0-or-later
"""Refining maps through Python, and whether the network earns its place there.

The pairs are bodies that no training saw (tests/meshes/held_out_bodies.npz); the truth is the
identity, the rough map what a matcher leaves: it drifts, jumps, and many vertices share a target.
Were the network replaced by the identity, both rows of figures would be equal and the test of it
would fail.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import supple

FIXTURE = Path(__file__).parents[1] / "meshes" / "held_out_bodies.npz"
PAIRS = 4


def unit(vertices: np.ndarray, faces: np.ndarray) -> float:
    """The root of the area."""
    corner = vertices[faces]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return float(np.sqrt(np.linalg.norm(cross, axis=1).sum() / 2))


def nearest(points: np.ndarray, among: np.ndarray) -> np.ndarray:
    return np.concatenate(
        [
            np.argmin(np.sum((block[:, None] - among[None]) ** 2, axis=2), axis=1)
            for block in np.array_split(points, max(1, len(points) // 200))
        ]
    )


def rough_map(target: np.ndarray, faces: np.ndarray, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    size = unit(target, faces)
    drift = np.sin(target @ rng.normal(size=(3, 3)) * 8 / size) * 0.01 * size
    moved = target + drift + rng.normal(0, 0.006 * size, target.shape)
    kept = np.flatnonzero(rng.random(len(target)) < 0.7)
    return kept[nearest(moved, target[kept])].astype(np.int32)


def figures(source, faces, target, point_map) -> np.ndarray:
    """Mean error x100 of the root of the area, and the share of vertices hit, in percent."""
    error = np.linalg.norm(target[point_map] - target, axis=1).mean() / unit(target, faces)
    return np.array([100 * error, 100 * len(np.unique(point_map)) / len(target)])


@pytest.fixture(scope="module")
def pairs() -> list[tuple]:
    """source, faces, target, the two prepared, a rough map."""
    result = []
    with np.load(FIXTURE) as data:
        for i in range(PAIRS):
            source, target = (data[f"{name}{i}"].astype(np.float64) for name in "st")
            faces = data[f"f{i}"].astype(np.int32)
            both = [supple.PreparedMesh(v, faces, cache=False) for v in (source, target)]
            result.append((source, faces, target, *both, rough_map(target, faces, i)))
    return result


def test_network_refines_maps_better_than_the_identity(pairs):
    rows = np.empty((3, len(pairs), 2))
    for i, (source, faces, target, from_, to, rough) in enumerate(pairs):
        rows[0, i] = figures(source, faces, target, rough)
        for row, model in ((1, None), (2, "spectral")):
            result = supple.Refiner(from_, to, model=model).refine(rough)
            assert result.report["network"] is (model is not None)
            rows[row, i] = figures(source, faces, target, result.point_map)
    initial, identity, network = rows
    assert network[:, 0].mean() < 0.9 * identity[:, 0].mean(), rows
    assert network[:, 1].mean() > identity[:, 1].mean(), rows
    assert np.all(network[:, 0] < identity[:, 0]), rows
    # And both beat what they were given.
    assert network[:, 0].mean() < 0.7 * initial[:, 0].mean(), rows
    assert np.all(network[:, 1] > initial[:, 1]), rows


def test_torn_maps_do_not_run_away():
    """An arm that goes to the other end of the body. The network knows nothing of faces that are
    stretched so far; without a bound the body became a thousand times as large."""
    with np.load(FIXTURE) as data:
        source, target, faces = (data[f"{name}2"].astype(np.float64) for name in "stf")
    faces = faces.astype(np.int32)
    torn = rough_map(target, faces, 2)
    size = np.ptp(target, axis=0)
    long, side = np.argmax(size), np.argsort(size)[1]
    arm = target[:, side] > np.quantile(target[:, side], 0.85)
    image = target[arm].copy()
    image[:, long] = target[:, long].min() + image[:, side] - image[:, side].min()
    torn[arm] = nearest(image, target)
    from_, to = (supple.PreparedMesh(v, faces, cache=False) for v in (source, target))
    counts = (80, 100, 120, 120, 120, 120)
    plain, got = (
        supple.Refiner(from_, to, model=model, counts=counts).refine(torn)
        for model in (None, "spectral")
    )
    assert plain.report["bounded_faces"] == 0
    assert 0 < got.report["bounded_faces"] < 0.2 * len(faces)
    assert np.ptp(got.recovered, axis=0).max() < 1.2 * size.max()
    energies = [supple.map_dirichlet(from_, to, result.point_map) for result in (plain, got)]
    assert energies[1] < energies[0]


def test_result_has_every_part(pairs):
    source, faces, target, from_, to, rough = pairs[0]
    result = supple.Refiner(from_, to, counts=[60], backward=True).refine(rough)
    n = len(source)
    assert result.point_map.shape == (n,)
    assert result.recovered.shape == (n, 3)
    assert result.confidence.min() >= 0
    assert result.confidence.max() <= 1
    on_target = np.einsum(
        "nk,nkd->nd", result.surface_map.weights, target[faces[result.surface_map.face]]
    )
    away = np.linalg.norm(result.recovered - on_target, axis=1)
    assert np.median(away) < 0.01 * unit(target, faces)
    corners = faces[result.surface_map.face]
    assert np.all(np.any(corners == result.point_map[:, None], axis=1))
    assert len(result.backward_point_map) == len(result.backward_surface_map) == len(target)
    assert result.report["rounds"] == 1
    assert result.report["eigenfunctions"] <= 60
    assert result.notes == []


def test_same_map_every_time_and_for_a_map_to_points(pairs):
    *_, from_, to, rough = pairs[0]
    refiner = supple.Refiner(from_, to, counts=[60])
    first, second = refiner.refine(rough), refiner.refine(rough)
    assert np.array_equal(first.recovered, second.recovered)
    as_points = refiner.refine(supple.SurfaceMap.from_point_map(rough, to))
    assert np.array_equal(first.point_map, as_points.point_map)


def test_one_call_from_arrays(pairs):
    source, faces, target, from_, to, rough = pairs[0]
    got = supple.refine((source, faces), (target, faces), rough, model=None, counts=[40])
    expected = supple.Refiner(from_, to, model=None, counts=[40]).refine(rough)
    assert np.array_equal(got.point_map, expected.point_map)


def test_bad_input_is_one_clear_error(pairs):
    *_, from_, to, rough = pairs[0]
    refiner = supple.Refiner(from_, to, model=None, counts=[20])
    beyond = rough.copy()
    beyond[3] = len(to.vertices)
    cases = {
        ("wrong_shape", "entries"): lambda: refiner.refine(rough[:-1]),
        ("index_out_of_range", "vertex 3"): lambda: refiner.refine(beyond),
        ("wrong_shape", "whole"): lambda: refiner.refine(rough + 0.5),
        ("bad_option", "rotations"): lambda: supple.Refiner(from_, to, model="rotation"),
        ("bad_option", "round"): lambda: supple.Refiner(from_, to, counts=[]),
        ("bad_option", "no way"): lambda: supple.Refiner(from_, to, method="magic"),
        ("wrong_shape", "source"): lambda: supple.Refiner(rough, to),
    }
    for (code, part), call in cases.items():
        with pytest.raises(supple.SuppleError) as caught:
            call()
        assert caught.value.code == code
        assert part in str(caught.value)


def test_a_cancelled_call_stops(pairs):
    *_, from_, to, rough = pairs[0]
    progress = supple.Progress()
    progress.cancel()
    with pytest.raises(supple.Cancelled):
        supple.Refiner(from_, to, model=None).refine(rough, progress=progress)
