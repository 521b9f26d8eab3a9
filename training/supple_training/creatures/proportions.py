# SPDX-License-Identifier: GPL-3.0-or-later
"""A creature with other proportions: limbs longer or shorter, thicker or thinner.

Two animals of different kinds are far from isometric. So are a creature and the same creature
whose parts have grown by different factors; the correspondence stays known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from supple_training.creatures.skeleton import FloatArray, Skeleton

_SPREAD = 0.28
"""Standard deviation of the logarithm of how much a chain grows."""

_LIMITS = (0.55, 1.8)


def _growth(rng: np.random.Generator, skeleton: Skeleton) -> FloatArray:
    """(chains,) factors; mirrored chains grow alike."""
    factors: list[float] = []
    for number, chain in enumerate(skeleton.chains):
        twin = number - 1
        if chain.mirrored and twin >= 0 and skeleton.chains[twin].joints == chain.joints:
            factors.append(factors[twin])
        else:
            factors.append(float(np.clip(np.exp(rng.normal(0.0, _SPREAD)), *_LIMITS)))
    return np.array(factors)


def grown(
    skeleton: Skeleton, vertices: FloatArray, weights: FloatArray, rng: np.random.Generator
) -> tuple[Skeleton, FloatArray]:
    """The skeleton and its skin (n, 3) with each chain grown by a random factor.

    vertices (n, 3) and weights (n, joints): the skin at rest and how far it follows each joint. A
    point that follows joint j goes to p'_j + s_j (v - p_j), p_j and p'_j being the joint's places.
    """
    factors = _growth(rng, skeleton)
    firsts = skeleton.first_joints()
    joints = weights.shape[1]
    scale, shift = np.ones(joints), np.zeros((joints, 3))
    chains = []
    for number, chain in enumerate(skeleton.chains):
        carrier = skeleton.carrier(number)
        root = chain.points[0]
        if carrier >= 0:
            root = scale[carrier] * root + shift[carrier]
        if not chain.joints:  # it follows its parent's joint, in size too
            own = scale[carrier] if carrier >= 0 else 1.0
        else:
            own = factors[number]
        offset = root - own * chain.points[0]
        span = slice(firsts[number], firsts[number] + chain.joints)
        scale[span], shift[span] = own, offset
        chains.append(replace(chain, points=own * chain.points + offset, radii=own * chain.radii))
    moved = (weights @ scale)[:, None] * vertices + weights @ shift
    return Skeleton(skeleton.family, tuple(chains)), moved
