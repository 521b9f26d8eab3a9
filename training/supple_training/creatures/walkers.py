# SPDX-License-Identifier: GPL-3.0-or-later
"""Creatures on upright legs: quadrupeds, birds and bipeds.

A maker takes two traits in [0, 1], how long limbs are and how thick the body is. Lengths are trunk
lengths. Flexion (x) turns what points forward downwards, and legs backwards.
"""

from __future__ import annotations

import numpy as np

from supple_training.creatures.parts import (
    add_front_leg,
    add_head,
    add_hind_leg,
    add_tail,
    add_trunk,
)
from supple_training.creatures.skeleton import Builder, Skeleton, ahead, mix, vector

Rng = np.random.Generator


def quadruped(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A mammal on four legs: from cat, dog and horse to giraffe, camel and elephant."""
    b = Builder("quadruped")
    r = mix(0.13, 0.29, thick)
    drop = 0.8 * r + mix(0.28, 0.85, limbs)
    arch, rise, flat = rng.uniform(-0.04, 0.05), rng.uniform(-0.04, 0.1), rng.uniform(0.7, 0.95)
    spine = b.add(
        "spine",
        [(0, 0.5, 0), (0, 0.18, arch), (0, -0.18, arch), (0, -0.5, rise)],
        r * np.array([rng.uniform(0.8, 1.0), rng.uniform(0.8, 1.15), rng.uniform(0.9, 1.2), 0.85]),
        joints=6,
        x=(-50, 65),
        y=(-25, 25),
        z=(-60, 60),
        flat=flat,
    )
    length = rng.uniform(0.2, 0.5) if rng.random() < 0.6 else rng.uniform(0.5, 1.1)
    rear, raised = rng.uniform(-5, 60), rng.uniform(10, 75)
    root = np.array([0, -0.5, rise + 0.15 * r])
    head_length = rng.uniform(0.24, 0.45)
    skull = head_length * rng.uniform(0.3, 0.45)
    middle = root + 0.5 * length * ahead(rear)
    ends = [root + 0.35 * r * np.array([0, 1, 0]), middle, middle + 0.5 * length * ahead(raised)]
    base = max(0.62 * r, 1.1 * skull * 0.7)
    neck = b.add(
        "neck",
        ends,
        [base, mix(base, 0.75 * skull, 0.6), 0.75 * skull],
        spine,
        -1,
        joints=6 if length < 0.6 else 9,
        flat=rng.uniform(0.75, 1.0),
        x=(-75, 90),
        y=(-40, 40),
        z=(-75, 75),
    )
    pitch = min(raised, 20) - rng.uniform(10, 55)
    head = add_head(b, rng, neck, head_length, skull, pitch)
    if rng.random() < 0.12:
        add_trunk(b, rng, neck, b.chains[head].points[-1], skull)
    if rng.random() < 0.2:
        for y in [0.0] if rng.random() < 0.6 else [-0.2, 0.22]:
            top = np.array([0, y, 0.9 * r])
            b.add(
                "rigid",
                [top, top + vector(0, 0, rng.uniform(0.4, 0.8) * r)],
                [0.6 * r, 0.4 * r],
                spine,
                3 if y == 0 else (4 if y < 0 else 1),
            )
    add_tail(
        b,
        rng,
        spine,
        np.array([0, 0.5 + 0.35 * r, 0.3 * r]),
        rng.uniform(0.15, 0.95),
        r * rng.uniform(0.14, 0.32),
        rng.uniform(-10, 80),
    )
    thigh = r * rng.uniform(0.4, 0.56)
    thin = thigh * rng.uniform(0.25, 0.8) if thick > 0.5 else thigh * rng.uniform(0.25, 0.5)
    bent, foot = rng.uniform(0.1, 1.0), rng.choice([0.04, 0.1, 0.18])
    side = r * flat * rng.uniform(0.62, 0.78)
    gait = rng.choice(["walk", "trot", "gallop"])
    phases = {"walk": (0, 0.5, 0.25, 0.75), "trot": (0, 0.5, 0.5, 0), "gallop": (0, 0.1, 0.5, 0.6)}
    phase = phases[str(gait)]
    hip = np.array([side, 0.46, 0.0])
    hind = add_hind_leg(b, rng, spine, hip, drop, thigh * 1.1, thin, bent, foot)
    top = np.array([side, -0.46, rise])
    front = add_front_leg(b, rng, spine, top, drop + rise, thigh, thin, bent, foot, phase[2])
    b.mirror(hind, phase[1])
    b.mirror(front, phase[3])
    return b.finish()


def bird(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A bird on two legs with wings: from sparrow to flamingo and ostrich."""
    b = Builder("bird")
    r = mix(0.2, 0.36, thick)
    tilt = rng.uniform(0, 45)
    way = ahead(tilt)
    spine = b.add(
        "spine",
        [-0.5 * way, 0 * way, 0.5 * way],
        [0.6 * r, r, 0.7 * r],
        joints=5,
        x=(-30, 30),
        y=(-15, 15),
        z=(-20, 20),
        flat=rng.uniform(0.8, 1.0),
    )
    length = mix(0.25, 1.5, rng.random() ** 1.5)
    root = 0.45 * way
    s1, s2 = ahead(rng.uniform(0, 50)), ahead(rng.uniform(60, 110))
    skull = rng.uniform(0.1, 0.17)
    thin = 0.6 * skull if length > 0.5 else 0.8 * skull
    points = [root, root + 0.3 * length * s1, root + 0.3 * length * s1 + 0.7 * length * s2]
    neck = b.add(
        "neck",
        points,
        [0.5 * r, max(thin, 0.25 * r), thin],
        spine,
        -1,
        joints=6 if length < 0.6 else 10,
        x=(-80, 100),
        y=(-50, 50),
        z=(-90, 90),
    )
    end = b.chains[neck].points[-1]
    face = ahead(rng.uniform(-30, 10))
    b.add("rigid", [end, end + 0.7 * skull * face], [skull, 0.8 * skull], neck, -1)
    beak = rng.uniform(1.0, 3.0) * skull
    b.add(
        "rigid",
        [end + skull * face, end + (skull + beak) * face + vector(0, 0, -0.2 * beak)],
        [0.45 * skull, 0.12 * skull],
        neck,
        -1,
        blend=0.2,
    )
    back = -0.5 * way
    b.add(
        "tail",
        [back, back + rng.uniform(0.25, 0.6) * np.array([0, 1, -0.2])],
        [0.4 * r, 0.5 * r],
        spine,
        0,
        joints=4,
        x=(-30, 40),
        y=(-15, 15),
        z=(-25, 25),
        flat=0.25,
        flat_axis=(0, 0.2, 1),
    )
    height = mix(0.35, 1.5, limbs)
    toe = rng.uniform(0.12, 0.25)
    x = 0.45 * r + 0.35 * toe
    w = rng.uniform(0.015, 0.04) + 0.06 * r
    knee = [x, -0.1 - 0.1 * height, -0.6 * r - 0.05 * height]
    ankle = [x, 0.05 + 0.04 * height, -0.6 * r - 0.5 * height]
    foot = [x, 0.0, -0.6 * r - 0.96 * height]
    leg = b.add(
        "limb",
        [
            [x, 0.1, -0.2 * r],
            knee,
            ankle,
            foot,
            [x, -0.5 * toe, foot[2] - 0.03],
            [x, -toe, foot[2] - 0.04],
        ],
        [0.4 * r, 0.25 * r, 1.2 * w, w, 1.2 * w, w],
        spine,
        1,
        x=[(-40, 30), (-15, 60), (-70, 20), (-15, 60), (-20, 40)],
        y=[(-8, 8), (0, 0), (0, 0), (0, 0), (0, 0)],
        z=[(-18, 4), (0, 0), (0, 0), (0, 0), (0, 0)],
    )
    b.mirror(leg, 0.5)
    for side in (0.6, -0.4):  # more toes
        out = np.array([side * toe, -0.7 * toe, -0.04])
        other = b.add("rigid", [np.array(foot), np.array(foot) + out], [1.1 * w, 0.8 * w], leg, 3)
        b.mirror(other, parent=leg + 1)
    span, sweep = rng.uniform(0.7, 1.4), rng.uniform(-0.1, 0.5)
    s = np.array([0.5 * r, -0.25 * np.cos(np.radians(tilt)), 0.3 * r + 0.25 * np.sin(tilt / 57.3)])
    droop = rng.uniform(-0.6, 0.4)
    points = [
        s,
        s + span * np.array([0.3, 0.05, 0.3 * droop + 0.05]),
        s + span * np.array([0.65, -0.02 + 0.4 * sweep, 0.65 * droop]),
        s + span * np.array([1.0, 0.1 + sweep, droop]),
    ]
    wide = rng.uniform(0.14, 0.24)
    wing = b.add(
        "limb",
        points,
        [0.8 * wide, wide, 0.9 * wide, 0.5 * wide],
        spine,
        3,
        joints=7,
        x=(-80, 70),
        y=(-30, 30),
        z=(-50, 60),
        axis=(0, 1, 0),
        flat=0.22,
        flat_axis=np.cross(points[-1] - s, [0, 1, 0]),
        blend=0.25,
    )
    b.mirror(wing)
    return b.finish()


def biped(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """An upright or leaning walker with a strong tail: from kangaroo to tyrannosaur."""
    b = Builder("biped")
    r = mix(0.16, 0.28, thick)
    tilt = rng.uniform(5, 80)
    way = ahead(tilt)
    spine = b.add(
        "spine",
        [-0.5 * way, np.zeros(3), 0.5 * way],
        [0.95 * r, r, 0.7 * r],
        joints=6,
        x=(-50, 65),
        y=(-35, 35),
        z=(-35, 35),
        flat=rng.uniform(0.8, 1.1),
    )
    root, length = 0.45 * way, rng.uniform(0.2, 0.6)
    lift = ahead(min(tilt + rng.uniform(0, 40), 95))
    head_length = rng.uniform(0.25, 0.5)
    skull = head_length * rng.uniform(0.32, 0.5)
    neck = b.add(
        "neck",
        [root, root + 0.5 * length * (way + lift) / 2, root + length * lift],
        [0.6 * r, 0.8 * skull, 0.75 * skull],
        spine,
        -1,
        joints=6,
        x=(-60, 60),
        y=(-50, 50),
        z=(-60, 60),
    )
    add_head(b, rng, neck, head_length, skull, rng.uniform(-30, 10))
    back = -0.5 * way
    add_tail(b, rng, spine, back, rng.uniform(0.5, 1.4), 0.6 * r, rng.uniform(-5, 50))
    height = mix(0.55, 1.15, limbs)
    hip = back + vector(0.6 * r, -0.02, 0)
    thigh = rng.uniform(0.5, 0.7) * r
    leg = add_hind_leg(
        b,
        rng,
        spine,
        hip,
        height,
        thigh,
        thigh * rng.uniform(0.25, 0.5),
        rng.uniform(0.3, 1.0),
        rng.uniform(0.12, 0.3),
    )
    b.mirror(leg, 0.5)
    s = 0.42 * way + np.array([0.6 * r, 0, 0])
    reach = rng.uniform(0.25, 0.9)
    w = 0.22 * r
    arm = b.add(
        "limb",
        [
            s,
            s + reach * np.array([0.12, -0.02, -0.45]),
            s + reach * np.array([0.14, -0.35, -0.7]),
            s + reach * np.array([0.14, -0.5, -0.75]),
        ],
        [1.6 * w, 1.2 * w, 0.9 * w, w],
        spine,
        -1,
        joints=5,
        x=[(-80, 35), (-20, 10), (-70, 20), (-30, 20), (-35, 35)],
        y=[(-20, 20), (-10, 10), (-20, 20), (-20, 20), (0, 0)],
        z=[(-55, 10), (0, 0), (0, 0), (0, 0), (-10, 10)],
        phase=0.5,
    )
    b.mirror(arm, 0.0)
    return b.finish()
