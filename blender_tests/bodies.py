# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies to pose, and what a test asks of them in world coordinates. No product code."""

import bpy
import numpy as np
from mathutils import Matrix

SEGMENTS = 12
RINGS = 17
HEIGHT = 2.0


def add_bar(name="Bar", *, groups=True):
    """Add a standing tube of radius 0.3 with n-gon caps, and make it active.

    Groups: 'feet' the lowest two rings, 'middle' one in the middle, 'head' the highest two.
    """
    angles = np.linspace(0, 2 * np.pi, SEGMENTS, endpoint=False)
    ring = np.stack([0.3 * np.cos(angles), 0.3 * np.sin(angles), np.zeros(SEGMENTS)], axis=1)
    heights = np.linspace(0, HEIGHT, RINGS)
    vertices = np.concatenate([ring + np.array([0, 0, z]) for z in heights])
    index = np.arange(RINGS * SEGMENTS).reshape(RINGS, SEGMENTS)
    following = np.roll(index, -1, axis=1)
    quads = np.stack([index[:-1], following[:-1], following[1:], index[1:]], axis=-1)
    faces = [
        *quads.reshape(-1, 4).tolist(),
        index[0, ::-1].tolist(),
        index[-1].tolist(),
    ]
    obj = add_mesh(name, vertices, faces)
    if groups:
        add_group(obj, "feet", index[:2].ravel())
        add_group(obj, "middle", index[RINGS // 2])
        add_group(obj, "head", index[-2:].ravel())
    return obj


def add_mesh(name, vertices, faces):
    """Add a mesh object to the scene and make it active."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(vertices).tolist(), [], faces)
    mesh.update()
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    return obj


def add_group(obj, name, vertices, weight=1.0):
    obj.vertex_groups.new(name=name).add([int(v) for v in vertices], weight, "REPLACE")


def members(obj, name):
    """Return the vertices of a vertex group."""
    group = obj.vertex_groups[name].index
    return [v.index for v in obj.data.vertices if any(g.group == group for g in v.groups)]


def rest(obj):
    """Return the rest positions (n, 3) float32: the Basis if there is one."""
    mesh = obj.data
    if mesh.shape_keys:
        return key(obj, mesh.shape_keys.reference_key.name)
    return np.array([v.co for v in mesh.vertices], dtype=np.float32)


def key(obj, name):
    """Return the positions (n, 3) float32 of a shape key."""
    data = obj.data.shape_keys.key_blocks[name].data
    return np.array([point.co for point in data], dtype=np.float32)


def to_world(obj, points):
    """Map local points to world by the object's evaluated matrix."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return transform(evaluated.matrix_world, points)


def transform(matrix, points):
    """Apply a 4x4 matrix to points (n, 3) in double precision."""
    matrix = np.array(matrix, dtype=np.float64)
    return np.asarray(points, dtype=np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def empty_matrix(empty):
    """Return the evaluated world matrix of an Empty."""
    return empty.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world.copy()


def rigid_motion():
    """Return a world motion that is no symmetry of anything here."""
    return Matrix.Translation((0.7, -0.4, 1.1)) @ Matrix.Rotation(1.2, 4, (0.3, -0.5, 0.8))


def everything():
    """Return a picture of the file that any change to it would change."""
    state = {}
    for obj in bpy.data.objects:
        rows = [
            (row.name, row.kind, row.empty.name if row.empty else None, tuple(row.bind))
            for row in obj.supple.handles
        ]
        state[obj.name] = (
            obj.mode,
            [tuple(row) for row in (*obj.matrix_basis, *obj.matrix_parent_inverse)],
            rows,
            obj.supple.bound_vertices,
            sorted(record.name for record in obj.supple.keys),
            obj.active_shape_key_index,
        )
        if obj.type != "MESH":
            continue
        keys = obj.data.shape_keys
        state[obj.name] += (
            rest(obj).tobytes(),
            [(k.name, k.value, k.mute, key(obj, k.name).tobytes()) for k in keys.key_blocks]
            if keys
            else None,
        )
    state["collections"] = sorted(collection.name for collection in bpy.data.collections)
    return state
