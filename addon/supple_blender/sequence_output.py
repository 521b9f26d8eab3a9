# SPDX-License-Identifier: GPL-3.0-or-later
"""What a bake leaves in the .blend: native data alone, which renders without the add-on."""

from pathlib import Path

import bpy

from . import compat, mesh_data, shape_key_frames
from .errors import UserError
from .modifier_stack import RESULT, SEQUENCE_KEYS, recorded_keys, visibility_paths

SHOWN = ("show_viewport", "show_render")


def require_free(obj, name=RESULT):
    """Raise UserError if modifier `name` is there and is none of Supple's."""
    mesh_data.require_mesh(obj)
    modifier = obj.modifiers.get(name)
    if modifier and (modifier.type != "MESH_CACHE" or modifier.cache_format != "PC2"):
        raise UserError(
            f"{obj.name}: its modifier '{name}' is not Supple's. Rename it; the result of a "
            "sequence takes this name."
        )
    if obj.library or (obj.override_library and obj.override_library.is_system_override):
        raise UserError(
            f"{obj.name}: it is linked from another file. Make a library override of it first "
            "(Object > Library Override > Make)."
        )


def _stored(path):
    """Return a path as the file stores it: relative, where it can be."""
    if not bpy.data.filepath:
        return str(path)
    try:
        return bpy.path.relpath(str(path))
    except ValueError:  # on another drive
        return str(path)


def show_file(obj, name, path, after):
    """Let obj show the one frame of PC2 file `path`, in the viewport only, by modifier `name`."""
    modifier = _cache_modifier(obj, name, str(path), after)
    modifier.time_mode, modifier.play_mode, modifier.eval_frame = "FRAME", "CUSTOM", 0.0
    modifier.show_viewport, modifier.show_render = True, False


def attach_cache(obj, name, path, frames, after, ends_at_rest=False):
    """Let obj show PC2 file `path` in `frames` (a range) by a Mesh Cache modifier `name`, which is
    placed after modifier `after`; outside them it is off: the mesh is as it was, bit for bit.

    ends_at_rest: the last frame is as the mesh has it without, so that it is off from there on, and
    between that frame and the next it does not stand still.
    """
    modifier = _cache_modifier(obj, name, _stored(path), after)
    modifier.frame_start, modifier.frame_scale = frames[0], 1.0
    modifier.time_mode, modifier.play_mode = "FRAME", "SCENE"
    last = frames[-1] - 1 if ends_at_rest and len(frames) > 1 else frames[-1]
    for shown, path in zip(SHOWN, visibility_paths(name), strict=True):
        _key_visibility(obj, modifier, shown, path, frames[0], last)
    return modifier


def _cache_modifier(obj, name, path, after):
    modifier = obj.modifiers.get(name)
    if modifier is None:
        modifier = obj.modifiers.new(name, "MESH_CACHE")
    _move(obj, modifier, after)
    modifier.cache_format = "PC2"
    modifier.filepath = path
    modifier.deform_mode, modifier.interpolation = "OVERWRITE", "LINEAR"
    modifier.forward_axis, modifier.up_axis = "POS_Y", "POS_Z"
    modifier.factor = 1.0
    return modifier


def _move(obj, modifier, after):
    """Move a modifier to the place after modifier `after`, '' for the first."""
    others = [other.name for other in obj.modifiers if other != modifier]
    index = others.index(after) + 1 if after else 0
    if obj.modifiers.find(modifier.name) != index:
        with bpy.context.temp_override(object=obj, active_object=obj):
            bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=index)


def _curves(obj, name):
    """Return the F-curves of the visibility of modifier `name`."""
    paths = visibility_paths(name)
    return [curve for curve in compat.curves_of(obj) if curve.data_path in paths]


def _key_visibility(obj, modifier, shown, path, first, last):
    for curve in compat.curves_of(obj):
        if curve.data_path == path:
            compat.remove_curve(obj, curve)
    for frame, value in ((first - 1, False), (first, True), (last, True), (last + 1, False)):
        setattr(modifier, shown, value)
        obj.keyframe_insert(path, frame=frame)
    for curve in compat.curves_of(obj):
        if curve.data_path == path:
            for point in curve.keyframe_points:
                point.interpolation = "CONSTANT"


def _keys(obj, name):
    """Return the shape keys that hold the result of a sequence, or none."""
    if name != RESULT:
        return []
    blocks = obj.data.shape_keys.key_blocks if obj.data.shape_keys else {}
    return [blocks[key] for key in recorded_keys(obj, SEQUENCE_KEYS)]


def is_shown(obj, name=RESULT):
    """Return whether the result is shown, or None where there is none."""
    keys = _keys(obj, name)
    if obj.modifiers.get(name) is None and not keys:
        return None
    return not any(curve.mute for curve in _curves(obj, name)) and not any(k.mute for k in keys)


def show(obj, shown, name=RESULT):
    """Show the result (after), or the animation without it (before)."""
    if is_shown(obj, name) is None:
        raise UserError(f"{obj.name}: there is no baked sequence to show. Press Bake first.")
    for key in _keys(obj, name):
        key.mute = not shown
    for curve in _curves(obj, name):
        curve.mute = not shown
    modifier = obj.modifiers.get(name)
    for attribute in SHOWN if modifier else ():
        setattr(modifier, attribute, False)
    scene = bpy.context.scene
    scene.frame_set(scene.frame_current)  # where shown, the F-curves decide


def detach(obj, name=RESULT):
    """Remove the result: its modifier with the keys of its visibility, and its shape keys.

    Returns the Path of the cache file, which stays, or None.
    """
    if is_shown(obj, name) is None:
        raise UserError(f"{obj.name}: there is no baked sequence to remove.")
    for key in [key.name for key in _keys(obj, name)]:
        shape_key_frames.remove(obj, key)
    return detach_cache(obj, name)


def detach_cache(obj, name=RESULT):
    """As `detach`, of the modifier alone, if there is one."""
    modifier = obj.modifiers.get(name)
    if modifier is None:
        return None
    for curve in _curves(obj, name):
        compat.remove_curve(obj, curve)
    path = Path(bpy.path.abspath(modifier.filepath))
    obj.modifiers.remove(modifier)
    return path
