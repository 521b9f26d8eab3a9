# SPDX-License-Identifier: GPL-3.0-or-later
"""Networks and their files: safetensors, with the architecture in the metadata."""

import json
import os
from pathlib import Path

import numpy as np
import safetensors
import safetensors.numpy
from numpy.typing import NDArray

from . import _native
from .errors import SuppleError
from .files import write_whole

FORMAT = "supple-ljn-1"
_FOLDER = Path(__file__).parent / "models"


class Model:
    """A Local Jacobian Network.

    Attributes:
        metadata: text by name: "format", "configuration", "signal", "eigenfunctions", "width", and
            where it came from: "training_data", "licence", "version", ...
        native: the network as the native module holds it.
    """

    def __init__(self, native: _native.Network, metadata: dict[str, str]) -> None:
        self.native = native
        architecture = native.architecture
        self.metadata = {
            **metadata,
            "format": FORMAT,
            "configuration": architecture.configuration,
            "signal": architecture.signal,
            "eigenfunctions": str(architecture.eigenfunctions),
            "width": str(architecture.width),
        }

    @property
    def signal(self) -> str:
        """The coarse signal it takes: "rotation" or "spectral"."""
        return self.metadata["signal"]

    def tensors(self) -> dict[str, NDArray[np.float32]]:
        """Every weight by name, (rows, columns) float32."""
        return {name: np.array(value) for name, value in self.native.tensors().items()}

    def save(self, path: str | os.PathLike) -> None:
        """Write a safetensors file; an existing one is replaced whole or not at all."""
        write_tensors(path, self.tensors(), self.metadata)


def from_tensors(tensors: dict[str, NDArray], metadata: dict[str, str]) -> Model:
    """A network from its tensors; metadata must name configuration, signal, eigenfunctions, width.

    Raises:
        SuppleError: model_file.
    """
    try:
        architecture = _native.Architecture(
            metadata["configuration"],
            metadata["signal"],
            int(metadata["eigenfunctions"]),
            int(metadata["width"]),
        )
    except (KeyError, ValueError) as error:
        raise SuppleError(
            "model_file", f"The weights do not say what network they are ({error})."
        ) from error
    values = {
        name: np.ascontiguousarray(np.atleast_2d(value), dtype=np.float32)
        for name, value in tensors.items()
    }
    return Model(_native.Network(architecture, values), metadata)


def shipped_models() -> dict[str, Path]:
    """Name and file of each network in the package."""
    return {path.stem: path for path in sorted(_FOLDER.glob("*.safetensors"))}


def load_model(name_or_path: str | os.PathLike) -> Model:
    """A network by the name of a shipped one ("rotation", "spectral") or from a .safetensors file.

    Raises:
        SuppleError: model_file: missing, truncated, not safetensors, or not a Supple network.
    """
    path, tensors, metadata = read_tensors(name_or_path, shipped_models(), FORMAT)
    try:
        return from_tensors(tensors, metadata)
    except SuppleError as error:
        raise SuppleError(error.code, f"{path}: {error}") from error


def write_tensors(
    path: str | os.PathLike, tensors: dict[str, NDArray], metadata: dict[str, str]
) -> None:
    """Write a safetensors file; an existing one is replaced whole or not at all, even where the
    power fails. The same contents are the same bytes."""
    write_whole(path, _ordered(safetensors.numpy.save(tensors, metadata=metadata)))


def _ordered(content: bytes) -> bytes:
    """A safetensors file with its metadata by name; the library's order is another each time."""
    size = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + size])
    header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 8)
    return len(text).to_bytes(8, "little") + text + content[8 + size :]


def read_tensors(
    name_or_path: str | os.PathLike, shipped: dict[str, Path], wanted_format: str
) -> tuple[Path, dict[str, NDArray], dict[str, str]]:
    """Path, tensors and metadata of a shipped file or of one by path.

    Raises:
        SuppleError: model_file.
    """
    path = shipped.get(str(name_or_path), Path(name_or_path))
    if not path.is_file():
        raise SuppleError(
            "model_file",
            f"There is no network '{name_or_path}'. Shipped ones: {', '.join(shipped) or 'none'}; "
            "otherwise give the path of a .safetensors file.",
        )
    try:
        with safetensors.safe_open(path, framework="numpy") as file:
            metadata = dict(file.metadata() or {})
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - no dict
    except (safetensors.SafetensorError, OSError, ValueError, TypeError) as error:
        raise SuppleError(
            "model_file",
            f"{path} cannot be read as a safetensors file ({error}). It may be cut short; "
            "copy it again.",
        ) from error
    if metadata.get("format") != wanted_format:
        raise SuppleError(
            "model_file",
            f"{path} holds no Supple network of this kind (format '{metadata.get('format')}', not "
            f"'{wanted_format}').",
        )
    return path, tensors, metadata
