# SPDX-License-Identifier: GPL-3.0-or-later
"""The object that Shrink Fit makes: the source's mesh in the target's shape."""

import bpy
import numpy as np
from mathutils import Matrix

from . import colour_view, handles, made, mesh_data
from .errors import UserError

KIND = "object"
MAX_NAME_BYTES = 63


def name_of(source, target):
    """Return what the object is called, as far as Blender keeps names."""
    name = f"{source.name} on {target.name}".encode()
    return name[:MAX_NAME_BYTES].decode(errors="ignore")


def require_free(source, target, overwrite):
    """Raise UserError unless the object can be made, or written again."""
    name = name_of(source, target)
    obj = bpy.data.objects.get(name)
    if obj is None:
        return
    if obj.type != "MESH" or obj in (source, target):
        raise UserError(f"{name}: an object of this name exists already. Rename it.")
    mesh_data.require_writable(obj)
    mesh_data.flush_edit_mode(obj)
    made.require_free(obj, KIND, name, mesh_data.rest_positions(obj), overwrite)


def _mesh(source, positions):
    """Return a copy of source's mesh with these vertices, without shape keys and layers of ours."""
    mesh_data.flush_edit_mode(source)
    mesh = source.data.copy()
    for layer in [a.name for a in mesh.attributes if a.name.startswith(colour_view.PREFIX)]:
        mesh.attributes.remove(mesh.attributes[layer])
    scratch = bpy.data.objects.new(mesh.name, mesh)
    scratch.shape_key_clear()
    bpy.data.objects.remove(scratch)
    mesh.vertices.foreach_set("co", np.ascontiguousarray(positions, dtype=np.float32).ravel())
    mesh.update()
    return mesh


def _keep_materials(source, obj):
    for slot, own in zip(source.material_slots, obj.material_slots, strict=True):
        if slot.link == "OBJECT":
            own.link, own.material = "OBJECT", slot.material


def write(context, source, target, positions):
    """Make the object, or write it again; positions: (n, 3) in target's local coordinates."""
    name = name_of(source, target)
    mesh = _mesh(source, positions)
    obj = bpy.data.objects.get(name)
    if obj is None:
        mesh.name = name
        obj = bpy.data.objects.new(name, mesh)
        for collection in source.users_collection or [context.scene.collection]:
            collection.objects.link(obj)
    else:
        before, obj.data = obj.data, mesh
        if not before.users:
            bpy.data.meshes.remove(before)
        mesh.name = name
    _keep_materials(source, obj)
    obj.matrix_world = Matrix(handles.world_matrix(context, target).tolist())
    made.remember(obj, KIND, name, mesh_data.rest_positions(obj))
    return obj
