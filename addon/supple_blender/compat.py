# SPDX-License-Identifier: GPL-3.0-or-later
"""Every difference between Blender 3.4 and 5.x that the add-on meets, in one place."""

import bpy
import numpy as np

# Options of a file's property that may start with "//"; from 4.5 on Blender wants to be told.
RELATIVE_PATH = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()


def read_key(key):
    """Return the positions of a shape key, (n, 3) float32."""
    positions = np.empty(3 * len(key.data), dtype=np.float32)
    if hasattr(key, "points"):  # 4.1 and later: a plain array, 30 times faster
        key.points.foreach_get("co", positions)
    else:
        key.data.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def write_key(mesh, key, positions):
    """Set the positions of a shape key of `mesh`; positions is (n, 3)."""
    flat = np.ascontiguousarray(positions, dtype=np.float32).reshape(-1)
    if hasattr(key, "points"):
        key.points.foreach_set("co", flat)
    else:
        key.data.foreach_set("co", flat)
    mesh.update()  # up to 4.2 a rewritten key is not evaluated again without it


def add_key(obj, name):
    """Add a shape key that equals the Basis and return it, with value 1.

    New keys start at 0 up to Blender 4.5 and at 1 from 5.0, so the value is always set.
    """
    key = obj.shape_key_add(name=name, from_mix=False)
    key.value = 1.0
    return key


def read_uvs(layer):
    """Return the UVs of a UV map, (corners, 2) float32."""
    data, name = (layer.uv, "vector") if hasattr(layer, "uv") else (layer.data, "uv")  # from 3.5 on
    uvs = np.empty(2 * len(data), dtype=np.float32)
    data.foreach_get(name, uvs)
    return uvs.reshape(-1, 2)


def write_uvs(layer, uvs):
    """Set the UVs of a UV map; uvs is (corners, 2)."""
    data, name = (layer.uv, "vector") if hasattr(layer, "uv") else (layer.data, "uv")
    data.foreach_set(name, np.ascontiguousarray(uvs, dtype=np.float32).reshape(-1))


# How an attribute's values are called, their length and their NumPy type.
_ATTRIBUTES = {
    "INT": ("value", 1, np.int32),
    "FLOAT": ("value", 1, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
}


def read_attribute(attribute):
    """Return the values of an attribute, (n,) or (n, k); int32 or float64, colours linear."""
    name, length, kind = _ATTRIBUTES[attribute.data_type]
    values = np.empty(length * len(attribute.data), dtype=kind)
    attribute.data.foreach_get(name, values)
    if kind is np.float32:
        values = values.astype(np.float64)
    return values if length == 1 else values.reshape(-1, length)


def write_attribute(attribute, values):
    """Set the values of an attribute, (n,) or (n, k)."""
    name, _, kind = _ATTRIBUTES[attribute.data_type]
    attribute.data.foreach_set(name, np.ascontiguousarray(values, dtype=kind).reshape(-1))


def new_world(name):
    """Add a world with a node tree and return it."""
    world = bpy.data.worlds.new(name)
    if bpy.app.version < (
        5,
        0,
        0,
    ):  # from 5.0 on it has one anyway, and asking for it is deprecated
        world.use_nodes = True
    return world


def is_bone_selected(pose_bone):
    """Return whether a pose bone is selected; from 5.0 on it knows itself."""
    return pose_bone.select if hasattr(pose_bone, "select") else pose_bone.bone.select


def select_bone(pose_bone, selected):
    """Select or deselect a pose bone."""
    (pose_bone if hasattr(pose_bone, "select") else pose_bone.bone).select = selected


def _curve_lists(owner):
    """Return the collections of F-curves that animate `owner`."""
    data = owner.animation_data
    action = data.action if data else None
    if action is None:
        return []
    if not hasattr(data, "action_slot"):  # before 4.4 an action is of one owner
        return [action.fcurves]
    # An action may be shared: a mesh's shape keys take that of its object, and the reverse.
    strips = (strip for layer in action.layers for strip in layer.strips)
    bags = (strip.channelbag(data.action_slot) for strip in strips)
    return [bag.fcurves for bag in bags if bag is not None]


def curves_of(owner):
    """Return the F-curves that animate `owner` (an object, shape keys, ...), as a list."""
    return [curve for curves in _curve_lists(owner) for curve in curves]


def remove_curve(owner, curve):
    """Remove one of the F-curves that `curves_of` gave."""
    for curves in _curve_lists(owner):
        if curve in list(curves):
            curves.remove(curve)


def is_rendering():
    """Return whether a render runs: it reads the scene from another thread."""
    return bpy.app.is_job_running("RENDER")


def draw_progress(layout, fraction, text):
    """Draw a progress bar, or its text where Blender has no bar (before 4.0)."""
    if hasattr(layout, "progress"):
        layout.progress(factor=fraction, text=text)
    else:
        layout.label(text=text)


def register_cli_command(name, function):
    """Register `blender --command NAME` (4.2 and later). Returns a list of handles, maybe empty."""
    if hasattr(bpy.utils, "register_cli_command"):
        return [bpy.utils.register_cli_command(name, function)]
    return []


def unregister_cli_command(handle):
    """Undo `register_cli_command` for one of the handles it gave."""
    bpy.utils.unregister_cli_command(handle)
