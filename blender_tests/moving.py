# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies that move over time, and what is evaluated at a frame. No product code."""

import bodies
import bpy
import numpy as np
from mathutils import Matrix

FRAMES = range(1, 41)


def add_armature(bar):
    """Pose a bar by two bones that bend to and fro, frames 1 to 40."""
    armature = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    lower = armature.data.edit_bones.new("lower")
    lower.head, lower.tail = (0, 0, 0), (0, 0, 1)
    upper = armature.data.edit_bones.new("upper")
    upper.head, upper.tail, upper.parent = (0, 0, 1), (0, 0, 2), lower
    bpy.ops.object.mode_set(mode="OBJECT")
    heights = bodies.rest(bar)[:, 2]
    share = np.clip((heights - 0.8) / 0.4, 0, 1)
    for name, weights in (("lower", 1 - share), ("upper", share)):
        group = bar.vertex_groups.new(name=name)
        for vertex, weight in enumerate(weights):
            if weight > 0:
                group.add([vertex], float(weight), "REPLACE")
    bar.modifiers.new("Armature", "ARMATURE").object = armature
    for name, most in (("lower", 0.5), ("upper", 0.9)):
        bone = armature.pose.bones[name]
        bone.rotation_mode = "XYZ"
        for frame in FRAMES[::3]:
            bone.rotation_euler = (most * np.sin(0.2 * frame), 0.3 * np.cos(0.15 * frame), 0.1)
            bone.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.view_layer.objects.active = bar
    return armature


def add_key_action(bar):
    """Animate a shape key of a bar that bends it over, frames 1 to 40."""
    bar.shape_key_add(name="Basis")
    lean = bar.shape_key_add(name="Lean")
    for point in lean.data:
        x, y, z = point.co
        angle = 0.5 * min(z, 1.5)  # an arc up to here, and from here on straight: the head is rigid
        along = (1 - np.cos(angle)) / 0.5 + np.sin(angle) * max(0.0, z - 1.5)
        up = np.sin(angle) / 0.5 + np.cos(angle) * max(0.0, z - 1.5)
        point.co = (along + x * np.cos(angle), y, up - x * np.sin(angle))
    for frame, value in ((1, 0.0), (20, 1.0), (40, 0.2)):
        lean.value = value
        lean.keyframe_insert("value", frame=frame)


def at(obj, frame):
    """Return the vertices (n, 3) float32 of obj at a frame, after every modifier."""
    bpy.context.scene.frame_set(frame)
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([vertex.co for vertex in evaluated.data.vertices], dtype=np.float32)


def every_frame(obj, frames=FRAMES):
    """Return {frame: positions}."""
    return {frame: at(obj, frame) for frame in frames}


def nearest_motion(rest, posed):
    """Return the (4, 4) rigid motion nearest to rest -> posed (k, 3). Source: Kabsch 1976."""
    rest, posed = np.float64(rest), np.float64(posed)
    u, _, vt = np.linalg.svd((rest - rest.mean(axis=0)).T @ (posed - posed.mean(axis=0)))
    sign = np.sign(np.linalg.det(u @ vt))
    turn = (u * [1, 1, sign]) @ vt
    motion = np.eye(4)
    motion[:3, :3] = turn.T
    motion[:3, 3] = posed.mean(axis=0) - rest.mean(axis=0) @ turn
    return motion


def lift(height):
    """Return the (4, 4) motion that lifts by `height`."""
    return np.array(Matrix.Translation((0, 0, height)))
