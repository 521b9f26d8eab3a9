# SPDX-License-Identifier: GPL-3.0-or-later
"""A sequence as shape keys: one a frame, with keyed values, for short ranges and game export.

A key acts before the modifiers. Where there is an armature before the result, what a frame is to
move is taken back through it, vertex by vertex, by Blender's own deformation matrices. Keys are
made under other names and take their places when all are done: a failure leaves those of before.
"""

import bpy
import numpy as np

from . import compat, mesh_data, native, shape_keys
from .errors import UserError
from .modifier_stack import MovingMesh, recorded_keys

# As many keys as a file and an exporter bear; more belong in a cache.
MOST_FRAMES = 120
# Largest distance, as a part of the mesh's size, at which a key counts as showing its frame.
TOLERANCE = 1e-4
# Of a Newton iteration: one is exact for an armature but for rounding, and more help what is bent.
MOST_STEPS = 3


def names(prefix, frames):
    """Return the key of each frame: 'Sequence 0012'."""
    return [f"{prefix} {frame:04}" for frame in frames]


def require_free(obj, prefix, frames, overwrite=False):
    """Raise UserError if the keys may not be written on obj."""
    mesh_data.require_writable(obj)
    if len(frames) > MOST_FRAMES:
        raise UserError(
            f"{obj.name}: {len(frames)} frames would be as many shape keys; {MOST_FRAMES} are the "
            "most. Write a cache file, or a shorter range."
        )
    for name in names(prefix, frames):
        shape_keys.require_free(obj, name, overwrite)


def write(context, obj, prefix, frames, path, stages, bare=False):
    """Write a key for each frame; a generator for `frame_work`. path: a PC2 file of what they are
    to show, from the first on; bare: before the modifiers, else after them.

    Keys of the same prefix that Supple wrote before go. Raises UserError where modifiers can't be
    taken back, CancelledError; then obj is as it was.
    """
    mesh_data.leave_mode(obj)
    had_keys = obj.data.shape_keys is not None
    new = names(f"{prefix} ~", frames)
    cache = native.supple().PointCacheReader(path)
    try:
        with MovingMesh(context, obj, bare=bare) as moving:
            size = float(np.linalg.norm(np.ptp(mesh_data.rest_positions(obj), axis=0)))
            for done, (frame, name) in enumerate(zip(frames, new, strict=True)):
                moving.go_to(frame)
                error = _fit_key(context, moving, name, frame, cache.read(done)) / size
                if error > TOLERANCE:
                    raise UserError(
                        f"{obj.name}: at frame {frame} a shape key can't show the result: its "
                        f"modifiers turn it into something {error:.2%} of the mesh's size off. "
                        "Write a cache file."
                    )
                stages.count(done + 1)
                yield None
            final = names(prefix, frames)
            for name in {*recorded_keys(obj, prefix), *final}:
                remove(obj, name)
            for name, wanted in zip(new, final, strict=True):
                shape_keys.find(obj, name).name = wanted  # its F-curves follow
                obj.supple.keys[name].name = wanted
    except BaseException:
        for name in new:
            remove(obj, name)
        if not had_keys and obj.data.shape_keys:
            obj.shape_key_clear()
        raise


def remove(obj, name):
    """Remove shape key `name` with its F-curve, if it is there."""
    key = shape_keys.find(obj, name)
    if key is None:
        return
    keys = obj.data.shape_keys
    for curve in compat.curves_of(keys):
        if curve.data_path == _path(name):
            compat.remove_curve(keys, curve)
    obj.shape_key_remove(key)
    index = obj.supple.keys.find(name)
    if index >= 0:
        obj.supple.keys.remove(index)


def _fit_key(context, moving, name, frame, wanted):
    """Write the key that shows `wanted` at `frame`; return the largest distance from that."""
    obj = moving.obj
    positions = mesh_data.rest_positions(obj)
    away = wanted - moving.positions()
    for step in range(MOST_STEPS):
        positions = positions + _taken_back(context, moving, away)
        if step == 0:
            _write_key(obj, name, positions, frame)
        else:
            shape_keys.rewrite(obj, name, positions)
        moving.go_to(frame)
        away = wanted - moving.positions()
    return float(np.abs(away).max())


def _taken_back(context, moving, away):
    """Return displacements (n, 3) of the deformed mesh as those before the deformation."""
    obj = moving.obj
    if not any(m.show_viewport for m in obj.modifiers):
        return away
    changed = np.flatnonzero(np.abs(away).max(axis=1) > 0)
    result = np.zeros_like(away)
    obj.crazyspace_eval(context.view_layer.depsgraph, context.scene)
    try:
        back = obj.crazyspace_displacement_to_original
        for vertex in changed:
            result[vertex] = back(vertex_index=int(vertex), displacement=away[vertex].tolist())
    finally:
        obj.crazyspace_eval_clear()
    return result


def _write_key(obj, name, positions, frame):
    shape_keys.write(obj, name, positions)
    key = shape_keys.find(obj, name)
    for at, value in ((frame - 1, 0.0), (frame, 1.0), (frame + 1, 0.0)):
        key.value = value
        key.keyframe_insert("value", frame=at)
    for curve in compat.curves_of(obj.data.shape_keys):
        if curve.data_path == _path(name):
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"


def _path(name):
    return f'key_blocks["{bpy.utils.escape_identifier(name)}"].value'
