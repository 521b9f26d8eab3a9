# SPDX-License-Identifier: GPL-3.0-or-later
"""The comparison of refined maps with peers: pyFM's ZoomOut finds the same map as ours."""

import numpy as np
import pytest
import supple
from supple_training.compare import shapes
from supple_training.compare.maps import command, peers

pytest.importorskip("pyFM", reason="pyfmaps is not installed")


def test_pyfm_zoomout_is_ours():
    torus = shapes.bumpy_torus(500)
    random = np.random.default_rng(0)
    order = random.permutation(len(torus.vertices))
    moved = np.empty_like(torus.vertices)
    moved[order] = 2.0 * torus.vertices
    source = supple.PreparedMesh(torus.vertices, torus.faces, cache=False)
    target = supple.PreparedMesh(moved, order[torus.faces], cache=False)
    rough = order.copy()
    wrong = random.random(len(order)) < 0.2
    rough[wrong] = order[random.integers(0, len(order), wrong.sum())]
    (method, of_samples), missing = peers.peers(1)
    assert missing and "Smooth FM" in missing[0]
    theirs = method.bind(source, target)(rough)
    assert np.mean(of_samples.bind(source, target)(rough) == theirs) > 0.95  # of fewer than 1,024
    ours = supple.zoomout_map(source, target, rough)
    assert np.mean(theirs == ours) > 0.98


def test_speed_is_compared_in_one_run():
    rows = {name: {"seconds_per_pair": s} for name, s in (("pyfm_zoomout", 6.0), ("ljn", 0.1))}
    assert command.speed_ratios(rows) == {"ljn": pytest.approx(60)}
    assert command.speed_ratios({"ljn": {"seconds_per_pair": 0.1}}) == {}
