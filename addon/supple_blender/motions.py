# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion that an Empty or a bone gives the vertices of its handle."""

from dataclasses import dataclass

import numpy as np

from . import handles, mesh_data, space
from .errors import UserError


@dataclass(frozen=True)
class Motion:
    """What a handle does: vertices (k,), a local matrix (4, 4) or None where it is held, and its
    weight, 1 where that is exact.
    """

    name: str
    vertices: np.ndarray
    matrix: np.ndarray | None
    weight: float = 1.0


@dataclass(frozen=True)
class Place:
    """Where things are evaluated: a scene and the dependency graph of one of its view layers."""

    scene: object
    depsgraph: object

    @classmethod
    def of(cls, context):
        return cls(context.scene, context.evaluated_depsgraph_get())

    def world_matrix(self, obj):
        """Return the evaluated world matrix (4, 4) of obj."""
        return space.as_array(obj.evaluated_get(self.depsgraph).matrix_world)


def vertices_of(obj):
    """Return {handle: vertices (k,)} for obj's handles. Raises UserError as the messages say."""
    handles.require_bound(obj)
    if not obj.supple.handles:
        raise UserError(
            f"{obj.name}: it has no handles. Press + Groups to make one for each vertex group."
        )
    mesh_data.flush_edit_mode(obj)
    return handles.row_vertices(obj)


def collect(place, obj, world, vertices):
    """Return the list of Motion of obj's handles now; vertices: as `vertices_of` gave them.

    Raises UserError for an Empty or a bone that is not there or has no usable scale.
    """
    to_local = np.linalg.inv(world)
    return [
        Motion(
            name=row.name,
            vertices=vertices[row.name],
            matrix=None if row.kind == "HELD" else _matrix(place, obj, row, to_local),
            weight=row.weight,
        )
        for row in obj.supple.handles
    ]


def _matrix(place, obj, row, to_local):
    """Return the local motion (4, 4) of a moved handle; to_local: from world to obj."""
    carrier = _bone_motion if row.bone else _empty_motion
    motion, what = carrier(place, obj, row, to_local)
    if space.is_flat(motion[:3, :3]):
        raise UserError(
            f"{obj.name}: the {what} of handle '{row.name}' is scaled to 0 or "
            "infinity. Give it another scale on X, Y and Z (Alt+S resets it)."
        )
    return motion


def _empty_motion(place, obj, row, to_local):
    empty = row.empty
    if empty is None or place.scene.objects.get(empty.name) != empty:
        raise UserError(
            f"{obj.name}: the Empty of handle '{row.name}' was deleted. "
            "Remove the handle, then add its group again."
        )
    evaluated = _evaluated(place, obj, row, empty, "Empty")
    bind = np.array(row.bind, dtype=np.float64).reshape(4, 4)
    motion = to_local @ space.as_array(evaluated.matrix_world)
    if row.frame:  # it carries the Empty along with the mesh; what counts is how the two differ
        frame = to_local @ place.world_matrix(row.frame)
        motion = bind @ np.linalg.inv(frame) @ motion
    return motion @ np.linalg.inv(bind), f"Empty '{empty.name}'"


def _bone_motion(place, obj, row, to_local):
    """As an Armature modifier has it: the armature's own place is no motion."""
    armature = row.armature
    if armature is None or place.scene.objects.get(armature.name) != armature:
        raise UserError(
            f"{obj.name}: the armature of handle '{row.name}' was deleted. "
            "Remove the handle, then add it again."
        )
    evaluated = _evaluated(place, obj, row, armature, "armature")
    bone = evaluated.pose.bones.get(row.bone)
    if bone is None:
        raise UserError(
            f"{obj.name}: '{armature.name}' has no bone '{row.bone}' any more. "
            "Remove the handle, then add it again."
        )
    at_rest = space.as_array(bone.bone.matrix_local)
    from_armature = to_local @ space.as_array(evaluated.matrix_world)
    moved = space.as_array(bone.matrix) @ np.linalg.inv(at_rest)
    return from_armature @ moved @ np.linalg.inv(from_armature), f"bone '{row.bone}'"


def _evaluated(place, obj, row, carrier, what):
    evaluated = carrier.evaluated_get(place.depsgraph)
    if not evaluated.is_evaluated or not _is_enabled(place.scene.collection, carrier):
        raise UserError(
            f"{obj.name}: the collection of {what} '{carrier.name}' (handle '{row.name}') is "
            "disabled in viewports, so Blender does not move it. Enable it in the Outliner; to "
            "hide it, use the eye."
        )
    return evaluated


def _is_enabled(collection, obj):
    """Return whether a path from `collection` to obj has no collection disabled in viewports.

    Blender does not evaluate objects in disabled collections, yet calls them evaluated.
    """
    if collection.hide_viewport:
        return False
    return collection.objects.get(obj.name) == obj or any(
        _is_enabled(child, obj) for child in collection.children
    )
