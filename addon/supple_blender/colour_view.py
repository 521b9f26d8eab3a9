# SPDX-License-Identifier: GPL-3.0-or-later
"""A colour attribute of ours beside the user's own, shown in the viewport and taken back."""

import bpy

from . import mesh_data

PREFIX = "Supple "


def has(obj, name):
    """Return whether mesh object obj has colour attribute `name`."""
    return name in obj.data.color_attributes


def write(obj, name, colours):
    """Set colour attribute `name` of obj to `colours` (n, 4) float32 at vertices."""
    obj.data.color_attributes[name].data.foreach_set("color", colours.ravel())


def add(obj, name, colours):
    """Add or rewrite the attribute; which one is active stays as it was. obj: in Object Mode."""
    attributes = obj.data.color_attributes
    if name not in attributes:
        active = attributes.active_color.name if attributes.active_color else ""
        attributes.new(name, "FLOAT_COLOR", "POINT")
        if active:
            attributes.active_color = attributes[active]
    write(obj, name, colours)
    obj.data.update()


def remove(obj, name):
    """Remove the attribute from obj, and show the viewport as it was before `view`."""
    mesh_data.require_writable(obj)
    attributes, body = obj.data.color_attributes, obj.supple
    active = attributes.active_color.name if attributes.active_color else ""
    attributes.remove(attributes[name])
    shown = body.colour_before if active == name else active
    if shown in attributes:
        attributes.active_color = attributes[shown]
    if shown.startswith(PREFIX) and shown in attributes:
        return  # another of ours is shown, which still needs the viewport
    if body.shading_before:
        for space_data in views():
            if space_data.shading.color_type == "VERTEX":
                space_data.shading.color_type = body.shading_before
    body.shading_before = body.colour_before = ""


def view(obj, name, space_data):
    """Make a 3D View show the attribute of obj; `remove` takes that back."""
    attributes, body = obj.data.color_attributes, obj.supple
    active = attributes.active_color
    if active and not active.name.startswith(PREFIX):
        body.colour_before = active.name
    attributes.active_color = attributes[name]
    shading = space_data.shading
    if shading.color_type != "VERTEX":
        body.shading_before = shading.color_type
    shading.type, shading.color_type = "SOLID", "VERTEX"


def is_viewed(obj, name, space_data):
    """Return whether a 3D View shows the attribute of obj."""
    active = obj.data.color_attributes.active_color
    shading = space_data.shading
    shows = shading.type == "SOLID" and shading.color_type == "VERTEX"
    return shows and active is not None and active.name == name


def views():
    """Return every 3D View there is."""
    areas = (area for screen in bpy.data.screens for area in screen.areas)
    return [area.spaces.active for area in areas if area.type == "VIEW_3D"]
