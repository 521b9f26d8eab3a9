# SPDX-License-Identifier: GPL-3.0-or-later
"""Following the handles of one body, a call at a time; `live` makes the calls.

Objects are looked up by name each time, as undo replaces them.
"""

import time

import bpy
import numpy as np

from . import (
    collecting,
    distortion,
    mesh_data,
    motions,
    shape_keys,
    snapshot,
    space,
    status,
)
from .background import Worker
from .errors import UserError
from .stages import Stages
from .warm import Warm

# A prepared mesh is made for a scale; while that is being dragged, making one would be for nothing.
REST_SECONDS = 0.3
# How often the rest shape is compared, and something that failed is tried again.
CHECK_SECONDS = 1.0
# Colours that take longer wait until the pose is settled.
COLOUR_SECONDS = 0.03


class LostError(Exception):
    """Live can't go on: undo, the user or a script removed what it writes to."""


def _bound_to(obj):
    """Return what a solver is bound to, to compare: which vertices are whose, and the weights."""
    return [(row.name, row.bone, row.least, row.weight) for row in obj.supple.handles]


def _blend_settings(obj, world):
    """Return what decides how much of a pose is taken where, to compare."""
    body = obj.supple
    scale = round(space.uniform_scale(world), 6)
    return body.strength, body.mask, body.falloff, scale, [row.kind for row in body.handles]


def _equal(one, other):
    """Return whether two settings, or two lists of matrices or None, are equal."""
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(np.array_equal, one, other))
    return one == other


class Follower:
    """Follows the handles of one body. `problem` and `doing` are for the panel."""

    def __init__(self, name, before):
        self.name = name
        self.before = before
        self.problem = ""
        self.stages = None
        self._worker = None
        self._warm = None
        self._vertices = {}
        self._made_for = self._options = self._blend = self._matrices = None
        self._paused = False
        self._checked = self._stretched = self._failed = 0.0
        self._stretch = None
        self._colouring = 0.0

    @property
    def doing(self):
        """Return what goes on, in a few words."""
        if self._paused:
            return f"Paused: {self.name} is not in Object Mode"
        if self._worker:
            return self.stages.doing() or "Preparing"
        return "Following" if not self._warm or self._warm.settled else "Refining"

    def follow(self, place, milliseconds, only_moved):
        """Bring the mesh up to date; return whether there is more to do soon.

        only_moved: leave refining to another call. Raises LostError.
        """
        obj = self._body()
        if obj.mode != "OBJECT":
            self._paused = True
            return False
        try:
            moved = self._aim(place, obj)
            if self._warm and (moved or not (only_moved or self._warm.settled)):
                self._write(obj, self._warm.advance(milliseconds))
        except UserError as error:
            self._failed = time.monotonic()
            self.problem = str(error)
            return False
        return bool(self._worker) or (self._warm is not None and not self._warm.settled)

    def stop(self):
        """End preparing, if it still runs."""
        if self._worker:
            self.stages.cancel()
            self._worker.wait()

    def _body(self):
        obj = snapshot.body(self.name)
        if obj is None:
            raise LostError(f"{self.name}: it is gone, so Live ended.")
        if shape_keys.find(obj, shape_keys.PREVIEW) is None:
            raise LostError(f"{self.name}: its key '{shape_keys.PREVIEW}' is gone: Live ended.")
        if self._paused and obj.mode == "OBJECT" and self._was_edited(obj):
            raise LostError(
                f"{self.name}: key '{shape_keys.PREVIEW}' was edited, so Live ended and left it."
            )
        return obj

    def _was_edited(self, obj):
        """Return whether someone changed the preview itself; an edited Basis takes it along."""
        return not shape_keys.is_ours(obj, shape_keys.PREVIEW) and self._has_same_rest(obj)

    def _has_same_rest(self, obj):
        known = self._warm and self._warm.rest.positions
        return known is not None and np.array_equal(mesh_data.rest_positions(obj), known)

    def _aim(self, place, obj):
        """Give the solver what changed; return whether something did."""
        if self._worker:
            return self._adopt()
        world = place.world_matrix(obj)
        if self._is_outdated(obj, world):
            self.make(place, obj, wait=bpy.app.background)
            return self._warm is not None
        if self._warm is None:
            return False
        found = motions.collect(place, obj, world, self._vertices)
        self._failed, self.problem = 0.0, ""
        options, blend = collecting.options_of(obj), _blend_settings(obj, world)
        matrices = [motion.matrix for motion in found]
        seen = [
            self._changes("_options", options, lambda: self._warm.set_options(options)),
            self._changes(
                "_blend",
                blend,
                lambda: self._warm.set_blend(collecting.blend_of(obj, world), found),
            ),
            self._changes("_matrices", matrices, lambda: self._warm.aim(found)),
        ]
        return any(seen)

    def _changes(self, name, new, act):
        """Call `act` if attribute `name` is not `new` yet; return whether it was."""
        if _equal(getattr(self, name), new):
            return False
        act()
        setattr(self, name, new)
        return True

    def _is_outdated(self, obj, world):
        """Return whether the solver is to be made (anew): the mesh, its scale or its handles."""
        now = time.monotonic()
        if now - self._failed < CHECK_SECONDS and self._failed:
            return False
        if self._warm is None or self._made_for != _bound_to(obj):
            return True
        if len(obj.data.vertices) != len(self._warm.rest.positions):
            return True
        stretch = space.solve_stretch(world, self.name)
        if not np.array_equal(stretch, self._warm.rest.stretch):
            if not np.array_equal(stretch, self._stretch):
                self._stretch, self._stretched = stretch, now
            return bpy.app.background or now - self._stretched > REST_SECONDS
        if self._paused or (self._warm.settled and now - self._checked > CHECK_SECONDS):
            self._checked = now
            was_paused, self._paused = self._paused, False
            # In other modes a group may have changed without a trace in the shape.
            return was_paused or not self._has_same_rest(obj)
        return False

    def make(self, place, obj, wait):
        """Make the solver for obj as it is, on a thread or, with wait, at once."""
        self._paused, self._warm = False, None
        inputs = collecting.collect_pose(place, obj)
        self._made_for, self._options = _bound_to(obj), inputs.options
        self._blend = _blend_settings(obj, place.world_matrix(obj))
        self._vertices = {motion.name: motion.vertices for motion in inputs.motions}
        self._matrices = [motion.matrix for motion in inputs.motions]
        stages = self.stages = Stages()
        self._worker = Worker(lambda stages: Warm(inputs, stages), stages)
        if wait:
            self._worker.wait()
            self._adopt()

    def _adopt(self):
        """Take what the worker made, if it is done; return whether it is."""
        if self._worker.is_alive():
            return False
        worker, self._worker = self._worker, None
        self._warm = worker.result()
        self._failed, self.problem = 0.0, ""
        mesh = self._warm.mesh
        status.remember(self._warm.rest, mesh.seconds, [note.message for note in mesh.notes])
        return True

    def _write(self, obj, positions):
        shape_keys.rewrite(obj, shape_keys.PREVIEW, positions)
        if distortion.is_shown(obj):
            self._colour(obj, positions)

    def _colour(self, obj, positions):
        """Show the distortion: at every call where that is quick, else when the pose is settled."""
        if self._colouring > COLOUR_SECONDS and not self._warm.settled:
            return
        start = time.perf_counter()
        distortion.update(obj, self._warm.rest, positions)
        self._colouring = time.perf_counter() - start
