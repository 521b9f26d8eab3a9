# SPDX-License-Identifier: GPL-3.0-or-later
"""The comparison of refined maps with peers: pyFM's ZoomOut finds the same map as ours, the others
bring maps right and find the least of what they say.
"""

import numpy as np
import pytest
import supple
from supple_training.compare import shapes
from supple_training.compare.maps import command, discrete, peers

pytest.importorskip("pyFM", reason="pyfmaps is not installed")


@pytest.fixture(scope="module")
def pair():
    """A surface, a scaled copy of it in another order, and the order."""
    torus = shapes.bumpy_torus(500)
    order = np.random.default_rng(0).permutation(len(torus.vertices))
    moved = np.empty_like(torus.vertices)
    moved[order] = 2.0 * torus.vertices
    source = supple.PreparedMesh(torus.vertices, torus.faces, cache=False)
    return source, supple.PreparedMesh(moved, order[torus.faces], cache=False), order


@pytest.fixture(scope="module")
def rough(pair):
    """The true map with a fifth of it drawn at random."""
    order = pair[2]
    random = np.random.default_rng(1)
    wrong = random.random(len(order)) < 0.2
    return np.where(wrong, order[random.integers(0, len(order), len(order))], order)


@pytest.fixture(scope="module")
def methods():
    found, missing = peers.peers(1)
    assert not missing
    return {method.name: method for method in found}


def test_pyfm_zoomout_is_ours(pair, rough, methods):
    source, target, _ = pair
    theirs = methods["pyfm_zoomout"].bind(source, target)(rough)
    of_samples = methods["pyfm_zoomout_samples"].bind(source, target)(rough)
    assert np.mean(of_samples == theirs) > 0.95  # of fewer than 1,024
    ours = supple.zoomout_map(source, target, rough)
    assert np.mean(theirs == ours) > 0.98


@pytest.mark.parametrize("name", ["discrete_optimization", "smooth_fm"])
def test_maps_between_copies_come_right(pair, rough, methods, name):
    source, target, order = pair
    refined = methods[name].bind(source, target)(rough)
    assert refined.dtype == np.int32
    assert np.mean(rough == order) < 0.85
    assert np.mean(refined == order) > 0.98


def sides(pair):
    found = peers.Sides(30)
    return found.of(pair[0]), found.of(pair[1])


def test_functional_maps_of_both_directions_are_least(pair, rough):
    source, target = sides(pair)
    random = np.random.default_rng(2)
    back = random.integers(0, len(rough), len(rough))
    s, t = source.functions[:, :12], target.functions[:, :12]

    def energy(c):
        there = source.mass @ ((s @ c - t[rough]) ** 2)
        return (there + target.mass @ ((s[back] @ c - t) ** 2)).sum()

    least = discrete.functional_map(source, target, rough, back, 12)
    for _ in range(5):
        step = 1e-4 * random.standard_normal(least.shape)
        change = energy(least + step) - energy(least - step)
        assert energy(least + step) > energy(least)
        assert abs(change) < 1e-6 * (energy(least + step) - energy(least))


def test_harmonic_places_are_least(pair, rough):
    source, target = sides(pair)
    random = np.random.default_rng(3)
    back = random.integers(0, len(rough), len(rough))

    def energy(y):
        close = source.mass @ ((y - target.vertices[rough]) ** 2)
        returned = target.mass @ ((y[back] - target.vertices) ** 2)
        smooth = (y * (source.laplacian @ y)).sum()
        return smooth + discrete.COUPLING * close.sum() + discrete.REVERSIBLE * returned.sum()

    least = discrete.harmonic(source, target, rough, back)
    for _ in range(5):
        step = 1e-3 * random.standard_normal(least.shape)
        gained = energy(least + step) - energy(least)
        assert gained > 0
        assert abs(energy(least + step) - energy(least - step)) < 1e-6 * gained


def test_speed_is_compared_in_one_run():
    rows = {name: {"seconds_per_pair": s} for name, s in (("pyfm_zoomout", 6.0), ("ljn", 0.1))}
    assert command.speed_ratios(rows) == {"ljn": pytest.approx(60)}
    assert command.speed_ratios({"ljn": {"seconds_per_pair": 0.1}}) == {}
