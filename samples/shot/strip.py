# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a strip of frames of walk_corrected.blend: the animation above, the correction below.

blender -b walk_corrected.blend -P samples/shot/strip.py -- --out walk.png
"""

import argparse
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

FRAMES = (33, 36, 38, 45, 53, 59)
SIZE = (260, 320)  # of a picture, in pixels
GAP = 4
BACKGROUND = (0.87, 0.88, 0.89)


def set_up(scene):
    """Let Workbench render small pictures; it needs no display."""
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.compression = 100
    scene.render.dither_intensity = 0  # noise makes a PNG three times as large
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("Strip")
    scene.world.color = BACKGROUND
    scene.display.render_aa = "16"
    shading = scene.display.shading
    shading.light, shading.studio_light = "STUDIO", "paint.sl"
    shading.color_type = "OBJECT"
    shading.background_type = "WORLD"
    shading.show_shadows = shading.show_cavity = True
    shading.shadow_intensity = 0.3
    scene.display.light_direction = (0.1, 0.9, 0.25)


def picture(scene, frame, folder):
    """Return the render of a frame, (height, width, 3), from the bottom row up."""
    scene.frame_set(frame)
    scene.render.filepath = str(folder / "frame.png")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.array(image.pixels[:], dtype=np.float32).reshape(*SIZE[::-1], 4)[..., :3]
    bpy.data.images.remove(image)
    return pixels


def row(scene, folder):
    pictures = [picture(scene, frame, folder) for frame in FRAMES]
    gap = np.ones((SIZE[1], GAP, 3), dtype=np.float32)
    return np.concatenate([part for each in pictures for part in (each, gap)][:-1], axis=1)


def save(scene, pixels, path):
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Strip", width, height)
    image.pixels[:] = np.concatenate([pixels, np.ones((height, width, 1))], axis=2).ravel()
    image.save_render(str(path), scene=scene)


def main(arguments):
    parser = argparse.ArgumentParser(prog="strip.py", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="the PNG to write")
    path = parser.parse_args(arguments).out.absolute()
    scene = bpy.context.scene
    set_up(scene)
    human = bpy.data.objects["Human"]
    with tempfile.TemporaryDirectory(prefix="supple-strip-") as folder:
        after = row(scene, Path(folder))
        human.modifiers.remove(human.modifiers["Supple Sequence"])
        before = row(scene, Path(folder))
    gap = np.ones((GAP, after.shape[1], 3), dtype=np.float32)
    save(scene, np.concatenate([after, gap, before]), path)  # rows of pixels count from the bottom
    print(f"wrote {path}")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
