# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh object's rest shape as arrays, read without changing it."""

import hashlib
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from . import compat, space
from .errors import UserError, count


@dataclass(frozen=True)
class RestMesh:
    """The rest shape of an object, free of any reference into Blender.

    positions: (n, 3) float64, local. triangles: (m, 3) int32. ngons: faces with more than 4
    corners. stretch: (3, 3), local to solve space (see `space`). digest: identifies the geometry
    as it is solved.
    """

    name: str
    positions: np.ndarray
    triangles: np.ndarray
    ngons: int
    stretch: np.ndarray
    digest: str


def require_mesh(obj):
    """Raise UserError unless obj is a mesh object."""
    if obj is None:
        raise UserError("No object is active. Select a mesh object.")
    if obj.type != "MESH":
        raise UserError(f"{obj.name}: this is not a mesh. Select a mesh object.")


def require_writable(obj):
    """Raise UserError unless shape keys and handles of mesh object obj may be written."""
    require_mesh(obj)
    mesh = obj.data
    if obj.library or mesh.library or obj.override_library or mesh.override_library:
        raise UserError(
            f"{obj.name}: it is linked from another file. "
            "Make it local first (Object > Relations > Make Local > All)."
        )
    if mesh.users - mesh.use_fake_user > 1:
        raise UserError(
            f"{obj.name}: its mesh '{mesh.name}' is shared by {mesh.users - mesh.use_fake_user} "
            "users. Make it single-user first (Object > Relations > Make Single User)."
        )


def flush_edit_mode(obj):
    """Bring what is being edited into the mesh data, so that it can be read."""
    if obj.mode == "EDIT":
        obj.update_from_editmode()


@contextmanager
def readable(obj):
    """Yield the mesh of obj with all its layers; in Edit Mode, where they can't be read, a copy."""
    if not obj.data.is_editmode:
        yield obj.data
        return
    flush_edit_mode(obj)
    copy = obj.data.copy()
    try:
        yield copy
    finally:
        bpy.data.meshes.remove(copy)


def leave_mode(obj):
    """Put obj into Object Mode, before it is changed.

    The edited copy would overwrite shape keys written beside it, and an undo step made in another
    mode holds no objects, so that Ctrl+Z would leave them behind.
    """
    if obj.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


def leave_modes(context, *objects):
    """As leave_mode, whichever object is active and edited; objects are those to be changed."""
    active = context.view_layer.objects.active
    if active is not None:
        leave_mode(active)
    for obj in objects:
        if obj.mode != "OBJECT":
            raise UserError(f"{obj.name}: it is edited elsewhere. Put it into Object Mode first.")


def rest_positions(obj):
    """Return the rest positions, (n, 3) float32: the Basis if there are shape keys."""
    mesh = obj.data
    if mesh.shape_keys:
        return compat.read_key(mesh.shape_keys.reference_key)
    positions = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def selected_vertices(obj):
    """Return the vertices selected in Edit Mode, (k,)."""
    flush_edit_mode(obj)
    selected = np.empty(len(obj.data.vertices), dtype=bool)
    obj.data.vertices.foreach_get("select", selected)
    return np.flatnonzero(selected)


def _triangles(mesh):
    mesh.calc_loop_triangles()
    triangles = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    return triangles.reshape(-1, 3)


def _count_ngons(mesh):
    corners = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", corners)
    return int((corners > 4).sum())


def digest_of(*arrays):
    """Return a fingerprint of arrays, as text."""
    digest = hashlib.blake2b(digest_size=16)
    for array in arrays:
        digest.update(np.int64(len(array)).tobytes())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def collect(obj, world):
    """Return the RestMesh of mesh object obj, whose evaluated world matrix (4, 4) is `world`.

    Works in Object and Edit Mode. Raises UserError for no mesh, no faces, positions that are not
    finite, and an object scaled to zero.
    """
    require_mesh(obj)
    flush_edit_mode(obj)
    positions = rest_positions(obj)
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if len(bad):
        what = count(len(bad), "vertex has", "vertices have")
        raise UserError(
            f"{obj.name}: {what} a position that is not a number (first: vertex {bad[0]}). "
            "Delete or move them in Edit Mode."
        )
    triangles = _triangles(obj.data)
    if not len(triangles):
        raise UserError(
            f"{obj.name}: the mesh has no faces ({count(len(positions), 'vertex', 'vertices')}). "
            "Supple poses surfaces; add faces in Edit Mode."
        )
    stretch = space.solve_stretch(world, obj.name)
    return RestMesh(
        name=obj.name,
        positions=positions.astype(np.float64),
        triangles=triangles,
        ngons=_count_ngons(obj.data),
        stretch=stretch,
        digest=digest_of(positions, triangles, stretch),
    )
