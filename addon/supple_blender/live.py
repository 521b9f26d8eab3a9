# SPDX-License-Identifier: GPL-3.0-or-later
"""Live: the mesh follows its handles while they move, through one solver kept warm.

Blender's own transform has the events while a handle is dragged, so nothing here is modal: a
handler follows what was evaluated, in the same frame, and a timer refines it while nothing moves.
"""

import bpy

from . import background, compat, mesh_data, motions, shape_keys, snapshot
from .errors import CancelledError
from .follower import Follower, LostError

FRAME_MILLISECONDS = 12.0
# Between two calls of the timer: while there is more to do, and while nothing moves.
BUSY_SECONDS, IDLE_SECONDS = 0.001, 0.03

# The Follower of the one body that is live, or None, and why the last one ended by itself.
running = None
ended = ""
_busy = False
_was_playing = False


def is_live(obj):
    """Return whether obj is the body that follows its handles now."""
    return running is not None and running.name == obj.name


def start(obj, place, wait):
    """Make obj follow its handles. Raises UserError, and then the file is as it was.

    wait: prepare everything and pose before it returns, instead of on a thread.
    """
    global running, ended
    mesh_data.require_writable(obj)
    shape_keys.require_free(obj, shape_keys.PREVIEW)
    end(keep=True)
    follower = Follower(obj.name, snapshot.take(obj))
    follower.make(place, obj, wait)
    key = follower.before.preview
    positions = mesh_data.rest_positions(obj) if key is None else key.positions
    shape_keys.write(obj, shape_keys.PREVIEW, positions)
    key = shape_keys.find(obj, shape_keys.PREVIEW)
    key.value, key.mute = 1.0, False
    running, ended = follower, ""
    bpy.app.handlers.depsgraph_update_post.append(_on_evaluated)
    bpy.app.timers.register(_on_timer)
    if wait:
        step(FRAME_MILLISECONDS)


def end(keep):
    """End Live, if it is on; keep=False puts the handles and the preview back as they were."""
    follower = forget()
    obj = snapshot.body(follower.name) if follower else None
    if obj is not None and not keep:
        mesh_data.leave_mode(obj)
        snapshot.put_back(obj, follower.before)


def forget(message=""):
    """End Live without touching the file; return its Follower, or None."""
    global running, ended, _was_playing
    follower, running = running, None
    _was_playing = False
    if follower is None:
        return None
    ended = message
    if _on_evaluated in bpy.app.handlers.depsgraph_update_post:
        bpy.app.handlers.depsgraph_update_post.remove(_on_evaluated)
    if bpy.app.timers.is_registered(_on_timer):
        bpy.app.timers.unregister(_on_timer)
    follower.stop()
    return follower


def step(milliseconds):
    """Follow and refine once, as the timer does; return whether there is more to do soon."""
    place = _place() if running else None
    return place is not None and _guarded(place, milliseconds)


def _guarded(place, milliseconds, only_moved=False):
    global _busy
    if _busy or running is None or background.running is not None or compat.is_rendering():
        return False
    _busy = True
    try:
        return running.follow(place, milliseconds, only_moved)
    except LostError as error:
        forget(str(error))
        return False
    except CancelledError:
        return False
    finally:
        _busy = False


def _place():
    """Return where the body is evaluated: the first window that shows it, or the context."""
    if bpy.app.background:
        return motions.Place.of(bpy.context)
    for window in bpy.context.window_manager.windows:
        layer = window.view_layer
        if layer.depsgraph is not None and running.name in layer.objects:
            return motions.Place(window.scene, layer.depsgraph)
    return None


def _on_evaluated(scene, depsgraph=None):
    """Follow in the same frame whatever moved the handles."""
    if running is None or depsgraph is None or depsgraph.mode != "VIEWPORT":
        return
    if running.name in depsgraph.view_layer.objects:
        _guarded(motions.Place(scene, depsgraph), FRAME_MILLISECONDS, only_moved=True)


def is_playing():
    """Return whether an animation plays, or did when Esc was pressed: that ends it, not Live.

    Blender ends the playback and then passes the same Esc on, before the timer's next turn.
    """
    return _was_playing or _plays()


def _plays():
    windows = bpy.context.window_manager.windows
    return any(window.screen.is_animation_playing for window in windows)


def _on_timer():
    global _was_playing
    _was_playing = _plays()
    shown = _shown()
    more = step(FRAME_MILLISECONDS)
    if _shown() != shown:
        background.redraw_sidebars(bpy.context)
    if running is None:
        return None
    return BUSY_SECONDS if more else IDLE_SECONDS


def _shown():
    return (running.problem, running.doing) if running else None


@bpy.app.handlers.persistent
def _on_load(*_):
    global _busy
    forget()
    _busy = False


@bpy.app.handlers.persistent
def _before_undo(*_):
    """While a step is loaded, what is evaluated and what is in the file do not belong together."""
    global _busy
    _busy = True


@bpy.app.handlers.persistent
def _after_undo(*_):
    global _busy
    _busy = False


_HANDLERS = (
    ("load_pre", _on_load),
    ("undo_pre", _before_undo),
    ("redo_pre", _before_undo),
    ("undo_post", _after_undo),
    ("redo_post", _after_undo),
)


def register():
    for event, function in _HANDLERS:
        getattr(bpy.app.handlers, event).append(function)


def unregister():
    forget()
    for event, function in _HANDLERS:
        getattr(bpy.app.handlers, event).remove(function)
