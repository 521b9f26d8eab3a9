# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of an edit is applied, and where; and places for handles."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .errors import SuppleError
from .mesh import PreparedMesh


def blend(
    rest: ArrayLike, posed: ArrayLike, strength: float = 1.0, weights: ArrayLike | None = None
) -> NDArray[np.float64]:
    """(n, 3) positions rest + strength * weights * (posed - rest); weights: (n,) or None for 1.

    Raises:
        SuppleError: wrong_shape, not_finite.
    """
    amount = np.zeros(0) if weights is None else np.asarray(weights, dtype=np.float64).ravel()
    if not np.isfinite(amount).all():
        raise SuppleError("not_finite", "weights holds a number that is not finite.")
    return _native.blend(
        arrays.points(rest, "rest"), arrays.points(posed, "posed"), float(strength), amount
    )


def falloff_weights(
    prepared: PreparedMesh, vertices: ArrayLike, radius: float
) -> NDArray[np.float64]:
    """(n,) weights: 1 at `vertices`, falling smoothly to 0 at `radius` from them (mesh units).

    Distances are along edges (Dijkstra), so up to some 15% more than along the surface; pieces
    without any of the vertices get 0.

    Raises:
        SuppleError: bad_option, index_out_of_range.
    """
    indices = arrays.indices(vertices, "vertices")
    return _native.falloff_weights(prepared.native, indices, float(radius))


def farthest_points(points: ArrayLike, count: int) -> NDArray[np.int32]:
    """(count,) ascending indices spread over points (n, 3); all n where count is more."""
    if count < 1:
        raise SuppleError("bad_option", f"count is {count}; it must be 1 or more.")
    return _native.farthest_points(arrays.points(points), int(count))
