# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a sequence. rest: (n, 3); posed and truth: (frames, n, 3); faces: (m, 3) int."""

from __future__ import annotations

import numpy as np
import supple
from numpy.typing import NDArray

from supple_training.compare.edits.figures import diagonal, doubled_normals, held_vertices
from supple_training.sequences import Sequence


def accelerations(posed: NDArray) -> NDArray[np.float64]:
    """(frames - 2, n, 3): x[t + 1] - 2 x[t] + x[t - 1] of the inner frames."""
    return posed[2:] - 2 * posed[1:-1] + posed[:-2]


def percent_of_size(rest: NDArray, faces: NDArray) -> float:
    """What turns lengths into hundredths of the root of the rest area, the unit of pose errors."""
    return 100 / np.sqrt(np.linalg.norm(doubled_normals(rest, faces), axis=1).sum() / 2)


def acceleration_errors(
    rest: NDArray, faces: NDArray, posed: NDArray, truth: NDArray
) -> NDArray[np.float64]:
    """(frames - 2,): over vertices, the mean distance of the acceleration from the truth's, x100 of
    the root of the rest area.
    """
    away = np.linalg.norm(accelerations(posed) - accelerations(truth), axis=2)
    return percent_of_size(rest, faces) * away.mean(axis=1)


def figures(sequence: Sequence, posed: NDArray) -> dict:
    """Everything about a result that does not depend on who made it, or how fast.

    "pose_error" and "acceleration_error" are means over frames, "..._errors" lists of all, those of
    accelerations from the second frame to the last but one.
    """
    rest, faces, truth = sequence.case.vertices, sequence.case.faces, sequence.truth
    held = held_vertices(sequence.case.handles)
    from_truth = np.linalg.norm(posed[:, held] - truth[:, held], axis=2)
    near = [supple.pose_error(rest, faces, *pair) for pair in zip(posed, truth, strict=True)]
    smooth = acceleration_errors(rest, faces, posed, truth)
    return {
        "pose_error": float(np.mean(near)),
        "pose_errors": near,
        "acceleration_error": float(smooth.mean()),
        "acceleration_errors": smooth.tolist(),
        "handle_error": float(from_truth.max()) / diagonal(rest),
    }
