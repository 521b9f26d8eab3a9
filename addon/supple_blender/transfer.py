# SPDX-License-Identifier: GPL-3.0-or-later
"""Carrying layers of a source to a target along their map. No bpy: it runs on any thread."""

from dataclasses import dataclass, field

import numpy as np

from . import native, space
from .errors import CancelledError, UserError, count
from .match import Match, solve_arrays
from .mesh_data import RestMesh
from .pose import guarded


@dataclass(frozen=True)
class Colour:
    """A colour attribute: values (n, 4), linear, at vertices (POINT) or loops (CORNER)."""

    name: str
    domain: str
    data_type: str
    values: np.ndarray


@dataclass(frozen=True)
class Key:
    """A shape key: positions (n, 3) local, and its settings {property: value}."""

    name: str
    positions: np.ndarray
    settings: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Layers:
    """What is carried, of the source before and of the target after.

    uvs: {name: (loops, 2)}. weights: {group: (n,)}. keys: list of Key. fit: whether the source is
    laid onto the target; afterwards its positions (n, 3) in the target's local coordinates.
    """

    uvs: dict = field(default_factory=dict)
    weights: dict = field(default_factory=dict)
    colours: list = field(default_factory=list)
    keys: list = field(default_factory=list)
    fit: object = False


@dataclass(frozen=True)
class TransferInput:
    """match: the `match.Match` along which is carried; None until it is known. corners: the
    `match_collect.Corners` of source and target.
    """

    source: RestMesh
    target: RestMesh
    corners: tuple
    layers: Layers
    match: Match | None = None

    @property
    def name(self):
        return self.target.name


@dataclass(frozen=True)
class Transferred:
    """layers: as the target gets them. notes: what people should know."""

    layers: Layers
    notes: list


class _Carrier:
    """Carries layers of one TransferInput."""

    def __init__(self, inputs):
        self.inputs = inputs
        self.supple = native.supple()
        self.map = inputs.match.surface_map
        self.source, self.target = solve_arrays(inputs.source), solve_arrays(inputs.target)

    def corners(self, values, *, extrapolate):
        """Carry values (loops, c) to the target's loops."""
        from_corners, to_corners = self.inputs.corners
        found = self.supple.transfer_corners(
            self.map,
            self.source,
            self.target,
            values[from_corners.loops],
            extrapolate=extrapolate,
            polygons=to_corners.polygons,
        )
        carried = np.zeros((to_corners.count, values.shape[1]))
        carried[to_corners.loops] = found.values
        return carried

    def colour(self, colour):
        if colour.domain == "CORNER":
            values = self.corners(colour.values, extrapolate=False)
        else:
            values = self.supple.transfer_field(self.map, self.source, colour.values).values
        return Colour(colour.name, colour.domain, colour.data_type, values)

    def weights(self, weights):
        if not weights:
            return {}, 0
        found = self.supple.transfer_groups(
            self.map, self.source, self.target, np.stack(list(weights.values()), axis=1)
        )
        return dict(zip(weights, found.weights.T, strict=True)), found.moved

    def keys(self, keys, progress):
        if not keys:
            return []
        stretch = self.inputs.source.stretch
        found = self.supple.transfer_shape_keys(
            self.source,
            [space.to_solve_points(stretch, key.positions) for key in keys],
            self.target,
            self.map,
            progress=progress,
        )
        back = self.inputs.target.stretch
        return [
            Key(key.name, space.to_local_points(back, shape), key.settings)
            for key, shape in zip(keys, found.shapes, strict=True)
        ]

    def fit(self, progress):
        """Return the source's vertices on the target, and how many faces turned over."""
        other_way = self.supple.reversed_map(self.map, self.target, self.source)
        found = self.supple.shrink_fit(self.source, self.target, other_way, progress=progress)
        return space.to_local_points(self.inputs.target.stretch, found.vertices), found.flipped


def _carry(inputs, stages):
    carrier, layers, notes = _Carrier(inputs), inputs.layers, []
    stages.begin("Carrying", 0.3)
    uvs = {name: carrier.corners(uv, extrapolate=True) for name, uv in layers.uvs.items()}
    weights, moved = carrier.weights(layers.weights)
    colours = [carrier.colour(colour) for colour in layers.colours]
    if moved:
        what = count(moved, "vertex takes its weights", "vertices take their weights")
        notes.append(f"{what} from the island that the rest of its own is on.")
    keys = carrier.keys(layers.keys, stages.begin("Carrying shape keys", 0.4))
    fit = None
    if layers.fit:
        fit, flipped = carrier.fit(stages.begin("Fitting", 0.3))
        if flipped:
            notes.append(f"Shrink Fit turned {count(flipped, 'face', 'faces')} over.")
    if stages.cancelled:  # what takes no time does not ask
        raise CancelledError
    unmapped = int((inputs.match.surface_map.face < 0).sum())
    if unmapped:
        what = count(unmapped, "vertex has", "vertices have")
        notes.append(f"{what} no partner on the source and got nothing.")
    return Transferred(Layers(uvs, weights, colours, keys, fit), notes)


def _solve(inputs, stages):
    supple = native.supple()
    try:
        return _carry(inputs, stages)
    except supple.Cancelled:
        raise
    except supple.SuppleError as error:
        raise UserError(f"{inputs.name}: {error}") from error


def solve(inputs, stages):
    """Return what the target gets, Transferred. Raises UserError, or CancelledError."""
    return guarded(inputs.name, lambda: _solve(inputs, stages))
