# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading what an object's modifiers make of its vertices, up to where the vertex order is kept.

Supple's own modifiers, and those after that place, are switched off while it is read.
"""

import re

import bpy
import numpy as np

from . import compat
from .errors import UserError, count

# Names of Supple's modifiers: the baked result, the preview while scrubbing, and in-betweens.
RESULT, PREVIEW, INBETWEEN = "Supple Sequence", "Supple Sequence Preview", "Supple In-betweens"
OURS = (RESULT, PREVIEW)
# Of shape keys for frames: 'Sequence 0012'.
SEQUENCE_KEYS, INBETWEEN_KEYS = "Sequence", "Between"

# These move vertices and never add or remove one.
DEFORMING = {
    *("ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE"),
    *("MESH_DEFORM", "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH"),
    *("LAPLACIANSMOOTH", "SURFACE_DEFORM", "WARP", "WAVE", "MESH_CACHE", "CLOTH", "SOFT_BODY"),
    *("DATA_TRANSFER", "NORMAL_EDIT", "WEIGHTED_NORMAL", "UV_PROJECT", "UV_WARP"),
    *("VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY"),
}


def _curve(obj, path):
    """Return the F-curve of a data path of obj, or None."""
    return next((curve for curve in compat.curves_of(obj) if curve.data_path == path), None)


def _key(obj, name):
    keys = obj.data.shape_keys
    return keys.key_blocks.get(name) if keys else None


def visibility_paths(modifier_name):
    """Return the data paths of a modifier's visibility, on its object."""
    name = bpy.utils.escape_identifier(modifier_name)
    return [f'modifiers["{name}"].{shown}' for shown in ("show_viewport", "show_render")]


def recorded_keys(obj, prefix):
    """Return the names of shape keys that Supple wrote for frames: 'Sequence 0012'."""
    keys = obj.data.shape_keys
    pattern = re.compile(rf"{re.escape(prefix)} -?\d+")
    recorded = (record.name for record in obj.supple.keys)
    return [n for n in recorded if keys and n in keys.key_blocks and pattern.fullmatch(n)]


class MovingMesh:
    """A context in which the vertices of obj can be read at any frame, as animated.

    Entering finds how many leading modifiers keep the vertex order; what they are followed by, and
    what Supple made of the sequence before, is off. Leaving puts everything back, and with
    keep_frame=False the frame. bare: read the mesh before all modifiers. Raises UserError.

    after: the name of the modifier that the result comes after, '' to come first. skipped: names of
    modifiers after that place that deform, too.
    """

    def __init__(self, context, obj, keep_frame=False, bare=False):
        self._keeps_frame, self._bare = keep_frame, bare
        self._scene, self._layer = context.scene, context.view_layer
        self._name = obj.name
        self._restore = []
        self._count = len(obj.data.vertices)
        self.after, self.skipped = "", []

    @property
    def obj(self):
        return bpy.data.objects[self._name]

    def __enter__(self):
        obj = self.obj
        if obj.mode == "EDIT":
            raise UserError(f"{obj.name}: it is in Edit Mode. Leave it (Tab) first.")
        if not obj.visible_get(view_layer=self._layer):
            raise UserError(
                f"{obj.name}: it is hidden in this view layer, so Blender does not move it. "
                "Show it first (the eye in the Outliner)."
            )
        if self._scene.render.frame_map_old != self._scene.render.frame_map_new:
            raise UserError(
                f"{obj.name}: the scene's time is remapped. Set Old and New to one value "
                "(Properties > Output > Time Stretching), or bake in another scene."
            )
        self._frame = self._scene.frame_current_final
        try:
            self._switch_off_ours(obj)
            self._find_kept(obj)
        except BaseException:
            self._leave()
            raise
        return self

    def __exit__(self, *_):
        self._leave()

    # Whatever is changed is found by its name again: an undo, or a bake, may have replaced it.

    def _set(self, find, attribute, value):
        owner = find(self.obj)
        before = getattr(owner, attribute)
        if before != value:
            self._restore.append((find, attribute, before))
            setattr(owner, attribute, value)

    def _off(self, name):
        for path in visibility_paths(name):
            if _curve(self.obj, path):
                self._set(lambda obj, path=path: _curve(obj, path), "mute", True)
        self._set(lambda obj: obj.modifiers.get(name), "show_viewport", False)

    def _switch_off_ours(self, obj):
        for modifier in obj.modifiers:
            if modifier.name in OURS or self._bare:
                self._off(modifier.name)
        for prefix in (SEQUENCE_KEYS, INBETWEEN_KEYS) if self._bare else (SEQUENCE_KEYS,):
            for name in recorded_keys(obj, prefix):
                self._set(lambda obj, name=name: _key(obj, name), "mute", True)

    def _find_kept(self, obj):
        kept = [m.name for m in obj.modifiers if m.show_viewport and m.name not in OURS]
        off = []
        for index, modifier in enumerate(obj.modifiers):
            keyed = any(_curve(obj, path) for path in visibility_paths(modifier.name))
            if keyed and modifier.name not in OURS and modifier.type not in DEFORMING:
                # On at some frames: what it adds would be found there.
                later = [m.name for m in obj.modifiers[index:]]
                off = [name for name in kept if name in later]
                kept = [name for name in kept if name not in later]
                self._off(modifier.name)
                break
        for name in off:
            self._off(name)
        self._layer.update()
        while self._evaluated_count() != self._count:
            if not kept:
                raise UserError(
                    f"{obj.name}: Blender shows {self._evaluated_count():,} vertices of its "
                    f"{self._count:,} even without modifiers. Is it hidden or edited elsewhere?"
                )
            off.insert(0, kept.pop())
            self._off(off[0])
            self._layer.update()
        self.after = kept[-1] if kept else ""
        types = {m.name: m.type for m in obj.modifiers}
        self.skipped = [name for name in off if types[name] in DEFORMING]
        self.may_change_count = any(types[name] not in DEFORMING for name in kept)

    def _leave(self):
        while self._restore:
            find, attribute, value = self._restore.pop()
            obj = bpy.data.objects.get(self._name)
            owner = find(obj) if obj else None
            if owner is not None:
                setattr(owner, attribute, value)
        if not self._keeps_frame:
            whole = int(np.floor(self._frame))
            self._scene.frame_set(whole, subframe=self._frame - whole)

    def _mesh(self):
        depsgraph = self._layer.depsgraph
        return self.obj.evaluated_get(depsgraph).data

    def _evaluated_count(self):
        return len(self._mesh().vertices)

    def go_to(self, frame):
        """Evaluate the scene at an integral frame."""
        self._scene.frame_set(frame)

    def positions(self):
        """Return the vertices (n, 3) float32, local, at the frame gone to."""
        mesh = self._mesh()
        if len(mesh.vertices) != self._count:
            raise UserError(
                f"{self._name}: at frame {self._scene.frame_current} it has "
                f"{count(len(mesh.vertices), 'vertex', 'vertices')} and {self._count:,} at rest. "
                "A sequence needs the same vertices in every frame; leave that frame out of the "
                "range, or switch off the modifier that adds or removes them."
            )
        positions = np.empty(3 * self._count, dtype=np.float32)
        mesh.vertices.foreach_get("co", positions)
        if not np.isfinite(positions).all():
            raise UserError(
                f"{self._name}: at frame {self._scene.frame_current} a vertex has a position that "
                "is not a number. Repair the animation there, or leave the frame out of the range."
            )
        return positions.reshape(-1, 3)

    def check_counts(self, frames):
        """Find a change of the vertex count before any work: yields after each frame looked at."""
        if not self.may_change_count:
            return
        for frame in frames:
            self.go_to(frame)
            self.positions()
            yield
