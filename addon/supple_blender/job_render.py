# SPDX-License-Identifier: GPL-3.0-or-later
"""Two pictures of an object from one camera, in a scene of their own that is removed again."""

import bpy
import numpy as np
from mathutils import Vector

from . import compat, handles, space
from .errors import UserError

# From the front, a little from its left and above, as portraits are taken.
VIEW_FROM = Vector((0.45, -1.0, 0.25)).normalized()
MARGIN = 1.1
BACKGROUND = (0.2, 0.21, 0.22)


def _seen_points(obj):
    """Return the world positions (n, 3) of every shape key of obj: all must be in the frame."""
    world = handles.world_matrix(bpy.context, obj)
    points = []
    for key in obj.data.shape_keys.key_blocks:
        local = np.array([point.co for point in key.data], dtype=np.float64)
        points.append(space.to_world_points(world, local))
    return np.concatenate(points)


def _add_camera(scene, points, size):
    camera = bpy.data.objects.new("Supple Camera", bpy.data.cameras.new("Supple Camera"))
    scene.collection.objects.link(camera)
    turn = VIEW_FROM.to_track_quat("Z", "Y")
    axes = np.array(turn.to_matrix())  # columns: the picture's right, its up, towards the camera
    seen = points @ axes
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle = (low + high) / 2
    depth = max(high[2] - low[2], np.ptp(points), 1e-6)
    camera.location = axes @ (middle[0], middle[1], high[2] + depth)
    camera.rotation_mode = "QUATERNION"
    camera.rotation_quaternion = turn
    width, height = size
    extent = high - low
    camera.data.type = "ORTHO"
    camera.data.sensor_fit = "HORIZONTAL"
    camera.data.ortho_scale = MARGIN * max(extent[0], extent[1] * width / height, 1e-6)
    camera.data.clip_start = depth * 1e-3
    camera.data.clip_end = depth * 10
    scene.camera = camera


def _add_light(scene):
    light = bpy.data.objects.new("Supple Light", bpy.data.lights.new("Supple Light", "SUN"))
    light.data.energy = 2.0
    light.rotation_euler = Vector((0.6, -1.0, 1.2)).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(light)
    scene.world = compat.new_world("Supple World")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (*BACKGROUND, 1.0)
    scene.world.color = BACKGROUND


def _set_up(scene, render):
    scene.render.engine = render.engine
    scene.render.resolution_x, scene.render.resolution_y = render.size
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "PNG"
    scene.view_settings.view_transform = "Standard"
    if render.engine == "CYCLES":
        scene.cycles.device = "CPU"
        scene.cycles.samples = render.samples
        scene.cycles.use_denoising = False
    else:
        scene.display.shading.light = "STUDIO"
        scene.display.shading.show_cavity = True


def _remove(scene):
    ours = [obj for obj in scene.collection.objects if obj.name.startswith("Supple ")]
    blocks = [scene.world, *ours, *(obj.data for obj in ours)]
    bpy.data.scenes.remove(scene)
    bpy.data.batch_remove(blocks)


def _shoot(scene, path):
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    if not path.is_file():
        raise UserError(f"{path}: the picture was not rendered; see the messages above")


def before_and_after(obj, key_name, render, partial):
    """Render obj without and with its shape key to partial[render.before] and [render.after]."""
    points = _seen_points(obj)
    scene = bpy.data.scenes.new("Supple Pictures")
    key = obj.data.shape_keys.key_blocks[key_name]
    muted = key.mute
    try:
        scene.collection.objects.link(obj)
        _add_camera(scene, points, render.size)
        _add_light(scene)
        _set_up(scene, render)
        for target, mute in ((render.before, True), (render.after, False)):
            if target:
                key.mute = mute
                _shoot(scene, partial[target])
    finally:
        key.mute = muted
        _remove(scene)
