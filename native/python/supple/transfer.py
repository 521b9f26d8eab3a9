# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps between surfaces, and what they carry across: weights, colours, UVs, shape keys, a fit.

A mesh is given as anything with `vertices` (n, 3) and `faces` (m, 3): a Mesh, a PreparedMesh, or
an (vertices, faces) pair. Of every transfer, the source has what is carried and the target gets it,
and the map goes from the TARGET's vertices to the SOURCE's surface; `reversed_map` turns one round.
"""

import os
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .errors import SuppleError
from .mesh import Mesh, PreparedMesh

AnyMesh = Mesh | PreparedMesh | tuple[ArrayLike, ArrayLike]


class SurfaceMap:
    """A point on a mesh for each of n points of another: a face and barycentric weights.

    Attributes:
        face: (n,) int32, a face of the mesh mapped to, -1 where a point has no partner.
        weights: (n, 3) float64 of its corners, >= 0, rows sum to 1; 0 where face is -1.

    Raises:
        SuppleError: wrong_shape.
    """

    def __init__(self, face: ArrayLike, weights: ArrayLike) -> None:
        self.face: NDArray[np.int32] = arrays.indices(face, "face")
        self.weights: NDArray[np.float64] = arrays.points(weights, "weights")
        if len(self.face) != len(self.weights):
            raise SuppleError(
                "wrong_shape",
                f"There are {len(self.face)} faces and {len(self.weights)} rows of weights.",
            )

    @classmethod
    def from_point_map(cls, point_map: ArrayLike, mesh: AnyMesh) -> "SurfaceMap":
        """The map to a vertex of `mesh` for each point, (n,); -1 for none. Raises
        index_out_of_range. A vertex of no face is no partner."""
        vertices, faces = _arrays(mesh)
        indices = arrays.indices(point_map, "point_map")
        return cls._of(_native.surface_map(indices, faces, len(vertices)))

    def nearest_corners(self, mesh: AnyMesh) -> NDArray[np.int32]:
        """(n,) the vertex of `mesh` with the largest weight, -1 where there is no partner."""
        return _native.nearest_corners(self.native, _arrays(mesh)[1])

    def __len__(self) -> int:
        return len(self.face)

    @property
    def native(self) -> _native.SurfaceMap:
        """What the native module takes."""
        return _native.SurfaceMap(self.face, self.weights)

    @classmethod
    def _of(cls, native: _native.SurfaceMap) -> "SurfaceMap":
        return cls(native.face, native.weights)


class ClosestPoints(NamedTuple):
    """Where points are nearest to a mesh.

    Attributes:
        map: SurfaceMap of the points to the mesh; every point has a partner.
        distance: (q,) to it.
        agrees: (q,) bool, whether the face's normal agrees; None where no normals were given.
    """

    map: SurfaceMap
    distance: NDArray[np.float64]
    agrees: NDArray[np.bool_] | None


class FieldTransfer(NamedTuple):
    """values: (n, c) at vertices, or (m, 3, c) at corners; unmapped: vertices without a partner."""

    values: NDArray[np.float64]
    unmapped: int


class GroupTransfer(NamedTuple):
    """Vertex groups on the target.

    Attributes:
        weights: (n, g), columns as the source's.
        normalised: whether the source's rows summed to 1, so that these do.
        unmapped: vertices without a partner; their weights are 0.
        moved: vertices whose partner was moved to the island that the rest of theirs is on.
    """

    weights: NDArray[np.float64]
    normalised: bool
    unmapped: int
    moved: int


class ShapeTransfer(NamedTuple):
    """Shape keys on the target.

    Attributes:
        shapes: list of (n, 3) vertices, one a key.
        coincide: whether the rest shapes are one surface, as they lie or after a similarity; then
            displacements are carried in place, else in each surface's own frames.
        unmapped: vertices without a partner; they move with the nearest that has one.
    """

    shapes: list[NDArray[np.float64]]
    coincide: bool
    unmapped: int


class ShrinkFit(NamedTuple):
    """The source's vertices on the target.

    Attributes:
        vertices: (n, 3) in the target's units.
        distance: (n,) of each from the target's surface.
        flipped: faces that turned over.
        unmapped: vertices without a partner.
    """

    vertices: NDArray[np.float64]
    distance: NDArray[np.float64]
    flipped: int
    unmapped: int


def _arrays(mesh: AnyMesh) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    if isinstance(mesh, Mesh | PreparedMesh):
        return mesh.vertices, mesh.faces
    if not isinstance(mesh, Sequence) or len(mesh) != 2:
        raise SuppleError(
            "wrong_shape",
            f"{type(mesh).__name__} is no mesh: give a Mesh, a PreparedMesh or (vertices, faces).",
        )
    vertices, faces = mesh
    return arrays.points(vertices), arrays.triangles(faces)


def closest_points(
    mesh: AnyMesh,
    points: ArrayLike,
    normals: ArrayLike | None = None,
    *,
    cos_limit: float = 0.5,
    reach: float = np.inf,
) -> ClosestPoints:
    """The nearest point of a mesh's surface to each point; ties to the lowest face.

    Args:
        points: (q, 3).
        normals: (q, 3) unit vectors, 0 for any: first among faces whose normal n has
            n . normal >= cos_limit, within `reach`; where there is none, the nearest of all.

    Raises:
        SuppleError: empty_mesh, not_finite, wrong_shape, bad_option, index_out_of_range.
    """
    towards = None if normals is None else arrays.points(normals, "normals")
    found, squared, agrees = _native.closest_points(
        *_arrays(mesh), arrays.points(points, "points"), towards, float(cos_limit), float(reach)
    )
    return ClosestPoints(
        SurfaceMap._of(found), np.sqrt(squared), None if normals is None else agrees
    )


def reversed_map(map: SurfaceMap, start: AnyMesh, end: AnyMesh) -> SurfaceMap:
    """The map of end's vertices to start's surface, of one from start's vertices to end's surface.

    start's faces are laid where their corners go; each vertex of end takes their nearest point,
    first among those that face the same way.

    Raises:
        SuppleError: wrong_shape, index_out_of_range, empty_mesh where no face is mapped whole.
    """
    return SurfaceMap._of(_native.reversed_map(map.native, *_arrays(start), *_arrays(end)))


def within_islands(
    map: SurfaceMap, source: AnyMesh, target: AnyMesh, *, majority: float = 0.95
) -> tuple[SurfaceMap, int]:
    """A map along which nothing bleeds between islands, and the number of vertices it moved.

    The source island with most of a target island's vertices is that island's own. Vertices
    elsewhere move to the point of it nearest to their partner, where the island they were on is
    another target island's own, or where at least `majority` of theirs is on their own.

    Raises:
        SuppleError: wrong_shape, index_out_of_range, bad_option.
    """
    held, _, moved = _native.within_islands(
        map.native, *_arrays(source), _arrays(target)[1], float(majority)
    )
    return SurfaceMap._of(held), moved


def transfer_field(
    map: SurfaceMap, source: AnyMesh, field: ArrayLike, *, otherwise: float = 0.0
) -> FieldTransfer:
    """Vertex values (n,) or (n, c) of the source, at the target's vertices (barycentric).

    Colours by vertex are such a field. `otherwise` is the value where there is no partner.

    Raises:
        SuppleError: wrong_shape, index_out_of_range.
    """
    single = np.ndim(field) == 1
    rows = arrays.numbers(field, "field")[:, None] if single else arrays.rows(field, "field")
    values, unmapped = _native.transfer_field(
        map.native, _arrays(source)[1], rows, float(otherwise)
    )
    return FieldTransfer(values[:, 0] if single else values, unmapped)


def transfer_groups(
    map: SurfaceMap,
    source: AnyMesh,
    target: AnyMesh,
    weights: ArrayLike,
    *,
    smallest: float = 1e-4,
    majority: float = 0.95,
) -> GroupTransfer:
    """Vertex groups (n, g), 0 for "not in the group", at the target's vertices.

    Rows are normalised if the source's are, weights below `smallest` become 0, and nothing bleeds
    between islands (see within_islands). Columns keep their order, whatever the groups' names.

    Raises:
        SuppleError: wrong_shape, not_finite, index_out_of_range; bad_option also for a weight
            below 0.
    """
    return GroupTransfer(
        *_native.transfer_groups(
            map.native,
            *_arrays(source),
            _arrays(target)[1],
            arrays.rows(weights, "weights"),
            float(smallest),
            float(majority),
        )
    )


def transfer_corners(
    map: SurfaceMap,
    source: AnyMesh,
    target: AnyMesh,
    corners: ArrayLike,
    *,
    extrapolate: bool = False,
    tolerance: float = 1e-6,
    polygons: ArrayLike | None = None,
    otherwise: float = 0.0,
) -> FieldTransfer:
    """Values at face corners (m, 3, c) of the source, at the target's: colours by corner, UVs.

    Each target face takes all its corners from one side of every seam, where the source's values
    at an edge differ by more than `tolerance` of their range.

    Args:
        extrapolate: over a seam, continue the values (UVs) instead of taking the nearest (colours).
        polygons: (m,) of the target: triangles of one number are one polygon, and a corner has one
            value in all of them; None where each triangle is its own.

    Raises:
        SuppleError: wrong_shape, not_finite, index_out_of_range, bad_option.
    """
    values = arrays.array(corners, "corners")
    if values.ndim != 3 or values.shape[1] != 3:
        raise SuppleError(
            "wrong_shape",
            f"corners has shape {values.shape}; it must be (m, 3, c): by face corner.",
        )
    count = values.shape[2]
    result, unmapped = _native.transfer_corners(
        map.native,
        *_arrays(source),
        _arrays(target)[1],
        np.ascontiguousarray(values.reshape(-1, count), dtype=np.float64),
        float(tolerance),
        bool(extrapolate),
        np.zeros(0, np.int32) if polygons is None else arrays.indices(polygons, "polygons"),
        float(otherwise),
    )
    return FieldTransfer(result.reshape(-1, 3, count), unmapped)


def transfer_uvs(
    map: SurfaceMap,
    source: AnyMesh,
    target: AnyMesh,
    uvs: ArrayLike,
    *,
    polygons: ArrayLike | None = None,
) -> FieldTransfer:
    """UVs (m, 3, 2) by face corner: transfer_corners, continued over seams."""
    return transfer_corners(map, source, target, uvs, extrapolate=True, polygons=polygons)


def transfer_shape_keys(
    source: AnyMesh,
    keys: Sequence[ArrayLike],
    target: AnyMesh,
    map: SurfaceMap,
    *,
    progress: _native.Progress | None = None,
) -> ShapeTransfer:
    """The source's vertices moved, each (n, 3), to the target's moved in the same way.

    Through the deformation's Jacobians, so the result is smooth over the source's faces and turns
    the target's detail along. What is exactly at rest stays exactly at rest.

    Raises:
        SuppleError: wrong_shape, not_finite, index_out_of_range, empty_mesh; bad_option where no
            vertex is mapped. Cancelled: if progress was cancelled.

    Source: Sumner and Popovic 2004, "Deformation Transfer for Triangle Meshes".
    """
    moved = [arrays.points(key, f"keys[{k}]") for k, key in enumerate(keys)]
    return ShapeTransfer(
        *_native.transfer_shape_keys(
            *_arrays(source), moved, *_arrays(target), map.native, progress
        )
    )


def shrink_fit(
    source: AnyMesh,
    target: AnyMesh,
    map: SurfaceMap,
    *,
    rounds: int = 4,
    project: bool = True,
    progress: _native.Progress | None = None,
) -> ShrinkFit:
    """The target's shape on the source's faces.

    Args:
        map: of the SOURCE's vertices to the TARGET's surface, the other direction of transfers.
        project: lay the result on the surface in the end; vertices for which that would turn a
            face over stay off it.

    Raises:
        SuppleError: wrong_shape, index_out_of_range, empty_mesh, bad_option. Cancelled: if
            progress was cancelled.
    """
    return ShrinkFit(
        *_native.shrink_fit(
            *_arrays(source), *_arrays(target), map.native, int(rounds), bool(project), progress
        )
    )


def save_map(path: str | os.PathLike, map: SurfaceMap, source: AnyMesh, target: AnyMesh) -> None:
    """Write a map of source's vertices to target's surface, replacing a file of that name.

    Raises:
        SuppleError: array_file where it can't be written; wrong_shape, index_out_of_range.
    """
    _native.save_map(os.fspath(path), map.native, *_arrays(source), *_arrays(target))


def load_map(path: str | os.PathLike, source: AnyMesh, target: AnyMesh) -> SurfaceMap:
    """The map of a file that save_map wrote.

    Raises:
        SuppleError: array_file where it is missing, damaged or no map; stale_mesh where a mesh is
            not the one it was made for: the message says which, and what has changed.
    """
    return SurfaceMap._of(_native.load_map(os.fspath(path), *_arrays(source), *_arrays(target)))
