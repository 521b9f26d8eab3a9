# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to a first, rough map between two meshes, for Refiner to refine."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .errors import SuppleError
from .mesh import Note, PreparedMesh


@dataclass(frozen=True)
class MapScore:
    """How plausible a map is, seen through few eigenfunctions; no truth is needed. Each 0 to 1.

    Attributes:
        value: the product of the others, the confidence.
        orientation: how well the normals of the source laid onto the target agree with the
            target's; near 0 for a map with left and right exchanged.
        smoothness: 1 where what is pulled back has the target's own Dirichlet energy.
        area: 1 where areas are kept and nothing is missed.
    """

    value: float
    orientation: float
    smoothness: float
    area: float


@dataclass
class InitialMap:
    """A first map of n source vertices.

    Attributes:
        point_map: (n,) int32, a target vertex each.
        score: MapScore.
        notes: list of Note: "mirrored", "uncertain", "partial_overlap".
    """

    point_map: NDArray[np.int32]
    score: MapScore
    notes: list[Note] = field(default_factory=list)


def _score(native: object) -> MapScore:
    return MapScore(native.value, native.orientation, native.smoothness, native.area)


def _result(native: object) -> InitialMap:
    notes = [Note(note.code, note.count, note.message) for note in native.notes]
    return InitialMap(native.point_map, _score(native.score), notes)


def map_score(source: PreparedMesh, target: PreparedMesh, point_map: ArrayLike) -> MapScore:
    """Of any map. Raises SuppleError: wrong_shape, index_out_of_range."""
    points = arrays.indices(point_map, "point_map")
    return _score(_native.map_score(source.native, target.native, points))


def landmark_map(
    source: PreparedMesh,
    target: PreparedMesh,
    landmarks: ArrayLike,
    *,
    progress: _native.Progress | None = None,
) -> InitialMap:
    """A map that has some pairs of vertices exactly, and is smooth between them.

    Args:
        landmarks: (p, 2), each a source and a target vertex, 0-based; one pair or more. On a
            symmetric shape, some off the middle.

    Raises:
        SuppleError: wrong_shape, index_out_of_range, bad_option. Cancelled: if progress was
            cancelled.
    """
    pairs = arrays.array(landmarks, "landmarks")
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        raise SuppleError(
            "wrong_shape",
            f"landmarks has shape {pairs.shape}; it must be (p, 2): a source and a target vertex.",
        )
    own, other = (arrays.indices(pairs[:, side], "landmarks") for side in (0, 1))
    for whose, mesh, vertices in (("source", source, own), ("target", target, other)):
        loose = np.flatnonzero(
            (vertices >= 0) & (vertices < mesh.vertex_count) & ~np.isin(vertices, mesh.faces)
        )
        if len(loose):
            raise SuppleError(
                "bad_option",
                f"Landmark {loose[0]} (0-based) is vertex {vertices[loose[0]]} of the {whose}, "
                "which belongs to no face. Take one on the surface.",
            )
    return _result(_native.landmark_map(source.native, target.native, own, other, progress))


def nearest_map(
    source: PreparedMesh,
    target: PreparedMesh,
    *,
    aligned: bool = False,
    progress: _native.Progress | None = None,
) -> InitialMap:
    """The nearest target vertex in space.

    Args:
        aligned: the meshes lie as they should, in the same units. Otherwise they are brought to one
            size and place, and their principal axes on one another with rigid ICP.

    Raises:
        Cancelled: if progress was cancelled.
    """
    return _result(_native.nearest_map(source.native, target.native, aligned, progress))


def uv_map(
    source: PreparedMesh, target: PreparedMesh, source_uvs: ArrayLike, target_uvs: ArrayLike
) -> InitialMap:
    """The target vertex at the same place in a UV layout that both meshes share.

    Args:
        source_uvs, target_uvs: (m, 3, 2), one a corner of each triangle.

    Raises:
        SuppleError: wrong_shape, not_finite; bad_option where the layouts don't overlap.
    """
    return _result(
        _native.uv_map(
            source.native,
            target.native,
            _flat_uvs(source_uvs, "source_uvs"),
            _flat_uvs(target_uvs, "target_uvs"),
        )
    )


def automatic_map(
    source: PreparedMesh, target: PreparedMesh, *, progress: _native.Progress | None = None
) -> InitialMap:
    """A map from the shapes alone: the best of many candidates, left and right told apart.

    The candidates come from wave kernel signatures with an orientation term, the signs of the first
    eigenfunctions, and laying the meshes on one another; each is upsampled by ZoomOut.

    Raises:
        SuppleError: bad_option for meshes that are too coarse. Cancelled: if progress was
            cancelled.
    """
    return _result(_native.automatic_map(source.native, target.native, progress))


def zoomout_map(
    source: PreparedMesh,
    target: PreparedMesh,
    point_map: ArrayLike,
    *,
    start: int = 20,
    end: int = 120,
    step: int = 5,
    sampled: bool = False,
    progress: _native.Progress | None = None,
) -> NDArray[np.int32]:
    """spectral.zoomout between prepared meshes: (n,) target vertices.

    Args:
        sampled: for large meshes: between the rounds only the source's prepared samples (1,024 by
            default) are mapped, all vertices at the end. Less exact: every vertex says more.

    Raises:
        SuppleError: wrong_shape, index_out_of_range, bad_option. Cancelled: if progress was
            cancelled.
    """
    return _native.zoomout_map(
        source.native,
        target.native,
        arrays.indices(point_map, "point_map"),
        start,
        end,
        step,
        sampled,
        progress,
    )


def _flat_uvs(value: ArrayLike, name: str) -> NDArray[np.float64]:
    array = arrays.array(value, name)
    if array.ndim != 3 or array.shape[1:] != (3, 2):
        raise SuppleError(
            "wrong_shape", f"{name} has shape {array.shape}; it must be (m, 3, 2), one a corner."
        )
    return np.ascontiguousarray(array.reshape(-1, 2), dtype=np.float64)
