# SPDX-License-Identifier: GPL-3.0-or-later
"""What a bake leaves in the .blend: native data alone, which renders without the add-on."""

from pathlib import Path

import bpy

from . import compat, mesh_data
from .errors import UserError
from .modifier_stack import RESULT

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


def show_file(obj, name, path, index):
    """Let obj show the one frame of PC2 file `path`, in the viewport only, by modifier `name`."""
    modifier = _cache_modifier(obj, name, str(path), index)
    modifier.time_mode, modifier.play_mode, modifier.eval_frame = "FRAME", "CUSTOM", 0.0
    modifier.show_viewport, modifier.show_render = True, False


def attach_cache(obj, name, path, first, last, index):
    """Let obj show PC2 file `path` in frames first..last by a Mesh Cache modifier `name`, which is
    placed `index`-th; outside them the modifier is off, so the mesh is as it was, bit for bit.
    """
    modifier = _cache_modifier(obj, name, _stored(path), index)
    modifier.frame_start, modifier.frame_scale = first, 1.0
    modifier.time_mode, modifier.play_mode = "FRAME", "SCENE"
    for shown in SHOWN:
        _key_visibility(obj, modifier, shown, first, last)
    return modifier


def _cache_modifier(obj, name, path, index):
    modifier = obj.modifiers.get(name)
    if modifier is None:
        modifier = obj.modifiers.new(name, "MESH_CACHE")
        _move(obj, modifier, index)
    modifier.cache_format = "PC2"
    modifier.filepath = path
    modifier.deform_mode, modifier.interpolation = "OVERWRITE", "LINEAR"
    modifier.forward_axis, modifier.up_axis = "POS_Y", "POS_Z"
    modifier.factor = 1.0
    return modifier


def _move(obj, modifier, index):
    """Move a modifier that is last to `index`."""
    at = len(obj.modifiers) - 1
    if at != index:
        with bpy.context.temp_override(object=obj, active_object=obj):
            bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=index)


def _path(modifier, shown):
    return f'modifiers["{modifier.name}"].{shown}'


def _curves(obj, name):
    """Return the F-curves of the visibility of modifier `name`."""
    paths = {f'modifiers["{name}"].{shown}' for shown in SHOWN}
    return [curve for curve in compat.curves_of(obj) if curve.data_path in paths]


def _key_visibility(obj, modifier, shown, first, last):
    path = _path(modifier, shown)
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


def is_shown(obj, name=RESULT):
    """Return whether the result is shown, or None where there is none."""
    if obj.modifiers.get(name) is None:
        return None
    return not any(curve.mute for curve in _curves(obj, name))


def show(obj, shown, name=RESULT):
    """Show the result (after), or the animation without it (before)."""
    modifier = obj.modifiers.get(name)
    if modifier is None:
        raise UserError(f"{obj.name}: there is no baked sequence to show. Press Bake first.")
    for curve in _curves(obj, name):
        curve.mute = not shown
    for attribute in SHOWN:
        setattr(modifier, attribute, False)
    scene = bpy.context.scene
    scene.frame_set(scene.frame_current)  # where shown, the F-curves decide


def detach(obj, name=RESULT):
    """Remove the result's modifier and the keys of its visibility; the cache file stays."""
    modifier = obj.modifiers.get(name)
    if modifier is None:
        raise UserError(f"{obj.name}: there is no baked sequence to remove.")
    for curve in _curves(obj, name):
        compat.remove_curve(obj, curve)
    path = Path(bpy.path.abspath(modifier.filepath))
    obj.modifiers.remove(modifier)
    return path
