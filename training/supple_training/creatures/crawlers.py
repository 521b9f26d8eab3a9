# SPDX-License-Identifier: GPL-3.0-or-later
"""Creatures that crawl or swim: lizards, snakes, fish, octopuses and insects.

A maker takes two traits in [0, 1], how long limbs are and how thick the body is. Lengths are about
trunk lengths.
"""

from __future__ import annotations

import numpy as np

from supple_training.creatures.skeleton import Builder, Skeleton, mix, vector

Rng = np.random.Generator


def sprawler(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A lizard, crocodile, newt or turtle, its legs out to the sides."""
    b = Builder("sprawler")
    r = mix(0.1, 0.24, thick)
    spine = b.add(
        "spine",
        [(0, 0.5, 0), (0, 0, 0.03), (0, -0.5, 0)],
        [0.75 * r, rng.uniform(0.95, 1.3) * r, 0.75 * r],
        joints=7,
        x=(-30, 30),
        y=(-30, 30),
        z=(-70, 70),
        flat=rng.uniform(0.6, 0.95),
        flat_axis=(0, 0, 1),
    )
    head_length = rng.uniform(0.25, 0.55)
    skull = rng.uniform(0.5, 0.75) * r
    length = rng.uniform(0.15, 0.45)
    neck = b.add(
        "neck",
        [(0, -0.45, 0), (0, -0.5 - length, rng.uniform(0, 0.2))],
        [0.7 * r, 0.95 * skull],
        spine,
        -1,
        joints=5,
        x=(-45, 35),
        y=(-20, 20),
        z=(-60, 60),
    )
    end = b.chains[neck].points[-1]
    b.add(
        "rigid",
        [end, end + vector(0, -0.35 * head_length, 0.02), end + vector(0, -head_length, -0.02)],
        [skull, 0.95 * skull, skull * rng.uniform(0.35, 0.7)],
        neck,
        -1,
        flat=rng.uniform(0.5, 0.8),
        flat_axis=(0, 0, 1),
    )
    if rng.random() < 0.6:
        eye = end + vector(0.5 * skull, -0.25 * head_length, 0.45 * skull)
        b.mirror(
            b.add(
                "rigid",
                [eye, eye + vector(0, -0.01, 0.02)],
                [0.3 * skull] * 2,
                neck,
                -1,
                blend=0.15,
            )
        )
    tail = rng.uniform(0.5, 1.6)
    b.add(
        "tail",
        [(0, 0.45, 0), (0, 0.5 + 0.5 * tail, -0.1 * r), (0, 0.5 + tail, -0.4 * r)],
        [0.7 * r, 0.4 * r, 0.1 * r],
        spine,
        0,
        joints=10,
        x=(-50, 60),
        y=(-30, 30),
        z=(-150, 150),
        flat=rng.uniform(0.7, 1.0),
    )
    out = mix(0.22, 0.6, limbs)
    w = r * rng.uniform(0.2, 0.34)
    for y, at, bend in ((0.42, 0, 0.25), (-0.4, -1, -0.2)):
        s = np.array([0.5 * r, y, -0.2 * r])
        leg = b.add(
            "limb",
            [
                s,
                s + out * np.array([0.3, 0.3 * bend, 0.03]),
                s + out * np.array([0.6, 0.6 * bend, -0.04]),
                s + out * np.array([0.68, bend - 0.1, -0.42]),
                s + out * np.array([0.72, bend - 0.25, -0.5]),
                s + out * np.array([0.76, bend - 0.5, -0.54]),
            ],
            [1.5 * w, 1.2 * w, w, 0.75 * w, 0.85 * w, 0.6 * w],
            spine,
            at,
            x=[(-40, 30), (0, 0), (-25, 40), (-20, 30), (-20, 25)],
            y=[(-15, 15), (-15, 15), (-15, 15), (0, 0), (0, 0)],
            z=[(-45, 45), (-15, 15), (-10, 10), (-20, 20), (-15, 15)],
            axis=(0, 1, 0.05),
            phase=0.0 if y > 0 else 0.5,
        )
        b.mirror(leg, b.chains[leg].phase + 0.5)
        for number in (leg, leg + 1):  # toes
            chain = b.chains[number]
            way = chain.points[-1] - chain.points[-2]
            for turn in (-0.7, 0.7):
                side = np.cross(way, [0, 0, 1]) * turn
                b.add(
                    "rigid",
                    [chain.points[-2], chain.points[-2] + 0.9 * way + side],
                    [0.7 * w, 0.45 * w],
                    number,
                    4,
                    blend=0.15,
                )
    return b.finish()


def snake(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A snake, eel, worm, or one arm of something larger."""
    b = Builder("snake")
    r = mix(0.045, 0.1, thick)
    length = mix(1.0, 1.5, limbs)
    curl, wave = rng.uniform(0, 0.12), rng.uniform(0.5, 2.0)
    t = np.linspace(0, 1, 7)
    points = np.stack([curl * np.sin(2 * np.pi * wave * t), length * (0.5 - t), 0 * t], axis=1)
    swell = 1 + rng.uniform(-0.2, 0.4) * np.sin(np.pi * t)
    radii = r * swell * np.interp(t, [0, 0.35, 1], [rng.uniform(0.15, 0.7), 0.9, 0.85])
    spine = b.add(
        "tail",
        points,
        radii,
        joints=16,
        x=(-160, 160),
        y=(-60, 60),
        z=(-250, 250),
        axis=(1, 0.1, 0),
    )
    if rng.random() < 0.75:
        end = b.chains[spine].points[-1]
        skull = r * rng.uniform(0.9, 1.5)
        b.add(
            "rigid",
            [end, end + vector(0, -2.2 * skull, 0)],
            [skull, 0.65 * skull],
            spine,
            -1,
            flat=rng.uniform(0.6, 0.9),
            flat_axis=(0, 0, 1),
        )
    if rng.random() < 0.3:
        fin = b.chains[spine].points[6]
        b.add(
            "rigid", [fin, fin + vector(0, 0.15, 2.5 * r)], [1.2 * r, 0.8 * r], spine, 6, flat=0.35
        )
    return b.finish()


def fish(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A fish, shark or dolphin with fins that bend."""
    b = Builder("fish")
    r = mix(0.12, 0.28, thick)
    y = np.array([0.75, 0.45, 0.1, -0.25, -0.5])
    spine = b.add(
        "spine",
        np.stack([0 * y, y, 0 * y], axis=1),
        r * np.array([0.22, 0.5, 1.0, 0.95, 0.35]),
        joints=10,
        x=(-60, 60),
        y=(-30, 30),
        z=(-110, 110),
        flat=rng.uniform(0.45, 0.95),
    )
    fin = mix(0.15, 0.45, limbs)
    upright = rng.random() < 0.6
    up = np.array([0, 0, 1.0]) if upright else np.array([1.0, 0, 0])
    thin = np.array([1.0, 0, 0]) if upright else np.array([0, 0, 1.0])
    stem = np.array([0, 0.75, 0])
    for sign in (1, -1):
        b.add(
            "tail",
            [stem, stem + fin * (np.array([0, 0.7, 0]) + sign * 0.9 * up)],
            [0.1, 0.06],
            spine,
            0,
            joints=4,
            x=(-30, 30),
            axis=np.cross([0, 1, 0], thin),
            z=(-25, 25),
            flat=0.3,
            flat_axis=thin,
        )
    b.add(
        "rigid",
        [(0, 0.05, 0.7 * r), (0, 0.3 * fin + 0.1, r + 0.5 * fin)],
        [0.14, 0.05],
        spine,
        5,
        flat=0.25,
    )
    s = np.array([0.3 * r, -0.15, -0.35 * r])
    arm = b.add(
        "limb",
        [s, s + fin * np.array([0.5, 0.3, -0.25]), s + fin * np.array([1.1, 0.7, -0.5])],
        [0.08, 0.09, 0.05],
        spine,
        7,
        joints=5,
        x=(-60, 60),
        y=(-40, 40),
        z=(-35, 35),
        axis=(0, 1, 0.2),
        flat=0.35,
        flat_axis=(0.4, 0, 1),
    )
    b.mirror(arm)
    return b.finish()


def octopus(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A round body with five to eight arms about it."""
    b = Builder("octopus")
    r = mix(0.22, 0.4, thick)
    spine = b.add(
        "spine",
        [(0, 0, 0), (0, 0.1, 0.5), (0, 0.3, 0.9)],
        [0.8 * r, 0.9 * r, rng.uniform(0.6, 1.2) * r],
        joints=5,
        x=(-60, 60),
        y=(-30, 30),
        z=(-40, 40),
    )
    count = int(rng.integers(5, 9))
    length = mix(0.9, 1.8, limbs)
    w = rng.uniform(0.2, 0.3) * r * (7 / count) ** 0.5
    up, fall = rng.uniform(0.0, 0.5), rng.uniform(0.0, 0.6)
    for i in range(count):
        a = 2 * np.pi * (i + 0.5 + rng.uniform(-0.1, 0.1)) / count
        out = np.array([np.cos(a), np.sin(a), 0])
        down = np.array([0, 0, -1.0])
        points = [
            0.4 * r * out,
            (r + 0.3 * length) * out + fall * 0.2 * length * down,
            (r + 0.65 * length) * out + fall * 0.6 * length * down,
            (r + 0.95 * length) * out + (fall - up) * length * down,
        ]
        b.add(
            "tail",
            points,
            [1.5 * w, w, 0.7 * w, 0.3 * w],
            spine,
            0,
            joints=9,
            x=(-110, 110),
            y=(-40, 40),
            z=(-110, 110),
            axis=np.cross(out, [0, 0, 1]),
        )
    return b.finish()


def insect(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """An ant, beetle, spider or crab: a body in parts and six or eight jointed legs."""
    b = Builder("insect")
    r = mix(0.13, 0.26, thick)
    waist = rng.uniform(0.35, 0.9)
    spine = b.add(
        "spine",
        [(0, 0.55, 0), (0, 0.1, 0), (0, -0.15, 0), (0, -0.45, 0)],
        [rng.uniform(0.9, 1.3) * r, waist * r, 0.85 * r, 0.75 * r],
        joints=6,
        x=(-45, 45),
        y=(-15, 15),
        z=(-40, 40),
        flat=rng.uniform(0.7, 1.0),
        flat_axis=(0, 0, 1),
    )
    neck = b.add(
        "neck",
        [(0, -0.4, 0), (0, -0.7, 0.02)],
        [0.55 * r, 0.7 * r],
        spine,
        -1,
        joints=5,
        x=(-40, 40),
        y=(-30, 30),
        z=(-40, 40),
    )
    if rng.random() < 0.6:
        s = np.array([0.3 * r, -0.75, 0.3 * r])
        b.mirror(
            b.add(
                "tail",
                [s, s + vector(0.1, -0.2, 0.25), s + vector(0.25, -0.5, 0.25)],
                [0.2 * r, 0.15 * r, 0.12 * r],
                neck,
                -1,
                joints=6,
                x=(-60, 60),
                z=(-50, 50),
            )
        )
    count = int(rng.integers(3, 5))
    length = mix(0.5, 1.2, limbs)
    w = rng.uniform(0.1, 0.16) * r
    lift = rng.uniform(0.1, 0.5)
    for i, turn in enumerate(np.linspace(-0.75, 0.75, count)):
        out = np.array([np.cos(turn), np.sin(turn), 0])
        up = np.array([0, 0, 1.0])
        y = -0.08 + 0.16 * (i - (count - 1) / 2)
        s = np.array([0.45 * r, y, -0.2 * r])
        drop = lift + rng.uniform(0.2, 0.5)
        points = [
            s,
            s + length * (0.12 * out),
            s + length * (0.42 * out + lift * up),
            s + length * (0.8 * out + (lift - 0.45 * drop) * up),
            s + length * (0.93 * out + (lift - drop) * up),
            s + length * (1.02 * out + (lift - 1.15 * drop) * up),
        ]
        leg = b.add(
            "limb",
            points,
            w * np.array([1.8, 1.5, 1.3, 1.0, 0.9, 0.7]),
            spine,
            int((0.55 - y) * 6),
            x=[(-25, 25), (-25, 25), (-35, 40), (-25, 35), (-20, 30)],
            z=[(-30, 30), (-10, 10), (0, 0), (0, 0), (0, 0)],
            y=[(-10, 10), (-10, 10), (0, 0), (0, 0), (0, 0)],
            axis=np.cross(out, up),
            phase=0.5 * (i % 2),
            blend=0.25,
        )
        b.mirror(leg, 0.5 * ((i + 1) % 2))
    return b.finish()
