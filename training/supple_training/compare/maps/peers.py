# SPDX-License-Identifier: GPL-3.0-or-later
"""Classical refinements through pyFM, with the paper's settings, as methods of an evaluation.

In pyFM's words mesh 2 is mapped to mesh 1: 2 is our source, 1 our target, and FM_12 (k2, k1) takes
functions on 1 to 2. The paper's two other peers, Discrete Optimization (Ren et al. 2021) and Smooth
FM (Magnet et al. 2022), are programs of their own over pyFM, not part of the package, and are
reported as missing.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from supple import PreparedMesh, farthest_points, geometry, spectral
from supple.evaluation import ZOOMOUT_FROM, ZOOMOUT_STEP, ZOOMOUT_TO, Map, Method

SAMPLES = 1024  # as many as a prepared mesh has


class Bases:
    """Eigenfunctions of meshes, found once each, at area 1."""

    def __init__(self, count: int = ZOOMOUT_TO) -> None:
        self._count = count
        self._found: dict[int, tuple[PreparedMesh, np.ndarray, np.ndarray]] = {}

    def of(self, mesh: PreparedMesh) -> tuple[np.ndarray, np.ndarray]:
        """(n, k) functions and (n,) masses."""
        if id(mesh) not in self._found:
            area = geometry.face_areas(mesh.vertices, mesh.faces).sum()
            vertices = mesh.vertices / np.sqrt(area)
            functions, mass = spectral.basis(vertices, mesh.faces, self._count)
            self._found[id(mesh)] = mesh, functions, mass  # the mesh too: its id must stay its own
        return self._found[id(mesh)][1:]


def _zoomout(bases: Bases, jobs: int, samples: int = 0):
    """samples: farthest points of both meshes that the rounds go through; 0: every vertex."""
    from pyFM.refine import zoomout_refine
    from pyFM.spectral import p2p_to_FM

    def bind(source: PreparedMesh, target: PreparedMesh):
        (phi2, mass2), (phi1, _) = bases.of(source), bases.of(target)
        area = sparse.diags(mass2)
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


def peers(jobs: int) -> tuple[list[Method], list[str]]:
    """The methods that can be had here, and what is missing and why."""
    try:
        import pyFM  # noqa: F401
    except ImportError:
        return [], ["pyFM's rows: pyfmaps is not installed; pip install 'pyfmaps>=1.3'"]
    bases = Bases()
    return [
        Method("pyfm_zoomout", _zoomout(bases, jobs)),
        Method("pyfm_zoomout_samples", _zoomout(bases, jobs, SAMPLES)),
    ], ["Discrete Optimization and Smooth FM: the package pyfmaps has neither"]
