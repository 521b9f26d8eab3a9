# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of creatures: strides, free turns of all joints, gaits, and the skin that follows."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from supple_training.creatures.skeleton import Chain, FloatArray, Skeleton

_BENDING = ("spine", "neck", "tail")

_LAG = 0.9
"""By how many radians of a stride a joint of a limb follows the one above it."""


def _curve(chain: Chain, strong: float, rng: np.random.Generator) -> FloatArray:
    """(k, 3) turns in [-1, 1] that vary smoothly along a chain."""
    t = np.linspace(0.0, 1.0, chain.joints)[:, None]
    whole = rng.uniform(-1, 1, 3) if rng.random() < strong else rng.normal(0, 0.25, 3)
    wave = rng.normal(0, 0.45, 3) * np.cos(np.pi * (rng.uniform(0.5, 2.0, 3) * t + rng.random(3)))
    along = 1 + rng.uniform(-0.8, 0.8) * (2 * t - 1)  # more at the root, or more at the tip
    return np.clip(whole * along + wave, -1.4, 1.4)


def _limb(
    chain: Chain, strong: float, stride: tuple[float, float] | None, rng: np.random.Generator
) -> FloatArray:
    """(k, 3) turns in [-1, 1]: a moment of a stride (moment, reach), or any turn of each joint."""
    k = chain.joints
    free = rng.uniform(-1, 1, (k, 3)) if rng.random() < strong else rng.normal(0, 0.22, (k, 3))
    if stride is None:
        return free
    moment, reach = stride
    angle = 2 * np.pi * (moment + chain.phase)
    turns = 0.2 * free
    # Joints down the limb follow later in the stride.
    turns[:, 0] += reach * np.sin(angle + _LAG * np.arange(k))
    return np.clip(turns, -1.0, 1.0)


def sample_turns(skeleton: Skeleton, rng: np.random.Generator) -> FloatArray:
    """Random turns of all joints about their own x, y and z axes: (joints, 3) degrees."""
    strong = rng.choice([0.35, 0.65, 0.95])
    stride = (rng.random(), rng.uniform(0.5, 1.1)) if rng.random() < 0.5 else None
    turns = []
    for chain in skeleton.chains:
        if not chain.joints:
            continue
        if chain.kind in _BENDING:
            unit = _curve(chain, strong, rng)
        else:
            unit = _limb(chain, strong, stride, rng)
        low, high = chain.ranges[..., 0], chain.ranges[..., 1]
        degrees = np.where(unit > 0, unit * high, -unit * low)
        turns.append(degrees * (np.array([1, -1, -1]) if chain.mirrored else 1))
    return np.concatenate(turns)


def sample_gait(skeleton: Skeleton, rng: np.random.Generator, frames: int) -> FloatArray:
    """A random gait, whole strides that close: (frames, joints, 3) degrees.

    Every angle is a sinusoid of time within a part of the joint's range. Limbs swing as their
    phases in the stride say; waves run along spines, necks and tails.
    """
    time = 2 * np.pi * np.arange(frames)[:, None, None] / frames
    moment, reach = rng.random(), rng.uniform(0.5, 1.0)
    turns = []
    for chain in skeleton.chains:
        if not chain.joints:
            continue
        along = np.arange(chain.joints)[:, None]
        start = 2 * np.pi * rng.random(3)
        if chain.kind in _BENDING:
            share = rng.uniform(0.1, 0.4, 3)
            start = start + np.pi * rng.uniform(0.0, 2.0) * along / chain.joints
        else:
            share = np.array([reach, *rng.uniform(0.0, 0.2, 2)])
            start[0] = 2 * np.pi * (moment + chain.phase)
            start = start + _LAG * along
        low, high = chain.ranges[..., 0], chain.ranges[..., 1]
        degrees = share * (low + high + (high - low) * np.sin(time + start)) / 2
        turns.append(degrees * (np.array([1, -1, -1]) if chain.mirrored else 1))
    return np.concatenate(turns, axis=1)


def joint_motions(skeleton: Skeleton, turns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How turns move the joints: unit quaternions (joints, 4), scalar last, and shifts (joints, 3).

    A point p that follows joint j goes to rotate(quaternion[j], p) + shift[j].
    """
    count = len(turns)
    spins: list[Rotation] = [Rotation.identity()] * count
    shifts = np.zeros((count, 3))
    firsts = skeleton.first_joints()
    for number, chain in enumerate(skeleton.chains):
        if not chain.joints:
            continue
        carrier = skeleton.carrier(number)
        first = firsts[number]
        frames = Rotation.from_matrix(chain.frames())
        # Flexion after sideways after twist.
        own = Rotation.from_euler("yzx", turns[first : first + chain.joints][:, [1, 2, 0]], True)
        local = frames * own * frames.inv()
        for i in range(chain.joints):
            before = carrier if i == 0 else first + i - 1
            spin, shift = (spins[before], shifts[before]) if before >= 0 else (None, np.zeros(3))
            joint = chain.points[i]
            spins[first + i] = local[i] if spin is None else spin * local[i]
            moved = joint + shift if spin is None else spin.apply(joint) + shift
            shifts[first + i] = moved - spins[first + i].apply(joint)
    return np.array([spin.as_quat() for spin in spins]), shifts


def _multiply(a: FloatArray, b: FloatArray) -> FloatArray:
    """Products of quaternions (n, 4), scalar last."""
    vector = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    scalar = a[:, 3] * b[:, 3] - np.einsum("nd,nd->n", a[:, :3], b[:, :3])
    return np.column_stack([vector, scalar])


def follow(
    vertices: FloatArray, weights: FloatArray, quaternions: FloatArray, shifts: FloatArray
) -> FloatArray:
    """Skin vertices (n, 3) that follow joints by weights (n, joints): blended dual quaternions.

    Kavan et al. 2008, "Geometric skinning with approximate dual quaternion blending".
    """
    pure = np.column_stack([shifts, np.zeros(len(shifts))])
    dual = 0.5 * _multiply(pure, quaternions)
    # A quaternion and its negative are one rotation: take the nearer to the heaviest joint's.
    same = np.where(quaternions @ quaternions.T < 0, -1.0, 1.0)
    signed = weights * same[weights.argmax(axis=1)]
    real, unreal = signed @ quaternions, signed @ dual
    length = np.linalg.norm(real, axis=1, keepdims=True)
    real, unreal = real / length, unreal / length
    shift = 2 * _multiply(unreal, real * np.array([-1, -1, -1, 1]))[:, :3]
    return Rotation.from_quat(real).apply(vertices) + shift


def sample_lean(rng: np.random.Generator) -> Rotation:
    """A small random turn, mostly about the vertical."""
    return Rotation.from_rotvec(np.radians(rng.normal(0.0, [8.0, 5.0, 12.0])))


def stand(posed: FloatArray, rest: FloatArray, lean: Rotation) -> FloatArray:
    """A pose (n, 3) moved rigidly to fit the rest best, then leant about its middle.

    Without this, the chain's first joint stays where it is and the far end swings about it.
    """
    middle, rest_middle = posed.mean(axis=0), rest.mean(axis=0)
    fit, _ = Rotation.align_vectors(rest - rest_middle, posed - middle)
    return (lean * fit).apply(posed - middle) + rest_middle
