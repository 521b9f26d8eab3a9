# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups as sets of vertices."""

import numpy as np

from .errors import UserError, count, some

# Painted groups fade out and overlap; a vertex is in a handle from this weight on.
MIN_WEIGHT = 0.5


def members(obj, names):
    """Return {name: sorted vertex indices (k,) int64} for the named vertex groups of obj.

    Raises UserError for a group that does not exist. A group without vertices gives an empty array.
    """
    missing = [name for name in names if name not in obj.vertex_groups]
    if missing:
        existing = [group.name for group in obj.vertex_groups]
        fix = f"Its groups are {some(existing, 8)}." if existing else "It has no vertex groups."
        raise UserError(f"{obj.name}: there is no vertex group {some(missing)}. {fix}")
    wanted = {obj.vertex_groups[name].index: [] for name in names}
    for vertex in obj.data.vertices:
        for element in vertex.groups:
            if element.weight >= MIN_WEIGHT and element.group in wanted:
                wanted[element.group].append(vertex.index)
    return {name: np.array(wanted[obj.vertex_groups[name].index], dtype=np.int64) for name in names}


def require_members(object_name, vertices_by_name):
    """Raise UserError if a group is empty or two groups share a vertex."""
    for name, vertices in vertices_by_name.items():
        if not len(vertices):
            raise UserError(
                f"{object_name}: vertex group '{name}' has no vertices with a weight of "
                f"{MIN_WEIGHT} or more. Assign some in Edit Mode or remove the handle."
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
