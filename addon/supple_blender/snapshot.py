# SPDX-License-Identifier: GPL-3.0-or-later
"""What Live may change on a body, as it was, to put it back. Names only: undo replaces objects."""

from dataclasses import dataclass

import bpy
import numpy as np

from . import compat, shape_keys

CHANNELS = (
    *("rotation_mode", "location", "rotation_euler", "rotation_quaternion"),
    *("rotation_axis_angle", "scale"),
)


def carrier_of(row):
    """Return what moves a handle, its Empty or its pose bone, or None."""
    if row.bone:
        return row.armature.pose.bones.get(row.bone) if row.armature else None
    return row.empty


def _value(carrier, channel):
    value = getattr(carrier, channel)
    return value if isinstance(value, str) else tuple(value)


@dataclass(frozen=True)
class Key:
    """A shape key: positions (n, 3) float32, its value, whether it is muted."""

    positions: np.ndarray
    value: float
    mute: bool


@dataclass(frozen=True)
class Snapshot:
    """transforms: {handle: {channel: value}}; preview: Key or None; active: a shape key's index."""

    transforms: dict
    preview: Key | None
    active: int


def take(obj):
    """Return the Snapshot of obj: its handles' own transforms and its preview key."""
    transforms = {}
    for row in obj.supple.handles:
        carrier = carrier_of(row)
        if carrier:
            transforms[row.name] = {name: _value(carrier, name) for name in CHANNELS}
    key = shape_keys.find(obj, shape_keys.PREVIEW)
    preview = Key(compat.read_key(key), key.value, key.mute) if key else None
    return Snapshot(transforms, preview, obj.active_shape_key_index)


def put_back(obj, before):
    """Make obj as it was when `before` was taken; obj is in Object Mode."""
    for row in obj.supple.handles:
        carrier = carrier_of(row)
        for name, value in before.transforms.get(row.name, {}).items():
            if carrier and _value(carrier, name) != value:
                setattr(carrier, name, value)
    if before.preview is None:
        shape_keys.remove_preview(obj)
    else:
        shape_keys.rewrite(obj, shape_keys.PREVIEW, before.preview.positions)
        key = shape_keys.find(obj, shape_keys.PREVIEW)
        key.value, key.mute = before.preview.value, before.preview.mute
    if obj.active_shape_key_index != before.active:
        obj.active_shape_key_index = before.active


def body(name):
    """Return mesh object `name`, looked up anew, or None."""
    obj = bpy.data.objects.get(name)
    return obj if obj is not None and obj.type == "MESH" else None
