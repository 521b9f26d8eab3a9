# SPDX-License-Identifier: GPL-3.0-or-later
"""Editing an animation: corrections of handles that travel with the moving surface."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .editing import Editor, Handle, options_of
from .mesh import PreparedMesh


@dataclass
class SequenceFrame:
    """One frame to correct.

    Attributes:
        vertices: (n, 3) as the animation has them, the caller's units.
        corrections: one a handle: its motion, (4, 4) affine for column vectors, as a correction of
            the rest shape; or None: the handle stays where the animation has it.
        share: how much of every correction is applied, 0 to 1; see range_share.
    """

    vertices: ArrayLike
    corrections: Sequence[ArrayLike | None]
    share: float = 1.0

    def _native_frame(self) -> _native.SequenceFrame:
        corrections = [
            None if matrix is None else arrays.matrix4(matrix, f"correction {h}")
            for h, matrix in enumerate(self.corrections)
        ]
        return _native.SequenceFrame(arrays.points(self.vertices), corrections, float(self.share))


class SequenceEditor:
    """Corrects frames of an animation of a prepared mesh, each by itself.

    With the rest mesh's operators: what the edit asks of a face multiplies the face's Jacobian from
    rest to the frame. Safe to call from several threads.

    Args:
        editor: handles bound to the rest mesh.
        mode, stiffness, method, network, loose_pieces, keep_volume: as for Editor.solve.

    Raises:
        SuppleError: bad_option.
    """

    def __init__(
        self,
        editor: Editor,
        *,
        mode: str | None = None,
        stiffness: float | None = None,
        method: str | None = None,
        network: bool = True,
        loose_pieces: str = "follow",
        keep_volume: bool = True,
    ) -> None:
        options = options_of(
            mode, stiffness, method, None, None, None, None, network, loose_pieces, keep_volume
        )
        self.editor = editor
        self._native = _native.SequenceEditor(editor._native, options)

    def solve(
        self, frames: Sequence[SequenceFrame], *, progress: _native.Progress | None = None
    ) -> list[NDArray[np.float64]]:
        """(n, 3) vertices of each frame, corrected; frames are shared among the threads.

        A handle of weight 1 is exactly at F C F^-1 of where the animation has it, with F its frame
        (`handle_frames`) and C the frame's share of its correction. A frame that asks for nothing
        comes back bit for bit. The bytes depend on neither the number of threads nor the frames
        solved beside one.

        Raises:
            SuppleError: wrong_shape, not_finite, singular_matrix.
            Cancelled: if progress was cancelled.
        """
        return self._native.solve([frame._native_frame() for frame in frames], progress)


def handle_frames(
    prepared: PreparedMesh, handles: Sequence[Handle], vertices: ArrayLike
) -> NDArray[np.float64]:
    """(h, 4, 4): where the surface at each handle is in a pose (n, 3) of the prepared mesh.

    The rigid motion that takes the centre of the handle's vertices at rest to their centre in the
    pose, and turns as the faces around them do; for column vectors, the caller's units.

    Raises:
        SuppleError: wrong_shape, not_finite, index_out_of_range, empty_handle.
    """
    indices = [arrays.indices(h.vertices, f"Handle '{h.name}': vertices") for h in handles]
    frames = _native.handle_frames(prepared.native, indices, arrays.points(vertices))
    return np.array(frames).reshape(-1, 4, 4)


def part_of_motion(matrix: ArrayLike, centre: ArrayLike, part: float) -> NDArray[np.float64]:
    """(4, 4): that part of an affine motion about a centre (3,), at 0 none of it, at 1 all.

    The rotation's angle, the stretch's difference from 1 and the centre's way grow in proportion.

    Raises:
        SuppleError: not_finite, singular_matrix.
    """
    point = arrays.points(np.reshape(centre, (1, 3)), "centre")[0]
    return _native.part_of_motion(arrays.matrix4(matrix, "matrix"), point, float(part))


def range_share(
    frame: float, first: float, last: float, ease_in: float = 12, ease_out: float = 12
) -> float:
    """How much of a correction is applied at a frame, 0 to 1.

    0 up to `first` and from `last` on; 1 between first + ease_in and last - ease_out; in between
    6 t^5 - 15 t^4 + 10 t^3, whose velocity and acceleration are 0 at both ends. Without an ease, 1
    at the end itself too.

    Raises:
        SuppleError: bad_option.
    """
    return _native.range_share(
        float(frame), float(first), float(last), float(ease_in), float(ease_out)
    )
