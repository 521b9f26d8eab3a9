# SPDX-License-Identifier: GPL-3.0-or-later
"""Point caches: a mesh's vertices at each frame, in PC2 files for Blender's Mesh Cache modifier.

A bake writes one frame by frame, survives a kill at any moment, and computes again only frames
whose inputs have changed:

    kept = KeptFrames(path)
    with PointCacheWriter(path, points, frame_count=len(inputs)) as cache:
        for key, given in inputs:
            positions = kept.find(key)
            cache.append(key, compute(given) if positions is None else positions)

A key names everything a frame is made from, as 32 hexadecimal digits or 16 bytes, such as
hashlib.blake2b(..., digest_size=16).hexdigest(). Keys lie beside the cache, in PATH.keys.
"""

import os
from types import TracebackType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays


class PointCacheReader:
    """Any PC2 file. It is kept open: one that replaces it meanwhile changes nothing here.

    Attributes:
        points: number of points n.
        start: frame of the first sample.
        rate: frames a sample.
        frames: number of samples.

    Raises:
        SuppleError: array_file where there is none, it is no PC2 file, or it has fewer samples
            than its header promises.
    """

    def __init__(self, path: str | os.PathLike) -> None:
        self._native = _native.PointCacheReader(os.fspath(path))
        self.points: int = self._native.points
        self.start: float = self._native.start
        self.rate: float = self._native.rate
        self.frames: int = self._native.frames

    def read(self, frame: int) -> NDArray[np.float32]:
        """(n, 3) of sample `frame`, counted from 0. Raises index_out_of_range, array_file."""
        return self._native.read(int(frame))


class PointCacheWriter:
    """Writes a PC2 file and its keys, so that a kill loses at most the frame being written.

    PATH.part is written, a valid PC2 file of the frames that are whole; PATH stays as it was until
    `finish`. What an earlier attempt left is kept for KeptFrames until then, for the last four.

    As a context manager it finishes at the end, unless it was closed, finished or discarded
    before; left by an exception, it closes and keeps PATH.part for a resume.

    Args:
        path: of the cache.
        points: number of points n, 1 or more.
        frame_count: number of frames, 1 or more.
        start: frame of the first sample.
        rate: frames a sample, above 0.

    Raises:
        SuppleError: bad_option; array_file where the folder is missing or can't be written, a
            folder has one of the names, or another writer has the path.
    """

    def __init__(
        self,
        path: str | os.PathLike,
        points: int,
        *,
        frame_count: int,
        start: float = 1.0,
        rate: float = 1.0,
    ) -> None:
        self._native = _native.PointCacheWriter(
            os.fspath(path), int(points), float(start), float(rate), int(frame_count)
        )
        self._open = True

    @property
    def frames(self) -> int:
        """Number of frames appended."""
        return self._native.frames

    def append(self, key: str | bytes, positions: ArrayLike) -> None:
        """Write the next frame: (n, 3), stored as float32.

        Raises:
            SuppleError: bad_option for what is no key, a frame too many, or after the end;
                wrong_shape; not_finite; array_file where it can't be written, such as on a full
                disk: the frames of before are kept, and the same one may be tried again.
        """
        self._native.append(_digits(key), arrays.points(positions, "positions", np.float32))

    def finish(self) -> None:
        """Replace PATH and PATH.keys by what was written, and close.

        Raises:
            SuppleError: bad_option before the last frame or where it is closed; array_file. PATH
                is then as it was, and PATH.part is kept.
        """
        self._native.finish()
        self._open = False

    def close(self) -> None:
        """Leave PATH.part for a resume."""
        self._native.close()
        self._open = False

    def discard(self) -> None:
        """Remove PATH.part and what earlier attempts left; PATH stays. Raises as finish."""
        self._native.discard()
        self._open = False

    def __enter__(self) -> "PointCacheWriter":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            if kind is None and self._open:
                self.finish()
        finally:
            self.close()


class KeptFrames:
    """The frames that earlier bakes left, found by their keys.

    Of each path: the finished cache, and what a writer of it that was killed, or is at work in
    another process, has written. What is not there or can't be read has no frames. Files are kept
    open, so that a writer may begin and finish at the same paths. len() is the number of keys.

    Args:
        paths: of the cache, and of any others, such as pieces baked by other processes.
    """

    def __init__(self, *paths: str | os.PathLike) -> None:
        self._native = _native.KeptFrames([os.fspath(path) for path in paths])

    def find(self, key: str | bytes) -> NDArray[np.float32] | None:
        """(n, 3) of that key; None where there is none, or none as it was written (its checksum
        is verified). Raises bad_option for what is no key."""
        return self._native.find(_digits(key))

    def __len__(self) -> int:
        return self._native.size()


def _digits(key: str | bytes) -> str:
    return key.hex() if isinstance(key, bytes) else key
