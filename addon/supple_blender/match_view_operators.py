# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that show a match: as colours, and one vertex's partner."""

import bpy
from bpy.props import BoolProperty, IntProperty

from . import handles, match_map, match_show, match_solving, mesh_data, space
from .errors import UserError
from .match_operators import PairOperator


def selected_vertex(obj):
    """Return the one vertex of mesh object obj that is selected, or raise UserError."""
    found = mesh_data.selected_vertices(obj)
    if len(found) != 1:
        raise UserError(
            f"{obj.name}: {len(found):,} vertices are selected. Select exactly one in Edit Mode."
        )
    return int(found[0])


class SUPPLE_OT_match_show(PairOperator, bpy.types.Operator):
    """Colour the source by place and the target by where its vertices belong; grey is uncertain"""

    bl_idname = "supple.match_show"
    bl_label = "Show"

    show: BoolProperty(name="Show", default=True, options={"SKIP_SAVE"})

    def change(self, context, pair):
        target = pair[1]
        if not self.show:
            mesh_data.require_writable(pair[0])
            mesh_data.leave_modes(context, *pair)
            match_show.hide(*pair)
            return "INFO", f"{target.name}: match not shown"
        match_show.show(context, *pair)
        view = context.space_data
        if view is not None and view.type == "VIEW_3D":
            match_show.view(*pair, view)
        return "INFO", f"{target.name}: match in colour attribute '{match_show.ATTRIBUTE}'"


class SUPPLE_OT_match_partner(PairOperator, bpy.types.Operator):
    """Put the 3D Cursor where the selected vertex of the target belongs on the source"""

    bl_idname = "supple.match_partner"
    bl_label = "Show Partner"

    vertex: IntProperty(
        name="Vertex",
        description="A vertex of the target; -1 for the selected one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )

    def change(self, context, pair):
        source, target = pair
        source_rest, target_rest = match_solving.fitting(context, source, target)
        vertex = selected_vertex(target) if self.vertex < 0 else self.vertex
        if vertex >= len(target_rest.positions):
            raise UserError(f"{target.name}: it has no vertex {vertex}.")
        kept = match_map.read(target)
        face = int(kept.surface_map.face[vertex])
        if face < 0:
            raise UserError(f"{target.name}: vertex {vertex} has no partner on '{source.name}'.")
        weights = kept.surface_map.weights[vertex]
        corners = source_rest.triangles[face]
        point = weights @ source_rest.positions[corners]
        world = handles.world_matrix(context, source)
        context.scene.cursor.location = space.to_world_points(world, point[None])[0]
        nearest = int(corners[weights.argmax()])
        confidence = f"confidence {kept.confidence[vertex]:.2f}"
        where = f"nearest vertex {nearest} of '{source.name}'"
        return (
            "INFO",
            f"{target.name}: vertex {vertex} belongs at the cursor, {where}, {confidence}",
        )


register, unregister = bpy.utils.register_classes_factory(
    (SUPPLE_OT_match_show, SUPPLE_OT_match_partner)
)
