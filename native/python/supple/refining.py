# SPDX-License-Identifier: GPL-3.0-or-later
"""Refining a map between two meshes: a rough one in, a smooth and accurate one out."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .errors import SuppleError
from .mesh import Note, PreparedMesh
from .model import Model, load_model
from .transfer import SurfaceMap

Meshlike = PreparedMesh | tuple[ArrayLike, ArrayLike]


@dataclass
class RefineResult:
    """A refined map from n source vertices to a target of t vertices.

    Attributes:
        point_map: (n,) int32, a target vertex each.
        surface_map: SurfaceMap to points on the target's faces.
        recovered: (n, 3) the source laid onto the target, in the target's units.
        confidence: (n,) from 0 to 1: how near the recovered vertex is to the target, how well the
            normals agree there, and whether the way back ends where it began.
        backward_point_map: (t,) int32, a source vertex each, of the same recovered surface; None if
            not asked for.
        backward_surface_map: SurfaceMap to points on the source's faces; None likewise.
        notes: where the two meshes differ in what a map can't respect.
        report: rounds, eigenfunctions (of the last round), network (whether it was used),
            bounded_faces (that the network would have stretched too far, as where the map is torn;
            0 on good maps), and the milliseconds of each stage.
    """

    point_map: NDArray[np.int32]
    surface_map: SurfaceMap
    recovered: NDArray[np.float64]
    confidence: NDArray[np.float64]
    backward_point_map: NDArray[np.int32] | None = None
    backward_surface_map: SurfaceMap | None = None
    notes: list[Note] = field(default_factory=list)
    report: dict[str, float | int | bool] = field(default_factory=dict)


class Refiner:
    """What refining maps between two meshes needs, factored once. The paper, 4.3; docs/method.md.

    Turning, moving or scaling either mesh leaves the maps as they are.

    Args:
        source: the mesh that is mapped: a PreparedMesh, or (vertices, faces).
        target: the mesh it is mapped to, likewise.
        model: name of a shipped network, a path or a Model that takes the spectral signal; None for
            no network: the coarse Jacobians themselves, all else the same.
        method: "recovery", the paper's; or "spectral_projection", the map of the functional map
            alone, which uses no network.
        counts: eigenfunctions of each round; as many as both meshes have where they have fewer.
            None for the default.
        settling_rounds: rounds after them that keep the last Jacobians; None for the default.
        form: of the embedding recovery: "product", the same at any resolution, or "literal", the
            paper's system.
        pull: of the product form, in 1 / area: what is larger than sqrt(area / pull) follows the
            map, what is smaller the Jacobians. None for the default.
        point_weight, jacobian_weight: the literal form's alpha_4 and alpha_5; None for the
            defaults.
        facing: a nearest point counts where the cosine between the normals is at least this; -1 for
            any. None for the default.
        backward: also give the map from the target back to the source.
        progress: a Progress to watch and cancel.

    Attributes:
        notes: list of Note: "components_differ", "boundaries_differ", "fewer_eigenfunctions".

    Raises:
        SuppleError: bad_option, wrong_shape, model_file, and those of PreparedMesh.
        Cancelled: if progress was cancelled.
    """

    def __init__(
        self,
        source: Meshlike,
        target: Meshlike,
        *,
        model: str | os.PathLike | Model | None = "spectral",
        method: str = "recovery",
        counts: Sequence[int] | None = None,
        settling_rounds: int | None = None,
        form: str = "product",
        pull: float | None = None,
        point_weight: float | None = None,
        jacobian_weight: float | None = None,
        facing: float | None = None,
        backward: bool = False,
        progress: _native.Progress | None = None,
    ) -> None:
        if method == "spectral_projection":
            model = None
        if model is not None and not isinstance(model, Model):
            model = load_model(model)
        self.source = _prepared(source, "source", progress)
        self.target = _prepared(target, "target", progress)
        self.model = model
        given = {
            "pull": pull,
            "point_weight": point_weight,
            "jacobian_weight": jacobian_weight,
            "facing": facing,
        }
        given = {
            name: arrays.number(value, name) for name, value in given.items() if value is not None
        }
        if counts is not None:
            given["counts"] = arrays.indices(counts, "counts").tolist()
        if settling_rounds is not None:
            given["settling_rounds"] = arrays.whole(settling_rounds, "settling_rounds")
        options = _native.RefineOptions(
            method=method,
            form=form,
            backward=backward,
            **given,
        )
        self._backward = backward
        self._native = _native.Refiner(
            self.source.native,
            self.target.native,
            None if model is None else model.native,
            options,
            progress,
        )
        self.notes = [Note(note.code, note.count, note.message) for note in self._native.notes]

    def refine(
        self, initial: ArrayLike | SurfaceMap, *, progress: _native.Progress | None = None
    ) -> RefineResult:
        """Refine a map; the same result every time. The native work runs without the GIL.

        Args:
            initial: (n,) a target vertex for each source vertex, 0-based; or a SurfaceMap to points
                on the target's faces.
            progress: a Progress to watch and cancel.

        Raises:
            SuppleError: wrong_shape, index_out_of_range.
            Cancelled: if progress was cancelled.
        """
        if isinstance(initial, SurfaceMap):
            native = self._native.refine(initial.native, progress)
        else:
            native = self._native.refine(arrays.indices(initial, "initial"), progress)
        return refine_result(native, backward=self._backward, notes=self.notes)


def refine_result(
    native: _native.RefineResult, *, backward: bool, notes: Sequence[Note]
) -> RefineResult:
    """From the native result; backward: whether the way back was asked for."""
    report = native.report
    return RefineResult(
        native.point_map,
        SurfaceMap._of(native.surface_map),
        native.recovered,
        native.confidence,
        native.backward_point_map if backward else None,
        SurfaceMap._of(native.backward_surface_map) if backward else None,
        list(notes),
        {
            "rounds": report.rounds,
            "eigenfunctions": report.eigenfunctions,
            "network": report.network,
            "bounded_faces": report.bounded_faces,
            "signal_milliseconds": report.signal_milliseconds,
            "network_milliseconds": report.network_milliseconds,
            "recovery_milliseconds": report.recovery_milliseconds,
            "nearest_milliseconds": report.nearest_milliseconds,
            "milliseconds": report.total_milliseconds,
        },
    )


def refine(
    source: Meshlike,
    target: Meshlike,
    initial: ArrayLike | SurfaceMap,
    *,
    progress: _native.Progress | None = None,
    **options: object,
) -> RefineResult:
    """Prepare, factor and refine in one call; the options are those of Refiner."""
    return Refiner(source, target, progress=progress, **options).refine(initial, progress=progress)


def _prepared(mesh: Meshlike, which: str, progress: _native.Progress | None) -> PreparedMesh:
    if isinstance(mesh, PreparedMesh):
        return mesh
    if not isinstance(mesh, tuple | list) or len(mesh) != 2:
        raise SuppleError(
            "wrong_shape", f"The {which} must be a PreparedMesh or a pair (vertices, faces)."
        )
    return PreparedMesh(*mesh, progress=progress)
