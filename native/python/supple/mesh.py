# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes, checked and prepared."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from . import cache as disk_cache
from .errors import SuppleError


@dataclass(frozen=True)
class Note:
    """Something unusual in a mesh and what was done about it.

    Attributes:
        code: "degenerate_faces", "unattached_vertices", "boundary", "nonmanifold_edges",
            "components"; of a prepared mesh also "cache_rebuilt", "cache_unwritable",
            "cache_too_small".
        count: how many places.
        message: for people.
    """

    code: str
    count: int
    message: str


def _notes(native: object) -> list[Note]:
    return [Note(note.code, note.count, note.message) for note in native.notes]


def _default_cache() -> tuple[_native.PreparedCache | None, list[Note]]:
    """The user's cache. Where its settings are wrong the work goes on without one, and says so."""
    try:
        return disk_cache.default(), []
    except SuppleError as error:
        return None, [Note("cache_unwritable", 1, f"The disk cache is not used. {error}")]


class Mesh:
    """A triangle mesh whose input was checked.

    Attributes:
        vertices: (n, 3) float64, the caller's units.
        faces: (m, 3) int32, 0-based.
        notes: what is unusual about it.

    Raises:
        SuppleError: empty_mesh, wrong_shape, index_out_of_range, not_finite.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        self.vertices: NDArray[np.float64] = arrays.points(vertices)
        self.faces: NDArray[np.int32] = arrays.triangles(faces)
        self.notes = _notes(_native.TriangleMesh(self.vertices, self.faces))


class PreparedMesh:
    """Everything about a rest mesh that no handle changes: operators and eigenfunctions.

    Built once, then shared by any number of editors. The native work runs without the GIL.

    Args:
        vertices: (n, 3), the caller's units.
        faces: (m, 3), 0-based triangles.
        eigenfunctions: of the network's spectral projections; fewer where the mesh has fewer.
        samples: points the network is evaluated at; 0 for every vertex (slower).
        progress: a Progress to watch and cancel.
        cache: where the result is looked for and kept: True for the user's cache (see
            supple.cache), False or None for nowhere, or a PreparedCache. A cache that fails is
            never an error, but a note.

    Attributes:
        vertices, faces: as given, float64 and int32.
        notes: list of Note.
        from_cache: whether it was found there instead of computed; the same bit for bit.
        seconds: time it took to prepare.
        residual: largest relative residual of the eigenfunctions.

    Raises:
        SuppleError: as Mesh; no_convergence; bad_option.
        Cancelled: if progress was cancelled.
    """

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        eigenfunctions: int = 128,
        samples: int = 1024,
        progress: _native.Progress | None = None,
        cache: bool | _native.PreparedCache | None = True,
    ) -> None:
        start = time.perf_counter()
        self.vertices: NDArray[np.float64] = arrays.points(vertices)
        self.faces: NDArray[np.int32] = arrays.triangles(faces)
        problems = []
        if cache is True:
            cache, problems = _default_cache()
        self.native = _native.PreparedMesh(
            self.vertices, self.faces, eigenfunctions, samples, progress, cache or None
        )
        self.from_cache: bool = self.native.from_cache
        self.notes = _notes(self.native) + problems
        self.residual: float = self.native.residual
        self.seconds = time.perf_counter() - start

    @property
    def vertex_count(self) -> int:
        """Number of vertices n."""
        return len(self.vertices)

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal, in the caller's units."""
        return self.native.diagonal
