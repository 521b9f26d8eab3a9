# SPDX-License-Identifier: GPL-3.0-or-later
"""Classical refinements with the paper's settings, as methods of an evaluation: ZoomOut by pyFM,
Discrete Optimization and Smooth FM by `discrete` with pyFM's nearest neighbours, as the package has
neither.

In pyFM's words mesh 2 is mapped to mesh 1: 2 is our source, 1 our target, and FM_12 (k2, k1) takes
functions on 1 to 2.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sparse
from supple import PreparedMesh, farthest_points, geometry, spectral
from supple.evaluation import ZOOMOUT_FROM, ZOOMOUT_STEP, ZOOMOUT_TO, Map, Method

from supple_training.compare.maps.discrete import (
    Nearest,
    Side,
    discrete_optimization,
    smooth_functional_map,
)

SAMPLES = 1024  # as many as a prepared mesh has


class Sides:
    """Meshes of area 1 with their eigenfunctions, made once each."""

    def __init__(self, count: int = ZOOMOUT_TO) -> None:
        self._count = count
        self._found: dict[int, tuple[PreparedMesh, Side]] = {}

    def of(self, mesh: PreparedMesh) -> Side:
        if id(mesh) not in self._found:
            areas = geometry.face_areas(mesh.vertices, mesh.faces)
            vertices = mesh.vertices / np.sqrt(areas.sum())
            functions, mass = spectral.basis(vertices, mesh.faces, self._count)
            laplacian = geometry.cotan_laplacian(vertices, mesh.faces)
            side = Side(vertices - mass @ vertices / mass.sum(), functions, mass, laplacian)
            self._found[id(mesh)] = mesh, side  # the mesh too: its id must stay its own
        return self._found[id(mesh)][1]


def _zoomout(sides: Sides, jobs: int, samples: int = 0):
    """samples: farthest points of both meshes that the rounds go through; 0: every vertex."""
    from pyFM.refine import zoomout_refine
    from pyFM.spectral import p2p_to_FM

    def bind(source: PreparedMesh, target: PreparedMesh):
        own = sides.of(source)
        phi2, phi1 = own.functions, sides.of(target).functions
        area = sparse.diags(own.mass)
        both = None
        if samples:
            both = [farthest_points(mesh.vertices, samples) for mesh in (target, source)]
        k = ZOOMOUT_FROM
        rounds = (ZOOMOUT_TO - ZOOMOUT_FROM) // ZOOMOUT_STEP

        def refine(initial: Map) -> Map:
            start = p2p_to_FM(initial, phi1[:, :k], phi2[:, :k], A2=area)
            _, refined = zoomout_refine(
                start,
                phi1,
                phi2,
                nit=rounds,
                step=ZOOMOUT_STEP,
                A2=area if both is None else None,
                subsample=both,
                return_p2p=True,
                n_jobs=jobs,
            )
            return refined.astype(np.int32)

        return refine

    return bind


def _alternating(sides: Sides, jobs: int, refine: Callable[[Side, Side, Map, Nearest], Map]):
    from pyFM.spectral.nearest_neighbor import knn_query

    def nearest(points: np.ndarray, queries: np.ndarray) -> Map:
        return knn_query(points, queries, n_jobs=jobs)

    def bind(source: PreparedMesh, target: PreparedMesh):
        own, other = sides.of(source), sides.of(target)
        return lambda initial: refine(own, other, initial, nearest).astype(np.int32)

    return bind


def peers(jobs: int) -> tuple[list[Method], list[str]]:
    """The methods that can be had here, and what is missing and why."""
    try:
        import pyFM  # noqa: F401
    except ImportError:
        return [], ["pyFM's rows: pyfmaps is not installed; pip install 'pyfmaps>=1.3'"]
    sides = Sides()
    return [
        Method("pyfm_zoomout", _zoomout(sides, jobs)),
        Method("pyfm_zoomout_samples", _zoomout(sides, jobs, SAMPLES)),
        Method("discrete_optimization", _alternating(sides, jobs, discrete_optimization)),
        Method("smooth_fm", _alternating(sides, jobs, smooth_functional_map)),
    ], []
