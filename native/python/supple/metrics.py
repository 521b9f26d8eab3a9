# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures for an edited mesh. rest and posed: (n, 3) in the same units; faces: (m, 3)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays


def face_distortion(rest: ArrayLike, faces: ArrayLike, posed: ArrayLike) -> NDArray[np.float64]:
    """(m,) symmetric Dirichlet of each face, s1^2 + s2^2 + s1^-2 + s2^-2 - 4; 0 for rigid motion.

    s are the singular values of the face's 2x2 Jacobian, not below 1e-6. Source: Smith and Schaefer
    2015.
    """
    return _native.face_distortion(*_checked(rest, faces, posed))


def symmetric_dirichlet(rest: ArrayLike, faces: ArrayLike, posed: ArrayLike) -> float:
    """Mean of face_distortion, weighted by rest area."""
    return _native.symmetric_dirichlet(*_checked(rest, faces, posed))


def flipped_faces(rest: ArrayLike, faces: ArrayLike, posed: ArrayLike) -> int:
    """Number of faces newly turned over (more than 90 degrees from the mean normal of their edge
    neighbours, which at rest they were not) or collapsed (below 1e-6 of their rest area)."""
    return _native.flipped_faces(*_checked(rest, faces, posed))


def pose_error(rest: ArrayLike, faces: ArrayLike, posed: ArrayLike, truth: ArrayLike) -> float:
    """Area-weighted RMS distance to the true (n, 3) pose, x100 of the root of the rest area."""
    return _native.pose_error(*_checked(rest, faces, posed), arrays.points(truth, "truth"))


def _checked(rest: ArrayLike, faces: ArrayLike, posed: ArrayLike) -> tuple:
    rest, faces = arrays.points(rest, "rest"), arrays.triangles(faces)
    _native.TriangleMesh(rest, faces)  # indices and coordinates, once, with the usual messages
    return rest, faces, arrays.points(posed, "posed")
