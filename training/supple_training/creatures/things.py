# SPDX-License-Identifier: GPL-3.0-or-later
"""Other things that bend: hands, plants and bottles.

A maker takes two traits in [0, 1], how long limbs are and how thick the body is.
"""

from __future__ import annotations

import numpy as np

from supple_training.creatures.skeleton import Builder, Skeleton, mix, vector

Rng = np.random.Generator


def hand(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A hand or paw: forearm, palm and three to five fingers that point up."""
    b = Builder("hand")
    wide = rng.uniform(0.32, 0.45)
    spine = b.add(
        "spine",
        [(0, 0, -0.9), (0, 0, -0.45), (0, 0, 0)],
        [0.2, 0.16, 0.17],
        joints=5,
        x=(-70, 60),
        y=(-60, 60),
        z=(-35, 35),
        flat=0.85,
        flat_axis=(0, 1, 0),
    )
    palm = b.add(
        "rigid",
        [(0, 0, 0.02), (0, 0, 0.4)],
        [wide * 0.75, wide],
        spine,
        -1,
        flat=0.38,
        flat_axis=(0, 1, 0),
    )
    count = int(rng.integers(3, 6))
    w = mix(0.055, 0.085, thick) * (4 / count) ** 0.5
    for x in np.linspace(-0.85, 0.85, count):
        length = mix(0.45, 1.0, limbs) * rng.uniform(0.85, 1.1) * (1 - 0.2 * abs(x))
        root = np.array([x * wide, 0, 0.42 + 0.2 * wide * (1 - x * x)])
        way = np.array([0.35 * x, -0.05, 1.0])
        points = [root + t * length * way for t in (-0.1, 0.15, 0.5, 0.62, 0.82, 1.0)]
        b.add(
            "limb",
            points,
            w * np.array([1.15, 1.1, 1.0, 1.0, 0.9, 0.75]),
            spine,
            -1,
            x=[(-15, 35), (-5, 45), (-5, 40), (-5, 45), (-5, 50)],
            z=[(-12, 12), *[(0, 0)] * 4],
            y=[(-5, 5), *[(0, 0)] * 4],
            phase=0.1 * x,
            blend=0.16,
        )
    if rng.random() < 0.8:
        root = np.array([0.6 * wide, -0.02, 0.1])
        way = np.array([0.85, -0.25, 0.6])
        b.add(
            "limb",
            [root + t * way * 0.6 for t in (0, 0.25, 0.5, 0.7, 0.85, 1.0)],
            1.15 * w * np.array([1.6, 1.4, 1.1, 1.0, 1.0, 0.8]),
            spine,
            -1,
            x=[(-15, 25), (-15, 30), (-5, 35), (-5, 40), (0, 30)],
            z=[(-20, 20), *[(0, 0)] * 4],
            blend=0.2,
        )
    del palm
    return b.finish()


def plant(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A stem with branches that end in leaves or fruit."""
    b = Builder("plant")
    r = mix(0.035, 0.08, thick)
    spine = b.add(
        "tail",
        [(0, 0, 0), (rng.uniform(-0.1, 0.1), 0.05, 0.6), (0, 0, 1.3)],
        [1.3 * r, r, 0.7 * r],
        joints=9,
        x=(-60, 60),
        y=(-60, 60),
        z=(-60, 60),
    )
    if rng.random() < 0.7:
        b.add("rigid", [(0, 0, -0.25), (0, 0, 0.03)], [0.2, 0.28], spine, 0, blend=0.15)
    if rng.random() < 0.6:
        top = b.chains[spine].points[-1]
        b.add(
            "rigid",
            [top, top + vector(0, 0, 0.1)],
            [rng.uniform(0.1, 0.25)] * 2,
            spine,
            -1,
            flat=rng.uniform(0.4, 1.0),
            flat_axis=(0, 1, 0.3),
        )
    count = int(rng.integers(3, 7))
    for i in range(count):
        at = 2 + 6 * i // (count - 1)
        s = b.chains[spine].points[at]
        a = 2.4 * i + rng.uniform(-0.4, 0.4)
        out = np.array([np.cos(a), np.sin(a), 0])
        length = mix(0.35, 0.8, limbs) * rng.uniform(0.8, 1.2)
        rise = rng.uniform(0.2, 0.9)
        leaf = rng.uniform(0.05, 0.1)
        flat_axis = np.cross(np.cross(out, [0, 0, 1]), out + vector(0, 0, rise))
        points = [
            s,
            s + 0.5 * length * (out + vector(0, 0, rise)),
            s + length * (out + vector(0, 0, 0.7 * rise)),
        ]
        b.add(
            "tail",
            points,
            [0.55 * r, leaf, 0.5 * leaf],
            spine,
            at,
            joints=6,
            x=(-70, 70),
            y=(-40, 40),
            z=(-30, 30),
            axis=np.cross(out, [0, 0, 1]),
            flat=0.35,
            flat_axis=flat_axis,
        )
    return b.finish()


def vessel(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A soft bottle or jug, mostly with a spout."""
    b = Builder("vessel")
    r = mix(0.22, 0.4, thick)
    height = mix(0.8, 1.3, limbs)
    profile = [
        0.8 * r,
        r,
        rng.uniform(0.8, 1.1) * r,
        rng.uniform(0.3, 0.6) * r,
        rng.uniform(0.3, 0.5) * r,
    ]
    z = height * np.array([0, 0.25, 0.55, 0.8, 1.0])
    spine = b.add(
        "spine",
        np.stack([0 * z, 0 * z, z], axis=1),
        profile,
        joints=8,
        x=(-90, 90),
        y=(-80, 80),
        z=(-90, 90),
        flat=rng.uniform(0.7, 1.0),
        flat_axis=(0, 1, 0),
        blend=0.15,
    )
    if rng.random() < 0.7:
        s = np.array([-0.4 * r, 0, 0.5 * height])
        b.add(
            "tail",
            [s, s + vector(-0.9 * r - 0.15, 0, 0.15), s + vector(-r - 0.3, 0, 0.4 * height)],
            [0.3 * r, 0.2 * r, 0.15 * r],
            spine,
            4,
            joints=6,
            x=(-40, 40),
            z=(-40, 40),
            axis=(0, 1, 0),
        )
    return b.finish()
