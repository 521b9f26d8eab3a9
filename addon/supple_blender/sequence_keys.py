# SPDX-License-Identifier: GPL-3.0-or-later
"""Keying corrections: F-curves on the handles' Empties, with Blender's own easing."""

from . import compat
from .errors import UserError

_ROTATIONS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}


def _channels(empty):
    return ("location", _ROTATIONS.get(empty.rotation_mode, "rotation_euler"), "scale")


def moved_empties(obj):
    """Return the Empties of obj's moved handles. Raises UserError if there are none."""
    empties = [row.empty for row in obj.supple.handles if row.kind != "HELD" and row.empty]
    if not empties:
        raise UserError(f"{obj.name}: no handle is Moved by an Empty, so there is none to key.")
    return empties


def key(obj, frame):
    """Key the corrections of all moved handles of obj at `frame`, as they are."""
    for empty in moved_empties(obj):
        key_empty(empty, frame)


def key_empty(empty, frame):
    """Key what an Empty does at `frame`."""
    for channel in _channels(empty):
        empty.keyframe_insert(channel, frame=frame)


def clear(obj, frame):
    """Remove the keys at `frame`. Raises UserError if there are none."""
    if frame not in frames(obj):
        raise UserError(f"{obj.name}: its handles have no key at frame {frame}.")
    for empty in moved_empties(obj):
        paths = {curve.data_path for curve in compat.curves_of(empty)}
        for channel in _channels(empty):
            if channel in paths:
                empty.keyframe_delete(channel, frame=frame)


def frames(obj):
    """Return the frames at which handles of obj are keyed, ascending."""
    found = {
        point.co[0]
        for row in obj.supple.handles
        if row.empty
        for curve in compat.curves_of(row.empty)
        for point in curve.keyframe_points
    }
    return sorted(found)
