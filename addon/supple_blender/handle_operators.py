# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that make, find and remove handles."""

import bpy
from bpy.props import StringProperty

from . import distortion, handles, live, shape_keys
from .errors import UserError, count, some
from .pose_operators import active_body


def _names(text):
    return [name.strip() for name in text.split(",") if name.strip()]


class HandleOperator:
    """Mixin: `change` does the work and returns the message; its UserError becomes a report."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        try:
            level, message = self.change(context, active_body(context))
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({level}, message)
        return {"FINISHED"}


class SUPPLE_OT_handles_from_groups(HandleOperator, bpy.types.Operator):
    """Make a handle with an Empty for each vertex group; those nearest the ground are held"""

    bl_idname = "supple.handles_from_groups"
    bl_label = "Groups"

    groups: StringProperty(
        name="Groups",
        description="Vertex groups to add, separated by commas; empty for all",
        options={"SKIP_SAVE"},
    )
    held: StringProperty(
        name="Held",
        description="Groups to hold, separated by commas; empty for those nearest the ground",
        options={"SKIP_SAVE"},
    )

    def change(self, context, obj):
        held = _names(self.held) or None
        added, left_out = handles.create(context, obj, _names(self.groups), held)
        obj.supple.active_handle = len(obj.supple.handles) - 1
        text = f"{obj.name}: {count(len(added), 'handle', 'handles')} added"
        if left_out:
            return "WARNING", f"{text}; left out, with no vertices: {some(left_out)}"
        return "INFO", text


class SUPPLE_OT_handle_remove(HandleOperator, bpy.types.Operator):
    """Remove a handle and its Empty; the vertex group stays"""

    bl_idname = "supple.handle_remove"
    bl_label = "Remove Handle"

    name: StringProperty(
        name="Handle",
        description="The handle to remove; empty for the active row",
        options={"SKIP_SAVE"},
    )

    def change(self, context, obj):
        rows = obj.supple.handles
        index = obj.supple.active_handle
        name = self.name or (rows[index].name if 0 <= index < len(rows) else "")
        handles.remove(obj, name)
        return "INFO", f"{obj.name}: handle '{name}' removed"


class SUPPLE_OT_handles_clear(HandleOperator, bpy.types.Operator):
    """Remove all handles, their Empties and the preview; baked shape keys stay"""

    bl_idname = "supple.handles_clear"
    bl_label = "Clear"

    def change(self, context, obj):
        if live.is_live(obj):
            live.end(keep=True)
        shape_keys.remove_preview(obj)
        if distortion.is_shown(obj):
            distortion.refresh(context, obj)
        handles.clear(obj)
        return "INFO", f"{obj.name}: handles removed"


class SUPPLE_OT_handle_select(HandleOperator, bpy.types.Operator):
    """Select the Empty of a handle, ready for G, R or S"""

    bl_idname = "supple.handle_select"
    bl_label = "Select Empty"

    name: StringProperty(name="Handle", options={"SKIP_SAVE"})

    def change(self, context, obj):
        row = obj.supple.handles.get(self.name)
        if row is None or row.empty is None or row.empty.name not in context.view_layer.objects:
            raise UserError(
                f"{obj.name}: handle '{self.name}' has no Empty in this view layer. "
                "Remove the handle, then add its group again."
            )
        if context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        for other in context.selected_objects:
            other.select_set(False)
        row.empty.select_set(True)
        context.view_layer.objects.active = row.empty
        return "INFO", f"'{row.empty.name}' selected"


class SUPPLE_OT_rebind(HandleOperator, bpy.types.Operator):
    """Fit the handles to the mesh as it is now, after vertices were added or removed"""

    bl_idname = "supple.rebind"
    bl_label = "Rebind"

    def change(self, context, obj):
        handles.rebind(context, obj)
        return "INFO", f"{obj.name}: handles fit its {len(obj.data.vertices):,} vertices now"


register, unregister = bpy.utils.register_classes_factory(
    (
        SUPPLE_OT_handles_from_groups,
        SUPPLE_OT_handle_remove,
        SUPPLE_OT_handles_clear,
        SUPPLE_OT_handle_select,
        SUPPLE_OT_rebind,
    )
)
