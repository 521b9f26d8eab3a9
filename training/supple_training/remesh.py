# SPDX-License-Identifier: GPL-3.0-or-later
"""Different triangulations of one surface, each in correspondence with it.

A network that saw only one connectivity could learn it by heart, so every training source gets its
own: random quad diagonals, a random decimation in a randomly stretched space, and random relaxing.
Each new vertex is a point of the original surface (a face and barycentric weights), so every pose
of the original carries over to the new connectivity.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

METHODS = ("edge collapse", "quadric collapse", "upsample, edge collapse", "loop, edge collapse")


@dataclass(frozen=True)
class Remeshed:
    """A triangulation whose n vertices are points on an original surface."""

    faces: IntArray
    """(m, 3), 0-based indices into the new vertices."""
    corners: IntArray
    """(n, 3): the original vertices of the face that each new vertex lies on."""
    weights: FloatArray
    """(n, 3): barycentric weights in [0, 1], rows sum to 1."""
    method: str
    """Which of `METHODS` made it."""

    def carry(self, vertices: FloatArray) -> FloatArray:
        """A pose of the original, (N, 3), on the new vertices: (n, 3)."""
        return np.einsum("nk,nkd->nd", self.weights, vertices[self.corners])


def euler_characteristic(faces: IntArray) -> int:
    """Vertices minus edges plus faces, over the vertices that faces use: 2 for a sphere."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return len(np.unique(faces)) - len(np.unique(_edge_numbers(edges))) + len(faces)


def _edge_numbers(edges: IntArray) -> IntArray:
    """A number for each edge (k, 2), the same for equal rows only: faster to sort than rows."""
    return edges[:, 0] * (np.int64(edges.max()) + 1) + edges[:, 1]


def is_closed_manifold(faces: IntArray) -> bool:
    """Whether every edge has exactly two faces of opposite direction, and every vertex one fan."""
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    unique = np.unique(_edge_numbers(directed))
    if len(unique) != len(directed):
        return False
    if not np.array_equal(unique, np.unique(_edge_numbers(directed[:, ::-1]))):
        return False
    return bool(np.all(igl.is_vertex_manifold(faces)))


def component_count(faces: IntArray) -> int:
    """The number of connected components among the vertices that faces use."""
    count = int(faces.max()) + 1
    rows, columns = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    graph = scipy.sparse.coo_matrix((np.ones(len(rows)), (rows, columns)), (count, count))
    _, labels = scipy.sparse.csgraph.connected_components(graph, directed=False)
    return len(np.unique(labels[np.unique(faces)]))


def unit_normals(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Face normals (m, 3), of length 1 (or 0 for a collapsed face), and areas (m,)."""
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1)
    return normal / np.maximum(length, 1e-300)[:, None], length / 2


def triangle_quality(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(m,): 4 sqrt(3) area / sum of squared edges: 1 for equilateral triangles, 0 for flat ones."""
    corner = vertices[faces]
    edges = corner - np.roll(corner, 1, axis=1)
    _, area = unit_normals(vertices, faces)
    return 4 * np.sqrt(3) * area / np.sum(edges**2, axis=(1, 2))


def _stretch(rng: np.random.Generator) -> FloatArray:
    """A random (3, 3) map with singular values in [0.75, 1.33]: the space edges are measured in."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return turn @ np.diag(np.exp(rng.uniform(-0.288, 0.288, 3))) @ turn.T


def _decimate(
    vertices: FloatArray, faces: IntArray, method: str, count: int, rng: np.random.Generator
) -> tuple[FloatArray, IntArray]:
    stretch = _stretch(rng)
    points = vertices @ stretch
    if method.startswith("upsample"):
        points, faces = igl.upsample(points, faces)
    elif method.startswith("loop"):
        points, faces = igl.loop(points, faces)
    if method == "quadric collapse":
        points, faces, _, _ = igl.qslim(points, faces, 2 * count - 4)
    else:
        points, faces, _, _ = igl.decimate(points, faces, 2 * count - 4)
    return points @ np.linalg.inv(stretch), faces


def relax(points: FloatArray, faces: IntArray, steps: int) -> FloatArray:
    """Move each vertex half way to its neighbours' mean, within its tangent plane."""
    adjacency = igl.adjacency_matrix(faces).astype(np.float64)
    mean = scipy.sparse.diags(1.0 / np.asarray(adjacency.sum(axis=1)).ravel()) @ adjacency
    for _ in range(steps):
        normal = igl.per_vertex_normals(points, faces)
        step = 0.5 * (mean @ points - points)
        points = points + step - np.sum(step * normal, axis=1, keepdims=True) * normal
    return points


def _closest(
    points: FloatArray, normals: FloatArray, vertices: FloatArray, faces: IntArray
) -> tuple[IntArray, FloatArray]:
    """The face and barycentric weights of the closest point that faces the same way.

    Where the closest face looks the other way (the far lip of a closed mouth, the next finger),
    the closest among the faces that look the same way as the point is taken.
    """
    distance, index, closest = igl.point_mesh_squared_distance(points, vertices, faces)
    original, _ = unit_normals(vertices, faces)
    wrong = np.flatnonzero(np.sum(original[index] * normals, axis=1) < 0.1)
    for i in wrong:
        same = np.flatnonzero(original @ normals[i] > 0.3)
        near = same[
            np.linalg.norm(vertices[faces[same, 0]] - points[i], axis=1)
            < 0.03 + np.sqrt(distance[i])
        ]
        if len(near):
            _, found, place = igl.point_mesh_squared_distance(
                points[i : i + 1], vertices, faces[near]
            )
            index[i], closest[i] = near[int(found[0])], place[0]
    corner = vertices[faces[index]]
    weights = igl.barycentric_coordinates(closest, corner[:, 0], corner[:, 1], corner[:, 2])
    weights = np.clip(weights, 0.0, 1.0)
    return faces[index], weights / weights.sum(axis=1, keepdims=True)


def remesh(
    vertices: FloatArray,
    faces: IntArray,
    rng: np.random.Generator,
    *,
    vertex_count: int | tuple[int, int] = (3500, 6500),
    attempts: int = 20,
) -> Remeshed:
    """Triangulate a closed surface again, with a random number of vertices in a range.

    vertices (N, 3), faces (M, 3): a closed manifold mesh. The result is one too, with the same
    Euler characteristic, no collapsed face (quality over 0.02) and no face turned over against
    the surface.

    Raises RuntimeError when none of `attempts` random triangulations is that good.
    """
    low, high = (vertex_count, vertex_count) if isinstance(vertex_count, int) else vertex_count
    wanted = euler_characteristic(faces)
    for _ in range(attempts):
        method = METHODS[rng.integers(len(METHODS))]
        count = int(rng.integers(low, high + 1))
        points, new_faces = _decimate(vertices, faces, method, count, rng)
        points = relax(points, new_faces, int(rng.integers(0, 7)))
        corners, weights = _closest(
            points, igl.per_vertex_normals(points, new_faces), vertices, faces
        )
        result = Remeshed(new_faces, corners, weights, method)
        if (
            is_closed_manifold(new_faces)
            and euler_characteristic(new_faces) == wanted
            and _faults(result, vertices) == 0
        ):
            return result
    raise RuntimeError(
        f"none of {attempts} triangulations with {low} to {high} vertices was free of collapsed or "
        "turned-over faces; ask for more vertices"
    )


def decimate(
    vertices: FloatArray,
    faces: IntArray,
    rng: np.random.Generator,
    *,
    vertex_count: int | tuple[int, int],
    attempts: int = 20,
) -> Remeshed:
    """Triangulate a surface with holes or several pieces again, by decimation only.

    vertices (N, 3), faces (M, 3): no edge has more than two faces. The result has the same Euler
    characteristic, no collapsed face and none turned over, as that of `remesh`; its vertices are
    not relaxed, since that would pull the boundary in.

    Raises RuntimeError when none of `attempts` random triangulations is that good.
    """
    low, high = (vertex_count, vertex_count) if isinstance(vertex_count, int) else vertex_count
    wanted = euler_characteristic(faces)
    for _ in range(attempts):
        method = METHODS[rng.integers(2)]
        points, new_faces = _decimate(
            vertices, faces, method, int(rng.integers(low, high + 1)), rng
        )
        corners, weights = _closest(
            points, igl.per_vertex_normals(points, new_faces), vertices, faces
        )
        result = Remeshed(new_faces, corners, weights, method)
        if euler_characteristic(new_faces) == wanted and _faults(result, vertices) == 0:
            return result
    raise RuntimeError(
        f"none of {attempts} decimations to {low} to {high} vertices was free of collapsed or "
        "turned-over faces; ask for more vertices, or close and clean the mesh"
    )


def _faults(result: Remeshed, vertices: FloatArray) -> int:
    """The number of collapsed or turned-over faces of a new triangulation on the original."""
    placed = result.carry(vertices)
    normals, _ = unit_normals(placed, result.faces)
    # A face agrees with the surface when it agrees with an original face that a corner lies on.
    original, _ = unit_normals(vertices, result.corners)
    agreement = np.einsum("mkd,md->mk", original[result.faces], normals).max(axis=1)
    return int(np.sum((triangle_quality(placed, result.faces) < 0.02) | (agreement < 0.0)))
