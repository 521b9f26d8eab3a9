# SPDX-License-Identifier: GPL-3.0-or-later
"""A colour attribute that shows how much a pose stretches the surface, and its legend."""

import numpy as np

from . import colour_view, compat, groups, handles, mesh_data, native, space

ATTRIBUTE = "Supple Distortion"

# Symmetric Dirichlet less that of a rigid motion, and the colour (scene linear) it is shown in.
LEVELS = (0.0, 0.05, 0.25, 1.0, 5.0)
COLOURS = np.array(
    [
        (0.60, 0.60, 0.60),
        (0.07, 0.25, 0.75),
        (0.05, 0.60, 0.20),
        (0.95, 0.70, 0.03),
        (0.80, 0.03, 0.02),
    ]
)


def is_shown(obj):
    """Return whether mesh object obj has the attribute."""
    return colour_view.has(obj, ATTRIBUTE)


def colours(values):
    """Return the colours (n, 4) float32 of distortions (n,)."""
    found = np.ones((len(values), 4), dtype=np.float32)
    for channel in range(3):
        found[:, channel] = np.interp(values, LEVELS, COLOURS[:, channel])
    return found


def at_vertices(rest, positions):
    """Return the distortion (n,) of a pose of RestMesh rest: the mean of a vertex's faces."""
    before, after = (space.to_solve_points(rest.stretch, p) for p in (rest.positions, positions))
    faces = native.supple().face_distortion(before, rest.triangles, after)
    count = len(rest.positions)
    corners = rest.triangles.ravel()
    sums = np.bincount(corners, np.repeat(faces, 3), minlength=count)
    return sums / np.maximum(np.bincount(corners, minlength=count), 1)


def update(obj, rest, positions):
    """Colour obj by the distortion of `positions` (n, 3), local, against RestMesh rest."""
    colour_view.write(obj, ATTRIBUTE, colours(at_vertices(rest, positions)))


def _seen(obj):
    """Return the shape that the shape keys make, (n, 3), local, before modifiers."""
    rest = mesh_data.rest_positions(obj).astype(np.float64)
    keys = obj.data.shape_keys
    seen = rest.copy()
    for key in keys.key_blocks[1:] if keys else ():
        if not key.mute and key.value:
            part = key.value
            if key.vertex_group:
                part = part * groups.weights(obj, key.vertex_group)[:, None]
            seen += part * (compat.read_key(key) - compat.read_key(key.relative_key))
    return seen


def refresh(context, obj):
    """Colour obj, which has the attribute, by the distortion of what its shape keys show now."""
    update(obj, mesh_data.collect(obj, handles.world_matrix(context, obj)), _seen(obj))


def show(context, obj):
    """Add the attribute to obj and fill it; which colour attribute is active stays as it was."""
    mesh_data.require_writable(obj)
    rest = mesh_data.collect(obj, handles.world_matrix(context, obj))
    distortions = at_vertices(rest, _seen(obj))
    mesh_data.leave_mode(obj)
    colour_view.add(obj, ATTRIBUTE, colours(distortions))


def hide(obj):
    """Remove the attribute from obj, and show the viewport as it was before `view`."""
    mesh_data.require_writable(obj)
    mesh_data.leave_mode(obj)
    colour_view.remove(obj, ATTRIBUTE)


def view(obj, space_data):
    """Make a 3D View show the attribute of obj; `hide` takes that back."""
    colour_view.view(obj, ATTRIBUTE, space_data)


def is_viewed(obj, space_data):
    """Return whether a 3D View shows the attribute of obj."""
    return colour_view.is_viewed(obj, ATTRIBUTE, space_data)
