# SPDX-License-Identifier: GPL-3.0-or-later
"""From frames of an animation and corrections to corrected frames. No bpy: runs on any thread."""

import hashlib
from dataclasses import dataclass

import numpy as np

from . import native, pose, prepared, space
from .live_solver import Options
from .mesh_data import RestMesh
from .pose import Blend

# Part of every frame's key: a change of what frames are made of must change it.
_VERSION = b"supple sequence 1"


@dataclass(frozen=True)
class Range:
    """Frames that may change, `first` to `last`, and over how many the change comes and goes."""

    first: int
    last: int
    ease_in: int = 12
    ease_out: int = 12

    @property
    def frames(self):
        return range(self.first, self.last + 1)

    def share(self, frame):
        """Return how much of the corrections is applied at `frame`, 0..1."""
        return native.supple().range_share(
            frame, self.first, self.last, self.ease_in, self.ease_out
        )


@dataclass(frozen=True)
class SequenceInput:
    """What all frames share. motions: as `motions.collect` gives them, at any frame."""

    rest: RestMesh
    motions: list
    range: Range
    options: Options
    blend: Blend

    @property
    def name(self):
        return self.rest.name


@dataclass(frozen=True)
class Frame:
    """One frame as the animation has it: positions (n, 3) float32, local; motions: the corrections
    of the handles, in order, of the rest shape.
    """

    number: int
    positions: np.ndarray
    motions: list
    share: float

    @property
    def asks(self):
        """Whether any handle is to move."""
        return self.share != 0 and any(
            motion.matrix is not None and not np.array_equal(motion.matrix, np.eye(4))
            for motion in self.motions
        )


class FrameKeys:
    """Fingerprints of everything that a corrected frame is made from."""

    def __init__(self, inputs):
        digest = hashlib.blake2b(_VERSION, digest_size=16)
        digest.update(native.supple().__version__.encode())
        digest.update(inputs.rest.digest.encode())
        digest.update(repr((inputs.options, inputs.blend.strength, inputs.blend.falloff)).encode())
        if inputs.blend.mask is not None:
            digest.update(np.ascontiguousarray(inputs.blend.mask).tobytes())
        digest.update(prepared.handles_key(inputs.motions).encode())
        self._digest = digest
        self.shared = digest.hexdigest()  # what all frames share

    def of(self, frame):
        """Return the key of a Frame, 32 hexadecimal digits."""
        digest = self._digest.copy()
        digest.update(np.ascontiguousarray(frame.positions).tobytes())
        if frame.asks:
            digest.update(np.float64(frame.share).tobytes())
            for motion in frame.motions:
                held = motion.matrix is None
                digest.update(b"held" if held else np.float64(motion.matrix).tobytes())
        return digest.hexdigest()


class Solver:
    """Corrects frames; made once for a SequenceInput. Raises UserError, CancelledError."""

    def __init__(self, inputs, stages):
        self._inputs = inputs
        pose.guarded(inputs.name, lambda: self._prepare(stages))

    def _prepare(self, stages):
        supple, inputs = native.supple(), self._inputs
        handles = pose.native_handles(inputs.rest, inputs.motions)
        self.mesh = prepared.mesh(inputs.rest, stages, share=0.8)
        editor = prepared.editor(
            inputs.rest, self.mesh, handles, pose.MODEL, stages, share=0.2, from_scratch=True
        )
        self._editor = supple.SequenceEditor(editor, **inputs.options.arguments())
        self._weights = pose.blend_weights(self.mesh, inputs.motions, inputs.blend)

    def solve(self, frames, progress=None):
        """Return the corrected positions, (n, 3) float32 each, of a list of Frame."""
        return pose.guarded(self._inputs.name, lambda: self._solve(frames, progress))

    def _solve(self, frames, progress):
        supple, rest, blend = native.supple(), self._inputs.rest, self._inputs.blend
        results = [frame.positions for frame in frames]
        asking = [i for i, frame in enumerate(frames) if frame.asks]
        before = [space.to_solve_points(rest.stretch, frames[i].positions) for i in asking]
        given = [
            supple.SequenceFrame(
                positions,
                [
                    None if m.matrix is None else space.to_solve_matrix(rest.stretch, m.matrix)
                    for m in frames[i].motions
                ],
                frames[i].share,
            )
            for i, positions in zip(asking, before, strict=True)
        ]
        solved = self._editor.solve(given, progress=progress)
        for i, start, end in zip(asking, before, solved, strict=True):
            if blend.strength != 1.0 or self._weights is not None:
                end = supple.blend(start, end, blend.strength, self._weights)
            results[i] = space.to_local_points(rest.stretch, end).astype(np.float32)
        return results
