# SPDX-License-Identifier: GPL-3.0-or-later
"""Recovering the deformation of a pair from its spectral signal."""

import os

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .mesh import PreparedMesh
from .model import Model, load_model


def deform(
    prepared: PreparedMesh,
    target_vertices: ArrayLike,
    *,
    model: str | os.PathLike | Model = "spectral",
    eigenfunctions: int = 40,
    network: bool = True,
    progress: _native.Progress | None = None,
) -> NDArray[np.float64]:
    """The target with its detail, from its coordinates in few eigenfunctions. The paper, 4.2.

    Args:
        prepared: the source.
        target_vertices: (n, 3) the same vertices elsewhere, in the source's units.
        model: name of a shipped network, a path or a Model that takes the spectral signal.
        eigenfunctions: in which the target is given; the paper uses 40.
        network: False replaces it by the identity: the coarse Jacobians themselves.
        progress: a Progress to watch and cancel.

    Returns:
        (n, 3) float64; each component keeps its target's centroid.

    Raises:
        SuppleError: wrong_shape, bad_option, model_file, and those of Mesh for the target.
    """
    chosen = None
    if network:
        chosen = (model if isinstance(model, Model) else load_model(model)).native
    return _native.deform(
        prepared.native,
        arrays.points(target_vertices, "target_vertices"),
        eigenfunctions,
        chosen,
        progress,
    )
