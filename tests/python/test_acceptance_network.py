# SPDX-License-Identifier: GPL-3.0-or-later
"""The shipped networks must earn their place on bodies they were not trained on.

The pairs come from held-out bodies of the CC0 package anny (tests/meshes/held_out_bodies.npz, CC0,
made by python -m supple_training.data --held-out). Each test measures the network beside the
identity in its place, all else the same: were the network replaced by the identity, both figures
would be equal and the test would fail.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import supple

FIXTURE = Path(__file__).parents[1] / "meshes" / "held_out_bodies.npz"


@pytest.fixture(scope="module")
def pairs() -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    with np.load(FIXTURE) as data:
        count = sum(name.startswith("t") for name in data.files)
        return [
            (
                data[f"s{i}"].astype(np.float64),
                data[f"f{i}"].astype(np.int32),
                data[f"t{i}"].astype(np.float64),
            )
            for i in range(count)
        ]


@pytest.fixture(scope="module")
def prepared(pairs) -> list[supple.PreparedMesh]:
    return [supple.PreparedMesh(source, faces, cache=False) for source, faces, _ in pairs]


def farthest_points(points: np.ndarray, count: int) -> list[int]:
    chosen = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())]
    distance = np.full(len(points), np.inf)
    while len(chosen) < count:
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(distance.argmax()))
    return chosen


def small_handles(source, faces, target, count: int) -> list[supple.Handle]:
    """A vertex and its neighbours each, at their true positions."""
    free = np.ones(len(source), bool)
    handles = []
    for centre in farthest_points(source, count):
        patch = np.unique(faces[np.any(faces == centre, axis=1)])
        patch = patch[free[patch]]
        free[patch] = False
        if len(patch):
            handles.append(supple.Handle(f"at {centre}", patch, positions=target[patch]))
    return handles


def pose_errors_by_editing(pairs, prepared, count: int) -> tuple[np.ndarray, np.ndarray]:
    """With and without the network, one a pair."""
    errors = np.empty((2, len(pairs)))
    for i, ((source, faces, target), mesh) in enumerate(zip(pairs, prepared, strict=True)):
        editor = supple.Editor(mesh, small_handles(source, faces, target, count), model="rotation")
        for row, network in enumerate((True, False)):
            result = editor.solve(mode="natural", network=network)
            assert result.report["network"] is network
            errors[row, i] = supple.pose_error(source, faces, result.vertices, target)
    return errors[0], errors[1]


@pytest.mark.parametrize("count", [8, 16, 40])
def test_rotation_network_is_nearer_to_true_poses_than_the_identity(pairs, prepared, count):
    with_network, without = pose_errors_by_editing(pairs, prepared, count)
    assert with_network.mean() < without.mean()
    assert np.sum(with_network < without) > len(pairs) / 2


@pytest.mark.parametrize("count", [8, 16, 40])
def test_the_same_from_another_pose_as_a_frame_of_an_animation(pairs, prepared, count):
    """From a pose on the way to the true one; with it, the identity and the way itself lose."""
    errors = np.empty((3, len(pairs)))
    for i, ((source, faces, target), mesh) in enumerate(zip(pairs, prepared, strict=True)):
        start = supple.Inbetween(mesh, [source, target], [0, 1]).at(0.4)
        editor = supple.Editor(mesh, small_handles(source, faces, target, count))
        errors[2, i] = supple.pose_error(source, faces, start, target)
        for row, network in enumerate((True, False)):
            result = editor.solve(mode="natural", network=network, start=start)
            errors[row, i] = supple.pose_error(source, faces, result.vertices, target)
    assert errors[0].mean() < 0.97 * errors[1].mean()
    assert np.sum(errors[0] < errors[1]) > len(pairs) / 2
    assert errors[0].mean() < 0.25 * errors[2].mean()


def test_natural_is_nearer_to_true_poses_than_as_rigid_as_possible(pairs, prepared):
    """By 8% in the mean over 8, 16 and 40 handles, and the network by 5% of the identity's."""
    errors = {"natural": [], "identity": [], "arap": []}
    for count in (8, 16, 40):
        for (source, faces, target), mesh in zip(pairs, prepared, strict=True):
            handles = small_handles(source, faces, target, count)
            editor = supple.Editor(mesh, handles, model="rotation")
            for name, options in (
                ("natural", {}),
                ("identity", {"network": False}),
                ("arap", {"mode": "arap"}),
            ):
                posed = editor.solve(**options).vertices
                errors[name].append(supple.pose_error(source, faces, posed, target))
    means = {name: np.mean(values) for name, values in errors.items()}
    assert means["natural"] <= 0.92 * means["arap"], means
    assert means["natural"] <= 0.95 * means["identity"], means


@pytest.mark.parametrize("count", [40, 80])
def test_spectral_network_is_nearer_to_true_targets_than_the_identity(pairs, prepared, count):
    errors = np.empty((2, len(pairs)))
    for i, ((source, faces, target), mesh) in enumerate(zip(pairs, prepared, strict=True)):
        for row, network in enumerate((True, False)):
            recovered = supple.deform(
                mesh, target, model="spectral", eigenfunctions=count, network=network
            )
            errors[row, i] = supple.pose_error(source, faces, recovered, target)
    assert errors[0].mean() < errors[1].mean()
    assert np.sum(errors[0] < errors[1]) > len(pairs) / 2
