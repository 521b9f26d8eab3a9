# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators for landmarks, the pairs of vertices that a match can start from."""

import bpy
from bpy.props import IntProperty

from . import mesh_data
from .errors import UserError, count
from .handle_operators import HandleOperator
from .match_operators import PairOperator
from .match_view_operators import selected_vertex


def require_new(settings, source, target, source_vertex, target_vertex):
    """Raise UserError where a vertex is not there or is in a row already; None is not asked for."""
    given = ((source, source_vertex, "source_vertex"), (target, target_vertex, "target_vertex"))
    for obj, vertex, which in given:
        if vertex is None:
            continue
        if not 0 <= vertex < len(obj.data.vertices):
            last = len(obj.data.vertices) - 1
            raise UserError(f"{obj.name}: it has no vertex {vertex}; its last is {last}.")
        for number, row in enumerate(settings.pairs, 1):
            if getattr(row, which) == vertex:
                raise UserError(
                    f"{obj.name}: vertex {vertex} is in pair {number} already. "
                    "Remove that pair first."
                )


def add_pair(settings, source_vertex, target_vertex):
    """Add a row. Call `require_new` before."""
    row = settings.pairs.add()
    row.source_vertex, row.target_vertex = source_vertex, target_vertex
    settings.active_pair = len(settings.pairs) - 1


class LandmarkOperator(HandleOperator):
    """Mixin for operators on the rows: `change(context, settings)`."""

    def body(self, context):
        return context.scene.supple_match


class SUPPLE_OT_landmark_add(PairOperator, bpy.types.Operator):
    """Add the vertex selected on the source and the one selected on the target as a pair"""

    bl_idname = "supple.landmark_add"
    bl_label = "Add Pair"

    source_vertex: IntProperty(
        name="Source Vertex",
        description="-1 for the selected one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )
    target_vertex: IntProperty(
        name="Target Vertex",
        description="-1 for the selected one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )

    def change(self, context, pair):
        vertices = [
            selected_vertex(obj) if given < 0 else given
            for obj, given in zip(pair, (self.source_vertex, self.target_vertex), strict=True)
        ]
        settings = context.scene.supple_match
        require_new(settings, *pair, *vertices)
        mesh_data.leave_modes(context)
        add_pair(settings, *vertices)
        number = count(len(settings.pairs), "pair", "pairs")
        return "INFO", f"{pair[1].name}: vertex {vertices[1]} paired; {number} now"


class SUPPLE_OT_landmark_remove(LandmarkOperator, bpy.types.Operator):
    """Remove the pair of the active row"""

    bl_idname = "supple.landmark_remove"
    bl_label = "Remove Pair"

    number: IntProperty(
        name="Pair",
        description="Counted from 1; 0 for the active row",
        default=0,
        min=0,
        options={"SKIP_SAVE"},
    )

    def change(self, context, settings):
        index = self.number - 1 if self.number else settings.active_pair
        if not 0 <= index < len(settings.pairs):
            raise UserError(f"There is no pair {index + 1}; there are {len(settings.pairs)}.")
        mesh_data.leave_modes(context)
        settings.pairs.remove(index)
        settings.active_pair = max(0, min(settings.active_pair, len(settings.pairs) - 1))
        return "INFO", f"Pair {index + 1} removed"


class SUPPLE_OT_landmarks_clear(LandmarkOperator, bpy.types.Operator):
    """Remove all pairs"""

    bl_idname = "supple.landmarks_clear"
    bl_label = "Clear Pairs"

    def change(self, context, settings):
        mesh_data.leave_modes(context)
        settings.pairs.clear()
        settings.active_pair = 0
        return "INFO", "Pairs removed"


register, unregister = bpy.utils.register_classes_factory(
    (SUPPLE_OT_landmark_add, SUPPLE_OT_landmark_remove, SUPPLE_OT_landmarks_clear)
)
