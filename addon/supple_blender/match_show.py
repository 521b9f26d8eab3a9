# SPDX-License-Identifier: GPL-3.0-or-later
"""A match as colours: the source's own pattern, and the same carried to the target."""

import numpy as np

from . import colour_view, match, match_map, match_solving, mesh_data, native, space

ATTRIBUTE = "Supple Match"
GREY = 0.25

# Colours fade to grey below the first confidence and are full from the second on.
FADING = (0.2, 0.6)


def is_shown(obj):
    """Return whether mesh object obj has the attribute."""
    return colour_view.has(obj, ATTRIBUTE)


def pattern(points):
    """Return colours (n, 3) of points (n, 3): red, green and blue are the place along X, Y, Z."""
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    return (points - low) / np.where(extent > 0, extent, 1)


def faded(colours, confidence):
    """Return colours (n, 4) float32 of colours (n, 3), grey where confidence (n,) is least."""
    part = np.interp(confidence, FADING, (0, 1))[:, None]
    found = np.ones((len(colours), 4), dtype=np.float32)
    found[:, :3] = part * colours + (1 - part) * GREY
    return found


def show(context, source, target):
    """Add the attribute to both, or fill it anew. Raises UserError where the match does not fit."""
    rests = match_solving.fitting(context, source, target)
    mesh_data.require_writable(source)
    kept = match_map.read(target)
    colours = pattern(space.to_solve_points(rests[0].stretch, rests[0].positions))
    carried = native.supple().transfer_field(
        kept.surface_map, match.solve_arrays(rests[0]), colours, otherwise=GREY
    )
    mesh_data.leave_modes(context, source, target)
    colour_view.add(source, ATTRIBUTE, faded(colours, np.ones(len(colours))))
    colour_view.add(target, ATTRIBUTE, faded(carried.values, kept.confidence))


def hide(source, target):
    """Remove the attribute from both, in Object Mode; viewports show again what they did."""
    for obj in (source, target):
        if is_shown(obj):
            colour_view.remove(obj, ATTRIBUTE)


def view(source, target, space_data):
    """Make a 3D View show the attribute of both."""
    for obj in (source, target):
        colour_view.view(obj, ATTRIBUTE, space_data)
