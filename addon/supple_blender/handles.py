# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles: rows on the object, and an Empty or a bone for each."""

import bpy
import numpy as np
from mathutils import Matrix

from . import groups, mesh_data, space
from .errors import UserError, some

# Groups with their centre within this part of the body's height above the lowest are proposed as
# held.
GROUND_BAND = 0.1


def world_matrix(context, obj):
    """Return the evaluated world matrix (4, 4) of obj: after F-curves, constraints and parents."""
    depsgraph = context.evaluated_depsgraph_get()
    return space.as_array(obj.evaluated_get(depsgraph).matrix_world)


def owns(obj, handle):
    """Return whether the row `handle` is obj's own, not one that came with a duplicated object."""
    carried = handle.frame or handle.empty  # its frame, where it travels with the mesh
    parent = carried.parent if carried else None
    if parent is None or parent == obj or parent.type != "MESH":
        return True
    return all(row.empty != handle.empty for row in parent.supple.handles)


def body_of(obj):
    """Return the mesh object that the user means by obj: itself, or the one that an Empty or an
    armature poses.
    """
    if obj is None or obj.type == "MESH":
        return obj
    parent = obj.parent.parent if obj.parent and obj.parent.type == "EMPTY" else obj.parent
    if parent and any(row.empty == obj for row in parent.supple.handles):
        return parent
    for other in bpy.data.objects:
        if any(obj in (row.empty, row.armature) for row in other.supple.handles):
            return other
    return obj


def require_bound(obj):
    """Raise UserError if obj's rows are another object's, or its vertex count changed."""
    body = obj.supple
    copied = [row for row in body.handles if not owns(obj, row)]
    if copied:
        raise UserError(
            f"{obj.name}: its handles are those of '{copied[0].empty.parent.name}', which it was "
            "duplicated from. Press Clear, then + Groups, to give it its own."
        )
    count = len(obj.data.vertices)
    if body.handles and count != body.bound_vertices:
        raise UserError(
            f"{obj.name}: it had {body.bound_vertices} vertices when its handles were made and has "
            f"{count} now. Press Rebind to go on with the mesh as it is."
        )


def row_vertices(obj):
    """Return {handle: vertices (k,)} for obj's rows. Raises UserError if one does not fit."""
    least = {row.name: row.least for row in obj.supple.handles}
    found = groups.members(obj, list(least), least)
    groups.require_members(obj.name, found, least)
    return found


def _propose_held(heights, body_height):
    """Return the names nearest the ground; never all of them."""
    if len(heights) < 2:
        return []
    lowest = min(heights.values())
    limit = lowest + GROUND_BAND * body_height
    near = [name for name, height in heights.items() if height <= limit]
    return near if len(near) < len(heights) else [min(heights, key=heights.get)]


def _choose(obj, names, held):
    """Return ({name: vertices} for rows to add, names of empty groups that were left out)."""
    found = groups.members(obj, [*dict.fromkeys([*names, *held])])
    if names:
        groups.require_members(obj.name, found)
    else:
        every = [group.name for group in obj.vertex_groups]
        if not every:
            raise UserError(
                f"{obj.name}: it has no vertex groups. Select vertices in Edit Mode and assign "
                "them to a group (Properties > Data > Vertex Groups)."
            )
        groups.require_members(obj.name, {name: found[name] for name in held})
        found = groups.members(obj, every)
    left_out = [name for name, vertices in found.items() if not len(vertices)]
    found = {name: vertices for name, vertices in found.items() if len(vertices)}
    if not found:
        raise UserError(
            f"{obj.name}: its vertex groups {some(left_out)} have no vertices with a weight of "
            f"{groups.MIN_WEIGHT} or more. Assign some in Edit Mode."
        )
    groups.require_members(obj.name, {**row_vertices(obj), **found})
    return found, left_out


def _collection(context, obj):
    """Return the collection of obj's Empties, made and linked to the scene if need be."""
    body = obj.supple
    if body.collection is None:
        body.collection = bpy.data.collections.new(f"Supple {obj.name}")
    if body.collection not in context.scene.collection.children_recursive:
        context.scene.collection.children.link(body.collection)
    return body.collection


def _place(obj, handle, bind):
    """Make `bind` (4, 4, local) the rest frame of the handle and of its Empty."""
    handle.empty.parent = obj
    handle.empty.matrix_parent_inverse = Matrix(bind.tolist())
    # Both are stored in single precision: with equal bits an untouched Empty is at rest.
    handle.bind = bind.reshape(16).tolist()


def _add_row(context, obj, name, world, positions, kind):
    bind = space.bind_matrix(world, positions.mean(axis=0))
    empty = bpy.data.objects.new(name, None)
    points = space.to_world_points(world, positions)
    reach = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    empty.empty_display_size = max(0.7 * float(reach), 1e-3)
    empty.show_in_front = True
    _collection(context, obj).objects.link(empty)
    row = obj.supple.handles.add()
    row.name = name
    row.empty = empty
    _place(obj, row, bind)
    row.kind = kind
    return row


def create(context, obj, names=(), held=None):
    """Add a row and an Empty for each vertex group in `names` (none: all), and return
    (names of the rows added, names of empty groups left out).

    held: names to hold, which are added too; None proposes those nearest the ground. Groups that
    have a row keep it and its Empty; only their kind follows `held`. Raises UserError before
    anything is changed.
    """
    mesh_data.require_writable(obj)
    require_bound(obj)
    world = world_matrix(context, obj)
    rest = mesh_data.collect(obj, world)
    found, left_out = _choose(obj, list(names), list(held or ()))
    new = [name for name in found if name not in obj.supple.handles]
    if held is None and not obj.supple.handles:
        points = space.to_world_points(world, rest.positions)
        heights = {name: points[vertices, 2].mean() for name, vertices in found.items()}
        held = _propose_held(heights, np.ptp(points[:, 2]))
    held = set(held or ())
    mesh_data.leave_mode(obj)
    for name in new:
        kind = "HELD" if name in held else "MOVED"
        _add_row(context, obj, name, world, rest.positions[found[name]], kind)
    for name in held:
        obj.supple.handles[name].kind = "HELD"
    obj.supple.bound_vertices = len(rest.positions)
    return new, left_out


def unhang(obj, row):
    """Let a handle's Empty hang on obj again, and remove the frame that carried it along."""
    frame, row.frame = row.frame, None
    if frame is None:
        return
    if row.empty and row.empty.parent == frame:
        row.empty.parent = obj
        row.empty.matrix_parent_inverse = Matrix(np.array(row.bind).reshape(4, 4).tolist())
    action = frame.animation_data.action if frame.animation_data else None
    bpy.data.objects.remove(frame)
    if action and not action.users:
        bpy.data.actions.remove(action)


def _drop_row(obj, index):
    row = obj.supple.handles[index]
    if owns(obj, row):
        unhang(obj, row)
    if row.empty and owns(obj, row):
        bpy.data.objects.remove(row.empty)
    obj.supple.handles.remove(index)


def remove(obj, name):
    """Remove the handle of vertex group `name` and its Empty. Raises UserError if there is none."""
    mesh_data.require_mesh(obj)
    index = obj.supple.handles.find(name)
    if index < 0:
        raise UserError(
            f"{obj.name}: there is no handle '{name}'. "
            f"Its handles are {some(row.name for row in obj.supple.handles) or 'none'}."
        )
    mesh_data.leave_mode(obj)
    _drop_row(obj, index)
    obj.supple.active_handle = max(0, min(obj.supple.active_handle, len(obj.supple.handles) - 1))
    if not obj.supple.handles:
        clear(obj)


def clear(obj):
    """Remove all handles of obj, their Empties, and their collection if nothing else is in it."""
    mesh_data.require_mesh(obj)
    mesh_data.leave_mode(obj)
    body = obj.supple
    copied = any(not owns(obj, row) for row in body.handles)
    while body.handles:
        _drop_row(obj, len(body.handles) - 1)
    collection = body.collection
    body.collection = None
    if collection and not copied and not collection.all_objects and not collection.children:
        bpy.data.collections.remove(collection)
    body.active_handle = 0
    body.bound_vertices = 0


def rebind(context, obj):
    """Bind the handles to the mesh as it is now, after its vertex count changed.

    Each Empty keeps its own motion and goes to the new centre of its group. An Empty that the user
    parented elsewhere stays where it is. Raises UserError before anything is changed.
    """
    mesh_data.require_writable(obj)
    world = world_matrix(context, obj)
    rest = mesh_data.collect(obj, world)
    found = row_vertices(obj)
    mesh_data.leave_mode(obj)
    for row in obj.supple.handles:
        unhang(obj, row)  # it followed the mesh as it was
        if row.empty and row.empty.parent == obj:
            centroid = rest.positions[found[row.name]].mean(axis=0)
            _place(obj, row, space.bind_matrix(world, centroid))
    obj.supple.bound_vertices = len(rest.positions)
