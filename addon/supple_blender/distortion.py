# SPDX-License-Identifier: GPL-3.0-or-later
"""A colour attribute that shows how much a pose stretches the surface, and its legend."""

import bpy
import numpy as np

from . import compat, groups, handles, mesh_data, native, space

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
    return ATTRIBUTE in obj.data.color_attributes


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
    data = obj.data.color_attributes[ATTRIBUTE].data
    data.foreach_set("color", colours(at_vertices(rest, positions)).ravel())


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
    attributes = obj.data.color_attributes
    active = attributes.active_color.name if attributes.active_color else ""
    attributes.new(ATTRIBUTE, "FLOAT_COLOR", "POINT")
    if active:
        attributes.active_color = attributes[active]
    attributes[ATTRIBUTE].data.foreach_set("color", colours(distortions).ravel())
    obj.data.update()


def hide(obj):
    """Remove the attribute from obj, and show the viewport as it was before `view`."""
    mesh_data.require_writable(obj)
    mesh_data.leave_mode(obj)
    attributes, body = obj.data.color_attributes, obj.supple
    active = attributes.active_color.name if attributes.active_color else ""
    attributes.remove(attributes[ATTRIBUTE])
    name = body.colour_before if active == ATTRIBUTE else active
    if name in attributes:
        attributes.active_color = attributes[name]
    if body.shading_before:
        for space_data in _views():
            if space_data.shading.color_type == "VERTEX":
                space_data.shading.color_type = body.shading_before
    body.shading_before = body.colour_before = ""


def view(obj, space_data):
    """Make a 3D View show the attribute of obj; `hide` takes that back."""
    attributes, body = obj.data.color_attributes, obj.supple
    active = attributes.active_color
    if active and active.name != ATTRIBUTE:
        body.colour_before = active.name
    attributes.active_color = attributes[ATTRIBUTE]
    shading = space_data.shading
    if shading.color_type != "VERTEX":
        body.shading_before = shading.color_type
    shading.type, shading.color_type = "SOLID", "VERTEX"


def is_viewed(obj, space_data):
    """Return whether a 3D View shows the attribute of obj."""
    active = obj.data.color_attributes.active_color
    shading = space_data.shading
    shows = shading.type == "SOLID" and shading.color_type == "VERTEX"
    return shows and active is not None and active.name == ATTRIBUTE


def _views():
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                yield area.spaces.active
