# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces without labels: triangulated anew, in a random order, turned, scaled and moved.

Nothing of such a shape says which point of the original a vertex is: neither its number, nor its
connectivity, nor where it lies in space. `Shape.surface`, which does say it, is for measuring.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from supple_training.remesh import (
    FloatArray,
    IntArray,
    Remeshed,
    decimate,
    is_closed_manifold,
    remesh,
    unit_normals,
)

_SCALES = (0.2, 5.0)
"""Sizes, uniform in their logarithm."""

_SHIFT = 2.0
"""Standard deviation of positions, in roots of the area."""


@dataclass(frozen=True)
class Shape:
    """A surface in a triangulation, order and place of its own."""

    vertices: FloatArray
    """(n, 3), in no particular unit."""
    faces: NDArray[np.int32]
    """(m, 3)."""
    surface: Remeshed
    """The vertices, in the same order, as points of the original surface."""


def shuffled(surface: Remeshed, rng: np.random.Generator) -> Remeshed:
    """The same triangulation with vertices and faces in a random order.

    Faces also begin at a random corner; they keep their sides.
    """
    order = rng.permutation(len(surface.corners))
    numbers = np.argsort(order)
    faces = numbers[surface.faces[rng.permutation(len(surface.faces))]]
    starts = rng.integers(0, 3, (len(faces), 1))
    faces = np.take_along_axis(faces, (starts + np.arange(3)) % 3, axis=1)
    return replace(
        surface, faces=faces, corners=surface.corners[order], weights=surface.weights[order]
    )


def placed(
    vertices: FloatArray, faces: NDArray, rng: np.random.Generator
) -> tuple[FloatArray, Rotation, float]:
    """Vertices (n, 3) after a random rotation, scale and shift; the rotation; the scale."""
    turn = Rotation.from_quat(rng.normal(size=4))
    scale = float(np.exp(rng.uniform(*np.log(_SCALES))))
    root = np.sqrt(unit_normals(vertices, faces)[1].sum())
    middle = vertices.mean(axis=0)
    shift = rng.normal(0.0, _SHIFT * root, 3)
    return scale * (turn.apply(vertices - middle) + shift), turn, scale


def remeshed(
    vertices: FloatArray,
    faces: IntArray,
    rng: np.random.Generator,
    vertex_count: int | tuple[int, int],
    *,
    posed: FloatArray | None = None,
) -> Shape:
    """A surface without labels, triangulated by `remesh`, or by `decimate` where it has holes.

    vertices (N, 3), faces (M, 3): the surface that is triangulated; vertex_count: how many vertices
    the shape has, or their range. posed (N, 3): where the vertices go afterwards, as for a pose
    whose rest is easier to triangulate.

    Raises RuntimeError when no triangulation is good enough.
    """
    make = remesh if is_closed_manifold(faces) else decimate
    surface = shuffled(make(vertices, faces, rng, vertex_count=vertex_count), rng)
    points = surface.carry(vertices if posed is None else posed)
    return Shape(placed(points, surface.faces, rng)[0], surface.faces.astype(np.int32), surface)


def cleaned(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Faces (m, 3) in which every vertex has one fan, and the original of each vertex, (n,).

    Faces that name a vertex twice go, and those beyond one with the same vertices; a vertex at
    which several fans of faces meet is split into one for each; unused vertices go.

    Raises ValueError when an edge has more than two faces or two that run along it the same way.
    """
    twice = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    faces = faces[~twice]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    faces = faces[np.sort(first)]
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    count = np.int64(faces.max()) + 1
    forward, backward = start * count + end, end * count + start
    edges, uses = np.unique(forward, return_counts=True)
    if uses.max() > 1:
        bad = edges[uses.argmax()]
        raise ValueError(
            f"{int((uses > 1).sum())} edges, one from vertex {bad // count} to {bad % count}, have "
            "more than two faces or faces that look opposite ways; make the mesh manifold"
        )
    # Two faces at an edge share the corners at its ends; corners joined so make one vertex.
    order = np.argsort(forward)
    at = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    across = order[at]
    inner = forward[across] == backward
    corner = np.arange(3 * len(faces))
    after = 3 * (corner // 3) + (corner + 1) % 3
    one = np.concatenate([corner[inner], after[inner]])
    other = np.concatenate([after[across[inner]], across[inner]])
    graph = scipy.sparse.coo_matrix((np.ones(len(one)), (one, other)), (len(corner), len(corner)))
    _, labels = scipy.sparse.csgraph.connected_components(graph, directed=False)
    _, place = np.unique(labels, return_index=True)
    return labels.reshape(-1, 3).astype(np.int64), faces.ravel()[place].astype(np.int64)
