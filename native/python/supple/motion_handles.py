# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles from a motion: where a mesh and the same mesh later differ most."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .mesh import PreparedMesh


def propose_motion_handles(
    prepared: PreparedMesh, moved: ArrayLike, count: int = 16, radius: float | None = None
) -> list[NDArray[np.int32]]:
    """Vertices of up to `count` handles that carry the motion to `moved`, (n, 3) in mesh units.

    Patches around the vertices that move farthest once the nearest rigid motion of the whole is
    taken out, spread so that every piece has one before any has two. No two share a vertex or an
    edge. The same for the same motion, whatever the whole's turn and place.

    Args:
        prepared: the mesh before.
        moved: the same vertices after.
        count: how many; fewer come back where no more fit.
        radius: of a patch, along edges, in mesh units; 0 for single vertices; None for 0.03 of the
            root of the area, with which 16 cover some 4%.

    Returns:
        (k,) int32 ascending indices each, those found first first.

    Raises:
        SuppleError: wrong_shape, not_finite, bad_option; no_handles where nothing moves but the
            whole.
    """
    return _native.propose_motion_handles(
        prepared.native,
        arrays.points(moved, "moved"),
        int(count),
        None if radius is None else float(radius),
    )
