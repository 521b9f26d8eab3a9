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
    method: str = "automatic",
    progress: _native.Progress | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """The first eigenfunctions of W phi = lambda M phi, k = min(count, n) of them.

    Args:
        method: "automatic"; "block_krylov"; "multiresolution", residual 1e-2 instead of 1e-8;
            "lanczos", the reference; "dense", which small meshes get whatever is asked.

    Returns:
        (n, k) M-orthonormal functions; (k,) ascending values in 1 / area; and the largest
        |M^-1/2 (W phi - lambda M phi)| / max(lambda, 1).

    Raises:
        SuppleError: no_convergence, bad_option. Cancelled: if progress was cancelled.
    """
    return _native.eigenbasis(*_mesh(vertices, faces), count, method, progress)


class SparseCholesky:
    """The factor of a sparse symmetric positive definite matrix, made once and solved with often.

    Safe to use from several threads; works without the GIL.
    """

    def __init__(
        self,
        matrix: "scipy.sparse.spmatrix",
        backend: str | None = None,
        ordering: str | ArrayLike | None = None,
    ) -> None:
        """
        Args:
            matrix: (n, n), any format of SciPy, both triangles stored.
            backend: "cholmod" or "eigen"; None for the better one that was built in.
            ordering: "automatic" (as is None), "amd" or "metis" (CHOLMOD's); or (n,), the row at
                each place of the factor, as `ordering` of an earlier factor has it.

        Raises:
            SuppleError: not_positive_definite, wrong_shape, bad_option.
        """
        import scipy.sparse

        matrix = scipy.sparse.csc_matrix(matrix, dtype=np.float64)
        if not matrix.has_canonical_format:
            matrix = matrix.copy()
            matrix.sum_duplicates()  # and sorted, as the native side needs them
        if ordering is None:
            ordering = "automatic"
        elif not isinstance(ordering, str):
            ordering = arrays.indices(ordering, "ordering")
        self._native = _native.SparseCholesky(matrix, backend, ordering)

    def solve(self, rhs: ArrayLike) -> NDArray[np.float64]:
        """(n,) or (n, c) solutions to right-hand sides of that shape. Raises wrong_shape."""
        if np.ndim(rhs) == 1:
            return self._native.solve(arrays.numbers(rhs, "rhs")[:, None])[:, 0]
        return self._native.solve(arrays.rows(rhs, "rhs"))

    @property
    def ordering(self) -> NDArray[np.int32]:
        """(n,) the row at each place of the factor."""
        return self._native.ordering

    @property
    def factor_entries(self) -> int:
        """Numbers the factor holds, a measure of its memory and of the time of a solve."""
        return self._native.factor_entries


class EmbeddingRecovery:
    """The embedding near given points whose Jacobians are near given ones; factored once.

    With W the cotangent Laplacian, M the lumped mass scaled to the sum 1, P the points, and
    d = G^T A J, the two forms are

        product   (W + s M) M^-1 (W + s M) V = s^2 M P + (2 s + W M^-1) d
        literal   (W + a4 M + a5 W M W) V = a4 M P + a5 W M d      (the paper's, as printed)

    Product gives a map back from itself and its Jacobians exactly, and factors a matrix of the
    Laplacian's own pattern; literal smooths it, by its term W V.
    """

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        form: str = "product",
        *,
        pull: float = 4000.0,
        point_weight: float = 2e4,
        jacobian_weight: float = 1.5e5,
    ) -> None:
        """
        Args:
            vertices: (n, 3) rest vertices in any units.
            form: "product" or "literal".
            pull: of product, s > 0, in 1 / area: what is larger than sqrt(area / s) follows the
                points, what is smaller the Jacobians.
            point_weight, jacobian_weight: of literal, a4 > 0 and a5 >= 0.

        Raises:
            SuppleError: bad_option, and what a bad mesh raises.
        """
        self._native = _native.EmbeddingRecovery(
            *_mesh(vertices, faces), form, pull, point_weight, jacobian_weight
        )

    def solve(self, coarse: ArrayLike, jacobians: ArrayLike) -> NDArray[np.float64]:
        """(n, 3) vertices from (n, 3) points and (m, 3, 3) Jacobians. Raises wrong_shape."""
        return self._native.solve(
            arrays.points(coarse, "coarse"), arrays.matrices(jacobians, "jacobians")
        )

    @property
    def factor_entries(self) -> int:
        """Numbers the factor holds."""
        return self._native.factor_entries
