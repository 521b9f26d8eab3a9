# SPDX-License-Identifier: GPL-3.0-or-later
"""Skeletons of random creatures: chains of joints with a skin radius along each.

Lengths are metres once `Builder.finish` has scaled the skeleton. Z is up, a creature looks along -Y
and its left side is at +X, as bodies do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Range = tuple[float, float]
Point = Sequence[float]

AREA = 1.9
"""The skin area in square metres, about a human's, that skeletons are scaled to (roughly)."""

THINNEST = 0.017
"""The smallest skin radius in metres; a marching cube is a little smaller."""


@dataclass(frozen=True)
class Chain:
    """A chain of k joints with k bones between k + 1 points."""

    kind: str
    """How it is posed: spine, neck, tail, limb or rigid."""
    points: FloatArray
    """(k + 1, 3): the joints and the end."""
    radii: FloatArray
    """(k + 1,): of the skin around them."""
    parent: int
    """The chain it hangs from, -1 for the first."""
    at: int
    """The joint of the parent that carries it."""
    ranges: FloatArray
    """(k, 3, 2): lowest and highest turn of each joint about its own axes, in degrees."""
    axis: FloatArray
    """(3,): about where the joints' x axis, that of flexion, points."""
    mirrored: bool = False
    """A right side: turns about y and z change sign."""
    phase: float = 0.0
    """Of a limb within a stride, from 0 to 1."""
    flat: float = 1.0
    """Thickness along `flat_axis` over that across it."""
    flat_axis: FloatArray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    blend: float = 0.3
    """How far the skin runs smoothly into other chains, in radii."""

    @property
    def joints(self) -> int:
        """The number of joints, none when it is rigid: it then follows its parent's joint."""
        return 0 if self.kind == "rigid" else len(self.points) - 1

    def frames(self) -> FloatArray:
        """(k, 3, 3): the joints' axes as columns; y runs along the bone."""
        y = np.diff(self.points, axis=0)
        y /= np.linalg.norm(y, axis=1, keepdims=True)
        x = self.axis - (y @ self.axis)[:, None] * y
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        return np.stack([x, y, np.cross(x, y)], axis=2)


@dataclass(frozen=True)
class Skeleton:
    """The chains of a creature, each after its parent."""

    family: str
    chains: tuple[Chain, ...]

    def first_joints(self) -> list[int]:
        """The number of each chain's first joint, joints being counted along all chains."""
        counts = [chain.joints for chain in self.chains]
        return [sum(counts[:i]) for i in range(len(counts))]

    def carrier(self, chain: int) -> int:
        """The number of the joint that a chain hangs from, -1 for the first chain."""
        link = self.chains[chain]
        if link.parent < 0:
            return -1
        if self.chains[link.parent].joints == 0:
            return self.carrier(link.parent)
        return self.first_joints()[link.parent] + link.at


def resample(points: FloatArray, count: int) -> FloatArray:
    """`count` + 1 rows evenly along a smooth curve through the rows of (k, d)."""
    k = len(points)
    if k == 2:
        return points[0] + np.linspace(0, 1, count + 1)[:, None] * (points[1] - points[0])
    ahead = np.concatenate([[2 * points[0] - points[1]], points, [2 * points[-1] - points[-2]]])
    fine = np.linspace(0, k - 1, 16 * (k - 1) + 1)
    i = np.minimum(fine.astype(int), k - 2)
    t = (fine - i)[:, None]
    a, b, c, d = (ahead[i + j] for j in range(4))  # Catmull-Rom
    curve = b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)))
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve[:, :3], axis=0), axis=1))])
    even = np.linspace(0, length[-1], count + 1)
    return np.stack([np.interp(even, length, column) for column in curve.T], axis=1)


def _ranges(value: Range | Sequence[Range], joints: int) -> FloatArray:
    """(joints, 2) degrees: a range for the whole chain in equal parts, or one for each joint."""
    given = np.asarray(value, float)
    return np.tile(given / joints, (joints, 1)) if given.ndim == 1 else given


class Builder:
    """Collects the chains of a creature in any unit of length."""

    def __init__(self, family: str) -> None:
        self.family = family
        self.chains: list[Chain] = []

    def add(
        self,
        kind: str,
        points: Sequence[Point],
        radii: Sequence[float],
        parent: int = -1,
        at: int = 0,
        *,
        joints: int | None = None,
        x: Range | Sequence[Range] = (0, 0),
        y: Range | Sequence[Range] = (0, 0),
        z: Range | Sequence[Range] = (0, 0),
        axis: Point = (1, 0, 0),
        flat_axis: Point = (1, 0, 0),
        **options: float | bool,
    ) -> int:
        """Add a chain and return its number.

        With `joints`, that many joints are spread evenly along a smooth curve through the points;
        otherwise each point but the last is one. `at` counts from the end when negative.
        """
        rows = np.column_stack([np.asarray(points, float), radii])
        if joints is not None:
            rows = resample(rows, joints)
        k = len(rows) - 1
        if parent >= 0 and at < 0:
            at += max(self.chains[parent].joints, 1)
        ranges = np.stack([_ranges(value, k) for value in (x, y, z)], axis=1)
        self.chains.append(
            Chain(
                kind,
                rows[:, :3],
                rows[:, 3],
                parent,
                at,
                ranges,
                np.asarray(axis, float),
                flat_axis=np.asarray(flat_axis, float),
                **options,
            )
        )
        return len(self.chains) - 1

    def mirror(self, number: int, phase: float | None = None, parent: int | None = None) -> int:
        """Add the right counterpart of a left chain and return its number."""
        left = self.chains[number]
        flip = np.array([-1.0, 1.0, 1.0])
        self.chains.append(
            replace(
                left,
                points=left.points * flip,
                # A mirrored turn goes the other way round; x keeps its sign by turning the axis.
                axis=-left.axis * flip,
                flat_axis=left.flat_axis * flip,
                mirrored=not left.mirrored,
                phase=left.phase if phase is None else phase,
                parent=left.parent if parent is None else parent,
            )
        )
        return len(self.chains) - 1

    def finish(self) -> Skeleton:
        """The skeleton, scaled to about `AREA` of skin, no part thinner than `THINNEST`."""
        area = 0.0
        for chain in self.chains:
            lengths = np.linalg.norm(np.diff(chain.points, axis=0), axis=1)
            middle = 0.5 * (chain.radii[1:] + chain.radii[:-1])
            inside = 0.85 if chain.parent >= 0 else 1.0
            round_ = 0.5 * (1 + chain.flat)
            area += inside * np.sum(2 * np.pi * round_ * middle * (lengths + 0.3 * middle))
        scale = np.sqrt(AREA / area)
        scaled = []
        for chain in self.chains:
            radii = np.maximum(chain.radii * scale, THINNEST)
            flat = max(chain.flat, min(1.0, 0.9 * THINNEST / float(np.median(radii))))
            scaled.append(replace(chain, points=chain.points * scale, radii=radii, flat=flat))
        return Skeleton(self.family, tuple(scaled))


def mix(low: float, high: float, share: float) -> float:
    """From low (share 0) to high (share 1)."""
    return low + share * (high - low)


def vector(x: float, y: float, z: float) -> FloatArray:
    """(3,) of three numbers."""
    return np.array([x, y, z], dtype=np.float64)


def ahead(elevation: float) -> FloatArray:
    """The direction forward (-Y), raised by degrees."""
    angle = np.radians(elevation)
    return np.array([0.0, -np.cos(angle), np.sin(angle)])
