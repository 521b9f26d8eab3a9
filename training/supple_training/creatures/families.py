# SPDX-License-Identifier: GPL-3.0-or-later
"""Families of creatures: random skeletons from two traits and a random generator.

The traits, both in [0, 1], are how long limbs are and how thick the body is. Lengths here are in
trunk lengths; flexion (x) of a part that points forward is downwards, of a leg backwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from supple_training.creatures.skeleton import Builder, FloatArray, Skeleton

Rng = np.random.Generator


def _mix(low: float, high: float, share: float) -> float:
    return low + share * (high - low)


def _ahead(elevation: float) -> FloatArray:
    """The direction forward (-Y), raised by degrees."""
    angle = np.radians(elevation)
    return np.array([0.0, -np.cos(angle), np.sin(angle)])


def _head(b: Builder, rng: Rng, neck: int, length: float, radius: float, pitch: float) -> int:
    """A rigid head at the end of a neck, with ears and perhaps horns or a trunk."""
    start = b.chains[neck].points[-1]
    way, up = _ahead(pitch), _ahead(pitch + 90)
    tip = radius * rng.uniform(0.35, 0.75)
    points = [start - 0.2 * radius * way, start + 0.35 * length * way, start + length * way]
    head = b.add("rigid", points, [radius, radius * rng.uniform(0.85, 1.05), tip], neck, -1,
                 flat=rng.uniform(0.75, 1.0))  # fmt: skip
    skull = start + 0.1 * length * way + 0.6 * radius * up
    if rng.random() < 0.8:
        size = radius * rng.choice([0.9, 1.4, 2.6], p=[0.5, 0.35, 0.15])
        out = np.array([1.0, 0.0, 0.0])
        lift = rng.uniform(0.0, 1.0)
        side = skull + 0.6 * radius * out
        ear = side + size * ((1 - lift) * out + lift * up - 0.3 * way)
        wide = radius * rng.uniform(0.25, 0.45) * (size / radius) ** 0.7
        b.mirror(b.add("rigid", [side, ear], [wide, 0.6 * wide], neck, -1,
                       flat=0.4, flat_axis=way + 0.3 * out, blend=0.2))  # fmt: skip
    if rng.random() < 0.2:
        horn = skull + 0.3 * radius * np.array([1.0, 0, 0])
        end = horn + radius * (1.3 * up + rng.uniform(0, 1) * np.array([1, 0, 0]) - 0.4 * way)
        b.mirror(b.add("rigid", [horn, end], [0.22 * radius, 0.08 * radius], neck, -1, blend=0.2))
    return head


def _trunk_of_head(b: Builder, rng: Rng, neck: int, end: FloatArray, radius: float) -> None:
    """An elephant's trunk (or a tapir's) that hangs from the muzzle."""
    length = rng.uniform(0.35, 0.8)
    points = [end + [0, 0.05, 0], end + [0, -0.15 * length, -0.3 * length],
              end + [0, -0.12 * length, -length]]  # fmt: skip
    b.add("tail", points, [0.75 * radius, 0.6 * radius, 0.35 * radius], neck, -1,
          joints=8, x=(-150, 60), z=(-60, 60), y=(-20, 20))  # fmt: skip


def _tail(b: Builder, rng: Rng, spine: int, root: FloatArray, length: float, radius: float,
          fall: float) -> None:  # fmt: skip
    """A tail that leaves backwards and falls by degrees."""
    a = np.radians(fall)
    way = np.array([0.0, np.cos(a), -np.sin(a)])
    points = [root, root + 0.5 * length * (way + [0, 0.25, 0.1]) / 1.15, root + length * way]
    end = radius * rng.uniform(0.15, 0.6)
    b.add("tail", points, [radius, _mix(end, radius, 0.45), end], spine, 0,
          joints=8, x=(-50, 90), y=(-20, 20), z=(-80, 80))  # fmt: skip


def _hind_leg(b: Builder, rng: Rng, spine: int, hip: FloatArray, height: float, thigh: float,
              thin: float, bent: float, foot: float) -> int:  # fmt: skip
    """A hind leg: hip, knee, hock, fetlock and toe; `bent` 0 is a column, 1 a cat's."""
    x, y, z = hip
    down = np.array([[0, 0, 0], [-0.2 * bent, 0, -0.42], [0.16 * bent, 0, -0.72],
                     [0.05 * bent, 0, -0.93], [-0.01 - 0.5 * foot, 0, -0.965],
                     [-0.02 - foot, 0, -1.0]])  # fmt: skip
    points = np.stack([
        np.linspace(x, x * rng.uniform(0.9, 1.1), 6), y + down[:, 0] * height,
        z + down[:, 2] * height,
    ], axis=1)  # fmt: skip
    radii = [thigh, _mix(thin, thigh, 0.55), _mix(thin, thigh, 0.14), thin, thin * 1.15, thin * 1.1]
    return b.add("limb", points, radii, spine, 0,
                 x=[(-48, 38), (-12, 75), (-65, 15), (-20, 30), (-12, 18)],
                 y=[(-12, 12), (0, 0), (0, 0), (-6, 6), (0, 0)],
                 z=[(-28, 6), (0, 0), (0, 0), (-6, 6), (0, 0)])  # fmt: skip


def _front_leg(b: Builder, rng: Rng, spine: int, top: FloatArray, height: float, thigh: float,
               thin: float, bent: float, foot: float) -> int:  # fmt: skip
    """A front leg: scapula, shoulder, elbow, carpus, fetlock and toe."""
    x, y, z = top
    down = np.array([[0.03, 0, 0.1], [-0.1 * bent, 0, -0.12], [0.1 * bent, 0, -0.42],
                     [0.0, 0, -0.72], [0.02, 0, -0.93], [-0.5 * foot, 0, -0.965],
                     [-foot, 0, -1.0]])  # fmt: skip
    points = np.stack([
        x * np.array([0.75, 1, 1, 0.97, 0.95, 0.95, 0.95]), y + down[:, 0] * height,
        z + down[:, 2] * height,
    ], axis=1)  # fmt: skip
    radii = [0.7 * thigh, thigh, _mix(thin, thigh, 0.45), _mix(thin, thigh, 0.12), thin,
             thin * 1.15, thin * 1.1]  # fmt: skip
    return b.add("limb", points, radii, spine, -1,
                 x=[(-15, 15), (-28, 28), (-70, 12), (-8, 85), (-20, 30), (-12, 18)],
                 y=[(0, 0), (-12, 12), (0, 0), (-6, 6), (-6, 6), (0, 0)],
                 z=[(-5, 5), (-24, 6), (0, 0), (0, 0), (-6, 6), (0, 0)])  # fmt: skip


def quadruped(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A mammal on four legs: from cat, dog and horse to giraffe, camel and elephant."""
    b = Builder("quadruped")
    r = _mix(0.13, 0.29, thick)
    drop = 0.8 * r + _mix(0.28, 0.85, limbs)
    arch, rise, flat = rng.uniform(-0.04, 0.05), rng.uniform(-0.04, 0.1), rng.uniform(0.7, 0.95)
    spine = b.add(
        "spine",
        [(0, 0.5, 0), (0, 0.18, arch), (0, -0.18, arch), (0, -0.5, rise)],
        r * np.array([rng.uniform(0.8, 1.0), rng.uniform(0.8, 1.15), rng.uniform(0.9, 1.2), 0.85]),
        joints=6, x=(-40, 50), y=(-25, 25), z=(-45, 45), flat=flat,
    )  # fmt: skip
    length = rng.uniform(0.2, 0.5) if rng.random() < 0.6 else rng.uniform(0.5, 1.1)
    rear, raised = rng.uniform(-5, 60), rng.uniform(10, 75)
    root = np.array([0, -0.5, rise + 0.15 * r])
    head_length = rng.uniform(0.24, 0.45)
    skull = head_length * rng.uniform(0.3, 0.45)
    middle = root + 0.5 * length * _ahead(rear)
    ends = [root + 0.35 * r * np.array([0, 1, 0]), middle, middle + 0.5 * length * _ahead(raised)]
    base = max(0.62 * r, 1.1 * skull * 0.7)
    neck = b.add("neck", ends, [base, _mix(base, 0.75 * skull, 0.6), 0.75 * skull], spine, -1,
                 joints=6 if length < 0.6 else 9, flat=rng.uniform(0.75, 1.0),
                 x=(-60, 75), y=(-40, 40), z=(-75, 75))  # fmt: skip
    pitch = min(raised, 20) - rng.uniform(10, 55)
    head = _head(b, rng, neck, head_length, skull, pitch)
    if rng.random() < 0.12:
        _trunk_of_head(b, rng, neck, b.chains[head].points[-1], skull)
    if rng.random() < 0.2:
        for y in [0.0] if rng.random() < 0.6 else [-0.2, 0.22]:
            top = np.array([0, y, 0.9 * r])
            b.add("rigid", [top, top + [0, 0, rng.uniform(0.4, 0.8) * r]],
                  [0.6 * r, 0.4 * r], spine, 3 if y == 0 else (4 if y < 0 else 1))  # fmt: skip
    _tail(b, rng, spine, np.array([0, 0.5 + 0.35 * r, 0.3 * r]), rng.uniform(0.15, 0.95),
          r * rng.uniform(0.14, 0.32), rng.uniform(-10, 80))  # fmt: skip
    thigh = r * rng.uniform(0.4, 0.56)
    thin = thigh * rng.uniform(0.25, 0.8) if thick > 0.5 else thigh * rng.uniform(0.25, 0.5)
    bent, foot = rng.uniform(0.1, 1.0), rng.choice([0.04, 0.1, 0.18])
    side = r * flat * rng.uniform(0.62, 0.78)
    gait = rng.choice(["walk", "trot", "gallop"])
    phases = {"walk": (0, 0.5, 0.25, 0.75), "trot": (0, 0.5, 0.5, 0), "gallop": (0, 0.1, 0.5, 0.6)}
    phase = phases[str(gait)]
    hip = np.array([side, 0.46, 0.0])
    hind = _hind_leg(b, rng, spine, hip, drop, thigh * 1.1, thin, bent, foot)
    top = np.array([side, -0.46, rise])
    front = _front_leg(b, rng, spine, top, drop + rise, thigh, thin, bent, foot)
    for leg, first in ((hind, 0), (front, 2)):
        b.mirror(leg, phase[first + 1])
        if first:
            b.chains[leg] = _with_phase(b, leg, phase[first])
    return b.finish()


def _with_phase(b: Builder, number: int, phase: float):
    from dataclasses import replace

    return replace(b.chains[number], phase=phase)


def bird(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A bird on two legs with wings: from sparrow to flamingo and ostrich."""
    b = Builder("bird")
    r = _mix(0.2, 0.36, thick)
    tilt = rng.uniform(0, 45)
    way = _ahead(tilt)
    spine = b.add("spine", [-0.5 * way, 0 * way, 0.5 * way], [0.6 * r, r, 0.7 * r], joints=5,
                  x=(-30, 30), y=(-15, 15), z=(-20, 20), flat=rng.uniform(0.8, 1.0))  # fmt: skip
    length = _mix(0.25, 1.5, rng.random() ** 1.5)
    root = 0.45 * way
    s1, s2 = _ahead(rng.uniform(0, 50)), _ahead(rng.uniform(60, 110))
    skull = rng.uniform(0.1, 0.17)
    thin = 0.6 * skull if length > 0.5 else 0.8 * skull
    points = [root, root + 0.3 * length * s1, root + 0.3 * length * s1 + 0.7 * length * s2]
    neck = b.add("neck", points, [0.5 * r, max(thin, 0.25 * r), thin], spine, -1,
                 joints=6 if length < 0.6 else 10, x=(-80, 100), y=(-50, 50),
                 z=(-90, 90))  # fmt: skip
    end = b.chains[neck].points[-1]
    face = _ahead(rng.uniform(-30, 10))
    b.add("rigid", [end, end + 0.7 * skull * face], [skull, 0.8 * skull], neck, -1)
    beak = rng.uniform(1.0, 3.0) * skull
    b.add("rigid", [end + skull * face, end + (skull + beak) * face + [0, 0, -0.2 * beak]],
          [0.45 * skull, 0.12 * skull], neck, -1, blend=0.2)  # fmt: skip
    back = -0.5 * way
    b.add("tail", [back, back + rng.uniform(0.25, 0.6) * np.array([0, 1, -0.2])],
          [0.4 * r, 0.5 * r], spine, 0, joints=4, x=(-30, 40), y=(-15, 15), z=(-25, 25),
          flat=0.25, flat_axis=(0, 0.2, 1))  # fmt: skip
    height = _mix(0.35, 1.5, limbs)
    toe = rng.uniform(0.12, 0.25)
    x = 0.45 * r + 0.35 * toe
    w = rng.uniform(0.015, 0.04) + 0.06 * r
    knee = [x, -0.1 - 0.1 * height, -0.6 * r - 0.05 * height]
    ankle = [x, 0.05 + 0.04 * height, -0.6 * r - 0.5 * height]
    foot = [x, 0.0, -0.6 * r - 0.96 * height]
    leg = b.add("limb", [[x, 0.1, -0.2 * r], knee, ankle, foot,
                         [x, -0.5 * toe, foot[2] - 0.03], [x, -toe, foot[2] - 0.04]],
                [0.4 * r, 0.25 * r, 1.2 * w, w, 1.2 * w, w], spine, 1,
                x=[(-40, 30), (-15, 60), (-70, 20), (-15, 60), (-20, 40)],
                y=[(-8, 8), (0, 0), (0, 0), (0, 0), (0, 0)],
                z=[(-18, 4), (0, 0), (0, 0), (0, 0), (0, 0)])  # fmt: skip
    b.mirror(leg, 0.5)
    for side in (0.6, -0.4):  # more toes
        out = np.array([side * toe, -0.7 * toe, -0.04])
        other = b.add("rigid", [np.array(foot), np.array(foot) + out], [1.1 * w, 0.8 * w], leg, 3)
        b.mirror(other, parent=leg + 1)
    span, sweep = rng.uniform(0.7, 1.4), rng.uniform(-0.1, 0.5)
    s = np.array([0.5 * r, -0.25 * np.cos(np.radians(tilt)), 0.3 * r + 0.25 * np.sin(tilt / 57.3)])
    droop = rng.uniform(-0.6, 0.4)
    points = [s, s + span * np.array([0.3, 0.05, 0.3 * droop + 0.05]),
              s + span * np.array([0.65, -0.02 + 0.4 * sweep, 0.65 * droop]),
              s + span * np.array([1.0, 0.1 + sweep, droop])]  # fmt: skip
    wide = rng.uniform(0.14, 0.24)
    wing = b.add("limb", points, [0.8 * wide, wide, 0.9 * wide, 0.5 * wide], spine, 3, joints=7,
                 x=(-80, 70), y=(-30, 30), z=(-50, 60), axis=(0, 1, 0), flat=0.22,
                 flat_axis=np.cross(points[-1] - s, [0, 1, 0]), blend=0.25)  # fmt: skip
    b.mirror(wing)
    return b.finish()


def biped(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """An upright or leaning walker with a strong tail: from kangaroo to tyrannosaur."""
    b = Builder("biped")
    r = _mix(0.16, 0.28, thick)
    tilt = rng.uniform(5, 80)
    way = _ahead(tilt)
    spine = b.add("spine", [-0.5 * way, np.zeros(3), 0.5 * way],
                  [0.95 * r, r, 0.7 * r], joints=6, x=(-40, 50), y=(-35, 35), z=(-35, 35),
                  flat=rng.uniform(0.8, 1.1))  # fmt: skip
    root, length = 0.45 * way, rng.uniform(0.2, 0.6)
    lift = _ahead(min(tilt + rng.uniform(0, 40), 95))
    head_length = rng.uniform(0.25, 0.5)
    skull = head_length * rng.uniform(0.32, 0.5)
    neck = b.add("neck", [root, root + 0.5 * length * (way + lift) / 2, root + length * lift],
                 [0.6 * r, 0.8 * skull, 0.75 * skull], spine, -1, joints=6,
                 x=(-60, 60), y=(-50, 50), z=(-60, 60))  # fmt: skip
    _head(b, rng, neck, head_length, skull, rng.uniform(-30, 10))
    back = -0.5 * way
    _tail(b, rng, spine, back, rng.uniform(0.5, 1.4), 0.6 * r, rng.uniform(-5, 50))
    height = _mix(0.55, 1.15, limbs)
    hip = back + [0.6 * r, -0.02, 0]
    thigh = rng.uniform(0.5, 0.7) * r
    leg = _hind_leg(b, rng, spine, hip, height, thigh, thigh * rng.uniform(0.25, 0.5),
                    rng.uniform(0.3, 1.0), rng.uniform(0.12, 0.3))  # fmt: skip
    b.mirror(leg, 0.5)
    s = 0.42 * way + np.array([0.6 * r, 0, 0])
    reach = rng.uniform(0.25, 0.9)
    w = 0.22 * r
    arm = b.add("limb", [s, s + reach * np.array([0.12, -0.02, -0.45]),
                         s + reach * np.array([0.14, -0.35, -0.7]),
                         s + reach * np.array([0.14, -0.5, -0.75])],
                [1.6 * w, 1.2 * w, 0.9 * w, w], spine, -1, joints=5,
                x=[(-80, 35), (-20, 10), (-70, 20), (-30, 20), (-35, 35)],
                y=[(-20, 20), (-10, 10), (-20, 20), (-20, 20), (0, 0)],
                z=[(-55, 10), (0, 0), (0, 0), (0, 0), (-10, 10)], phase=0.5)  # fmt: skip
    b.mirror(arm, 0.0)
    return b.finish()


def sprawler(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A lizard, crocodile, newt or turtle, its legs out to the sides."""
    b = Builder("sprawler")
    r = _mix(0.1, 0.24, thick)
    spine = b.add("spine", [(0, 0.5, 0), (0, 0, 0.03), (0, -0.5, 0)],
                  [0.75 * r, rng.uniform(0.95, 1.3) * r, 0.75 * r], joints=7,
                  x=(-30, 30), y=(-30, 30), z=(-70, 70),
                  flat=rng.uniform(0.6, 0.95), flat_axis=(0, 0, 1))  # fmt: skip
    head_length = rng.uniform(0.25, 0.55)
    skull = rng.uniform(0.5, 0.75) * r
    length = rng.uniform(0.15, 0.45)
    neck = b.add("neck", [(0, -0.45, 0), (0, -0.5 - length, rng.uniform(0, 0.2))],
                 [0.7 * r, 0.95 * skull], spine, -1, joints=5,
                 x=(-45, 35), y=(-20, 20), z=(-60, 60))  # fmt: skip
    end = b.chains[neck].points[-1]
    b.add("rigid", [end, end + [0, -0.35 * head_length, 0.02], end + [0, -head_length, -0.02]],
          [skull, 0.95 * skull, skull * rng.uniform(0.35, 0.7)], neck, -1,
          flat=rng.uniform(0.5, 0.8), flat_axis=(0, 0, 1))  # fmt: skip
    if rng.random() < 0.6:
        eye = end + [0.5 * skull, -0.25 * head_length, 0.45 * skull]
        b.mirror(b.add("rigid", [eye, eye + [0, -0.01, 0.02]], [0.3 * skull] * 2, neck, -1,
                       blend=0.15))  # fmt: skip
    tail = rng.uniform(0.5, 1.6)
    b.add("tail", [(0, 0.45, 0), (0, 0.5 + 0.5 * tail, -0.1 * r), (0, 0.5 + tail, -0.4 * r)],
          [0.7 * r, 0.4 * r, 0.1 * r], spine, 0, joints=10, x=(-50, 60), y=(-30, 30),
          z=(-150, 150), flat=rng.uniform(0.7, 1.0))  # fmt: skip
    out = _mix(0.22, 0.6, limbs)
    w = r * rng.uniform(0.2, 0.34)
    for y, at, bend in ((0.42, 0, 0.25), (-0.4, -1, -0.2)):
        s = np.array([0.5 * r, y, -0.2 * r])
        leg = b.add("limb", [s, s + out * np.array([0.3, 0.3 * bend, 0.03]),
                             s + out * np.array([0.6, 0.6 * bend, -0.04]),
                             s + out * np.array([0.68, bend - 0.1, -0.42]),
                             s + out * np.array([0.72, bend - 0.25, -0.5]),
                             s + out * np.array([0.76, bend - 0.5, -0.54])],
                    [1.5 * w, 1.2 * w, w, 0.75 * w, 0.85 * w, 0.6 * w], spine, at,
                    x=[(-40, 30), (0, 0), (-25, 40), (-20, 30), (-20, 25)],
                    y=[(-15, 15), (-15, 15), (-15, 15), (0, 0), (0, 0)],
                    z=[(-45, 45), (-15, 15), (-10, 10), (-20, 20), (-15, 15)],
                    axis=(0, 1, 0.05), phase=0.0 if y > 0 else 0.5)  # fmt: skip
        b.mirror(leg, b.chains[leg].phase + 0.5)
        for number in (leg, leg + 1):  # toes
            chain = b.chains[number]
            way = chain.points[-1] - chain.points[-2]
            for turn in (-0.7, 0.7):
                side = np.cross(way, [0, 0, 1]) * turn
                b.add("rigid", [chain.points[-2], chain.points[-2] + 0.9 * way + side],
                      [0.7 * w, 0.45 * w], number, 4, blend=0.15)  # fmt: skip
    return b.finish()


def snake(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A snake, eel, worm, or one arm of something larger."""
    b = Builder("snake")
    r = _mix(0.03, 0.085, thick)
    length = _mix(1.0, 1.5, limbs)
    curl, wave = rng.uniform(0, 0.12), rng.uniform(0.5, 2.0)
    t = np.linspace(0, 1, 7)
    points = np.stack([curl * np.sin(2 * np.pi * wave * t), length * (0.5 - t), 0 * t], axis=1)
    swell = 1 + rng.uniform(-0.2, 0.4) * np.sin(np.pi * t)
    radii = r * swell * np.interp(t, [0, 0.35, 1], [rng.uniform(0.15, 0.7), 0.9, 0.85])
    spine = b.add("tail", points, radii, joints=16, x=(-160, 160), y=(-60, 60), z=(-300, 300),
                  axis=(1, 0.1, 0))  # fmt: skip
    if rng.random() < 0.75:
        end = b.chains[spine].points[-1]
        skull = r * rng.uniform(0.9, 1.5)
        b.add("rigid", [end, end + [0, -2.2 * skull, 0]], [skull, 0.65 * skull], spine, -1,
              flat=rng.uniform(0.6, 0.9), flat_axis=(0, 0, 1))  # fmt: skip
    if rng.random() < 0.3:
        fin = b.chains[spine].points[6]
        b.add("rigid", [fin, fin + [0, 0.15, 2.5 * r]], [1.2 * r, 0.8 * r], spine, 6, flat=0.35)
    return b.finish()


def fish(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A fish, shark or dolphin with fins that bend."""
    b = Builder("fish")
    r = _mix(0.12, 0.28, thick)
    y = np.array([0.75, 0.45, 0.1, -0.25, -0.5])
    spine = b.add("spine", np.stack([0 * y, y, 0 * y], axis=1),
                  r * np.array([0.22, 0.5, 1.0, 0.95, 0.35]), joints=10, x=(-60, 60), y=(-30, 30),
                  z=(-110, 110), flat=rng.uniform(0.45, 0.95))  # fmt: skip
    fin = _mix(0.15, 0.45, limbs)
    upright = rng.random() < 0.6
    up = np.array([0, 0, 1.0]) if upright else np.array([1.0, 0, 0])
    thin = np.array([1.0, 0, 0]) if upright else np.array([0, 0, 1.0])
    stem = np.array([0, 0.75, 0])
    for sign in (1, -1):
        b.add("tail", [stem, stem + fin * (np.array([0, 0.7, 0]) + sign * 0.9 * up)],
              [0.1, 0.06], spine, 0, joints=4, x=(-30, 30), axis=np.cross([0, 1, 0], thin),
              z=(-25, 25), flat=0.3, flat_axis=thin)  # fmt: skip
    b.add("rigid", [(0, 0.05, 0.7 * r), (0, 0.3 * fin + 0.1, r + 0.5 * fin)], [0.14, 0.05],
          spine, 5, flat=0.25)  # fmt: skip
    s = np.array([0.3 * r, -0.15, -0.35 * r])
    arm = b.add("limb", [s, s + fin * np.array([0.5, 0.3, -0.25]),
                         s + fin * np.array([1.1, 0.7, -0.5])],
                [0.08, 0.09, 0.05], spine, 7, joints=5, x=(-60, 60), y=(-40, 40), z=(-35, 35),
                axis=(0, 1, 0.2), flat=0.35, flat_axis=(0.4, 0, 1))  # fmt: skip
    b.mirror(arm)
    return b.finish()


def hand(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A hand or paw: forearm, palm and three to five fingers that point up."""
    b = Builder("hand")
    wide = rng.uniform(0.32, 0.45)
    spine = b.add("spine", [(0, 0, -0.9), (0, 0, -0.45), (0, 0, 0)],
                  [0.2, 0.16, 0.17], joints=5, x=(-70, 60), y=(-60, 60), z=(-35, 35),
                  flat=0.85, flat_axis=(0, 1, 0))  # fmt: skip
    palm = b.add("rigid", [(0, 0, 0.02), (0, 0, 0.4)], [wide * 0.75, wide], spine, -1,
                 flat=0.38, flat_axis=(0, 1, 0))  # fmt: skip
    count = int(rng.integers(3, 6))
    w = _mix(0.055, 0.085, thick) * (4 / count) ** 0.5
    for x in np.linspace(-0.85, 0.85, count):
        length = _mix(0.45, 1.0, limbs) * rng.uniform(0.85, 1.1) * (1 - 0.2 * abs(x))
        root = np.array([x * wide, 0, 0.42 + 0.2 * wide * (1 - x * x)])
        way = np.array([0.35 * x, -0.05, 1.0])
        points = [root + t * length * way for t in (-0.1, 0.15, 0.5, 0.62, 0.82, 1.0)]
        b.add("limb", points, w * np.array([1.15, 1.1, 1.0, 1.0, 0.9, 0.75]), spine, -1,
              x=[(-15, 35), (-5, 45), (-5, 40), (-5, 45), (-5, 50)], z=[(-12, 12), *[(0, 0)] * 4],
              y=[(-5, 5), *[(0, 0)] * 4], phase=0.1 * x, blend=0.16)  # fmt: skip
    if rng.random() < 0.8:
        root = np.array([0.6 * wide, -0.02, 0.1])
        way = np.array([0.85, -0.25, 0.6])
        b.add("limb", [root + t * way * 0.6 for t in (0, 0.25, 0.5, 0.7, 0.85, 1.0)],
              1.15 * w * np.array([1.6, 1.4, 1.1, 1.0, 1.0, 0.8]), spine, -1,
              x=[(-15, 25), (-15, 30), (-5, 35), (-5, 40), (0, 30)], z=[(-20, 20), *[(0, 0)] * 4],
              blend=0.2)  # fmt: skip
    del palm
    return b.finish()


def octopus(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A round body with five to eight arms about it."""
    b = Builder("octopus")
    r = _mix(0.22, 0.4, thick)
    spine = b.add("spine", [(0, 0, 0), (0, 0.1, 0.5), (0, 0.3, 0.9)],
                  [0.8 * r, 0.9 * r, rng.uniform(0.6, 1.2) * r], joints=5, x=(-60, 60),
                  y=(-30, 30), z=(-40, 40))  # fmt: skip
    count = int(rng.integers(5, 9))
    length = _mix(0.9, 1.8, limbs)
    w = rng.uniform(0.2, 0.3) * r * (7 / count) ** 0.5
    up, fall = rng.uniform(0.0, 0.5), rng.uniform(0.0, 0.6)
    for i in range(count):
        a = 2 * np.pi * (i + 0.5 + rng.uniform(-0.1, 0.1)) / count
        out = np.array([np.cos(a), np.sin(a), 0])
        down = np.array([0, 0, -1.0])
        points = [0.4 * r * out, (r + 0.3 * length) * out + fall * 0.2 * length * down,
                  (r + 0.65 * length) * out + fall * 0.6 * length * down,
                  (r + 0.95 * length) * out + (fall - up) * length * down]  # fmt: skip
        b.add("tail", points, [1.5 * w, w, 0.7 * w, 0.3 * w], spine, 0, joints=9,
              x=(-110, 110), y=(-40, 40), z=(-110, 110),
              axis=np.cross(out, [0, 0, 1]))  # fmt: skip
    return b.finish()


def insect(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """An ant, beetle, spider or crab: a body in parts and six or eight jointed legs."""
    b = Builder("insect")
    r = _mix(0.13, 0.26, thick)
    waist = rng.uniform(0.35, 0.9)
    spine = b.add("spine", [(0, 0.55, 0), (0, 0.1, 0), (0, -0.15, 0), (0, -0.45, 0)],
                  [rng.uniform(0.9, 1.3) * r, waist * r, 0.85 * r, 0.75 * r], joints=6,
                  x=(-45, 45), y=(-15, 15), z=(-40, 40), flat=rng.uniform(0.7, 1.0),
                  flat_axis=(0, 0, 1))  # fmt: skip
    neck = b.add("neck", [(0, -0.4, 0), (0, -0.7, 0.02)], [0.55 * r, 0.7 * r], spine, -1, joints=5,
                 x=(-40, 40), y=(-30, 30), z=(-40, 40))  # fmt: skip
    if rng.random() < 0.6:
        s = np.array([0.3 * r, -0.75, 0.3 * r])
        b.mirror(b.add("tail", [s, s + [0.1, -0.2, 0.25], s + [0.25, -0.5, 0.25]],
                       [0.2 * r, 0.15 * r, 0.12 * r], neck, -1, joints=6, x=(-60, 60),
                       z=(-50, 50)))  # fmt: skip
    count = int(rng.integers(3, 5))
    length = _mix(0.5, 1.2, limbs)
    w = rng.uniform(0.1, 0.16) * r
    lift = rng.uniform(0.1, 0.5)
    for i, turn in enumerate(np.linspace(-0.75, 0.75, count)):
        out = np.array([np.cos(turn), np.sin(turn), 0])
        up = np.array([0, 0, 1.0])
        y = -0.08 + 0.16 * (i - (count - 1) / 2)
        s = np.array([0.45 * r, y, -0.2 * r])
        drop = lift + rng.uniform(0.2, 0.5)
        points = [s, s + length * (0.12 * out), s + length * (0.42 * out + lift * up),
                  s + length * (0.8 * out + (lift - 0.45 * drop) * up),
                  s + length * (0.93 * out + (lift - drop) * up),
                  s + length * (1.02 * out + (lift - 1.15 * drop) * up)]  # fmt: skip
        leg = b.add("limb", points, w * np.array([1.8, 1.5, 1.3, 1.0, 0.9, 0.7]), spine, int((0.55 - y) * 6),
                    x=[(-25, 25), (-25, 25), (-35, 40), (-25, 35), (-20, 30)],
                    z=[(-30, 30), (-10, 10), (0, 0), (0, 0), (0, 0)],
                    y=[(-10, 10), (-10, 10), (0, 0), (0, 0), (0, 0)],
                    axis=np.cross(out, up), phase=0.5 * (i % 2), blend=0.25)  # fmt: skip
        b.mirror(leg, 0.5 * ((i + 1) % 2))
    return b.finish()


def plant(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A stem with branches that end in leaves or fruit."""
    b = Builder("plant")
    r = _mix(0.035, 0.08, thick)
    spine = b.add("tail", [(0, 0, 0), (rng.uniform(-0.1, 0.1), 0.05, 0.6), (0, 0, 1.3)],
                  [1.3 * r, r, 0.7 * r], joints=9, x=(-60, 60), y=(-60, 60),
                  z=(-60, 60))  # fmt: skip
    if rng.random() < 0.7:
        b.add("rigid", [(0, 0, -0.25), (0, 0, 0.03)], [0.2, 0.28], spine, 0, blend=0.15)
    if rng.random() < 0.6:
        top = b.chains[spine].points[-1]
        b.add("rigid", [top, top + [0, 0, 0.1]], [rng.uniform(0.1, 0.25)] * 2, spine, -1,
              flat=rng.uniform(0.4, 1.0), flat_axis=(0, 1, 0.3))  # fmt: skip
    count = int(rng.integers(3, 7))
    for i in range(count):
        at = 2 + 6 * i // (count - 1)
        s = b.chains[spine].points[at]
        a = 2.4 * i + rng.uniform(-0.4, 0.4)
        out = np.array([np.cos(a), np.sin(a), 0])
        length = _mix(0.35, 0.8, limbs) * rng.uniform(0.8, 1.2)
        rise = rng.uniform(0.2, 0.9)
        leaf = rng.uniform(0.05, 0.1)
        flat_axis = np.cross(np.cross(out, [0, 0, 1]), out + [0, 0, rise])
        points = [s, s + 0.5 * length * (out + [0, 0, rise]),
                  s + length * (out + [0, 0, 0.7 * rise])]  # fmt: skip
        b.add("tail", points, [0.55 * r, leaf, 0.5 * leaf], spine, at, joints=6, x=(-70, 70),
              y=(-40, 40), z=(-30, 30), axis=np.cross(out, [0, 0, 1]),
              flat=0.35, flat_axis=flat_axis)  # fmt: skip
    return b.finish()


def vessel(limbs: float, thick: float, rng: Rng) -> Skeleton:
    """A soft bottle or jug with a closed handle: the one family with a hole."""
    b = Builder("vessel")
    r = _mix(0.22, 0.4, thick)
    height = _mix(0.8, 1.3, limbs)
    profile = [0.8 * r, r, rng.uniform(0.8, 1.1) * r, rng.uniform(0.3, 0.6) * r,
               rng.uniform(0.3, 0.5) * r]  # fmt: skip
    z = height * np.array([0, 0.25, 0.55, 0.8, 1.0])
    spine = b.add("spine", np.stack([0 * z, 0 * z, z], axis=1), profile, joints=8, x=(-90, 90),
                  y=(-80, 80), z=(-90, 90), flat=rng.uniform(0.7, 1.0), flat_axis=(0, 1, 0),
                  blend=0.15)  # fmt: skip
    w, out = rng.uniform(0.05, 0.08), rng.uniform(0.25, 0.4)
    t = np.linspace(0, 1, 7)
    low, high = 0.25 * height, 0.85 * height
    points = np.stack([0.25 * r + (0.75 * r + out) * np.sin(np.pi * t) ** 0.7, 0 * t,
                       low + (high - low) * t], axis=1)  # fmt: skip
    b.add("strap", points, np.full(7, w), spine, 2, joints=12, blend=0.25)
    if rng.random() < 0.5:
        s = np.array([-0.4 * r, 0, 0.5 * height])
        b.add("tail", [s, s + [-0.9 * r - 0.15, 0, 0.15], s + [-r - 0.3, 0, 0.4 * height]],
              [0.3 * r, 0.2 * r, 0.15 * r], spine, 4, joints=6, x=(-40, 40), z=(-40, 40),
              axis=(0, 1, 0))  # fmt: skip
    return b.finish()


FAMILIES: dict[Callable[[float, float, Rng], Skeleton], float] = {
    quadruped: 0.52,
    bird: 0.1,
    biped: 0.08,
    sprawler: 0.09,
    snake: 0.03,
    fish: 0.03,
    hand: 0.04,
    octopus: 0.04,
    insect: 0.04,
    plant: 0.03,
}
"""How often each family is drawn."""
