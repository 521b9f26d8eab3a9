# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel "Sequence"."""

import bpy

from . import background, handles, native, sequence_frames, sequence_keys, sequence_output
from . import sequence_preview as preview
from .modifier_stack import INBETWEEN
from .panel import Sidebar, draw_text
from .sequence_operators import (
    SUPPLE_OT_inbetween,
    SUPPLE_OT_inbetween_remove,
    SUPPLE_OT_sequence_bake,
    SUPPLE_OT_sequence_clear,
    SUPPLE_OT_sequence_follow,
    SUPPLE_OT_sequence_key,
    SUPPLE_OT_sequence_preview,
    SUPPLE_OT_sequence_remove,
    SUPPLE_OT_sequence_show,
)


class SUPPLE_PT_sequence(Sidebar, bpy.types.Panel):
    bl_label = "Sequence"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        obj = handles.body_of(context.object)
        return obj is not None and obj.type == "MESH" and not native.problem()

    def draw(self, context):
        layout = self.layout
        layout.enabled = background.running is None
        obj = handles.body_of(context.object)
        body = obj.supple_sequence
        column = layout.column(align=True)
        row = column.row(align=True)
        row.prop(body, "first")
        row.prop(body, "last")
        row = column.row(align=True)
        row.prop(body, "ease_in", text="In")
        row.prop(body, "ease_out", text="Out")
        self._draw_keys(layout, context, obj)
        self._draw_output(layout, obj)

    def _draw_keys(self, layout, context, obj):
        if not obj.supple.handles:
            layout.label(text="Make handles in Pose first", icon="INFO")
            return
        travels = sequence_frames.travels(obj)
        icon = "CHECKMARK" if travels else "CON_FOLLOWTRACK"
        layout.operator(SUPPLE_OT_sequence_follow.bl_idname, icon=icon)
        row = layout.row(align=True)
        row.operator(SUPPLE_OT_sequence_key.bl_idname, text="Key", icon="KEY_HLT")
        row.operator(SUPPLE_OT_sequence_clear.bl_idname, icon="KEY_DEHLT")
        keyed = sequence_keys.frames(obj)
        shown = ", ".join(f"{frame:g}" for frame in keyed[:8]) + (" ..." if len(keyed) > 8 else "")
        layout.label(text=f"Keys at {shown}" if keyed else "No keys yet", icon="BLANK1")
        is_on = preview.is_on(obj)
        layout.operator(
            SUPPLE_OT_sequence_preview.bl_idname,
            icon="HIDE_OFF" if is_on else "HIDE_ON",
            depress=is_on,
        )
        problem = preview.running.problem if is_on else preview.ended
        if problem:
            draw_text(layout, problem, "ERROR")

    def _draw_output(self, layout, obj):
        body = obj.supple_sequence
        layout.row().prop(body, "output", expand=True)
        if body.output == "CACHE":
            layout.prop(body, "file", text="")
        layout.operator(SUPPLE_OT_sequence_bake.bl_idname, icon="RENDER_ANIMATION")
        shown = sequence_output.is_shown(obj)
        if shown is None:
            return
        row = layout.row(align=True)
        for text, value in (("Before", False), ("After", True)):
            button = row.operator(
                SUPPLE_OT_sequence_show.bl_idname, text=text, depress=shown is value
            )
            button.show = value
        row.operator(SUPPLE_OT_sequence_remove.bl_idname, text="", icon="X")


class SUPPLE_PT_inbetween(Sidebar, bpy.types.Panel):
    bl_label = "In-betweens"
    bl_parent_id = "SUPPLE_PT_sequence"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        layout.enabled = background.running is None
        obj = handles.body_of(context.object)
        body, keys = obj.supple_sequence, obj.data.shape_keys
        if keys is None:
            layout.label(text="The mesh has no shape keys", icon="INFO")
            return
        layout.prop_search(body, "from_key", keys, "key_blocks")
        layout.prop_search(body, "to_key", keys, "key_blocks")
        row = layout.row(align=True)
        row.operator(SUPPLE_OT_inbetween.bl_idname, text="Fill the Range", icon="IPO_EASE_IN_OUT")
        if INBETWEEN in obj.modifiers:
            row.operator(SUPPLE_OT_inbetween_remove.bl_idname, text="", icon="X")


register, unregister = bpy.utils.register_classes_factory((SUPPLE_PT_sequence, SUPPLE_PT_inbetween))
