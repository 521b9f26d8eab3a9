# SPDX-License-Identifier: GPL-3.0-or-later
"""In-betweening: a few poses of a mesh in, every pose between them out."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .mesh import PreparedMesh


class Inbetween:
    """Key poses of a mesh at given times, interpolated by their Jacobians: parts turn on arcs.

    Rotations are interpolated on SO(3), stretches linearly, or both by cubics; one Poisson solve a
    frame joins the faces again. What stands still in all keys stays. May be shared by threads; the
    native work runs without the GIL.

    Args:
        prepared: the rest mesh; it need not be one of the poses.
        poses: at least 2, (n, 3) each: the same vertices in the caller's units.
        times: one a pose, ascending, in any unit.
        smooth: whether the motion goes through inner keys without a change of speed; otherwise
            each pair of keys is interpolated by itself. Two keys are the same either way.
        progress: a Progress to watch and cancel.

    Attributes:
        times: (K,) as given.

    Raises:
        SuppleError: wrong_shape, not_finite; bad_option for times that do not ascend.
        Cancelled: if progress was cancelled.
    """

    def __init__(
        self,
        prepared: PreparedMesh,
        poses: Sequence[ArrayLike],
        times: ArrayLike,
        *,
        smooth: bool = True,
        progress: _native.Progress | None = None,
    ) -> None:
        self.prepared = prepared
        self.times: NDArray[np.float64] = arrays.numbers(times, "times")
        self._native = _native.Inbetween(
            prepared.native,
            [arrays.points(pose, f"poses[{k}]") for k, pose in enumerate(poses)],
            self.times.tolist(),
            smooth,
            progress,
        )

    def at(self, time: float) -> NDArray[np.float64]:
        """(n, 3) float64: at a key its pose bit for bit; outside the keys the pose at the end.

        Raises:
            SuppleError: not_finite.
        """
        return self._native.at(float(time))
