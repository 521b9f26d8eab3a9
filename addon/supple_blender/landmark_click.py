# SPDX-License-Identifier: GPL-3.0-or-later
"""Clicking pairs of landmarks in a 3D View, one on the source, then one on the target."""

import bpy
from bpy_extras import view3d_utils

from . import landmark_marks, match_collect, mesh_data
from .background import redraw_sidebars
from .errors import UserError
from .landmark_operators import add_pair, require_new


def vertex_under(context, obj, place):
    """Return the vertex of mesh object obj nearest to what is seen of it at `place`, a pixel of the
    region, or None.
    """
    depsgraph = context.evaluated_depsgraph_get()
    region, view = context.region, context.region_data
    inverse = obj.evaluated_get(depsgraph).matrix_world.inverted_safe()
    origin = inverse @ view3d_utils.region_2d_to_origin_3d(region, view, place)
    direction = inverse.to_3x3() @ view3d_utils.region_2d_to_vector_3d(region, view, place)
    is_hit, point, _, _ = obj.evaluated_get(depsgraph).ray_cast(origin, direction)
    if not is_hit:
        return None
    vertices, _ = landmark_marks.seen_points(depsgraph, obj)
    return min(range(len(vertices)), key=lambda index: (vertices[index].co - point).length_squared)


class SUPPLE_OT_landmark_click(bpy.types.Operator):
    """Click a point on the source, then where it belongs on the target, as often as you like"""

    bl_idname = "supple.landmark_click"
    bl_label = "Click Pairs"
    bl_options = {"REGISTER"}  # each pair is an undo step of its own

    @classmethod
    def poll(cls, context):
        return context.space_data is not None and context.space_data.type == "VIEW_3D"

    def invoke(self, context, event):
        try:
            pair = match_collect.chosen(context)
            mesh_data.leave_modes(context, *pair)
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        settings = context.scene.supple_match
        settings.source, settings.target = pair  # what is selected may change in between
        landmark_marks.waiting = None
        self._say(context)
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in {"ESC", "RIGHTMOUSE", "RET", "NUMPAD_ENTER"} and event.value == "PRESS":
            return self._end(context)
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"}
        place = event.mouse_region_x, event.mouse_region_y
        region = context.region
        if not (0 <= place[0] < region.width and 0 <= place[1] < region.height):
            return {"PASS_THROUGH"}
        if any(self._covers(other, event) for other in context.area.regions if other != region):
            return {"PASS_THROUGH"}
        try:
            self._click(context, place)
        except UserError as error:
            self.report({"WARNING"}, str(error))
        self._say(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        self._end(context)

    @staticmethod
    def _covers(region, event):
        """Return whether a sidebar or header lies over the view where the mouse is."""
        x, y = event.mouse_x - region.x, event.mouse_y - region.y
        return 0 <= x < region.width and 0 <= y < region.height

    def _click(self, context, place):
        source, target = match_collect.chosen(context)
        settings = context.scene.supple_match
        first = landmark_marks.waiting
        found = vertex_under(context, source if first is None else target, place)
        if found is None:
            return
        if first is None:
            require_new(settings, source, target, found, None)
            landmark_marks.waiting = found
            return
        require_new(settings, source, target, first, found)
        add_pair(settings, first, found)
        landmark_marks.waiting = None
        bpy.ops.ed.undo_push(message="Add Pair")

    def _say(self, context):
        settings = context.scene.supple_match
        on = settings.source if landmark_marks.waiting is None else settings.target
        number = len(settings.pairs) + 1
        if on is not None:
            text = f"Pair {number}: click a point on '{on.name}'   Esc ends"
            context.workspace.status_text_set(text)
        redraw_sidebars(context)

    def _end(self, context):
        landmark_marks.waiting = None
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        redraw_sidebars(context)
        return {"FINISHED"}


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (SUPPLE_OT_landmark_click,)
)


def register():
    _register_classes()
    landmark_marks.register()


def unregister():
    landmark_marks.unregister()
    _unregister_classes()
