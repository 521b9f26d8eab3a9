# SPDX-License-Identifier: GPL-3.0-or-later
"""Sequences on disk: handles that move over time, and the true positions of every vertex.

A folder with

- mesh.obj: the rest shape, n vertices;
- case.json: {"handles": [{"name", "vertices": [0-based]}, ...], "about": {...}}, as an edit case of
  `supple.cases` has it, without matrices and positions: these are the truth's in each frame;
- frames.pc2: the truth, a point cache (`supple.PointCacheReader`), a sample a frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import supple
from numpy.typing import NDArray
from supple.cases import EditCase, read_case

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
    try:
        cache = supple.PointCacheReader(path)
        samples = [cache.read(frame) for frame in range(cache.frames)]
    except supple.SuppleError as error:
        raise supple.SuppleError("bad_case", str(error)) from error
    positions = np.array(samples, dtype=np.float64).reshape(-1, cache.points, 3)
    finite = np.isfinite(positions).all(axis=(1, 2))
    if not finite.all():
        raise supple.SuppleError(
            "bad_case", f"{path}: sample {int(finite.argmin())} has a position that is not finite."
        )
    return positions


def write_pc2(path: Path, positions: NDArray) -> None:
    """Write (samples, n, 3) positions, one sample a frame from frame 0."""
    samples, count, _ = positions.shape
    with supple.PointCacheWriter(path, count, frame_count=samples, start=0.0) as cache:
        for frame, points in enumerate(positions):
            cache.append(f"{frame:032x}", points)
    path.with_name(f"{path.name}.keys").unlink()  # of a bake; nothing is baked here
