# SPDX-License-Identifier: GPL-3.0-or-later
"""Networks that match without a map: a feature extractor, with the local Jacobian network that was
trained with it. One safetensors file, the architectures in its metadata."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from . import _native
from .errors import SuppleError
from .mesh import PreparedMesh
from .model import Model, from_tensors, load_model, read_tensors, write_tensors

FORMAT = "supple-match-1"
_FOLDER = Path(__file__).parent / "models" / "match"
_FEATURES, _JACOBIANS = "features.", "jacobians."


class MatchModel:
    """A feature extractor (DiffusionNet) and, unless it is None, a local Jacobian network.

    Attributes:
        metadata: text by name: "format", "input" (what the extractor is given at a vertex),
            "inputs", "outputs", "width", "blocks", "eigenfunctions", the network's
            "configuration" and others as of Model, prefixed "jacobians.", and where it came from.
        native: both as the native module holds them.
    """

    def __init__(self, native: _native.MatchNetworks, metadata: dict[str, str]) -> None:
        self.native = native
        sizes = native.sizes
        self.metadata = {
            **{k: v for k, v in metadata.items() if not k.startswith(_JACOBIANS)},
            "format": FORMAT,
            "input": native.input,
            "inputs": str(sizes.inputs),
            "outputs": str(sizes.outputs),
            "width": str(sizes.width),
            "blocks": str(sizes.blocks),
            "eigenfunctions": str(native.eigenfunctions),
        }
        if self.network is not None:
            about = self.network.metadata
            self.metadata |= {
                _JACOBIANS + name: about[name]
                for name in ("configuration", "signal", "eigenfunctions", "width")
            }

    @property
    def network(self) -> Model | None:
        """The local Jacobian network."""
        native = self.native.network
        return None if native is None else Model(native, {})

    def tensors(self) -> dict[str, NDArray[np.float32]]:
        """Every weight by name, "features." and "jacobians." before it."""
        result = {_FEATURES + name: np.array(v) for name, v in self.native.tensors().items()}
        if self.network is not None:
            result |= {_JACOBIANS + name: v for name, v in self.network.tensors().items()}
        return result

    def features(self, mesh: PreparedMesh) -> NDArray[np.float32]:
        """(n, outputs) of a mesh's surface vertices; soft maps compare their directions."""
        return self.native.features(mesh.native)

    def save(self, path: str | os.PathLike) -> None:
        """Write a safetensors file; an existing one is replaced whole or not at all."""
        write_tensors(path, self.tensors(), self.metadata)


def untrained_match_model(
    *,
    seed: int = 0,
    input: str = "wave_kernel",
    inputs: int = 128,
    outputs: int = 128,
    width: int = 128,
    blocks: int = 4,
    eigenfunctions: int = 128,
    network: str | os.PathLike | Model | None = "spectral",
) -> MatchModel:
    """New weights for features, beside a local Jacobian network.

    Args:
        input: "wave_kernel", "heat_kernel" (both intrinsic) or "coordinates" (inputs is 3).
        inputs, outputs: channels a vertex. width, blocks: of the DiffusionNet.
        eigenfunctions: that diffusion runs in.
        network: a network of the spectral signal to start from, or None for none.

    Raises:
        SuppleError: bad_option; model_file.
    """
    if network is not None and not isinstance(network, Model):
        network = load_model(network)
    native = _native.MatchNetworks.untrained(
        input,
        _native.DiffusionSizes(inputs, outputs, width, blocks),
        eigenfunctions,
        seed,
        None if network is None else network.native,
    )
    return MatchModel(native, {})


def shipped_match_models() -> dict[str, Path]:
    """Name and file of each in the package."""
    return {path.stem: path for path in sorted(_FOLDER.glob("*.safetensors"))}


def load_match_model(name_or_path: str | os.PathLike) -> MatchModel:
    """By the name of a shipped one ("features") or from a .safetensors file.

    Raises:
        SuppleError: model_file: missing, truncated, not safetensors, or not what matching needs.
    """
    path, tensors, metadata = read_tensors(name_or_path, shipped_match_models(), FORMAT)
    try:
        return match_model_from_tensors(tensors, metadata)
    except SuppleError as error:
        raise SuppleError(error.code, f"{path}: {error}") from error


def match_model_from_tensors(tensors: dict[str, NDArray], metadata: dict[str, str]) -> MatchModel:
    """From tensors as MatchModel.tensors returns them. Raises SuppleError: model_file."""
    try:
        sizes = _native.DiffusionSizes(
            *(int(metadata[name]) for name in ("inputs", "outputs", "width", "blocks"))
        )
        input_kind, eigenfunctions = metadata["input"], int(metadata["eigenfunctions"])
    except (KeyError, ValueError) as error:
        raise SuppleError(
            "model_file", f"The weights do not say what features they are ({error})."
        ) from error
    about = {k.removeprefix(_JACOBIANS): v for k, v in metadata.items() if k.startswith(_JACOBIANS)}
    network = from_tensors(_part(tensors, _JACOBIANS), about) if about else None
    native = _native.MatchNetworks(
        input_kind,
        sizes,
        eigenfunctions,
        _part(tensors, _FEATURES),
        None if network is None else network.native,
    )
    return MatchModel(native, metadata)


def _part(tensors: dict[str, NDArray], prefix: str) -> dict[str, NDArray[np.float32]]:
    return {
        name.removeprefix(prefix): np.ascontiguousarray(np.atleast_2d(value), dtype=np.float32)
        for name, value in tensors.items()
        if name.startswith(prefix)
    }
