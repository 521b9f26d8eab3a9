# SPDX-License-Identifier: GPL-3.0-or-later
"""The corrected frame in the viewport, while scrubbing and while handles are moved.

A Mesh Cache modifier shows a file of one frame in a folder of this session, written anew whenever
the frame or a handle changes. It is never rendered and never saved.
"""

import tempfile
from pathlib import Path

import bpy

from . import background, compat, native, sequence, sequence_output, snapshot
from .errors import CancelledError, UserError
from .modifier_stack import PREVIEW, RESULT, MovingMesh
from .sequence_bake import FrameReader, collect, range_of
from .stages import Stages

# The Preview of the one object that is previewed, or None, and why the last one ended by itself.
running = None
ended = ""
_busy = False


class Preview:
    """Shows the corrected frames of one object. `problem` is for the panel."""

    def __init__(self, context, obj, stages):
        self.name, self.problem = obj.name, ""
        self._folder = tempfile.TemporaryDirectory(prefix="supple-")
        self._number, self._file = 0, None
        self._shown = self._keys = self._solver = None
        self.update(context, stages)

    def update(self, context, stages=None):
        """Show the frame that the scene is at, unless it is shown already. Raises UserError."""
        obj = snapshot.body(self.name)
        if obj is None:
            raise UserError(f"{self.name}: it is gone, so the preview ended.")
        range = range_of(obj)
        with MovingMesh(context, obj, keep_frame=True) as moving:
            inputs = collect(context, obj, range)
            frame = FrameReader(context, moving, inputs).here(context.scene.frame_current)
            # Over a result that is baked already.
            after = RESULT if RESULT in obj.modifiers else moving.after
        keys = sequence.FrameKeys(inputs)
        key = keys.of(frame)
        modifier = obj.modifiers.get(PREVIEW)
        if key == self._shown and modifier and modifier.filepath == str(self._file):
            return
        if self._solver is None or keys.shared != self._keys:
            self._solver, self._keys = sequence.Solver(inputs, stages or Stages()), keys.shared
        self._show(obj, key, self._solver.solve([frame])[0], after)
        self._shown = key

    def _show(self, obj, key, positions, after):
        self._number += 1
        path = Path(self._folder.name) / f"{self._number}.pc2"
        writer = native.supple().PointCacheWriter(path, len(positions), frame_count=1)
        writer.append(key, positions)
        writer.finish()
        sequence_output.show_file(obj, PREVIEW, path, after)
        self._file = path
        for suffix in ("", ".keys"):
            path.with_name(f"{self._number - 1}.pc2{suffix}").unlink(missing_ok=True)

    def hide(self):
        """Remove the modifier; `update` brings it back."""
        self._shown = None
        _remove_all()

    def end(self):
        self.hide()
        self._folder.cleanup()


def is_on(obj):
    """Return whether obj's corrected frames are previewed now."""
    return running is not None and running.name == obj.name


def start(context, obj):
    """Preview obj's corrected frames from now on. Raises UserError; then nothing was changed."""
    global running, ended
    end()
    sequence_output.require_free(obj, PREVIEW)
    preview = _guarded(lambda: Preview(context, obj, Stages()))
    running, ended = preview, ""
    for handlers, function in _handlers():
        handlers.append(function)


def end(message=""):
    """End the preview, if it is on."""
    global running, ended
    preview, running = running, None
    if preview is None:
        return
    ended = message
    for handlers, function in _handlers():
        if function in handlers:
            handlers.remove(function)
    preview.end()


def _handlers():
    handlers = bpy.app.handlers
    return ((handlers.frame_change_post, _on_change), (handlers.depsgraph_update_post, _on_update))


def _guarded(call):
    """Run `call`, during which Blender's own reports of changes are not answered."""
    global _busy
    _busy = True
    try:
        return call()
    finally:
        _busy = False


@bpy.app.handlers.persistent
def _on_update(scene, depsgraph=None):
    """As `_on_change`, where something else than the mesh itself changed: that the preview does."""
    if running is None or depsgraph is None:
        return
    moving = (bpy.types.Object, bpy.types.Armature, bpy.types.Key, bpy.types.Action)
    changed = [u.id.original for u in depsgraph.updates if isinstance(u.id, moving)]
    if any(owner.name != running.name for owner in changed):
        _on_change(scene, depsgraph)


@bpy.app.handlers.persistent
def _on_change(scene, depsgraph=None):
    if _busy or running is None or background.running is not None or compat.is_rendering():
        return
    if bpy.context.scene != scene or (depsgraph and depsgraph.mode != "VIEWPORT"):
        return
    try:
        _guarded(lambda: running.update(bpy.context))
        running.problem = ""
    except UserError as error:
        if snapshot.body(running.name) is None:
            end(str(error))
        else:
            running.problem = str(error)
    except CancelledError:
        pass


def _remove_all():
    """Remove every preview, also those that an undo, a rename or another session left."""
    for obj in bpy.data.objects:
        modifier = obj.modifiers.get(PREVIEW) if obj.type == "MESH" else None
        if modifier and modifier.type == "MESH_CACHE" and not obj.library:
            obj.modifiers.remove(modifier)


@bpy.app.handlers.persistent
def _after_undo(*_):
    if running is None:
        _remove_all()


@bpy.app.handlers.persistent
def _before_save(*_):
    if running is not None:
        _guarded(running.hide)
    else:
        _remove_all()


@bpy.app.handlers.persistent
def _after_save(*_):
    if running is not None:
        _on_change(bpy.context.scene)


@bpy.app.handlers.persistent
def _on_load(*_):
    end()


_EVENTS = (
    ("save_pre", _before_save),
    ("save_post", _after_save),
    ("load_pre", _on_load),
    ("undo_post", _after_undo),
    ("redo_post", _after_undo),
)


def register():
    for event, function in _EVENTS:
        getattr(bpy.app.handlers, event).append(function)


def unregister():
    end()
    for event, function in _EVENTS:
        getattr(bpy.app.handlers, event).remove(function)
