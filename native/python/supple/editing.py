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
        weight: 1 for exactly there; above 0 and below 1 for a pull that the mesh may resist, about
            even at 0.5. Bound with the vertices: another weight needs a rebind.
    """

    name: str
    vertices: ArrayLike
    matrix: ArrayLike | None = None
    positions: ArrayLike | None = None
    weight: float = 1.0

    def _native_handle(self) -> _native.Handle:
        vertices = arrays.indices(self.vertices, f"Handle '{self.name}': vertices")
        return _native.Handle(self.name, vertices, float(self.weight))

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
        vertices: (n, 3) float64, the caller's units; vertices of handles of weight 1 exactly on
            their targets.
        notes: what is unusual about the mesh.
        report: rounds, polish, passes, network (whether it was used), and the milliseconds of each
            stage.
    """

    vertices: NDArray[np.float64]
    notes: list[Note] = field(default_factory=list)
    report: dict[str, float | int | bool] = field(default_factory=dict)


class Editor:
    """Handles bound to a prepared mesh, for any targets. The paper, 4.4; docs/method.md.

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
        if model is not None and not isinstance(model, Model):
            model = load_model(model)
        self._bind(prepared, handles, model, progress, None)

    def _bind(
        self,
        prepared: PreparedMesh,
        handles: Sequence[Handle],
        model: Model | None,
        progress: _native.Progress | None,
        former: _native.Editor | None,
    ) -> None:
        self.prepared = prepared
        self.handles = list(handles)
        self.model = model
        self._native = _native.Editor(
            prepared.native,
            [handle._native_handle() for handle in self.handles],
            None if model is None else model.native,
            progress,
            former,
        )

    def rebind(
        self, handles: Sequence[Handle], *, progress: _native.Progress | None = None
    ) -> "Editor":
        """An editor of the same mesh and network with other handles: added, removed or changed.

        What the two share is not computed again, so a few vertices more or less take milliseconds.
        The result is the same as that of a new Editor, to single precision.

        Raises:
            SuppleError: as for Editor.
        """
        other = Editor.__new__(Editor)
        other._bind(self.prepared, handles, self.model, progress, self._native)
        return other

    def solve(
        self,
        handles: Sequence[Handle] | None = None,
        *,
        mode: str | None = None,
        stiffness: float | None = None,
        method: str | None = None,
        rounds: int | None = None,
        network_rounds: int | None = None,
        polish: int | None = None,
        passes: int | None = None,
        network: bool = True,
        loose_pieces: str = "follow",
        keep_volume: bool = True,
        start: ArrayLike | None = None,
        progress: _native.Progress | None = None,
    ) -> EditResult:
        """Pose the mesh; the same result every time. The native work runs without the GIL.

        Args:
            handles: the same handles, in order, with new targets; None for those given before.
            mode: short for the two below: "natural" (stiffness 0), "stiff" (1) or "arap" (method).
            stiffness: from 0, natural, the network's shape, to 1, stiff, least distortion.
            method: "supple", or "arap" for as-rigid-as-possible (spokes and rims).
            rounds: of closest rotations and Poisson solve; None for the default.
            network_rounds: how many of them, the last ones, use the network; None for the default.
            polish: passes that let the network's stretch turn with the result; None: the default.
            passes: the most towards least distortion at stiffness 1, and of "arap"; None for the
                default. Up to three quarters more at stiffness 1 while faces are turned over.
            network: False replaces it by the identity.
            loose_pieces: "follow" or "stay": what components without a handle do.
            keep_volume: whether closed components whose handles keep their size get back most of
                the volume that the edit has lost; not of "arap".
            start: (n, 3) a pose of the mesh to edit in place of the rest shape, as a frame of an
                animation; held handles stay and matrices act where it has them. See SequenceEditor.
            progress: a Progress to watch and cancel.

        Raises:
            SuppleError: wrong_shape, not_finite, singular_matrix, bad_option.
            Cancelled: if progress was cancelled.
        """
        options = options_of(
            mode,
            stiffness,
            method,
            rounds,
            network_rounds,
            polish,
            passes,
            network,
            loose_pieces,
            keep_volume,
        )
        targets = self._targets(self.handles if handles is None else handles)
        pose = None if start is None else arrays.points(start, "start")
        vertices, report = self._native.solve(targets, options, progress, pose)
        return _result(self.prepared, vertices, report)

    def session(
        self,
        *,
        mode: str | None = None,
        stiffness: float | None = None,
        method: str | None = None,
        network: bool = True,
        loose_pieces: str = "follow",
        keep_volume: bool = True,
    ) -> "EditSession":
        """An edit that goes on while its targets change; the arguments are those of `solve`."""
        options = options_of(
            mode, stiffness, method, None, None, None, None, network, loose_pieces, keep_volume
        )
        return EditSession(self, _native.EditSession(self._native, options))

    def _targets(self, handles: Sequence[Handle]) -> list[_native.HandleTarget]:
        current = list(handles)
        for bound, given in zip(self.handles, current, strict=False):
            if bound.name != given.name:
                raise SuppleError(
                    "bad_option",
                    f"Handle '{given.name}' stands where '{bound.name}' was bound. Give the same "
                    "handles in the same order, or use `rebind`.",
                )
        return [handle._native_target() for handle in current]


class EditSession:
    """A drag: `aim` at new targets, `advance` for as long as a frame allows. See Editor.session.

    Not safe to share between threads.
    """

    def __init__(self, editor: Editor, native: _native.EditSession) -> None:
        self._editor = editor
        self._native = native

    def aim(self, handles: Sequence[Handle]) -> None:
        """New targets of the editor's handles, in order. What was done for the last is dropped.

        Raises:
            SuppleError: as for Editor.solve.
        """
        self._native.aim(self._editor._targets(handles))

    def advance(self, milliseconds: float = 12.0) -> NDArray[np.float64]:
        """Work for about so long, at least to a usable pose. Returns (n, 3) vertices.

        Called until `settled`, it ends where Editor.solve does.

        Raises:
            SuppleError: bad_option before the first `aim`.
        """
        return self.step(milliseconds).vertices

    def step(self, milliseconds: float = 12.0) -> EditResult:
        """As `advance`, with the report."""
        return _result(self._editor.prepared, *self._native.advance(milliseconds))

    @property
    def settled(self) -> bool:
        """Whether another `advance` would change nothing."""
        return self._native.settled


_MODES = {"natural": ("supple", 0.0), "stiff": ("supple", 1.0), "arap": ("arap", 1.0)}


def options_of(
    mode: str | None,
    stiffness: float | None,
    method: str | None,
    rounds: int | None,
    network_rounds: int | None,
    polish: int | None,
    passes: int | None,
    network: bool,
    loose_pieces: str,
    keep_volume: bool,
) -> _native.EditOptions:
    """What Editor.solve takes, checked."""
    if mode is not None and mode not in _MODES:
        raise SuppleError("bad_option", f"'{mode}' is no mode. Use 'natural', 'stiff' or 'arap'.")
    if mode is not None and (stiffness is not None or method is not None):
        raise SuppleError("bad_option", "Give mode, or stiffness and method, not both.")
    if loose_pieces not in ("follow", "stay"):
        raise SuppleError(
            "bad_option", f"loose_pieces is '{loose_pieces}'; use 'follow' or 'stay'."
        )
    counts = {
        "rounds": rounds,
        "network_rounds": network_rounds,
        "polish": polish,
        "passes": passes,
    }
    for name, value in counts.items():
        if value is not None and value < 0:
            raise SuppleError("bad_option", f"{name} is {value}; it must be 0 or more.")
    usual_method, usual_stiffness = _MODES[mode or "natural"]
    return _native.EditOptions(
        usual_method if method is None else method,
        usual_stiffness if stiffness is None else float(stiffness),
        **{name: -1 if value is None else value for name, value in counts.items()},
        network=network,
        loose_pieces_follow=loose_pieces == "follow",
        keep_volume=keep_volume,
    )


def _result(
    prepared: PreparedMesh, vertices: NDArray[np.float64], report: _native.EditReport
) -> EditResult:
    return EditResult(
        vertices,
        list(prepared.notes),
        {
            "rounds": report.rounds,
            "polish": report.polish,
            "passes": report.passes,
            "network": report.network,
            "volume_kept": report.volume_kept,
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
