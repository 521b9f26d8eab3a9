# SPDX-License-Identifier: GPL-3.0-or-later
"""Make walk.blend: the sample human walks, and its right foot cuts into a low step as it lands.

    blender -b --factory-startup -P samples/shot/make_shot.py -- --out FOLDER

The job samples/jobs/walk.toml corrects it. Blender 3.4 and later, or the Python package bpy.
"""

import argparse
import json
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

sys.path.insert(0, str(Path(__file__).parent))

import gait

HUMAN = Path(__file__).resolve().parent.parent / "human"
FRAMES = range(1, 121)
FRAMES_A_SECOND = 24

STEPPED_ON = 1  # the right foot's stance on the step, by number
STEP_HEIGHT = 0.08
STEP_X = (-0.32, -0.02)  # below the right foot alone
STEP_BEHIND, STEP_AHEAD = 0.1, 0.33  # of the ankle that stands

COLOURS = {
    "Human": (0.72, 0.58, 0.49, 1.0),
    "Step": (0.1, 0.35, 0.65, 1.0),
    "Floor": (0.75, 0.76, 0.77, 1.0),
}


def import_human():
    """Return the sample human with the vertex groups of its JSON files, Z up, at the origin."""
    bpy.ops.wm.obj_import(filepath=str(HUMAN / "human.obj"))
    human = bpy.context.selected_objects[0]
    human.name = "Human"
    human.data.transform(human.matrix_world)  # the importer's turn from Y up
    human.matrix_world = Matrix.Identity(4)
    for polygon in human.data.polygons:
        polygon.use_smooth = True
    for name, vertices in json.loads((HUMAN / "human_groups.json").read_text()).items():
        human.vertex_groups.new(name=name).add(vertices, 1.0, "REPLACE")
    return human


def add_rig(human, rig):
    """Return an armature of the rig's bones that moves the human by its weights."""
    armature = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for name, place in rig["bones"].items():
        bone = armature.data.edit_bones.new(name)
        bone.head, bone.tail = place["head"], place["tail"]
        bone.parent = armature.data.edit_bones[place["parent"]] if place["parent"] else None
    bpy.ops.object.mode_set(mode="OBJECT")
    for name, members in rig["weights"].items():
        group = human.vertex_groups.new(name=name)
        for vertex, weight in zip(members["vertices"], members["weights"], strict=True):
            group.add([vertex], weight, "REPLACE")
    modifier = human.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    armature.hide_render = True
    return armature


def animate(armature, rig, frames):
    """Key the walk of `gait` at every frame."""
    walker = gait.Walker(rig)
    before = {}
    for frame in frames:
        turns, offset = walker.pose(frame)
        for name, turn in turns.items():
            bone = armature.pose.bones[name]
            rest = np.array(bone.bone.matrix_local)[:3, :3]
            parent = turns[bone.parent.name] if bone.parent else np.eye(3)
            own = Matrix((rest.T @ parent.T @ turn @ rest).tolist()).to_quaternion()
            if name in before:
                own.make_compatible(before[name])
            before[name] = bone.rotation_quaternion = own
            bone.keyframe_insert("rotation_quaternion", frame=frame)
            if bone.parent is None:
                bone.location = rest.T @ offset
                bone.keyframe_insert("location", frame=frame)


def add_box(name, low, high):
    """Return a new box between two corners, in world coordinates."""
    corners = [
        (x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])
    ]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    box = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(box)
    return box


def add_set():
    """Add the floor and the step."""
    ankle = -gait.footprint(STEPPED_ON, "R")
    add_box(
        "Step",
        (STEP_X[0], ankle - STEP_AHEAD, 0.0),
        (STEP_X[1], ankle + STEP_BEHIND, STEP_HEIGHT),
    )
    add_box("Floor", (-20.0, -20.0, -0.02), (20.0, 20.0, 0.0))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens = 85
    middle = Vector((0.0, ankle + 0.02, 0.9))
    camera.location = middle + Vector((-5.4, -1.7, 0.5))
    camera.rotation_euler = (camera.location - middle).to_track_quat("Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera


def build(frames=FRAMES):
    """Fill the empty open file with the shot, walked in `frames`. Returns the human."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = frames[0], frames[-1]
    scene.render.fps = FRAMES_A_SECOND
    rig = json.loads((HUMAN / "human_rig.json").read_text())
    human = import_human()
    animate(add_rig(human, rig), rig, frames)
    add_set()
    for name, colour in COLOURS.items():
        bpy.data.objects[name].color = colour
    bpy.context.view_layer.objects.active = human
    scene.frame_set(frames[0])
    return human


def main(arguments):
    parser = argparse.ArgumentParser(prog="make_shot.py", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="where walk.blend goes")
    folder = parser.parse_args(arguments).out.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    build()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "walk.blend"), compress=True)
    print(f"wrote {folder / 'walk.blend'}")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
