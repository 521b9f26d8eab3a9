# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps between two surfaces and their refinement, for researchers.

A point map has one target vertex for each source vertex; a functional map C is a matrix between
eigenfunctions that takes functions on the target to the source. Source and target are each a
`Basis`; a plain pair of arrays does too. Functions are taken in units where their surface has area
1, so that a scaled copy has the functional map 1.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays, geometry


class Basis(NamedTuple):
    """Eigenfunctions of a surface.

    Attributes:
        functions: (n, k), orthonormal under `mass`, as geometry.eigenbasis returns them.
        mass: (n,), as geometry.lumped_mass returns it.
    """

    functions: ArrayLike
    mass: ArrayLike


def basis(
    vertices: ArrayLike,
    faces: ArrayLike,
    count: int = 128,
    *,
    method: str = "automatic",
    progress: _native.Progress | None = None,
) -> Basis:
    """The first `count` eigenfunctions and the mass. Raises what geometry.eigenbasis does."""
    functions, _, _ = geometry.eigenbasis(vertices, faces, count, method=method, progress=progress)
    return Basis(functions, geometry.lumped_mass(vertices, faces))


def _checked(basis: Basis, whose: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    functions, mass = basis
    return (
        arrays.rows(functions, f"the {whose}'s functions"),
        arrays.numbers(mass, f"the {whose}'s mass"),
    )


def functional_map(source: Basis, target: Basis, point_map: ArrayLike) -> NDArray[np.float64]:
    """(k_source, k_target) functional map Phi_s^T M_s Phi_t[point_map]. Ovsjanikov et al. 2012.

    Raises:
        SuppleError: wrong_shape, index_out_of_range.
    """
    return _native.functional_map(
        *_checked(source, "source"),
        *_checked(target, "target"),
        arrays.indices(point_map, "point_map"),
    )


def point_map(
    source: Basis,
    target: Basis,
    functional_map: ArrayLike,
    *,
    progress: _native.Progress | None = None,
) -> NDArray[np.int32]:
    """(n_source,) the target vertex whose row of Phi_t C^T is nearest to each row of Phi_s.

    Exact; of equally near ones the lowest. C (k_s, k_t) takes the first k_s and k_t functions.

    Raises:
        SuppleError: wrong_shape, not_finite, bad_option. Cancelled: if progress was cancelled.
    """
    return _native.point_map(
        *_checked(source, "source"),
        *_checked(target, "target"),
        arrays.rows(functional_map, "functional_map"),
        progress,
    )


def zoomout(
    source: Basis,
    target: Basis,
    point_map: ArrayLike,
    *,
    start: int = 20,
    end: int = 120,
    step: int = 5,
    progress: _native.Progress | None = None,
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Refine a point map: functional map, point map, and again with `step` more functions.

    Args:
        point_map: (n_source,), one target vertex for each source vertex.
        start, end: functions in the first round and in the last.

    Returns:
        (n_source,) point map, and the (end, end) functional map that it was made from.

    Raises:
        SuppleError: wrong_shape, index_out_of_range, bad_option. Cancelled: if progress was
            cancelled.

    Source: Melzi et al. 2019, "ZoomOut: Spectral Upsampling for Efficient Shape Correspondence".
    """
    return _native.zoomout(
        *_checked(source, "source"),
        *_checked(target, "target"),
        arrays.indices(point_map, "point_map"),
        start,
        end,
        step,
        progress,
    )
