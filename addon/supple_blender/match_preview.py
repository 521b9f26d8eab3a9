# SPDX-License-Identifier: GPL-3.0-or-later
"""A match as colours while it is found: those of `match_show`, taken back when the work ends."""

from dataclasses import dataclass

import numpy as np

from . import colour_view, compat, match_show, mesh_data, snapshot, space
from .errors import UserError
from .match_show import ATTRIBUTE


@dataclass(frozen=True)
class _Before:
    """Of one object. colours: (n, 4) of the attribute, or None where it has none. active: the name
    of the active colour attribute or "". notes: what `colour_view.view` keeps.
    """

    colours: np.ndarray | None
    active: str
    notes: tuple


def _take(obj):
    attributes, body = obj.data.color_attributes, obj.supple
    shown = match_show.is_shown(obj)
    return _Before(
        compat.read_attribute(attributes[ATTRIBUTE]) if shown else None,
        attributes.active_color.name if attributes.active_color else "",
        (body.colour_before, body.shading_before),
    )


def _put_back(obj, before):
    attributes = obj.data.color_attributes
    if before.colours is None and ATTRIBUTE in attributes:
        attributes.remove(attributes[ATTRIBUTE])
    elif before.colours is not None:
        compat.write_attribute(attributes[ATTRIBUTE], before.colours)
    if before.active in attributes:
        attributes.active_color = attributes[before.active]
    obj.supple.colour_before, obj.supple.shading_before = before.notes
    obj.data.update()


def is_possible(source, target, space_data):
    """Return whether both can be coloured without another change, and a 3D View shows it."""
    if space_data is None or space_data.type != "VIEW_3D":
        return False
    return all(_can_be_coloured(obj) for obj in (source, target))


def _can_be_coloured(obj):
    try:
        mesh_data.require_writable(obj)
    except UserError:
        return False
    layer = obj.data.attributes.get(ATTRIBUTE)
    kind = ("POINT", "FLOAT_COLOR")
    is_free = layer is None or (layer.domain, layer.data_type) == kind
    return is_free and obj.mode == "OBJECT"


def _find(rest):
    """Return the object of a RestMesh, or None where a script took it or changed it."""
    obj = snapshot.body(rest.name)
    if obj is None or len(obj.data.vertices) != len(rest.positions):
        return None
    return obj


class Preview:
    """Colours the objects of RestMeshes source and target, and shows that in a view, until `end`.

    Both must be there, and `is_possible`.
    """

    def __init__(self, source, target, space_data):
        self._target = target
        self._colours = match_show.pattern(space.to_solve_points(source.stretch, source.positions))
        self._space = space_data
        self._shading = space_data.shading.type, space_data.shading.color_type
        self._before = [(rest, _take(_find(rest))) for rest in (source, target)]
        self._fill(source, self._colours)

    def _fill(self, rest, colours):
        obj = _find(rest)
        if obj is not None:
            colour_view.add(obj, ATTRIBUTE, match_show.faded(colours, np.ones(len(colours))))
            colour_view.view(obj, ATTRIBUTE, self._space)

    def update(self, point_map):
        """Colour each vertex of the target as the one of the source, (n,), that it belongs to."""
        self._fill(self._target, self._colours[point_map])

    def end(self):
        """Make both, and the view, as they were before."""
        for rest, before in self._before:
            obj = _find(rest)
            if obj is not None:
                _put_back(obj, before)
        if self._space in colour_view.views():
            self._space.shading.type, self._space.shading.color_type = self._shading
