# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading what an object's modifiers make of its vertices, up to where the vertex order is kept.

Supple's own modifiers, and those after that place, are switched off while it is read.
"""

import bpy
import numpy as np

from . import compat
from .errors import UserError, count

# Names of Supple's modifiers: the baked result, the preview while scrubbing, and in-betweens.
RESULT, PREVIEW, INBETWEEN = "Supple Sequence", "Supple Sequence Preview", "Supple In-betweens"
OURS = (RESULT, PREVIEW)

# These move vertices and never add or remove one.
DEFORMING = {
    *("ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE"),
    *("MESH_DEFORM", "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH"),
    *("LAPLACIANSMOOTH", "SURFACE_DEFORM", "WARP", "WAVE", "MESH_CACHE", "CLOTH", "SOFT_BODY"),
    *("DATA_TRANSFER", "NORMAL_EDIT", "WEIGHTED_NORMAL", "UV_PROJECT", "UV_WARP"),
    *("VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY"),
}


def _is_visibility_of(curve, modifier):
    return curve.data_path in (
        f'modifiers["{modifier.name}"].show_viewport',
        f'modifiers["{modifier.name}"].show_render',
    )


class MovingMesh:
    """A context in which the vertices of obj can be read at any frame, as animated.

    Entering finds how many leading modifiers keep the vertex order (`kept`, an index into
    obj.modifiers); leaving puts every modifier back, and with keep_frame=False the frame where it
    was. bare: read the mesh before all modifiers. Raises UserError.
    """

    def __init__(self, context, obj, keep_frame=False, bare=False):
        self._keeps_frame, self._bare = keep_frame, bare
        self._scene, self._layer = context.scene, context.view_layer
        self._name = obj.name
        self._restore = []
        self.kept = 0
        self._count = len(obj.data.vertices)

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

    def _off(self, modifier):
        for curve in compat.curves_of(self.obj):
            if _is_visibility_of(curve, modifier) and not curve.mute:
                curve.mute = True
                self._restore.append((curve, "mute", False))
        self._restore.append((modifier, "show_viewport", modifier.show_viewport))
        modifier.show_viewport = False

    def _switch_off_ours(self, obj):
        for modifier in obj.modifiers:
            if modifier.name in OURS or self._bare:
                self._off(modifier)

    def _find_kept(self, obj):
        modifiers = [m for m in obj.modifiers if m.show_viewport]
        self._layer.update()
        while self._evaluated_count() != self._count:
            if not modifiers:
                raise UserError(
                    f"{obj.name}: Blender shows {self._evaluated_count():,} vertices of its "
                    f"{self._count:,} even without modifiers. Is it hidden or edited elsewhere?"
                )
            self._off(modifiers.pop())
            self._layer.update()
        self.kept = obj.modifiers.find(modifiers[-1].name) + 1 if modifiers else 0
        self.may_change_count = any(m.type not in DEFORMING for m in modifiers)

    def _leave(self):
        try:
            while self._restore:
                owner, name, value = self._restore.pop()
                setattr(owner, name, value)
        except ReferenceError:  # an undo or another file took them away
            return
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
