# SPDX-License-Identifier: GPL-3.0-or-later
"""Two classical refinements that take turns between functional maps and maps of points, both ways.

Discrete Optimization: Ren, Melzi, Wonka, Ovsjanikov 2021. Smooth FM: Magnet, Ren, Sorkine-Hornung,
Ovsjanikov 2022, in its default form (reversible harmonic maps). Written from the two papers, with
the settings of their authors' program and the numbers of functions of the paper on Local Jacobian
Networks. Nearest neighbours are pyFM's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve
from supple.evaluation import Map

DISCRETE_COUNTS = range(20, 101, 5)
SMOOTH_COUNTS = range(10, 71, 5)
SMOOTH_ROUNDS = 5
"""Of each number of functions."""
COUPLING = 1.0
"""Weight of the distance to the map of points, beside the Dirichlet energy."""
REVERSIBLE = 1e4
"""Weight of the way there and back."""
SPECTRAL = 0.25
"""Size of the functions' part among what nearest neighbours are found by."""
PLACES = (0.15, 1.5)
"""The same of the places' part, in the first and in the last round, by equal ratios."""

Nearest = Callable[[NDArray, NDArray], Map]
"""The row of the first that is nearest to each of the second."""


@dataclass(frozen=True)
class Side:
    """A mesh of area 1 about its centre: vertices (n, 3), functions (n, k), mass (n,), (n, n)."""

    vertices: NDArray[np.float64]
    functions: NDArray[np.float64]
    mass: NDArray[np.float64]
    laplacian: sparse.spmatrix


def functional_map(source: Side, target: Side, there: Map, back: Map, k: int) -> NDArray:
    """(k, k): of functions on the target to the source, C that makes least of
    |S C - T[there]|^2 + |S[back] C - T|^2 by area, S and T the first k functions.
    """
    own, other = source.functions[:, :k], target.functions[:, :k]
    returned = own[back].T * target.mass
    system = np.eye(k) + returned @ own[back]
    return np.linalg.solve(system, (own.T * source.mass) @ other[there] + returned @ other)


def start_back(source: Side, target: Side, there: Map, k: int, nearest: Nearest) -> Map:
    """(target n,): a map back to begin with, by the functional map of the one there."""
    own, other = source.functions[:, :k], target.functions[:, :k]
    c = (own.T * source.mass) @ other[there]
    return nearest(own @ c, other)


def discrete_optimization(source: Side, target: Side, initial: Map, nearest: Nearest) -> Map:
    """(source n,) target vertices: coupling, orthogonality and bijectivity alike."""

    def points(own: Side, other: Side, c: NDArray, d: NDArray) -> Map:
        k = len(c)
        s, t = own.functions[:, :k], other.functions[:, :k]
        return nearest(np.hstack([t @ c.T, t, t @ d]), np.hstack([s, s @ c, s]))

    there = initial
    back = start_back(source, target, there, DISCRETE_COUNTS[0], nearest)
    for k in DISCRETE_COUNTS:
        c = functional_map(source, target, there, back, k)
        d = functional_map(target, source, back, there, k)
        there, back = points(source, target, c, d), points(target, source, d, c)
    return there


def harmonic(own: Side, other: Side, there: Map, back: Map) -> NDArray:
    """(own n, 3): places Y on the other mesh that make least of
    |grad Y|^2 + COUPLING |Y - X[there]|^2 + REVERSIBLE |Y[back] - X|^2, X the other's vertices.
    """
    hit = sparse.csr_matrix(
        (np.ones(len(back)), (np.arange(len(back)), back)), shape=(len(back), len(there))
    )
    pulled = hit.T @ sparse.diags(other.mass)
    system = own.laplacian + COUPLING * sparse.diags(own.mass) + REVERSIBLE * pulled @ hit
    right = COUPLING * own.mass[:, None] * other.vertices[there]
    return spsolve(system.tocsc(), right + REVERSIBLE * pulled @ other.vertices)


def smooth_functional_map(source: Side, target: Side, initial: Map, nearest: Nearest) -> Map:
    """(source n,) target vertices: smooth places beside coupling and bijectivity."""

    def points(own: Side, other: Side, c: NDArray, d: NDArray, y: NDArray, weight: float) -> Map:
        k = len(c)
        s, t = own.functions[:, :k], other.functions[:, :k]
        small = SPECTRAL / np.sqrt(k)
        scale = weight / np.sqrt((own.mass @ y**2).sum())
        return nearest(
            np.hstack([scale * other.vertices, small * t, small * (t @ d)]),
            np.hstack([scale * y, small * (s @ c), small * s]),
        )

    there = initial
    back = start_back(source, target, there, SMOOTH_COUNTS[0], nearest)
    for k, weight in zip(SMOOTH_COUNTS, np.geomspace(*PLACES, len(SMOOTH_COUNTS)), strict=True):
        for _ in range(SMOOTH_ROUNDS):
            c = functional_map(source, target, there, back, k)
            d = functional_map(target, source, back, there, k)
            y = harmonic(source, target, there, back)
            z = harmonic(target, source, back, there)
            there, back = (
                points(source, target, c, d, y, weight),
                points(target, source, d, c, z, weight),
            )
    return there
