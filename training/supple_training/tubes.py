# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed tubes along Y to be bent by matrices: a bumpy cylinder or bar, and a tapered arm.

Lengths are in units of about one tube's length; no two numbers give the same tube.
"""

from __future__ import annotations

import numpy as np
import supple
from numpy.typing import NDArray

AROUND, ALONG = 48, 84
"""Vertices around the tube, and rings along it without the caps."""

JITTER = 0.25
"""Vertices move by up to this part of their distance to the next one, along the surface."""

HELD = 0.14
"""The part of its length at either end of a bent tube that is a handle."""


def _cross_section(angle: NDArray, squareness: float) -> NDArray[np.float64]:
    """Distance from the axis, about 1: a circle (0) to a rounded square (towards 1)."""
    power = 2 + 6 * squareness
    return (np.abs(np.cos(angle)) ** power + np.abs(np.sin(angle)) ** power) ** (-1 / power)


def tube(
    rng: np.random.Generator,
    *,
    radii: tuple[float, float],
    squareness: float = 0.0,
    bumps: float = 0.0,
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A closed tube of length 1 from y = 0 to 1 with round caps: vertices (n, 3), faces (m, 3).

    radii: at the lower and the upper end. bumps: their height, as a part of the radius.
    """
    low, high = radii
    caps = 8
    rise = np.arange(1, caps + 1) / caps * np.pi / 2
    inner = np.linspace(low, 1 - high, ALONG + 2)[1:-1]
    y = np.concatenate([low * (1 - np.cos(rise)), inner, 1 - high * (1 - np.cos(rise[::-1]))])
    straight = np.interp(inner, [low, 1 - high], radii)
    r = np.concatenate([low * np.sin(rise), straight, high * np.sin(rise[::-1])])
    rings = len(y)
    angle = np.broadcast_to(2 * np.pi * np.arange(AROUND) / AROUND, (rings, AROUND))
    angle = angle + rng.uniform(-JITTER, JITTER, (rings, AROUND)) * 2 * np.pi / AROUND
    step = np.gradient(y)
    sway = rng.uniform(-JITTER, JITTER, (rings, AROUND)) * step[:, None]
    sway[: caps + 1], sway[-caps - 1 :] = 0, 0  # caps keep their rings
    height = y[:, None] + sway
    waves = np.sin(rng.uniform(18, 26) * height + rng.uniform(0, 6)) * np.cos(
        rng.integers(3, 6) * angle + rng.uniform(0, 6)
    )
    radius = r[:, None] * _cross_section(angle, squareness) * (1 + bumps * waves)
    points = np.stack([radius * np.cos(angle), height, -radius * np.sin(angle)], axis=2)
    i, j = np.divmod(np.arange((rings - 1) * AROUND), AROUND)
    right = (j + 1) % AROUND
    a, b, c, d = (
        ring * AROUND + column for ring, column in ((i, j), (i, right), (i + 1, right), (i + 1, j))
    )
    one, other = np.stack([a, b, c, a, c, d], 1), np.stack([a, b, d, b, c, d], 1)
    sides = np.where(rng.random(len(a))[:, None] < 0.5, one, other).reshape(-1, 3)
    first, last = rings * AROUND, rings * AROUND + 1
    column = np.arange(AROUND)
    bottom = np.stack([np.full(AROUND, first), (column + 1) % AROUND, column], 1)
    end = (rings - 1) * AROUND
    top = np.stack([np.full(AROUND, last), end + column, end + (column + 1) % AROUND], 1)
    vertices = np.concatenate([points.reshape(-1, 3), [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    return vertices, np.concatenate([sides, bottom, top]).astype(np.int32)


def turned(degrees: float, before: NDArray, after: NDArray) -> NDArray[np.float64]:
    """(4, 4): by `degrees` about Z, clockwise (Y towards X), taking `before` (3,) to `after`."""
    angle = np.radians(degrees)
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    matrix[:3, 3] = after - matrix[:3, :3] @ before
    return matrix


def _handles(points: NDArray, low: float, high: float, matrix: NDArray) -> list[supple.Handle]:
    return [
        supple.Handle("held", np.flatnonzero(points[:, 1] <= low)),
        supple.Handle("moved", np.flatnonzero(points[:, 1] >= high), matrix=matrix),
    ]


def bend(rng: np.random.Generator, *, square: bool, degrees: float = 90.0):
    """A bumpy cylinder or bar whose upper end goes to where a circular arc takes it.

    Returns vertices, faces and handles; its axis between the handles would keep its length.
    """
    radius = rng.uniform(0.09, 0.12)
    points, faces = tube(
        rng,
        radii=(radius, radius),
        squareness=1.0 if square else 0.0,
        bumps=rng.uniform(0.04, 0.09),
    )
    angle, free = np.radians(degrees), 1 - 2 * HELD
    arc = free / angle
    end = [arc * (1 - np.cos(angle)), HELD + arc * np.sin(angle), 0.0]
    matrix = turned(degrees, np.array([0.0, 1 - HELD, 0.0]), np.array(end))
    return points, faces, _handles(points, HELD, 1 - HELD, matrix)


def elbow(rng: np.random.Generator, *, degrees: float = 120.0):
    """A tapered arm: the upper arm held, the forearm turned about the elbow. As `bend`."""
    upper = rng.uniform(0.075, 0.095)
    points, faces = tube(
        rng, radii=(upper, upper * rng.uniform(0.5, 0.7)), bumps=rng.uniform(0.0, 0.03)
    )
    joint = np.array([0.0, 0.5, 0.0])
    half = 1.1 * upper  # the free part, on either side of the joint
    return points, faces, _handles(points, 0.5 - half, 0.5 + half, turned(degrees, joint, joint))
