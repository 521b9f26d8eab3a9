# SPDX-License-Identifier: GPL-3.0-or-later
"""What every job does with files: opens one, and writes all that it names, or nothing."""

import json
import os
from contextlib import contextmanager

import bpy

from . import VERSION, native
from .errors import UserError


def say(text):
    print(f"Supple: {text}", flush=True)


def open_blend(path, file):
    """Open a .blend that job file `file` names."""
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    except RuntimeError as error:
        raise UserError(f"{file}: input.blend: {error}") from error


def scene_object(name, file, key):
    """Return the object of the scene that `key` of job file `file` names."""
    scene = bpy.context.scene
    if name not in scene.objects:
        raise UserError(f"{file}: {key}: there is no object '{name}' in the scene '{scene.name}'")
    return scene.objects[name]


@contextmanager
def all_or_nothing(targets):
    """Yield {target: path to write to}; on success they take the targets' places, else they go."""
    partial = {path: path.with_name(f".partial-{os.getpid()}-{path.name}") for path in targets}
    try:
        for path in targets:
            if path.is_dir():
                raise UserError(f"{path}: is a folder, so no file of this name can be written")
            path.parent.mkdir(parents=True, exist_ok=True)
        yield partial
        for path, written in partial.items():
            os.replace(written, path)
    except OSError as error:
        raise UserError(f"{error.filename}: can't be written: {error.strerror}") from error
    finally:
        for written in partial.values():
            written.unlink(missing_ok=True)


def save(path):
    """Save a copy of the open file to `path`."""
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, check_existing=False)
    except RuntimeError as error:
        raise UserError(f"{path}: can't be saved: {error}") from error


def versions():
    """Return what made a report."""
    return {
        "supple": native.supple().__version__,
        "addon": ".".join(map(str, VERSION)),
        "blender": bpy.app.version_string,
    }


def _plain(value):
    """Return a NumPy scalar or array as what JSON knows."""
    return value.tolist()


def write_json(path, report):
    """Write a report, a dict that may hold NumPy values."""
    path.write_text(json.dumps(report, indent=2, default=_plain) + "\n", encoding="utf-8")
