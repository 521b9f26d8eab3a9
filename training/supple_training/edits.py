# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of pairs: handles at their true positions, and what an edit makes of them by itself.

A network trained on the rotations of true Jacobians meets other rotations when it is used: those of
a smooth guess from a few handles. So the editing network is trained on such guesses.
"""

from __future__ import annotations

import numpy as np
import supple
from numpy.typing import NDArray

from supple_training.pairs import Pair

HANDLES = (8, 60)
"""The range of handle counts in training; small and large ones are equally likely by ratio."""

MOST_ROUNDS = 2
"""A suggestion is the smooth first guess after 0 to this many rounds without a network."""

RINGS = (0.1, 0.6, 0.3)
"""How often a handle is a vertex alone, with its neighbours, or with theirs too."""

Suggestion = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Suggested vertices (n, 3) and the indices (k,) of those that are at their targets."""


def farthest_points(
    points: NDArray[np.float64], count: int, *, start: int | None = None
) -> NDArray[np.int64]:
    """(count,) indices of points (n, 3) far from each other, from `start` or the outermost one."""
    if start is None:
        start = int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())
    chosen = [start]
    distance = np.full(len(points), np.inf)
    while len(chosen) < count:
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(distance.argmax()))
    return np.array(chosen)


def true_handles(
    pair: Pair, centres: NDArray[np.int64], rings: NDArray[np.int64] | None = None
) -> list[supple.Handle]:
    """Small handles at their true positions: each centre with its rings of neighbours, one if
    `rings` does not say.
    """
    source, faces, target = pair
    free = np.ones(len(source), bool)
    handles = []
    for number, centre in enumerate(centres):
        patch = np.array([centre])
        for _ in range(1 if rings is None else rings[number]):
            patch = np.unique(faces[np.isin(faces, patch).any(axis=1)])
        patch = patch[free[patch]]
        free[patch] = False
        if len(patch):
            handles.append(supple.Handle(f"handle {number}", patch, positions=target[patch]))
    return handles


def suggestions(pair: Pair, rng: np.random.Generator, count: int) -> list[Suggestion]:
    """`count` edits of a pair by random handles, each stopped after a random number of rounds."""
    source, faces, _ = pair
    prepared = supple.PreparedMesh(source, faces, eigenfunctions=1, samples=1, cache=False)
    result = []
    for _ in range(count):
        handle_count = int(np.exp(rng.uniform(*np.log(HANDLES))))
        if rng.random() < 0.5:
            centres = farthest_points(source, handle_count, start=int(rng.integers(len(source))))
        else:
            centres = rng.choice(len(source), handle_count, replace=False)
        # Of one size in most edits, as a user makes them, and mixed in some.
        rings = rng.choice(len(RINGS), size=len(centres), p=RINGS)
        if rng.random() < 0.7:
            rings[:] = rings[0]
        handles = true_handles(pair, centres, rings)
        rounds = int(rng.integers(MOST_ROUNDS + 1))
        edited = supple.Editor(prepared, handles, model=None).solve(rounds=rounds, polish=0)
        held = np.concatenate([handle.vertices for handle in handles])
        result.append((edited.vertices, held))
    return result
