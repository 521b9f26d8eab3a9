# SPDX-License-Identifier: GPL-3.0-or-later
"""Rough maps between surfaces whose true map is known: what refining a map starts from.

Matchers err in three ways, and so do these maps: parts drift along the surface together, single
vertices jump about, and many vertices share one target.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from supple_training.pairs import Pair
from supple_training.remesh import FloatArray, unit_normals

_DRIFT = (0.003, 0.09)
"""RMS of the drift, in roots of the area, uniform in its logarithm."""

_WAVELENGTH = (0.12, 0.6)
"""Of the drift, in roots of the area."""

_JUMP = 0.015
"""The largest standard deviation of single vertices' jumps, in roots of the area."""

_TARGETS = (0.45, 1.0)
"""The share of the target's vertices that anything maps to."""

_NORMAL = 0.08
"""How far, in roots of the area, a normal that points the other way counts."""

_WAVES = 8


def vertex_normals(vertices: FloatArray, faces: NDArray) -> FloatArray:
    """(n, 3) unit normals: sums over the faces at a vertex, by area."""
    normals, areas = unit_normals(vertices, faces)
    total = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, faces[:, corner], areas[:, None] * normals)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)


def smooth_field(points: FloatArray, rms: float, wavelength: float, rng: np.random.Generator):
    """(n, 3) random vectors that vary smoothly with the point."""
    direction = rng.normal(size=(_WAVES, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    waves = 2 * np.pi / wavelength * rng.uniform(0.3, 1.0, (_WAVES, 1)) * direction
    field = np.sin(points @ waves.T + rng.uniform(0, 2 * np.pi, _WAVES)) @ rng.normal(
        size=(_WAVES, 3)
    )
    return field * (rms / np.sqrt(np.mean(np.sum(field**2, axis=1))))


def rough_map(
    places: FloatArray,
    place_normals: FloatArray,
    vertices: FloatArray,
    faces: NDArray,
    rng: np.random.Generator,
) -> NDArray[np.int32]:
    """(n,) a target vertex for each source vertex.

    places, place_normals (n, 3): where the source's vertices truly lie on the target, and its
    normals there; vertices (t, 3), faces: the target.
    """
    _, areas = unit_normals(vertices, faces)
    unit = np.sqrt(areas.sum())
    drift = unit * np.exp(rng.uniform(*np.log(_DRIFT)))
    moved = places + smooth_field(places, drift, unit * rng.uniform(*_WAVELENGTH), rng)
    moved += rng.normal(0, unit * rng.uniform(0, _JUMP), moved.shape)
    kept = np.flatnonzero(rng.random(len(vertices)) < rng.uniform(*_TARGETS))
    weight = 0.5 * unit * _NORMAL
    normals = vertex_normals(vertices, faces)
    tree = cKDTree(np.hstack([vertices[kept], weight * normals[kept]]))
    _, nearest = tree.query(np.hstack([moved, weight * place_normals]))
    return kept[nearest].astype(np.int32)


def rough_maps(pair: Pair, rng: np.random.Generator, count: int) -> list[NDArray[np.int32]]:
    """The true map of a pair in one connectivity, and `count` rough ones."""
    _, faces, target = pair
    normals = vertex_normals(target, faces)
    true = np.arange(len(target), dtype=np.int32)
    return [true, *(rough_map(target, normals, target, faces, rng) for _ in range(count))]
