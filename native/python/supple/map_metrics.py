# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures for a map from a source to a target mesh.

Meshes are a Mesh or a PreparedMesh. A map has one target vertex, 0-based, for each source vertex.
Every function raises SuppleError with wrong_shape for a map of another length and with
index_out_of_range for a target that is not there.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .errors import SuppleError
from .mesh import Mesh, PreparedMesh

AnyMesh = Mesh | PreparedMesh


class GeodesicError(NamedTuple):
    """Of one map.

    Attributes:
        mean: over the points that are reached, x100 of the square root of the target's area.
        unreachable: points whose image no path joins with where they belong; not in the mean.
    """

    mean: float
    unreachable: int


class Geodesics:
    """Exact lengths of the shortest paths on a mesh, in its units.

    Windows are sent across the faces in order of distance: Mitchell et al. 1987, Chen and Han 1990,
    Xin and Wang 2009. Work stops once what was asked for is reached.

    Raises:
        SuppleError: wrong_shape, not_finite, index_out_of_range.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None:
        self.native = _native.Geodesics(arrays.points(vertices), arrays.triangles(faces))

    def distances(self, source: int) -> NDArray[np.float64]:
        """(n,) from vertex `source` to every vertex; infinite where no path leads."""
        return self.native.distances(source)

    def between(
        self,
        sources: ArrayLike,
        targets: ArrayLike,
        *,
        progress: _native.Progress | None = None,
    ) -> NDArray[np.float64]:
        """(p, q) from each of `sources` (p,) to each of its row of `targets` (p, q)."""
        return self.native.between(
            arrays.indices(sources, "sources"), _images(targets, "targets"), progress
        )


def _images(value: ArrayLike, name: str) -> NDArray[np.int32]:
    """(p, q) int32 of (p, q), or of (p,) as one column."""
    array = np.asarray(value)
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2:
        raise SuppleError("wrong_shape", f"{name} has shape {array.shape}; it must be (p, q).")
    return arrays.indices(array.ravel(), name).reshape(array.shape)


def geodesic_errors(
    target: AnyMesh,
    truth: ArrayLike,
    images: ArrayLike,
    *,
    geodesics: Geodesics | None = None,
    progress: _native.Progress | None = None,
) -> list[GeodesicError]:
    """How far the images of known points are from where they belong, along the target.

    Args:
        truth: (p,) target vertices.
        images: (p, maps) what each map makes of the same points; several maps share the work.
        geodesics: of the target, where many maps are measured one after the other.

    Source: Kim et al. 2011; the paths are exact.
    """
    areas = _native.face_areas(target.vertices, target.faces)
    return [
        GeodesicError(*error)
        for error in _native.geodesic_errors(
            (geodesics or Geodesics(target.vertices, target.faces)).native,
            float(areas.sum()),
            arrays.indices(truth, "truth"),
            _images(images, "images"),
            progress,
        )
    ]


def flipped(
    target: AnyMesh,
    truth: ArrayLike,
    mirror: ArrayLike,
    images: ArrayLike,
    *,
    geodesics: Geodesics | None = None,
    progress: _native.Progress | None = None,
) -> list[bool]:
    """Whether maps take left for right: their images are nearer the mirrored truth than the truth.

    Mean distances along the target are compared. A hundred points that are spread over the mesh are
    enough; those far from the truth take most of the time.

    Args:
        truth: (p,) target vertices, where known points belong.
        mirror: (p,) target vertices, where their mirror images belong.
        images, geodesics: as for geodesic_errors.
    """
    geodesics = geodesics or Geodesics(target.vertices, target.faces)
    right, wrong = (
        geodesic_errors(target, points, images, geodesics=geodesics, progress=progress)
        for points in (truth, mirror)
    )
    return [m.mean < t.mean for t, m in zip(right, wrong, strict=True)]


def face_inversion(source: AnyMesh, target: AnyMesh, point_map: ArrayLike) -> float:
    """Percent of the source's faces whose image has a normal against the sum of the target's
    vertex normals at its three corners."""
    return _native.face_inversion(*_checked(source, target, point_map))


def vertex_inversion(source: AnyMesh, target: AnyMesh, point_map: ArrayLike) -> float:
    """Percent of the target's vertices whose normal points against the sum of the normals of the
    mapped source vertices on it. Source: the paper, Eqn Inv."""
    return _native.vertex_inversion(*_checked(source, target, point_map))


def map_dirichlet(source: AnyMesh, target: AnyMesh, point_map: ArrayLike) -> float:
    """Dirichlet energy of the map, on meshes of area 1; 2 for the identity."""
    return _native.map_dirichlet(*_checked(source, target, point_map))


def coverage(source: AnyMesh, target: AnyMesh, point_map: ArrayLike) -> float:
    """Percent of the target's vertex area that some source vertex maps to."""
    return _native.coverage(*_checked(source, target, point_map))


def chamfer(a: ArrayLike, b: ArrayLike) -> float:
    """Mean distance of each of the points a (n, 3) to the nearest of b (m, 3), plus b's to a."""
    return _native.chamfer(arrays.points(a, "a"), arrays.points(b, "b"))


def _checked(source: AnyMesh, target: AnyMesh, point_map: ArrayLike) -> tuple:
    return (
        _native.TriangleMesh(source.vertices, source.faces),
        _native.TriangleMesh(target.vertices, target.faces),
        arrays.indices(point_map, "point_map"),
    )
