# SPDX-License-Identifier: GPL-3.0-or-later
"""Discrete operators of a triangle mesh, for researchers. Sparse results need SciPy installed.

Faces must have an area here: these are the operators themselves, without the repairs of
PreparedMesh. Conventions are those of docs/conventions.md.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays

if TYPE_CHECKING:
    import scipy.sparse


def _mesh(vertices: ArrayLike, faces: ArrayLike) -> tuple[NDArray, NDArray]:
    vertices, faces = arrays.points(vertices), arrays.triangles(faces)
    _native.TriangleMesh(vertices, faces)  # the usual checks and messages
    return vertices, faces


def cotan_laplacian(vertices: ArrayLike, faces: ArrayLike) -> "scipy.sparse.csc_matrix":
    """(n, n) cotangent Laplacian W, positive semidefinite, rows sum to 0. Pinkall and Polthier."""
    return _native.cotan_laplacian(*_mesh(vertices, faces))


def lumped_mass(vertices: ArrayLike, faces: ArrayLike) -> NDArray[np.float64]:
    """(n,) mixed Voronoi area of each vertex, squared units. Meyer et al. 2003."""
    return _native.lumped_mass(*_mesh(vertices, faces))


def gradient(vertices: ArrayLike, faces: ArrayLike) -> "scipy.sparse.csc_matrix":
    """(3m, n) gradient; rows 3f..3f+2 are the tangent gradient on face f, per unit of length."""
    return _native.gradient(*_mesh(vertices, faces))


def face_areas(vertices: ArrayLike, faces: ArrayLike) -> NDArray[np.float64]:
    """(m,) area of each face, squared units."""
    return _native.face_areas(*_mesh(vertices, faces))


def jacobians(rest: ArrayLike, faces: ArrayLike, moved: ArrayLike) -> NDArray[np.float64]:
    """(m, 3, 3) Jacobians J = E1^-1 E2: rest edges (rows) times J are moved edges. Eqn 2."""
    rest, faces = _mesh(rest, faces)
    return _native.jacobians(rest, faces, arrays.points(moved, "moved")).reshape(-1, 3, 3)


def closest_rotations(matrices: ArrayLike) -> NDArray[np.float64]:
    """(m, 3, 3) closest rotation (Frobenius, determinant +1) of each of (m, 3, 3) matrices."""
    flat = np.ascontiguousarray(np.asarray(matrices, dtype=np.float64).reshape(-1, 9))
    return _native.closest_rotations(flat).reshape(-1, 3, 3)


def eigenbasis(
    vertices: ArrayLike,
    faces: ArrayLike,
    count: int = 128,
    *,
    progress: _native.Progress | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """The first eigenfunctions of W phi = lambda M phi, k = min(count, n) of them.

    Returns:
        (n, k) M-orthonormal functions; (k,) ascending values in 1 / area; and the largest
        |M^-1/2 (W phi - lambda M phi)| / max(lambda, 1).

    Raises:
        SuppleError: no_convergence, bad_option. Cancelled: if progress was cancelled.
    """
    return _native.eigenbasis(*_mesh(vertices, faces), count, progress)
