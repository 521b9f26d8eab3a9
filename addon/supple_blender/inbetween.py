# SPDX-License-Identifier: GPL-3.0-or-later
"""In-betweens: from a few key poses of a mesh to every frame between them. No bpy."""

import hashlib
from dataclasses import dataclass

import numpy as np

from . import native, pose, prepared, space
from .errors import CancelledError
from .mesh_data import RestMesh

_VERSION = b"supple in-betweens 1"


@dataclass(frozen=True)
class InbetweenInput:
    """poses: (n, 3) float32 each, local, at ascending `times` (frames)."""

    rest: RestMesh
    poses: list
    times: list

    @property
    def name(self):
        return self.rest.name

    @property
    def frames(self):
        """The integral frames from the first key to the last."""
        return range(self.times[0], self.times[-1] + 1)

    def key_of(self, frame):
        """Return the key of a frame, 32 hexadecimal digits, for what is kept of earlier bakes."""
        digest = hashlib.blake2b(_VERSION, digest_size=16)
        digest.update(native.supple().__version__.encode())
        digest.update(self.rest.digest.encode())
        digest.update(np.array([frame, *self.times], dtype=np.float64).tobytes())
        for positions in self.poses:
            digest.update(np.ascontiguousarray(positions).tobytes())
        return digest.hexdigest()


def write(inputs, path, stages):
    """Write the frames of an InbetweenInput to a PC2 file. Raises UserError, CancelledError."""
    pose.guarded(inputs.name, lambda: _write(inputs, path, stages))


def _write(inputs, path, stages):
    supple, rest = native.supple(), inputs.rest
    mesh = prepared.mesh(rest, stages, share=0.3)
    solver = supple.Inbetween(
        mesh,
        [space.to_solve_points(rest.stretch, np.float64(p)) for p in inputs.poses],
        inputs.times,
        progress=stages.begin("Comparing poses", 0.1),
    )
    at_key = dict(zip(inputs.times, inputs.poses, strict=True))
    kept = supple.KeptFrames(path)
    writer = supple.PointCacheWriter(
        path, len(rest.positions), frame_count=len(inputs.frames), start=inputs.frames[0]
    )
    try:
        for done, frame in enumerate(inputs.frames):
            if stages.cancelled:
                raise CancelledError
            key = inputs.key_of(frame)
            positions = at_key.get(frame)
            if positions is None:
                positions = kept.find(key)
            if positions is None:
                positions = space.to_local_points(rest.stretch, solver.at(frame))
            writer.append(key, positions.astype(np.float32))
            stages.count(done + 1)
        writer.finish()
    finally:
        writer.close()
