# SPDX-License-Identifier: GPL-3.0-or-later
"""The meshes that are measured on, and what is done to them. All have area 1."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SEED = 20

JITTER = 0.3
"""Vertices move by up to this part of their distance to the next one, along the surface."""


@dataclass(frozen=True)
class Case:
    """A mesh: vertices (n, 3) float64 and faces (m, 3) int32."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]


def _area(vertices: NDArray, faces: NDArray) -> float:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _torus_points(u: NDArray, v: NDArray) -> NDArray[np.float64]:
    r = 0.3 * (1.0 + 0.2 * np.sin(3.0 * u + 0.3) * np.cos(2.0 * v))
    ring = 1.0 + r * np.cos(v)
    return np.stack([ring * np.cos(u), ring * np.sin(u), r * np.sin(v)], axis=1)


def bumpy_torus(size: int) -> Case:
    """A closed surface of about `size` vertices, curved and irregular; the same every time.

    That of native/bench with every vertex moved along the surface, every quad cut along a random
    diagonal, and the vertices in random order, so that no solver meets the order of a grid.
    """
    rng = np.random.default_rng([SEED, size])
    along = max(4, int(np.sqrt(size * 2.5)))
    around = max(3, size // along)
    count = along * around
    i, j = np.divmod(np.arange(count), around)
    shift_u, shift_v = rng.uniform(-JITTER, JITTER, (2, count))
    vertices = _torus_points(2 * np.pi * (i + shift_u) / along, 2 * np.pi * (j + shift_v) / around)
    next_i, next_j = (i + 1) % along, (j + 1) % around
    a, b = i * around + j, next_i * around + j
    c, d = next_i * around + next_j, i * around + next_j
    one = np.stack([a, b, c, a, c, d], axis=1)
    other = np.stack([a, b, d, b, c, d], axis=1)
    faces = np.where(rng.random(count)[:, None] < 0.5, one, other).reshape(-1, 3)
    place = rng.permutation(count)
    shuffled = np.empty_like(vertices)
    shuffled[place] = vertices
    faces = place[faces].astype(np.int32)
    return Case(shuffled / np.sqrt(_area(shuffled, faces)), faces)


def body(size: int) -> Case:
    """A human body of about `size` vertices at rest: long thin limbs beside a round trunk."""
    import igl

    from supple_training import bodies

    phenotype = np.full(len(bodies.PHENOTYPES), 0.5)
    full = np.ascontiguousarray(bodies.vertices(phenotype))
    vertices, faces, _, _ = igl.qslim(full, bodies.triangles(), 2 * size - 4)
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    return Case(np.ascontiguousarray(vertices) / np.sqrt(_area(vertices, faces)), faces)


def save(case: Case, path: Path) -> None:
    """As .npz, for `load`."""
    np.savez(path, vertices=case.vertices, faces=case.faces)


def load(path: Path) -> Case:
    """A mesh that `save` wrote."""
    with np.load(path) as file:
        return Case(file["vertices"], file["faces"])


def bent(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """The vertices (n, 3) twisted and bent by about a radian end to end: a large deformation."""
    x, y, z = (vertices - vertices.mean(axis=0)).T
    twist = 1.5 * x
    y, z = np.cos(twist) * y - np.sin(twist) * z, np.sin(twist) * y + np.cos(twist) * z
    bend = 1.0 * y
    return np.stack([np.cos(bend) * x - np.sin(bend) * y, np.sin(bend) * x + np.cos(bend) * y, z]).T


def two_ends(vertices: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Vertices at either end along x: one twelfth of the extent each. What edits hold and lift."""
    x = vertices[:, 0]
    low, high = x.min(), x.max()
    margin = (high - low) / 12
    ends = (np.flatnonzero(x < low + margin), np.flatnonzero(x > high - margin))
    return ends[0].astype(np.int32), ends[1].astype(np.int32)


LIFT = 0.5
"""By how much the second end is lifted, in roots of the area."""
