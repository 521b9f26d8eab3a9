# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of triangle meshes from NumPy alone: a z-buffer with smooth shading.

PyVista was tried: VTK 9.7 needs the system's EGL or OSMesa and ends the process with a
segmentation fault where there is neither; matplotlib has no depth buffer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CHUNK = 400_000
"""Fragments at a time."""

SAMPLES = 2
"""Along each side of a pixel."""

LIGHTS = (((-0.45, 0.65, 0.62), 0.62), ((0.75, 0.1, 0.65), 0.22), ((0.0, 0.1, 1.0), 0.12))
"""Directions towards the lights, as seen by the camera (right, up, backwards), and strengths."""
AMBIENT, SHINE, OUTLINE = 0.24, 0.10, 0.45


@dataclass(frozen=True)
class Camera:
    """A parallel view: rows of `axes` (3, 3) are right, up and backwards; all in mesh units."""

    axes: NDArray[np.float64]
    centre: NDArray[np.float64]
    """(2,) right and up of the middle of the picture."""
    extent: NDArray[np.float64]
    """(2,) width and height of what is seen."""


def camera(clouds: list[NDArray], *, elevation: float = 12.0, turn: float = 25.0) -> Camera:
    """One that sees all points of (n, 3) arrays, Y up, from the side that shows most.

    It stands across the widest horizontal direction, on the side of +Z or +X, then goes `turn`
    degrees around and `elevation` degrees up.
    """
    points = np.concatenate(clouds)
    flat = points[:, [0, 2]] - points[:, [0, 2]].mean(axis=0)
    across = np.linalg.svd(flat, full_matrices=False)[2][1]  # the narrowest horizontal direction
    if across[np.abs(across).argmax()] < 0:
        across = -across
    angle = np.arctan2(across[0], across[1]) - np.radians(turn)
    rise = np.radians(elevation)
    back = np.array([np.sin(angle) * np.cos(rise), np.sin(rise), np.cos(angle) * np.cos(rise)])
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(back, right), back])
    seen = points @ axes[:2].T
    low, high = seen.min(axis=0), seen.max(axis=0)
    return Camera(axes, (low + high) / 2, (high - low) * 1.06)


def _vertex_normals(points: NDArray, faces: NDArray) -> NDArray[np.float64]:
    """(n, 3), weighted by area."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    sums = np.stack(
        [np.bincount(faces.ravel(), np.repeat(normals[:, i], 3), len(points)) for i in range(3)],
        axis=1,
    )
    return sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300)


def _fragments(corners: NDArray, width: int, height: int):
    """Yields (face, pixel, barycentric weights (., 3)) of the pixel centres inside each triangle.

    corners: (m, 3, 2) in pixels.
    """
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5).astype(int), 0, [width, height])
    high = np.clip(np.floor(corners.max(axis=1) - 0.5).astype(int) + 1, 0, [width, height])
    span = np.maximum(high - low, 0)
    (ax, ay), (bx, by), (cx, cy) = (corners[:, i].T for i in range(3))
    doubled = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    drawn = np.flatnonzero((span.prod(axis=1) > 0) & (doubled != 0))
    # A corner's weight is a plane over the picture: at (x, y), plane . (x, y, 1).
    planes = np.zeros((2, 3, len(corners)))
    for plane, (px, py, qx, qy) in zip(planes, ((bx, by, cx, cy), (cx, cy, ax, ay)), strict=True):
        parts = np.stack([py - qy, qx - px, px * qy - py * qx])
        np.divide(parts, doubled, out=plane, where=doubled != 0)
    ends = np.cumsum(span[drawn].prod(axis=1))
    first = 0
    while first < len(drawn):
        before = ends[first - 1] if first else 0
        last = max(first + 1, int(np.searchsorted(ends, before + CHUNK, "right")))
        some = drawn[first:last]
        counts = span[some].prod(axis=1)
        face = np.repeat(some, counts)
        inside = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)
        row, column = np.divmod(inside, span[face, 0])
        x, y = column + low[face, 0], row + low[face, 1]
        first_two = [
            right[face] * (x + 0.5) + down[face] * (y + 0.5) + start[face]
            for right, down, start in planes
        ]
        weights = np.stack([*first_two, 1 - first_two[0] - first_two[1]], axis=1)
        kept = (weights >= 0).all(axis=1)
        yield face[kept], y[kept] * width + x[kept], weights[kept]
        first = last


def _outline(depth: NDArray, size: float) -> NDArray[np.float64]:
    """(h, w) from 0 to 1: where something stands well in front of what is beside it."""
    finite = np.where(np.isfinite(depth), depth, depth[np.isfinite(depth)].min() - size)
    edge = np.zeros(depth.shape)
    for axis in (0, 1):
        for step in (1, -1):
            edge = np.maximum(edge, np.roll(finite, step, axis) - finite)
    return np.clip((edge / size - 0.02) / 0.03, 0, 1)


def _lit(normal: NDArray, colour: NDArray) -> NDArray[np.float64]:
    """(k, 3) colours of points with these normals (k, 3), as the camera sees them."""
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    normal *= np.where(normal[:, 2:] < -0.2, -1.0, 1.0)  # the inside, not a silhouette
    lights = [(np.array(d) / np.linalg.norm(d), strength) for d, strength in LIGHTS]
    light = AMBIENT + sum(s * np.clip(normal @ d, 0, None) for d, s in lights)
    half = lights[0][0] + [0, 0, 1]
    shine = SHINE * np.clip(normal @ (half / np.linalg.norm(half)), 0, None) ** 30
    return np.clip(colour * light[:, None] + shine[:, None], 0, 1)


def render(
    points: NDArray, faces: NDArray, colours: NDArray, view: Camera, width: int
) -> NDArray[np.float64]:
    """A picture (h, w, 4), RGBA from 0 to 1, of `width` pixels, transparent where nothing is.

    colours: (m, 3) RGB of each face. Both sides of faces are lit.
    """
    w = width * SAMPLES
    h = max(1, round(width * view.extent[1] / view.extent[0])) * SAMPLES
    seen = points @ view.axes.T
    scale = w / view.extent[0]
    flat = (seen[:, :2] - view.centre) * [scale, -scale] + [w / 2, h / 2]
    depth = np.full(w * h, -np.inf)
    shown = np.zeros(w * h, int)
    place = np.zeros((w * h, 3))
    for face, pixel, weights in _fragments(flat[faces], w, h):
        z = np.einsum("fi,fi->f", weights, seen[faces, 2][face])
        nearer = z > depth[pixel]
        face, pixel, weights, z = (part[nearer] for part in (face, pixel, weights, z))
        order = np.argsort(z, kind="stable")  # of several in one pixel, the nearest is written last
        pixel = pixel[order]
        depth[pixel], shown[pixel], place[pixel] = z[order], face[order], weights[order]
    covered = np.flatnonzero(np.isfinite(depth))
    picture = np.zeros((w * h, 4))
    normals = _vertex_normals(points, faces) @ view.axes.T
    normal = np.einsum("fi,fij->fj", place[covered], normals[faces[shown[covered]]])
    picture[covered, :3] = _lit(normal, colours[shown[covered]])
    picture[covered, 3] = 1
    picture = picture.reshape(h, w, 4)
    if len(covered):
        lines = OUTLINE * _outline(depth.reshape(h, w), float(view.extent.max()))
        picture[..., :3] *= 1 - (lines * picture[..., 3])[..., None]
    blocks = picture.reshape(h // SAMPLES, SAMPLES, w // SAMPLES, SAMPLES, 4)
    hits = blocks[..., 3].sum(axis=(1, 3))
    result = np.zeros((h // SAMPLES, w // SAMPLES, 4))
    result[..., :3] = (blocks[..., :3] * blocks[..., 3:]).sum(axis=(1, 3))
    result[..., :3] /= np.maximum(hits, 1)[..., None]
    result[..., 3] = hits / SAMPLES**2
    return result
