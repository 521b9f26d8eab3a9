# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of creatures on legs: heads, tails, and the legs of mammals.

Lengths are trunk lengths. Flexion (x) turns what points forward downwards, and legs backwards.
"""

from __future__ import annotations

import numpy as np

from supple_training.creatures.skeleton import Builder, FloatArray, ahead, mix, vector

Rng = np.random.Generator


def add_head(b: Builder, rng: Rng, neck: int, length: float, radius: float, pitch: float) -> int:
    """A rigid head at the end of a neck, with ears and perhaps horns or a trunk."""
    start = b.chains[neck].points[-1]
    way, up = ahead(pitch), ahead(pitch + 90)
    tip = radius * rng.uniform(0.35, 0.75)
    points = [start - 0.2 * radius * way, start + 0.35 * length * way, start + length * way]
    head = b.add(
        "rigid",
        points,
        [radius, radius * rng.uniform(0.85, 1.05), tip],
        neck,
        -1,
        flat=rng.uniform(0.75, 1.0),
    )
    skull = start + 0.1 * length * way + 0.6 * radius * up
    if rng.random() < 0.8:
        size = radius * rng.choice([0.9, 1.4, 2.6], p=[0.5, 0.35, 0.15])
        out = np.array([1.0, 0.0, 0.0])
        lift = rng.uniform(0.0, 1.0)
        side = skull + 0.6 * radius * out
        ear = side + size * ((1 - lift) * out + lift * up - 0.3 * way)
        wide = radius * rng.uniform(0.25, 0.45) * (size / radius) ** 0.7
        b.mirror(
            b.add(
                "rigid",
                [side, ear],
                [wide, 0.6 * wide],
                neck,
                -1,
                flat=0.4,
                flat_axis=way + 0.3 * out,
                blend=0.2,
            )
        )
    if rng.random() < 0.2:
        horn = skull + 0.3 * radius * np.array([1.0, 0, 0])
        end = horn + radius * (1.3 * up + rng.uniform(0, 1) * np.array([1, 0, 0]) - 0.4 * way)
        b.mirror(b.add("rigid", [horn, end], [0.22 * radius, 0.08 * radius], neck, -1, blend=0.2))
    return head


def add_trunk(b: Builder, rng: Rng, neck: int, end: FloatArray, radius: float) -> None:
    """An elephant's trunk (or a tapir's) that hangs from the muzzle."""
    length = rng.uniform(0.35, 0.8)
    points = [
        end + vector(0, 0.05, 0),
        end + vector(0, -0.15 * length, -0.3 * length),
        end + vector(0, -0.12 * length, -length),
    ]
    b.add(
        "tail",
        points,
        [0.75 * radius, 0.6 * radius, 0.35 * radius],
        neck,
        -1,
        joints=8,
        x=(-150, 60),
        z=(-60, 60),
        y=(-20, 20),
    )


def add_tail(
    b: Builder, rng: Rng, spine: int, root: FloatArray, length: float, radius: float, fall: float
) -> None:
    """A tail that leaves backwards and falls by degrees."""
    a = np.radians(fall)
    way = np.array([0.0, np.cos(a), -np.sin(a)])
    points = [root, root + 0.5 * length * (way + vector(0, 0.25, 0.1)) / 1.15, root + length * way]
    end = radius * rng.uniform(0.15, 0.6)
    b.add(
        "tail",
        points,
        [radius, mix(end, radius, 0.45), end],
        spine,
        0,
        joints=8,
        x=(-50, 90),
        y=(-20, 20),
        z=(-80, 80),
    )


def add_hind_leg(
    b: Builder,
    rng: Rng,
    spine: int,
    hip: FloatArray,
    height: float,
    thigh: float,
    thin: float,
    bent: float,
    foot: float,
) -> int:
    """A hind leg: hip, knee, hock, fetlock and toe; `bent` 0 is a column, 1 a cat's."""
    x, y, z = hip
    down = np.array(
        [
            [0, 0, 0],
            [-0.2 * bent, 0, -0.42],
            [0.16 * bent, 0, -0.72],
            [0.05 * bent, 0, -0.93],
            [-0.01 - 0.5 * foot, 0, -0.965],
            [-0.02 - foot, 0, -1.0],
        ]
    )
    points = np.stack(
        [
            np.linspace(x, x * rng.uniform(0.9, 1.1), 6),
            y + down[:, 0] * height,
            z + down[:, 2] * height,
        ],
        axis=1,
    )
    radii = [thigh, mix(thin, thigh, 0.55), mix(thin, thigh, 0.14), thin, thin * 1.15, thin * 1.1]
    return b.add(
        "limb",
        points,
        radii,
        spine,
        0,
        x=[(-55, 48), (-12, 88), (-75, 15), (-20, 30), (-12, 18)],
        y=[(-12, 12), (0, 0), (0, 0), (-6, 6), (0, 0)],
        z=[(-28, 6), (0, 0), (0, 0), (-6, 6), (0, 0)],
    )


def add_front_leg(
    b: Builder,
    rng: Rng,
    spine: int,
    top: FloatArray,
    height: float,
    thigh: float,
    thin: float,
    bent: float,
    foot: float,
    phase: float,
) -> int:
    """A front leg: scapula, shoulder, elbow, carpus, fetlock and toe."""
    x, y, z = top
    down = np.array(
        [
            [0.03, 0, 0.1],
            [-0.1 * bent, 0, -0.12],
            [0.1 * bent, 0, -0.42],
            [0.0, 0, -0.72],
            [0.02, 0, -0.93],
            [-0.5 * foot, 0, -0.965],
            [-foot, 0, -1.0],
        ]
    )
    points = np.stack(
        [
            x * np.array([0.75, 1, 1, 0.97, 0.95, 0.95, 0.95]),
            y + down[:, 0] * height,
            z + down[:, 2] * height,
        ],
        axis=1,
    )
    radii = [
        0.7 * thigh,
        thigh,
        mix(thin, thigh, 0.45),
        mix(thin, thigh, 0.12),
        thin,
        thin * 1.15,
        thin * 1.1,
    ]
    return b.add(
        "limb",
        points,
        radii,
        spine,
        -1,
        x=[(-15, 15), (-38, 36), (-82, 12), (-8, 95), (-20, 30), (-12, 18)],
        y=[(0, 0), (-12, 12), (0, 0), (-6, 6), (-6, 6), (0, 0)],
        z=[(-5, 5), (-24, 6), (0, 0), (0, 0), (-6, 6), (0, 0)],
        phase=phase,
    )
