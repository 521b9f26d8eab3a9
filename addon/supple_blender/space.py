# SPDX-License-Identifier: GPL-3.0-or-later
"""The three spaces a pose passes through, and the way between them.

local: the mesh's own coordinates. world: Blender's. solve: local coordinates stretched by the
object's scale, so that it is congruent to what the viewport shows (up to a rotation, a reflection
and one uniform scale, which the solve does not see). Without it a non-uniformly scaled object would
be posed as if it had not been scaled, and a rigid motion in the viewport would not stay rigid.

Matrices act on columns, as Blender's; points are rows.
"""

import numpy as np

from .errors import UserError

# A smaller ratio of two axis scales is taken for a flattened object.
MIN_SCALE_RATIO = 1e-6


def as_array(matrix):
    """Return a Blender matrix as a float64 array."""
    return np.array(matrix, dtype=np.float64)


def is_flat(linear):
    """Return whether a (3, 3) map flattens space, or is not finite."""
    if not np.isfinite(linear).all():
        return True
    scales = np.linalg.svd(linear, compute_uv=False)
    return scales[-1] <= MIN_SCALE_RATIO * scales[0]


def solve_stretch(world, name):
    """Return the (3, 3) map from local to solve space: S, scaled to determinant 1, of the polar
    decomposition world = Q S.

    It is rounded, so that turning an object, which moves the last digits, leaves it as it was.
    Raises UserError for an object scaled to zero; `name` is the object's.
    """
    linear = world[:3, :3]
    if is_flat(linear):
        raise UserError(
            f"{name}: the object is scaled to zero along an axis. "
            "Give it a scale other than 0 on X, Y and Z."
        )
    squared, axes = np.linalg.eigh(linear.T @ linear)
    stretch = (axes * np.sqrt(squared)) @ axes.T
    stretch = np.round(stretch / np.cbrt(np.linalg.det(stretch)), 5)
    return np.eye(3) if np.abs(stretch - np.eye(3)).max() < 2e-5 else stretch


def uniform_scale(world):
    """Return how many world units one unit of solve space is."""
    return float(np.cbrt(abs(np.linalg.det(world[:3, :3]))))


def _is_identity(stretch):
    return np.array_equal(stretch, np.eye(3))


def to_solve_points(stretch, points):
    """Map local points (n, 3) to solve space."""
    return points if _is_identity(stretch) else points @ stretch.T


def to_local_points(stretch, points):
    """Map points (n, 3) in solve space back to local."""
    return points if _is_identity(stretch) else points @ np.linalg.inv(stretch).T


def to_solve_matrix(stretch, matrix):
    """Map a local motion (4, 4) to the same motion in solve space."""
    full = np.eye(4)
    full[:3, :3] = stretch
    return full @ matrix @ np.linalg.inv(full)


def to_local_matrix(world, motion):
    """Map a world motion (4, 4) of an object's points to its local coordinates."""
    return np.linalg.inv(world) @ motion @ world


def to_world_points(world, points):
    """Map local points (n, 3) to world."""
    return points @ world[:3, :3].T + world[:3, 3]


def bind_matrix(world, centroid):
    """Return the local (4, 4) frame of a handle at rest: at `centroid`, with the world's axes.

    An Empty placed there has axes one unit long whatever the object's scale, so that turning it
    turns the handle without shear, and moving it along Z moves the handle up.
    """
    frame = np.eye(4)
    frame[:3, 3] = to_world_points(world, centroid[None])[0]
    return np.linalg.inv(world) @ frame
