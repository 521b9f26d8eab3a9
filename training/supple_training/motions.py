# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of everyday motions for the bodies of `bodies.py`, walking, reaching and sitting, and
whole motions as sequences of poses.

Angles are degrees about a bone's own axes from the rest pose, for the left side; on the right, y
and z change sign. Thighs swing forward with negative x, arms with positive x; elbows and knees bend
with positive x; positive z raises an arm.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from supple_training import bodies

Bones = dict[str, NDArray[np.float64]]

_SPINE = ("spine05", "spine04", "spine03", "spine02", "spine01")
_NECK = ("neck01", "neck02", "neck03", "head")


def _chain(bones: tuple[str, ...], x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Bones:
    turn = bodies.rotation(np.array([x, y, z]) / len(bones))
    return dict.fromkeys(bones, turn)


def _limb(bone: str, side: int, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Bones:
    """side: 1 for left, -1 for right."""
    return {bone + (".L" if side > 0 else ".R"): bodies.rotation(np.array([x, side * y, side * z]))}


def stride(phase: float, swing: float, lean: float) -> Bones:
    """A moment of walking: arms down, each swinging against its leg.

    phase: in radians; at 0 the left leg is in front. swing: how far legs go forward and back, and
    lean: how far the trunk does, in degrees.
    """
    bones = _chain(_SPINE, x=lean, y=10 * np.cos(phase))
    for side in (1, -1):
        turn = phase + (0.0 if side > 0 else np.pi)
        forward = np.cos(turn)  # 1: the leg in front
        bones |= _limb("upperleg01", side, x=-8 - swing * forward)
        bones |= _limb("lowerleg01", side, x=8 + 55 * max(0.0, -np.sin(turn)) ** 1.5)
        bones |= _limb("foot", side, x=12 * max(0.0, -forward))
        bones |= _limb("upperarm01", side, x=-swing * forward, z=-30)
        bones |= _limb("lowerarm01", side, x=-15 - 15 * forward)
    return bones


def _gait(rng: np.random.Generator) -> tuple[float, float, float]:
    """A random phase, swing and lean for `stride`."""
    return rng.uniform(0, 2 * np.pi), rng.uniform(22, 36), rng.uniform(0, 8)


def walk(rng: np.random.Generator) -> Bones:
    """A random phase of a stride."""
    return stride(*_gait(rng))


def reach(rng: np.random.Generator) -> Bones:
    """One arm stretched forward and up, the trunk leaning and turning after it."""
    reaching = 1 if rng.random() < 0.5 else -1
    lean = rng.uniform(5, 35)
    bones = _chain(_SPINE, x=lean, y=reaching * rng.uniform(-25, -5), z=rng.uniform(-10, 10))
    bones |= _chain(_NECK, x=-0.6 * lean)
    bones |= _limb("upperarm01", reaching, x=rng.uniform(45, 75), z=rng.uniform(10, 55))
    bones |= _limb("lowerarm01", reaching, x=rng.uniform(-38, -20))
    bones |= _limb("upperarm01", -reaching, x=rng.uniform(-20, 10), z=rng.uniform(-30, -20))
    bones |= _limb("lowerarm01", -reaching, x=rng.uniform(-20, 30))
    for side in (1, -1):
        bend = rng.uniform(0, 25)
        bones |= _limb("upperleg01", side, x=-bend)
        bones |= _limb("lowerleg01", side, x=1.6 * bend)
    return bones


def sit(rng: np.random.Generator) -> Bones:
    """As on a chair: thighs level, knees bent, arms hanging or on the thighs."""
    bones = _chain(_SPINE, x=rng.uniform(0, 25), y=rng.uniform(-10, 10))
    bones |= _chain(_NECK, x=rng.uniform(-10, 10))
    for side in (1, -1):
        bones |= _limb("upperleg01", side, x=rng.uniform(-98, -75), z=rng.uniform(-15, 0))
        bones |= _limb("lowerleg01", side, x=rng.uniform(70, 100))
        bones |= _limb("upperarm01", side, x=rng.uniform(-5, 25), z=rng.uniform(-28, -10))
        bones |= _limb("lowerarm01", side, x=rng.uniform(-10, 40))
    return bones


MOTIONS: dict[str, Callable[[np.random.Generator], Bones]] = {
    "walk": walk,
    "reach": reach,
    "sit": sit,
}


def walk_cycle(rng: np.random.Generator, frames: int) -> list[Bones]:
    """A whole stride of one walk, from a random phase; the frame after the last is the first."""
    phase, swing, lean = _gait(rng)
    turns = 2 * np.pi * np.arange(frames) / frames
    return [stride(phase + turn, swing, lean) for turn in turns]


def _standing() -> Bones:
    """Upright, arms hanging."""
    bones: Bones = {}
    for side in (1, -1):
        bones |= _limb("upperarm01", side, z=-30)
        bones |= _limb("lowerarm01", side, x=-10)
    return bones


def blend(start: Bones, end: Bones, share: float) -> Bones:
    """Each bone turned by a share of the shortest way from `start` (0) to `end` (1)."""
    bones, still = {}, np.eye(3)
    for name in dict.fromkeys((*start, *end)):
        first = Rotation.from_matrix(start.get(name, still))
        way = first.inv() * Rotation.from_matrix(end.get(name, still))
        bones[name] = (first * Rotation.from_rotvec(share * way.as_rotvec())).as_matrix()
    return bones


def reach_over(rng: np.random.Generator, frames: int) -> list[Bones]:
    """From standing to a reach, starting and ending without speed and without acceleration."""
    start, end = _standing(), reach(rng)
    time = np.linspace(0, 1, frames)
    return [blend(start, end, share) for share in time**3 * (10 - 15 * time + 6 * time**2)]


SEQUENCES: dict[str, Callable[[np.random.Generator, int], list[Bones]]] = {
    "walk": walk_cycle,
    "reach": reach_over,
}
"""Motions as so many poses, evenly spaced in time."""


def sequence(
    motion: str,
    phenotype: NDArray[np.float64],
    rng: np.random.Generator,
    frames: int,
    *,
    intersection_limit: float = 0.03,
    attempts: int = 20,
) -> NDArray[np.float64]:
    """The body in each frame of a motion of `SEQUENCES`: (frames, 13348, 3) in metres.

    Raises RuntimeError when in each sequence some frame cuts too far into itself.
    """
    faces = bodies.triangles()
    allowed = bodies.self_intersection(bodies.vertices(phenotype), faces) + intersection_limit
    for _ in range(attempts):
        posed = []
        for bones in SEQUENCES[motion](rng, frames):
            posed.append(bodies.vertices(phenotype, bones))
            if bodies.self_intersection(posed[-1], faces) > allowed:
                break
        else:
            return np.stack(posed)
    raise RuntimeError(
        f"no sequence of '{motion}' out of {attempts} kept self intersection below {allowed:.3f} "
        "in all frames"
    )


def pose(
    motion: str,
    phenotype: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    intersection_limit: float = 0.03,
    attempts: int = 20,
) -> NDArray[np.float64]:
    """The body in a pose of the motion: (13348, 3) in metres; see `bodies.sample_pose`.

    Raises RuntimeError when every pose cuts too far into itself.
    """
    faces = bodies.triangles()
    allowed = bodies.self_intersection(bodies.vertices(phenotype), faces) + intersection_limit
    for _ in range(attempts):
        posed = bodies.vertices(phenotype, MOTIONS[motion](rng))
        if bodies.self_intersection(posed, faces) <= allowed:
            return posed
    raise RuntimeError(
        f"no pose of '{motion}' out of {attempts} kept self intersection below {allowed:.3f}"
    )
