# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of an edit. rest and posed: (n, 3) in the same units; faces: (m, 3) int.

What can be computed here without the library that is measured is: handle errors, newly turned
faces, volumes, and the energy that ARAP minimises.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse
import supple
from numpy.typing import NDArray
from supple.cases import EditCase

COLLAPSED = 1e-6
"""A face of less than this part of its area at rest is degenerate."""


def held_vertices(handles: list[supple.Handle]) -> NDArray[np.int64]:
    """(k,) indices of all handles' vertices, in the order of the handles."""
    return np.concatenate([np.asarray(handle.vertices, np.int64) for handle in handles])


def targets(rest: NDArray, handles: list[supple.Handle]) -> NDArray[np.float64]:
    """(k, 3) where those vertices are asked to be, computed here and not by any solver."""
    parts = []
    for handle in handles:
        points = rest[np.asarray(handle.vertices, np.int64)]
        if handle.matrix is not None:
            matrix = np.asarray(handle.matrix, np.float64)
            points = points @ matrix[:3, :3].T + matrix[:3, 3]
        elif handle.positions is not None:
            points = np.asarray(handle.positions, np.float64)
        parts.append(points)
    return np.concatenate(parts)


def diagonal(points: NDArray) -> float:
    """Length of the bounding box's diagonal."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def doubled_normals(points: NDArray, faces: NDArray) -> NDArray[np.float64]:
    """(m, 3) normals, twice as long as the area."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def is_closed(faces: NDArray) -> bool:
    """Whether each edge has exactly two faces, which pass it in opposite directions."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    directed = np.unique(edges, axis=0)
    return len(directed) == len(edges) and np.array_equal(
        directed, np.unique(edges[:, ::-1], axis=0)
    )


def volume_ratio(rest: NDArray, faces: NDArray, posed: NDArray) -> float | None:
    """Enclosed volume over that at rest; None where the mesh is not closed."""
    if not is_closed(faces):
        return None

    def volume(points: NDArray) -> float:
        a, b, c = ((points - rest.mean(axis=0))[faces[:, i]] for i in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)

    at_rest = volume(rest)
    return volume(posed) / at_rest if at_rest else None


def _against_neighbours(points: NDArray, faces: NDArray) -> NDArray[np.float64]:
    """(m,) product of each face's unit normal with the sum of those across its edges."""
    normals = doubled_normals(points, faces)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge = np.unique(edges, axis=0, return_inverse=True)
    face = np.repeat(np.arange(len(faces)), 3)
    ones = np.ones(len(face))
    incidence = scipy.sparse.csr_matrix((ones, (face, edge.ravel())), dtype=np.float64)
    around = incidence @ (incidence.T @ normals) - 3 * normals
    return np.einsum("ij,ij->i", normals, around)


def new_defects(rest: NDArray, faces: NDArray, posed: NDArray) -> tuple[int, int]:
    """How many faces are turned over, and how many degenerate, that at rest were not.

    Turned over: more than 90 degrees from the mean normal of the faces across its edges.
    """
    area = np.linalg.norm(doubled_normals(rest, faces), axis=1)
    degenerate = np.linalg.norm(doubled_normals(posed, faces), axis=1) < COLLAPSED * area
    edge = 1e-9  # three sheets at one edge stand at exactly 90 degrees
    before = _against_neighbours(rest, faces) < edge
    over = _against_neighbours(posed, faces) < -edge
    return int(np.sum(over & ~before & (area > 0))), int(np.sum(degenerate))


class ArapEnergy:
    """The spokes-and-rims energy of a mesh, over its area: what ARAP contenders minimise.

    For each vertex the least sum, over the three edges of each face around it, of
    cot(opposite angle) / 2 |e' - R e|^2 over rotations R. Sources: Sorkine and Alexa 2007; Chao et
    al. 2010.
    """

    def __init__(self, rest: NDArray, faces: NDArray) -> None:
        self.faces = faces
        self.edges = self._edges(rest)  # (m, 3, 3): face, edge opposite to each corner, x y z
        doubled = np.linalg.norm(doubled_normals(rest, faces), axis=1)
        long = np.einsum("mij,mij->m", self.edges, self.edges)
        sound = doubled > 1e-10 * long  # else there is no angle to take a cotangent of
        opposite = -np.einsum("mij,mij->mi", self.edges[:, [1, 2, 0]], self.edges[:, [2, 0, 1]])
        self.weights = (
            np.where(sound[:, None], opposite, 0.0) / np.where(sound, doubled, 1)[:, None]
        )
        self.weights /= 2
        self.area = doubled.sum() / 2
        corner = faces.ravel()
        face = np.repeat(np.arange(len(faces)), 3)
        self.around = scipy.sparse.csr_matrix(
            (np.ones(len(face)), (corner, face)), (len(rest), len(faces))
        )
        self.still = self._lengths(self.edges)

    def _edges(self, points: NDArray) -> NDArray[np.float64]:
        corners = points[self.faces]
        return corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]

    def _lengths(self, edges: NDArray) -> float:
        """Each edge of a face belongs to the cells of its three corners."""
        return 3 * float(np.einsum("mi,mij,mij->", self.weights, edges, edges))

    def __call__(self, posed: NDArray) -> float:
        edges = self._edges(posed)
        products = np.einsum("mi,mij,mik->mjk", self.weights, self.edges, edges)
        cells = (self.around @ products.reshape(-1, 9)).reshape(-1, 3, 3)
        values = np.linalg.svd(cells, compute_uv=False)
        values[:, 2] *= np.sign(np.linalg.det(cells))
        return (self.still + self._lengths(edges) - 2 * float(values.sum())) / self.area


def figures(case: EditCase, posed: NDArray[np.float64]) -> dict:
    """Everything about a result that does not depend on who made it, or how fast."""
    arguments = (case.vertices, case.faces, posed)
    held = held_vertices(case.handles)
    distance = np.linalg.norm(posed[held] - targets(case.vertices, case.handles), axis=1)
    over, degenerate = new_defects(*arguments)
    error = None if case.truth is None else supple.pose_error(*arguments, case.truth)
    return {
        "symmetric_dirichlet": supple.symmetric_dirichlet(*arguments),
        "flipped_faces": supple.flipped_faces(*arguments),
        "new_turned_over_faces": over,
        "new_degenerate_faces": degenerate,
        "handle_error": float(distance.max()) / diagonal(case.vertices),
        "pose_error": error,
        "volume_ratio": volume_ratio(*arguments),
    }
