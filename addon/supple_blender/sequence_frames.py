# SPDX-License-Identifier: GPL-3.0-or-later
"""Empties that travel with the moving mesh, so that handles are where their vertices are.

Each moved handle's Empty hangs on another, its frame, whose F-curves follow the surface. They are
plain keys: nothing needs to run for them to move. A correction is what the handle's Empty does
beside its frame, so a key of it travels with the body.
"""

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from . import compat, handles, mesh_data, motions, native, pose, prepared, space
from .errors import CancelledError, UserError
from .modifier_stack import MovingMesh

_CHANNELS = (("location", 3), ("rotation_quaternion", 4))


def collect(context, obj, range, stages):
    """Read where the surface at each moved handle is in the frames of a sequence.Range.

    A generator for `frame_work`; it returns {handle: (frames, 7)}: location and quaternion of the
    handle's frame in world axes, while obj is where it is at the first frame. Raises UserError,
    CancelledError.
    """
    with MovingMesh(context, obj) as moving:
        if moving.skipped:
            raise UserError(
                f"{obj.name}: modifier '{moving.skipped[0]}' moves it after one that adds or "
                "removes vertices, so where its vertices are can't be told. Move it up."
            )
        moving.go_to(range.first)
        place = motions.Place.of(context)
        world = place.world_matrix(obj)
        rest = mesh_data.collect(obj, world)
        vertices = motions.vertices_of(obj)
        motions.collect(place, obj, world, vertices)  # raises where an Empty is gone
        rows = [row for row in obj.supple.handles if row.kind != "HELD" and not row.bone]
        if not rows:
            raise UserError(
                f"{obj.name}: no handle is Moved by an Empty, so there is none to carry."
            )
        mesh = pose.guarded(obj.name, lambda: prepared.mesh(rest, stages))
        supple = native.supple()
        given = [supple.Handle(row.name, vertices[row.name]) for row in rows]
        centres = {row.name: rest.positions[vertices[row.name]].mean(axis=0) for row in rows}
        turn = _turn(world, rest.stretch)
        found = {row.name: [] for row in rows}
        for done, number in enumerate(range.frames):
            if stages.cancelled:
                raise CancelledError
            moving.go_to(number)
            points = space.to_solve_points(rest.stretch, moving.positions())
            frames = pose.guarded(
                obj.name, lambda points=points: supple.handle_frames(mesh, given, points)
            )
            for handle, frame in zip(given, frames, strict=True):
                centre = space.to_solve_points(rest.stretch, centres[handle.name][None])[0]
                local = space.to_local_points(
                    rest.stretch, (frame[:3, :3] @ centre + frame[:3, 3])[None]
                )
                location = space.to_world_points(world, local)[0]
                rotation = Matrix((turn @ frame[:3, :3] @ turn.T).tolist()).to_quaternion()
                found[handle.name].append([*location, *rotation])
            stages.count(done + 1)
            yield None
    return {name: _continuous(np.array(rows)) for name, rows in found.items()}


def _turn(world, stretch):
    """Return the (3, 3) rotation of the object, or reflection: from solve space to world axes."""
    turn = world[:3, :3] @ np.linalg.inv(stretch)
    return turn / np.cbrt(abs(np.linalg.det(turn)))


def _continuous(rows):
    """Let each quaternion have the sign nearest to the one before."""
    for before, now in zip(rows[:-1, 3:], rows[1:, 3:], strict=True):
        if before @ now < 0:
            now *= -1
    return rows


def attach(context, obj, range, frames):
    """Make the frames follow: what `collect` returned. Handles' Empties keep their own motion."""
    mesh_data.leave_mode(obj)
    scene = context.scene
    now = scene.frame_current_final
    scene.frame_set(range.first)
    try:
        world = Matrix(handles.world_matrix(context, obj).tolist())
        for row in obj.supple.handles:
            if row.name in frames and row.empty:
                _follow(obj, row, world, range, frames[row.name])
    finally:
        scene.frame_set(int(now // 1), subframe=now % 1)


def _follow(obj, row, world, range, values):
    frame = row.frame
    if frame is None:
        frame = row.frame = bpy.data.objects.new(f"{row.name} frame", None)
        frame.empty_display_size = row.empty.empty_display_size * 0.5
        frame.hide_select = True
        obj.supple.collection.objects.link(frame)
    frame.parent = obj
    frame.matrix_parent_inverse = world.inverted()
    frame.rotation_mode = "QUATERNION"
    _key(frame, range, values)
    row.empty.parent = frame
    row.empty.matrix_parent_inverse = Matrix.Identity(4)


def _key(frame, range, values):
    for curve in compat.curves_of(frame):
        compat.remove_curve(frame, curve)
    frame.location, frame.rotation_quaternion = values[0, :3], Quaternion(values[0, 3:])
    column = 0
    numbers = np.array(range.frames, dtype=np.float64)
    for channel, size in _CHANNELS:
        frame.keyframe_insert(channel, frame=range.first)
        for curve in compat.curves_of(frame):
            if curve.data_path == channel:
                _fill(curve, numbers, values[:, column + curve.array_index])
        column += size


def _fill(curve, numbers, values):
    points = curve.keyframe_points
    points.add(len(numbers) - len(points))
    points.foreach_set("co", np.stack([numbers, values], axis=1).ravel())
    for point in points:
        point.interpolation = "LINEAR"
    curve.update()


def travels(obj):
    """Return whether handles of obj hang on frames."""
    return any(row.frame for row in obj.supple.handles)
