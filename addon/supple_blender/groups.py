# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups as sets of vertices."""

import numpy as np

from .errors import UserError, count, some

# Painted groups fade out and overlap; a vertex is in a handle from this weight on.
MIN_WEIGHT = 0.5


def members(obj, names, least=None):
    """Return {name: sorted vertex indices (k,) int64} for the named vertex groups of obj.

    least: {name: weight} from which on a vertex is in it, where that is not MIN_WEIGHT. Raises
    UserError for a group that does not exist. A group without vertices gives an empty array.
    """
    missing = [name for name in names if name not in obj.vertex_groups]
    if missing:
        existing = [group.name for group in obj.vertex_groups]
        fix = f"Its groups are {some(existing, 8)}." if existing else "It has no vertex groups."
        raise UserError(f"{obj.name}: there is no vertex group {some(missing)}. {fix}")
    wanted = {obj.vertex_groups[name].index: [] for name in names}
    limits = {obj.vertex_groups[name].index: (least or {}).get(name, MIN_WEIGHT) for name in names}
    for vertex in obj.data.vertices:
        for element in vertex.groups:
            if element.weight >= limits.get(element.group, np.inf):
                wanted[element.group].append(vertex.index)
    return {name: np.array(wanted[obj.vertex_groups[name].index], dtype=np.int64) for name in names}


def weights(obj, name):
    """Return the weights (n,) float64 of vertex group `name` of obj, 0 outside it.

    Raises UserError for a group that does not exist.
    """
    if name not in obj.vertex_groups:
        raise UserError(
            f"{obj.name}: the mask '{name}' is no vertex group of it. Choose another, or none."
        )
    index = obj.vertex_groups[name].index
    found = np.zeros(len(obj.data.vertices))
    for vertex in obj.data.vertices:
        for element in vertex.groups:
            if element.group == index:
                found[vertex.index] = element.weight
    return found


def read(obj, mesh):
    """Return the weights (n, g) float64 of the g vertex groups of obj; mesh: its readable mesh."""
    found = np.zeros((len(mesh.vertices), len(obj.vertex_groups)))
    for vertex in mesh.vertices:
        for element in vertex.groups:
            if element.group < found.shape[1]:
                found[vertex.index, element.group] = element.weight
    return found


def write(obj, name, values):
    """Make vertex group `name` of obj, in Object Mode, hold exactly the weights (n,) above 0."""
    group = obj.vertex_groups.get(name) or obj.vertex_groups.new(name=name)
    group.remove(range(len(values)))
    for vertex in np.flatnonzero(values):
        group.add([int(vertex)], float(values[vertex]), "REPLACE")


def add(obj, name, vertices):
    """Add a vertex group of these vertices, with weight 1; return its name, which may differ."""
    group = obj.vertex_groups.new(name=name)
    group.add([int(vertex) for vertex in vertices], 1.0, "REPLACE")
    return group.name


def require_members(object_name, vertices_by_name, least=None):
    """Raise UserError if a group is empty or two groups share a vertex; least: as for `members`."""
    for name, vertices in vertices_by_name.items():
        if not len(vertices):
            limit = (least or {}).get(name, MIN_WEIGHT)
            raise UserError(
                f"{object_name}: vertex group '{name}' has no vertices with a weight of "
                f"{limit:.2g} or more. Assign some in Edit Mode or remove the handle."
            )
    every = np.concatenate([np.empty(0, np.int64), *vertices_by_name.values()])
    vertices, counts = np.unique(every, return_counts=True)
    if (counts > 1).any():
        first = vertices[counts > 1][0]
        one, other = [name for name in vertices_by_name if first in vertices_by_name[name]][:2]
        shared = np.intersect1d(vertices_by_name[one], vertices_by_name[other])
        what = count(len(shared), "vertex is", "vertices are")
        raise UserError(
            f"{object_name}: {what} in both '{one}' and '{other}' (first: "
            f"vertex {first}). Remove them from one of the two groups, or use only one of them "
            "as a handle."
        )
