# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin of a skeleton: a closed surface around its chains, and how far it follows each joint.

The surface is an implicit one, a smooth union of tapered and flattened tubes, cut out by marching
cubes; small bumps and folds then move it along its normals. Weights come from the same tubes and
are made smooth by heat that spreads over the surface about as far as a limb is thick.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from supple_training.creatures.skeleton import FloatArray, Skeleton, resample
from supple_training.remesh import relax

IntArray = NDArray[np.int64]

CUBE = 0.0135
"""The edge of a marching cube in metres."""

REACH = 3.0
"""A tube ends to act where its signed distance exceeds this many blend lengths."""


@dataclass(frozen=True)
class _Tubes:
    """The tapered segments around one chain, in a space in which they are round."""

    start: FloatArray
    end: FloatArray
    radii: FloatArray
    """(s + 1,)"""
    place: FloatArray
    """(s + 1,): where along the chain, counted in joints."""
    stretch: FloatArray
    """(3, 3): from metres to that space."""
    blend: float
    flat: float

    def distances(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of points (n, 3): signed distance, radius and place along the chain, each (n,)."""
        along = self.end - self.start
        square = np.sum(along**2, axis=1)
        q = points @ self.stretch.T
        ahead = q @ along.T - np.sum(self.start * along, axis=1)
        t = np.clip(ahead / square, 0.0, 1.0)
        off = np.sum(q**2, axis=1)[:, None] - 2 * q @ self.start.T + np.sum(self.start**2, axis=1)
        off += t * (t * square - 2 * ahead)
        distance = np.sqrt(np.maximum(off, 0.0))
        distance -= self.radii[:-1] + t * np.diff(self.radii)
        near = distance.argmin(axis=1)
        row = np.arange(len(points))
        t = t[row, near]
        radius = self.radii[near] + t * np.diff(self.radii)[near]
        return distance[row, near], radius, self.place[near] + t * np.diff(self.place)[near]

    def on_grid(self, axes: list[FloatArray], i: int) -> FloatArray:
        """Segment i's signed distance in blend lengths on the grid that axes (3 arrays) span."""
        start, along = self.start[i], self.end[i] - self.start[i]
        # The stretched point is a sum of one term for each axis, which saves most of the work.
        x, y, z = (np.outer(a, column) for a, column in zip(axes, self.stretch.T, strict=True))
        x = x - start

        def total(fx: FloatArray, fy: FloatArray, fz: FloatArray) -> FloatArray:
            return fx[:, None, None] + fy[:, None] + fz

        direction = along / (along @ along)
        t = np.clip(total(x @ direction, y @ direction, z @ direction), 0.0, 1.0)
        square = np.zeros_like(t)
        for d in range(3):
            off = total(x[:, d], y[:, d], z[:, d]) - along[d] * t
            off *= off
            square += off
        radius = self.radii[i] + (self.radii[i + 1] - self.radii[i]) * t
        np.sqrt(square, out=square)
        return (square / radius - 1.0) / self.blend


def _tubes(skeleton: Skeleton) -> list[_Tubes]:
    result = []
    for chain in skeleton.chains:
        rows = np.column_stack([chain.points, chain.radii, np.arange(len(chain.points))])
        if len(rows) > 2:
            length = np.linalg.norm(np.diff(chain.points, axis=0), axis=1).sum()
            fine = int(np.ceil(length / (0.45 * np.median(chain.radii))))
            rows = resample(rows, int(np.clip(fine, len(rows) - 1, 3 * (len(rows) - 1))))
        axis = chain.flat_axis / np.linalg.norm(chain.flat_axis)
        stretch = np.eye(3) + (1 / chain.flat - 1) * np.outer(axis, axis)
        points = rows[:, :3] @ stretch.T
        radii = np.maximum(rows[:, 3], 0.8 * chain.radii.min())
        result.append(
            _Tubes(points[:-1], points[1:], radii, rows[:, 4], stretch, chain.blend, chain.flat)
        )
    return result


def _surface(tubes: list[_Tubes]) -> tuple[FloatArray, IntArray]:
    """Marching cubes on the smooth union: vertices and counterclockwise faces."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for tube in tubes:
        for ends in (tube.start, tube.end):
            back = ends @ np.linalg.inv(tube.stretch).T
            low = np.minimum(low, back.min(axis=0) - 1.6 * tube.radii.max())
            high = np.maximum(high, back.max(axis=0) + 1.6 * tube.radii.max())
    shape = np.ceil((high - low) / CUBE).astype(int) + 1
    total = np.zeros(shape, np.float64)
    for tube in tubes:
        # Within a chain the nearest segment counts, so that joints do not swell; chains add up.
        own = np.full(shape, np.inf)
        for i in range(len(tube.start)):
            radius = max(tube.radii[i], tube.radii[i + 1])
            margin = radius * (1 + REACH * tube.blend)
            ends = np.stack([tube.start[i], tube.end[i]]) @ np.linalg.inv(tube.stretch).T
            first = np.maximum(((ends.min(axis=0) - margin - low) / CUBE).astype(int), 0)
            last = np.minimum(((ends.max(axis=0) + margin - low) / CUBE).astype(int) + 2, shape)
            axes = [low[d] + CUBE * np.arange(first[d], last[d]) for d in range(3)]
            part = own[first[0] : last[0], first[1] : last[1], first[2] : last[2]]
            np.minimum(part, tube.on_grid(axes, i), out=part)
        total += np.maximum(np.exp(-own) - np.exp(-REACH), 0.0)
    grid = np.stack(
        np.meshgrid(*(low[d] + CUBE * np.arange(shape[d]) for d in range(3)), indexing="ij"), -1
    )
    vertices, faces, _ = igl.marching_cubes(
        np.log(total + 1e-3).ravel(order="F"),
        np.stack([grid[..., d].ravel(order="F") for d in range(3)], axis=1),
        *(int(n) for n in shape),
        0.0,
    )
    corner = vertices[faces]
    if np.einsum("md,md->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) < 0:
        faces = faces[:, ::-1]
    return vertices, faces


def _largest_piece(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """The component with most faces, its vertices counted anew."""
    n = len(vertices)
    graph = scipy.sparse.coo_matrix(
        (np.ones(2 * len(faces)), (faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel())), (n, n)
    )
    _, labels = scipy.sparse.csgraph.connected_components(graph, directed=False)
    faces = faces[labels[faces[:, 0]] == np.bincount(labels[faces[:, 0]]).argmax()]
    used, numbers = np.unique(faces, return_inverse=True)
    return vertices[used], numbers.reshape(-1, 3)


def _influence(
    tubes: list[_Tubes], skeleton: Skeleton, vertices: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """How far each vertex belongs to each joint, (n, joints), and the local thickness (n,)."""
    n = len(vertices)
    firsts = skeleton.first_joints()
    weights = np.zeros((n, sum(chain.joints for chain in skeleton.chains)))
    thickness, most = np.zeros(n), np.zeros(n)
    for number, (tube, chain) in enumerate(zip(tubes, skeleton.chains, strict=True)):
        distance, radius, place = tube.distances(vertices)
        share = np.exp(-np.maximum(distance / (tube.blend * radius), -2.0))
        share[share < np.exp(-REACH)] = 0.0
        if chain.joints:
            joint = np.clip(place.astype(int), 0, chain.joints - 1)
            weights[np.arange(n), firsts[number] + joint] += share
        else:
            weights[:, max(skeleton.carrier(number), 0)] += share
        thickness = np.where(share > most, radius * np.sqrt(tube.flat), thickness)
        most = np.maximum(most, share)
    return weights / weights.sum(axis=1, keepdims=True), thickness


def spread(
    vertices: FloatArray, faces: IntArray, weights: FloatArray, thickness: FloatArray
) -> FloatArray:
    """Heat that starts as the weights and spreads twice, by about 0.4 of the thickness."""
    laplacian = -igl.cotmatrix(vertices, faces)
    mass = igl.massmatrix(vertices, faces, igl.MASSMATRIX_TYPE_BARYCENTRIC)
    width = 0.4 * np.maximum(thickness, 1.5 * CUBE)
    half = scipy.sparse.diags(width)
    solver = splu(
        (mass + half @ laplacian @ half).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    for _ in range(2):
        weights = np.maximum(solver.solve(mass @ weights), 0.0)
        weights /= weights.sum(axis=1, keepdims=True)
    return weights


def _detail(
    vertices: FloatArray, faces: IntArray, thickness: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Bumps, ripples and folds along the normals, smaller where the creature is thin."""
    size = np.minimum(thickness, 0.12)
    height = np.zeros(len(vertices))
    for _ in range(int(rng.integers(3, 7))):  # lumps: two crossing waves
        waves = rng.normal(size=(3, 2))
        waves *= 2 * np.pi / rng.uniform(0.1, 0.5, 2) / np.linalg.norm(waves, axis=0)
        crossing = np.sin(vertices @ waves + rng.uniform(0, 2 * np.pi, 2))
        height += rng.uniform(0.02, 0.08) * crossing[:, 0] * crossing[:, 1]
    if rng.random() < 0.6:  # folds: sharp furrows in patches
        wave = rng.normal(size=3)
        wave /= np.linalg.norm(wave)
        bend = 0.04 * np.sin(vertices @ rng.normal(size=(3, 3)) * rng.uniform(3, 9))
        furrow = np.abs(np.sin((vertices + bend) @ wave * np.pi / rng.uniform(0.05, 0.12)))
        patch = np.sin(vertices @ rng.normal(size=3) * 6 + rng.uniform(0, 6))
        patch = np.clip(2 * patch, 0.0, 1.0) ** 2
        height -= rng.uniform(0.04, 0.12) * patch * (1 - furrow) ** 2
    for centre in rng.choice(len(vertices), int(rng.integers(8, 40)), replace=False):
        reach = rng.uniform(0.25, 0.7) * size[centre] + 0.01
        away = np.sum((vertices - vertices[centre]) ** 2, axis=1)
        height += rng.uniform(-0.08, 0.16) * np.exp(-away / reach**2)
    normals = igl.per_vertex_normals(vertices, faces)
    return vertices + (size * np.clip(height, -0.25, 0.3))[:, None] * normals


def fused(skeleton: Skeleton, faces: IntArray, weights: FloatArray) -> bool:
    """Whether the skin joins parts that are apart, such as two feet.

    weights (n, joints) before they are spread: of the parts of the skeleton themselves.
    """
    chains = skeleton.chains
    chain = np.concatenate([np.full(c.joints, i) for i, c in enumerate(chains)])
    place = np.concatenate([np.arange(c.joints) for c in chains])
    hangs = np.concatenate([np.full(c.joints, c.parent) for c in chains])
    joint = weights.argmax(axis=1)
    start, end = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    a, b = joint[start], joint[end]
    apart = (chain[a] != chain[b]) & (hangs[a] != chain[b]) & (hangs[b] != chain[a])
    # Limbs that leave a body side by side may well share their skin there.
    apart &= (place[a] > 0) & (place[b] > 0)
    of_chain = np.stack([weights[:, chain == i].sum(axis=1) for i in range(len(chains))], axis=1)
    apart[apart] = of_chain[start, chain[a]][apart] + of_chain[start, chain[b]][apart] > 0.85
    along = (chain[a] == chain[b]) & (np.abs(place[a] - place[b]) > 5)
    return bool(np.any(apart | along))


def skin(
    skeleton: Skeleton, rng: np.random.Generator
) -> tuple[FloatArray, IntArray, FloatArray, FloatArray] | None:
    """The skin of a skeleton, or None when parts that are apart touch each other.

    Vertices (n, 3) in metres, faces (m, 3), weights (n, joints) that `spread` makes smooth, and the
    local thickness (n,) in metres.
    """
    tubes = _tubes(skeleton)
    vertices, faces = _largest_piece(*_surface(tubes))
    vertices = relax(vertices, faces, 6)
    weights, thickness = _influence(tubes, skeleton, vertices)
    if fused(skeleton, faces, weights):
        return None
    return _detail(vertices, faces, thickness, rng), faces, weights, thickness
