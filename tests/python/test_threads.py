# SPDX-License-Identifier: GPL-3.0-or-later
"""The number of threads changes how long it takes to prepare, edit and map, and not one byte."""

from __future__ import annotations

import numpy as np
import pytest
import supple
from supple import geometry, learning


@pytest.fixture
def threads():
    """Sets the number of threads; the old one comes back."""
    before = supple.thread_count()
    yield supple.set_thread_count
    supple.set_thread_count(before)


def test_meshes_edits_and_maps_are_the_same_bytes_with_any_number_of_threads(blob, threads):
    source, target = blob(3000, 1), blob(2500, 2, bend=0.4)
    rough = source.nearest(target)
    order = np.argsort(source.vertices[:, 0])
    handles = [supple.Handle("low", order[:40]), supple.Handle("high", order[-40:])]
    up = np.eye(4)
    up[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    moved = [handles[0], supple.Handle("high", order[-40:], matrix=up)]

    def results(count: int) -> dict[str, np.ndarray]:
        threads(count)
        a = supple.PreparedMesh(source.vertices, source.faces, cache=False)
        b = supple.PreparedMesh(target.vertices, target.faces, cache=False)
        bent = geometry.jacobians(source.vertices, source.faces, source.vertices * [1, 1, 2])
        turned = geometry.closest_rotations(bent)
        editor = supple.Editor(a, handles)
        refined = supple.refine(a, b, rough)
        return {
            "eigenvalues": a.native.eigenvalues,
            "network": learning.network_forward(a, supple.load_model("rotation"), turned),
            "natural": editor.solve(moved, mode="natural").vertices,
            "stiff": editor.solve(moved, mode="stiff").vertices,
            "arap": editor.solve(moved, method="arap").vertices,
            "recovered": refined.recovered,
            "map": refined.point_map,
            "automatic": supple.automatic_map(a, b).point_map,
        }

    one = results(1)
    for count in (2, 3):
        for name, values in results(count).items():
            assert np.array_equal(values, one[name]), f"{name} differs with {count} threads"
