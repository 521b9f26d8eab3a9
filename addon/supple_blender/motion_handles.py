# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles from a motion: where a mesh differs most from itself at a frame, or from another mesh."""

from dataclasses import dataclass

import numpy as np
from mathutils import Matrix

from . import groups, handles, mesh_data, native, pose, prepared, space
from .errors import UserError
from .mesh_data import RestMesh
from .modifier_stack import MovingMesh


@dataclass(frozen=True)
class MotionInput:
    """The rest shape, and the same vertices moved: (n, 3), local."""

    rest: RestMesh
    moved: np.ndarray
    count: int

    @property
    def name(self):
        return self.rest.name


def collect(context, obj, other, count):
    """Return the MotionInput from the rest of obj to `other`, or (None) to obj at this frame."""
    mesh_data.require_writable(obj)
    handles.require_bound(obj)
    if obj.supple.handles:
        raise UserError(f"{obj.name}: it has handles already. Press Clear (x) first.")
    rest = mesh_data.collect(obj, handles.world_matrix(context, obj))
    if other is None:
        with MovingMesh(context, obj, keep_frame=True) as moving:
            return MotionInput(rest, moving.positions().astype(np.float64), count)
    moved = mesh_data.rest_positions(other).astype(np.float64)
    if len(moved) != len(rest.positions):
        raise UserError(
            f"{obj.name}: it has {len(rest.positions):,} vertices and '{other.name}' "
            f"{len(moved):,}. A motion needs the same vertices in both; use Match for others."
        )
    return MotionInput(rest, moved, count)


def find(inputs, stages):
    """Return the vertices (k,) of each handle."""
    return pose.guarded(inputs.name, lambda: _find(inputs, stages))


def _find(inputs, stages):
    rest = inputs.rest
    mesh = prepared.mesh(rest, stages)
    moved = space.to_solve_points(rest.stretch, inputs.moved)
    return native.supple().propose_motion_handles(mesh, moved, inputs.count)


def create(context, obj, inputs, found):
    """Make a group and a handle for each set of vertices, its Empty where the motion takes it.

    Returns their names.
    """
    mesh_data.leave_mode(obj)
    names = [
        groups.add(obj, f"Motion {index + 1}", vertices) for index, vertices in enumerate(found)
    ]
    handles.create(context, obj, names, held=[])
    world = handles.world_matrix(context, obj)
    rest = inputs.rest
    for name, vertices in zip(names, found, strict=True):
        before, after = (
            space.to_world_points(world, positions[vertices])
            for positions in (rest.positions, inputs.moved)
        )
        row = obj.supple.handles[name]
        row.kind = "MOVED"
        # An Empty rests at the centre of its vertices, with the world's axes.
        row.empty.matrix_basis = Matrix(_rigid(before, after).tolist())
    context.view_layer.update()
    return names


def _rigid(before, after):
    """Return the rigid motion (4, 4) nearest to before -> after (k, 3), about before's centre."""
    centre, to = before.mean(axis=0), after.mean(axis=0)
    u, _, vt = np.linalg.svd((before - centre).T @ (after - to))
    turn = (u * [1, 1, np.sign(np.linalg.det(u @ vt)) or 1]) @ vt if len(before) > 2 else np.eye(3)
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = turn.T, to - centre
    return motion
