# SPDX-License-Identifier: GPL-3.0-or-later
"""Editing: handles in, a posed mesh out."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .errors import SuppleError
from .mesh import Note, PreparedMesh
from .model import Model, load_model


@dataclass
class Handle:
    """Vertices that are told where to be. With neither matrix nor positions they are held at rest.

    Attributes:
        name: for messages.
        vertices: (k,) 0-based indices; no vertex in two handles.
        matrix: (4, 4) affine, for column vectors, from rest to target positions; or None.
        positions: (k, 3) target positions in the caller's units; or None.
    """

    name: str
    vertices: ArrayLike
    matrix: ArrayLike | None = None
    positions: ArrayLike | None = None

    def _native_handle(self) -> _native.Handle:
        vertices = arrays.indices(self.vertices, f"Handle '{self.name}': vertices")
        return _native.Handle(self.name, vertices)

    def _native_target(self) -> _native.HandleTarget:
        where = f"Handle '{self.name}'"
        matrix = positions = None
        if self.matrix is not None:
            matrix = arrays.matrix4(self.matrix, f"{where}: matrix")
        if self.positions is not None:
            positions = arrays.points(self.positions, f"{where}: positions")
        return _native.HandleTarget(matrix, positions)


@dataclass
class EditResult:
    """A posed mesh.

    Attributes:
        vertices: (n, 3) float64, the caller's units; handle vertices exactly on their targets.
        notes: what is unusual about the mesh.
        report: rounds, passes, network (whether it was used), and the milliseconds of each stage.
    """

    vertices: NDArray[np.float64]
    notes: list[Note] = field(default_factory=list)
    report: dict[str, float | int | bool] = field(default_factory=dict)


class Editor:
    """Handles bound to a prepared mesh: factored once, solved for any targets. The paper, 4.4.

    Args:
        prepared: the rest mesh.
        handles: at least one; their vertices stay, their targets may change at every solve.
        model: name of a shipped network, a path, a Model, or None for no network.
        progress: a Progress to watch and cancel.

    Raises:
        SuppleError: no_handles, empty_handle, index_out_of_range, overlapping_handles, model_file,
            bad_option; the message names the handle.
    """

    def __init__(
        self,
        prepared: PreparedMesh,
        handles: Sequence[Handle],
        *,
        model: str | os.PathLike | Model | None = "rotation",
        progress: _native.Progress | None = None,
    ) -> None:
        self.prepared = prepared
        self.handles = list(handles)
        if model is not None and not isinstance(model, Model):
            model = load_model(model)
        self.model = model
        self._native = _native.Editor(
            prepared.native,
            [handle._native_handle() for handle in self.handles],
            None if model is None else model.native,
            progress,
        )

    def solve(
        self,
        handles: Sequence[Handle] | None = None,
        *,
        mode: str = "natural",
        rounds: int | None = None,
        network_rounds: int | None = None,
        passes: int | None = None,
        network: bool = True,
        loose_pieces: str = "follow",
        progress: _native.Progress | None = None,
    ) -> EditResult:
        """Pose the mesh. The native work runs without the GIL.

        Args:
            handles: the same handles, in order, with new targets; None for those given before.
            mode: "natural" ends with the network's Jacobians, "stiff" with passes towards least
                distortion.
            rounds: of closest rotations and Poisson solve; None for the default, 3.
            network_rounds: how many of them, the last ones, use the network; None for 1.
            passes: of closest rotations and Poisson solve, "stiff" only; None for the default.
            network: False replaces it by the identity.
            loose_pieces: "follow" or "stay": what components without a handle do.
            progress: a Progress to watch and cancel.

        Raises:
            SuppleError: wrong_shape, not_finite, singular_matrix, bad_option.
            Cancelled: if progress was cancelled.
        """
        current = self.handles if handles is None else list(handles)
        for bound, given in zip(self.handles, current, strict=False):
            if bound.name != given.name:
                raise SuppleError(
                    "bad_option",
                    f"Handle '{given.name}' stands where '{bound.name}' was bound. Give the same "
                    "handles in the same order, or make a new Editor.",
                )
        if loose_pieces not in ("follow", "stay"):
            raise SuppleError(
                "bad_option", f"loose_pieces is '{loose_pieces}'; use 'follow' or 'stay'."
            )
        for name, value in (
            ("rounds", rounds),
            ("network_rounds", network_rounds),
            ("passes", passes),
        ):
            if value is not None and value < 0:
                raise SuppleError("bad_option", f"{name} is {value}; it must be 0 or more.")
        vertices, report = self._native.solve(
            [handle._native_target() for handle in current],
            mode,
            -1 if rounds is None else rounds,
            -1 if network_rounds is None else network_rounds,
            -1 if passes is None else passes,
            network,
            loose_pieces == "follow",
            progress,
        )
        return EditResult(
            vertices,
            list(self.prepared.notes),
            {
                "rounds": report.rounds,
                "passes": report.passes,
                "network": report.network,
                "suggestion_milliseconds": report.suggestion_milliseconds,
                "rounds_milliseconds": report.rounds_milliseconds,
                "passes_milliseconds": report.passes_milliseconds,
                "milliseconds": report.total_milliseconds,
            },
        )


def edit(
    vertices: ArrayLike,
    faces: ArrayLike,
    handles: Sequence[Handle],
    *,
    model: str | os.PathLike | Model | None = "rotation",
    mode: str = "natural",
    network: bool = True,
    progress: _native.Progress | None = None,
    cache: bool | _native.PreparedCache | None = True,
) -> EditResult:
    """Prepare, bind and solve in one call; see PreparedMesh, Editor and Editor.solve."""
    prepared = PreparedMesh(vertices, faces, progress=progress, cache=cache)
    return Editor(prepared, handles, model=model).solve(mode=mode, network=network)
