# SPDX-License-Identifier: GPL-3.0-or-later
"""What unsupervised training keeps in a folder, to go on from after it was stopped.

state.safetensors    after every epoch: all that the trainer remembers, and the history
guides.safetensors   the guides so far; they are found before the first epoch

Each is replaced whole or not at all, and says which training it is of.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import SuppleError
from .matching import Epoch
from .model import read_tensors, write_tensors

STATE, GUIDES = "state.safetensors", "guides.safetensors"
_FORMATS = {STATE: "supple-unsupervised-1", GUIDES: "supple-guides-1"}

Tensors = dict[str, NDArray]


@dataclass(frozen=True)
class FoundGuide:
    """Rough maps of two shapes both ways, found without labels.

    Attributes:
        pair: the shapes.
        round_trip: mean distance between a vertex and where the way there and back ends, in roots
            of the area.
        maps: (k_s, k_t) functional maps there and back, or None where they are not used.
    """

    pair: tuple[int, int]
    round_trip: float
    maps: tuple[NDArray[np.float64], NDArray[np.float64]] | None


def digest(arrays: Iterable[NDArray]) -> str:
    """SHA-256 of types, shapes and contents."""
    found = hashlib.sha256()
    for array in arrays:
        found.update(f"{array.dtype.str}{array.shape}".encode())
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


class Checkpoint:
    """The folder of one training; it is made.

    Args:
        settings: all that decides the result, as JSON has it: text, numbers and lists by name.

    Raises:
        SuppleError: bad_checkpoint: a file there is damaged, or of a training with other settings.
    """

    def __init__(self, folder: str | os.PathLike, settings: Mapping[str, object]) -> None:
        self._folder = Path(folder)
        self._settings = json.dumps(settings)
        self._folder.mkdir(parents=True, exist_ok=True)

    def state(self) -> tuple[Tensors, list[Epoch]] | None:
        """Of the last epoch that was finished, if there is one."""
        found = self._read(STATE)
        if found is None:
            return None
        return found[0], [Epoch(**epoch) for epoch in found[1]]

    def keep_state(self, tensors: Tensors, history: list[Epoch]) -> None:
        """Replace what `state` returns."""
        self._write(STATE, tensors, [asdict(epoch) for epoch in history])

    def guides(self) -> list[FoundGuide]:
        """Those found so far."""
        found = self._read(GUIDES)
        if found is None:
            return []
        tensors, about = found
        return [
            FoundGuide(
                (first, second),
                round_trip,
                (tensors[f"there.{i}"], tensors[f"back.{i}"]) if f"there.{i}" in tensors else None,
            )
            for i, (first, second, round_trip) in enumerate(about)
        ]

    def keep_guides(self, guides: list[FoundGuide]) -> None:
        """Replace what `guides` returns."""
        tensors = {
            f"{way}.{i}": values
            for i, guide in enumerate(guides)
            if guide.maps is not None
            for way, values in zip(("there", "back"), guide.maps, strict=True)
        }
        self._write(GUIDES, tensors, [[*guide.pair, guide.round_trip] for guide in guides])

    def _write(self, name: str, tensors: Tensors, about: list) -> None:
        text = json.dumps(about)  # every number comes back exactly
        metadata = {"format": _FORMATS[name], "settings": self._settings, "about": text}
        metadata["digest"] = _digest(tensors, metadata)
        write_tensors(self._folder / name, tensors, metadata)

    def _read(self, name: str) -> tuple[Tensors, list] | None:
        if not (self._folder / name).exists():
            return None
        try:
            path, tensors, metadata = read_tensors(self._folder / name, {}, _FORMATS[name])
        except SuppleError as error:
            raise self._damaged(str(error)) from error
        if metadata.pop("digest", None) != _digest(tensors, metadata):
            raise self._damaged(f"{path} is not as it was written.")
        different = _differences(json.loads(metadata["settings"]), json.loads(self._settings))
        if different:
            raise SuppleError(
                "bad_checkpoint",
                f"{path} is of another training: {'; '.join(different)}. Train with the same "
                "options and shapes to go on with it; for a new training name another folder or "
                "remove this one.",
            )
        return tensors, json.loads(metadata["about"])

    def _damaged(self, what: str) -> SuppleError:
        return SuppleError(
            "bad_checkpoint",
            f"The checkpoint is damaged: {what} Remove {self._folder} to train from the start.",
        )


def _digest(tensors: Tensors, metadata: Mapping[str, str]) -> str:
    names = sorted(tensors)
    text = json.dumps([names, sorted(metadata.items())]).encode()
    return digest([np.frombuffer(text, np.uint8), *(tensors[name] for name in names)])


def _differences(there: dict, here: dict) -> list[str]:
    """What differs between settings, in words."""
    found = []
    for name in {**here, **there}:
        values = there.get(name), here.get(name)
        if values[0] == values[1]:
            continue
        lists = all(isinstance(value, list) for value in values)
        if lists and len(values[0]) != len(values[1]):
            found.append(f"{name}: {len(values[0])} there, {len(values[1])} here")
        elif lists and len(values[0]) > 2:
            at = next(i for i, (a, b) in enumerate(zip(*values, strict=True)) if a != b)
            found.append(f"{name}: number {at} is another")
        elif all(isinstance(value, str) and len(value) == 64 for value in values):
            found.append(f"{name}: another")
        else:
            found.append(f"{name}: {values[0]} there, {values[1]} here")
    return found
