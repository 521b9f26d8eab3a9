# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles from the selection, from bones, and proposed ones. Groups are in `handles.create`."""

import numpy as np

from . import compat, groups, handles, mesh_data, native, space
from .errors import UserError, count, some

# Bones share the vertices at their joints; those that are a bone's alone are its handle, and the
# joints between bend as the mesh does.
BONE_WEIGHT = 0.9


def _free(obj, vertices):
    """Return those of `vertices` that are in no handle of obj."""
    taken = handles.row_vertices(obj).values()
    return np.setdiff1d(vertices, np.concatenate([np.empty(0, np.int64), *taken]))


def from_selection(context, obj, name, kind):
    """Make a vertex group and a handle of the vertices selected in Edit Mode; return its name."""
    mesh_data.require_writable(obj)
    handles.require_bound(obj)
    vertices = mesh_data.selected_vertices(obj)
    if not len(vertices):
        raise UserError(f"{obj.name}: no vertices are selected. Select some in Edit Mode.")
    free = _free(obj, vertices)
    if len(free) < len(vertices):
        what = count(len(vertices) - len(free), "vertex is", "vertices are")
        raise UserError(
            f"{obj.name}: {what} in a handle already (first: vertex "
            f"{np.setdiff1d(vertices, free)[0]}). Deselect them, or remove that handle."
        )
    mesh_data.collect(obj, handles.world_matrix(context, obj))  # raises what `create` would
    mesh_data.leave_mode(obj)
    group = groups.add(obj, name, vertices)
    handles.create(context, obj, [group], held=[group] if kind == "HELD" else [])
    return group


def propose(context, obj, number):
    """Make `number` groups and handles spread over obj, each a vertex and those around it.

    Returns their names; those nearest the ground are held unless obj has handles already.
    """
    mesh_data.require_writable(obj)
    handles.require_bound(obj)
    world = handles.world_matrix(context, obj)
    rest = mesh_data.collect(obj, world)
    free = np.zeros(len(rest.positions), dtype=bool)
    free[_free(obj, np.unique(rest.triangles))] = True
    candidates = np.flatnonzero(free)
    points = space.to_solve_points(rest.stretch, rest.positions)[candidates]
    centres = candidates[native.supple().farthest_points(points, number)]
    if len(centres) < number:
        what = count(len(candidates), "vertex that is", "vertices that are")
        raise UserError(f"{obj.name}: it has {what} in no handle yet. Ask for fewer than {number}.")
    free[centres] = False
    sets = {}
    for centre in centres:
        around = np.unique(rest.triangles[(rest.triangles == centre).any(axis=1)])
        around = around[free[around]]
        free[around] = False
        sets[len(sets) + 1] = np.append(around, centre)
    mesh_data.leave_mode(obj)
    names = [groups.add(obj, f"Handle {index}", vertices) for index, vertices in sets.items()]
    handles.create(context, obj, names, held=[] if obj.supple.handles else None)
    return names


def _armature(obj):
    """Return the armature that poses mesh object obj: of its modifiers, or its parent."""
    found = [m.object for m in obj.modifiers if m.type == "ARMATURE" and m.object]
    if obj.parent and obj.parent.type == "ARMATURE":
        found.append(obj.parent)
    return found[0] if found else None


def _bone_names(obj, armature, wanted):
    """Return the bones meant: the wanted, else the selected in Pose Mode, else all with a group."""
    bones = armature.pose.bones
    if wanted:
        return wanted
    if armature.mode == "POSE":
        selected = [bone.name for bone in bones if compat.is_bone_selected(bone)]
        if selected:
            return selected
    return [bone.name for bone in bones if bone.name in obj.vertex_groups]


def body_of_armature(context, armature):
    """Return the mesh object meant while `armature` is active. Raises UserError if unclear."""
    posed = [
        obj for obj in context.scene.objects if obj.type == "MESH" and _armature(obj) == armature
    ]
    chosen = [obj for obj in context.selected_objects if obj.type == "MESH"]
    found = chosen or posed
    if len(found) != 1:
        raise UserError(
            f"{armature.name}: {count(len(found), 'mesh', 'meshes')} could be meant. "
            "Select the one to pose together with the armature."
        )
    return found[0]


def from_bones(context, obj, armature, names=(), held=()):
    """Make a handle for each bone's vertex group, moved by the bone; no Empty is made.

    armature: None for that of obj's modifier or parent. names: bones; none for the selected ones
    in Pose Mode, else for all that have a group. Returns (names added, names left out).
    """
    mesh_data.require_writable(obj)
    handles.require_bound(obj)
    armature = armature or _armature(obj)
    if armature is None:
        raise UserError(
            f"{obj.name}: it has no armature. Add an Armature modifier, or select an armature too."
        )
    missing = [name for name in (*names, *held) if name not in armature.pose.bones]
    if missing:
        raise UserError(f"{obj.name}: '{armature.name}' has no bone {some(missing)}.")
    names = list(dict.fromkeys([*_bone_names(obj, armature, names), *held]))
    new = [name for name in names if name not in obj.supple.handles]
    least = dict.fromkeys(new, BONE_WEIGHT)
    found = groups.members(obj, new, least)
    left_out = [name for name, vertices in found.items() if not len(vertices)]
    found = {name: vertices for name, vertices in found.items() if len(vertices)}
    if not found and not new:
        raise UserError(f"{obj.name}: no bone of '{armature.name}' has a vertex group here.")
    if not found:
        raise UserError(
            f"{obj.name}: no vertex has a weight of {BONE_WEIGHT} or more in {some(left_out)}. "
            "Paint some, or use + Groups."
        )
    groups.require_members(obj.name, {**handles.row_vertices(obj), **found})
    mesh_data.collect(obj, handles.world_matrix(context, obj))
    mesh_data.leave_mode(obj)
    for name in found:
        row = obj.supple.handles.add()
        row.name, row.bone, row.armature, row.least = name, name, armature, BONE_WEIGHT
    for name in held:
        if name in obj.supple.handles:
            obj.supple.handles[name].kind = "HELD"
    obj.supple.bound_vertices = len(obj.data.vertices)
    return list(found), left_out


def also_deformed_by(obj):
    """Return the names of Armature modifiers that move the mesh a second time."""
    armatures = {row.armature for row in obj.supple.handles if row.bone}
    return [
        modifier.name
        for modifier in obj.modifiers
        if modifier.type == "ARMATURE" and modifier.object in armatures and modifier.show_viewport
    ]
