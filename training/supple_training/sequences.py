# SPDX-License-Identifier: GPL-3.0-or-later
"""Sequences on disk: handles that move over time, and the true positions of every vertex.

A folder with

- mesh.obj: the rest shape, n vertices;
- case.json: {"handles": [{"name", "vertices": [0-based]}, ...], "about": {...}}, as an edit case of
  `supple.cases` has it, without matrices and positions: these are the truth's in each frame;
- frames.pc2: the truth, a point cache (PC2), little endian: 12 bytes "POINTCACHE2" and a zero,
  int32 version 1, int32 n, float32 start, float32 rate, int32 samples, then n x 3 float32 a sample.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import supple
from numpy.typing import NDArray
from supple.cases import EditCase, read_case

MAGIC = b"POINTCACHE2\0"
_HEADER = struct.Struct("<12siiffi")

FEWEST_FRAMES = 3
"""An acceleration needs so many."""


@dataclass(frozen=True)
class Sequence:
    """A motion to make from its handles.

    Attributes:
        case: the rest shape and the handles, held where they are at rest; no truth.
        truth: (frames, n, 3) of every frame.
    """

    case: EditCase
    truth: NDArray[np.float64]

    def handles(self, frame: int) -> list[supple.Handle]:
        """The handles at their true positions of a frame."""
        return [
            supple.Handle(h.name, h.vertices, positions=self.truth[frame, np.asarray(h.vertices)])
            for h in self.case.handles
        ]


def read_sequence(folder: Path) -> Sequence:
    """Read a sequence's folder.

    Raises:
        supple.SuppleError: bad_case, naming the file and what is wrong with it.
    """
    case = read_case(folder)
    where = folder / "case.json"
    if not case.handles:
        raise supple.SuppleError("bad_case", f"{where} has no handles; a sequence needs one.")
    for handle in case.handles:
        if handle.matrix is not None or handle.positions is not None:
            raise supple.SuppleError(
                "bad_case",
                f"{where}: handle '{handle.name}' has targets of its own; leave them out, a "
                "sequence takes them from frames.pc2.",
            )
        indices = np.asarray(handle.vertices)
        if indices.size and not 0 <= indices.min() <= indices.max() < len(case.vertices):
            raise supple.SuppleError(
                "bad_case",
                f"{where}: handle '{handle.name}' has a vertex outside 0 to "
                f"{len(case.vertices) - 1}, those of mesh.obj.",
            )
    truth = read_pc2(folder / "frames.pc2")
    frames, count, _ = truth.shape
    if count != len(case.vertices):
        raise supple.SuppleError(
            "bad_case",
            f"{folder / 'frames.pc2'} has {count} vertices, mesh.obj {len(case.vertices)}; they "
            "must be the same vertices.",
        )
    if frames < FEWEST_FRAMES:
        raise supple.SuppleError(
            "bad_case",
            f"{folder / 'frames.pc2'} has {frames} frames; accelerations need {FEWEST_FRAMES} or "
            "more.",
        )
    return Sequence(case, truth)


def read_pc2(path: Path) -> NDArray[np.float64]:
    """The positions in a point cache: (samples, n, 3).

    Raises:
        supple.SuppleError: bad_case, where the file is missing, is none, is not as long as it says
            or has a position that is not finite.
    """
    if not path.is_file():
        raise supple.SuppleError("bad_case", f"There is no file {path}.")
    content = path.read_bytes()
    if len(content) < _HEADER.size or not content.startswith(MAGIC):
        raise supple.SuppleError("bad_case", f"{path} is no point cache (PC2).")
    _, version, count, _, _, samples = _HEADER.unpack_from(content)
    if version != 1 or count < 0 or samples < 0:
        raise supple.SuppleError(
            "bad_case",
            f"{path} is a point cache of version {version} with {count} points and {samples} "
            "samples; version 1 and no negative number can be read.",
        )
    expected = _HEADER.size + 12 * count * samples
    if len(content) != expected:
        raise supple.SuppleError(
            "bad_case",
            f"{path} has {len(content)} bytes, but {samples} samples of {count} points need "
            f"{expected}; write it again.",
        )
    positions = np.frombuffer(content, "<f4", offset=_HEADER.size).astype(np.float64)
    positions = positions.reshape(samples, count, 3)
    finite = np.isfinite(positions).all(axis=(1, 2))
    if not finite.all():
        raise supple.SuppleError(
            "bad_case", f"{path}: sample {int(finite.argmin())} has a position that is not finite."
        )
    return positions


def write_pc2(path: Path, positions: NDArray) -> None:
    """Write (samples, n, 3) positions, one sample a frame from frame 0."""
    samples, count, _ = positions.shape
    header = _HEADER.pack(MAGIC, 1, count, 0.0, 1.0, samples)
    path.write_bytes(header + np.ascontiguousarray(positions, "<f4").tobytes())
