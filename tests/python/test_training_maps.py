# SPDX-License-Identifier: GPL-3.0-or-later
"""Rough maps to train and measure refining on: near the truth, rough, and the same for a seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("anny", reason="anny is not installed; pip install ./training")
pytest.importorskip("igl", reason="libigl is not installed; pip install ./training")

from supple_training.maps import rough_maps, smooth_field
from supple_training.remesh import unit_normals

FIXTURE = Path(__file__).parents[1] / "meshes" / "held_out_bodies.npz"


@pytest.fixture(scope="module")
def pair():
    with np.load(FIXTURE) as data:
        return (
            data["s0"].astype(np.float64),
            data["f0"].astype(np.int32),
            data["t0"].astype(np.float64),
        )


def test_rough_maps_are_near_the_truth_but_not_it(pair):
    _, faces, target = pair
    true, *rough = rough_maps(pair, np.random.default_rng(1), 6)
    assert np.array_equal(true, np.arange(len(target)))
    unit = np.sqrt(unit_normals(target, faces)[1].sum())
    errors = [np.linalg.norm(target[m] - target, axis=1).mean() / unit for m in rough]
    assert min(errors) > 0.001
    assert max(errors) < 0.15
    for m in rough:
        assert m.min() >= 0
        assert m.max() < len(target)
        assert len(np.unique(m)) < 0.95 * len(target)


def test_same_seed_same_maps(pair):
    first, second = (rough_maps(pair, np.random.default_rng(3), 2) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


def test_drift_is_smooth_and_as_large_as_asked(pair):
    points = pair[2]
    field = smooth_field(points, 0.02, 0.5, np.random.default_rng(2))
    assert np.sqrt(np.mean(np.sum(field**2, axis=1))) == pytest.approx(0.02)
    nudged = smooth_field(points + 1e-4, 0.02, 0.5, np.random.default_rng(2))
    assert np.abs(nudged - field).max() < 1e-4
