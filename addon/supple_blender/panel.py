# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab "Supple"."""

import textwrap

import bpy

from . import background, compat, distortion, handles, live, native, status
from .handle_operators import (
    SUPPLE_OT_handle_remove,
    SUPPLE_OT_handle_select,
    SUPPLE_OT_handles_clear,
    SUPPLE_OT_handles_from_bones,
    SUPPLE_OT_handles_from_groups,
    SUPPLE_OT_handles_from_motion,
    SUPPLE_OT_handles_from_selection,
    SUPPLE_OT_propose_handles,
    SUPPLE_OT_rebind,
)
from .live_operators import (
    SUPPLE_OT_distortion,
    SUPPLE_OT_distortion_view,
    SUPPLE_OT_live,
    SUPPLE_OT_live_keep,
)
from .pose_operators import (
    SUPPLE_OT_bake,
    SUPPLE_OT_check_mesh,
    SUPPLE_OT_prepare,
    SUPPLE_OT_solve,
)


def draw_text(layout, text, icon):
    """Draw a long message, wrapped to the sidebar's usual width."""
    column = layout.column(align=True)
    for index, line in enumerate(textwrap.wrap(text, 42)):
        column.label(text=line, icon=icon if index == 0 else "BLANK1")


class SUPPLE_UL_handles(bpy.types.UIList):
    """One row a handle: its kind, its group, its weight, a button that selects what moves it."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property):
        row = layout.row(align=True)
        row.prop(item, "kind", text="", icon_only=True)
        if item.bone:
            row.label(text=item.name, icon="BONE_DATA")
        else:
            row.label(text=item.name)
        weight = row.row(align=True)
        weight.scale_x = 0.6
        weight.prop(item, "weight", text="", slider=True)
        row.operator(
            SUPPLE_OT_handle_select.bl_idname, text="", icon="RESTRICT_SELECT_OFF"
        ).name = item.name


class Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Supple"


class SUPPLE_PT_mesh(Sidebar, bpy.types.Panel):
    bl_label = "Mesh"

    def draw(self, context):
        layout = self.layout
        if native.problem():
            draw_text(layout, native.problem(), "ERROR")
            return
        obj = handles.body_of(context.object)
        if obj is None or obj.type != "MESH":
            layout.label(text="Select a mesh object", icon="INFO")
            return
        ready = status.of(obj)
        row = layout.row()
        row.label(text=f"{obj.name}   {len(obj.data.vertices):,} vertices", icon="MESH_DATA")
        if background.running is not None:
            stages = background.running
            compat.draw_progress(layout, stages.fraction, stages.doing())
            layout.label(text=stages.left() or "Esc cancels")
            return
        text = f"Ready, {ready.seconds:.1f} s" if ready else "Prepare"
        row = layout.row(align=True)
        row.operator(SUPPLE_OT_prepare.bl_idname, text=text)
        row.operator(SUPPLE_OT_check_mesh.bl_idname)
        for note in ready.notes if ready else ():
            draw_text(layout, note, "INFO")


class SUPPLE_PT_pose(Sidebar, bpy.types.Panel):
    bl_label = "Pose"

    @classmethod
    def poll(cls, context):
        obj = handles.body_of(context.object)
        return obj is not None and obj.type == "MESH" and not native.problem()

    def draw(self, context):
        layout = self.layout
        layout.enabled = background.running is None
        obj = handles.body_of(context.object)
        body = obj.supple
        row = layout.row()
        row.template_list("SUPPLE_UL_handles", "", body, "handles", body, "active_handle", rows=4)
        column = row.column(align=True)
        column.operator(SUPPLE_OT_handle_remove.bl_idname, text="", icon="REMOVE")
        column.separator()
        column.operator(SUPPLE_OT_handles_clear.bl_idname, text="", icon="X")
        self._draw_sources(layout)
        if body.handles and body.bound_vertices != len(obj.data.vertices):
            draw_text(layout, f"It had {body.bound_vertices:,} vertices before", "ERROR")
            layout.operator(SUPPLE_OT_rebind.bl_idname)
        self._draw_look(layout, body)
        self._draw_live(layout, obj)
        self._draw_key(layout, obj)

    def _draw_sources(self, layout):
        column = layout.column(align=True)
        row = column.row(align=True)
        row.operator(SUPPLE_OT_handles_from_groups.bl_idname, icon="ADD")
        row.operator(SUPPLE_OT_handles_from_selection.bl_idname, icon="ADD")
        row = column.row(align=True)
        row.operator(SUPPLE_OT_handles_from_bones.bl_idname, icon="ADD")
        row.operator(SUPPLE_OT_propose_handles.bl_idname, text="Propose 12", icon="ADD").count = 12
        column.operator(SUPPLE_OT_handles_from_motion.bl_idname, icon="ADD").count = 16

    def _draw_look(self, layout, body):
        row = layout.split(factor=0.3)
        row.active = body.method == "SUPPLE"
        row.label(text="Natural")
        row = row.split(factor=0.74)
        row.prop(body, "stiffness", text="", slider=True)
        row.label(text="Stiff")
        layout.prop(body, "strength", slider=True)

    def _draw_live(self, layout, obj):
        is_live = live.is_live(obj)
        row = layout.row(align=True)
        row.scale_y = 1.3
        button = SUPPLE_OT_live_keep if is_live else SUPPLE_OT_live
        icon = "PAUSE" if is_live else "PLAY"
        row.operator(button.bl_idname, text="Live", icon=icon, depress=is_live)
        preview = row.row(align=True)
        preview.enabled = not is_live
        preview.operator(SUPPLE_OT_solve.bl_idname)
        if is_live:
            layout.label(text=live.running.doing, icon="INFO")
            layout.label(text="Enter keeps, Esc takes back")
            if live.running.problem:
                draw_text(layout, live.running.problem, "ERROR")
        elif live.ended:
            draw_text(layout, live.ended, "INFO")

    def _draw_key(self, layout, obj):
        name = obj.supple.key_name
        keys = obj.data.shape_keys
        row = layout.row()
        row.prop(obj.supple, "key_name", text="Key")
        bake = row.operator(SUPPLE_OT_bake.bl_idname, text="Bake")
        bake.name = name
        bake.overwrite = obj.supple.overwrite
        if keys and name in keys.key_blocks:
            layout.prop(obj.supple, "overwrite", text=f"Overwrite '{name}'")


class _PoseSettings(Sidebar):
    bl_parent_id = "SUPPLE_PT_pose"
    bl_options = {"DEFAULT_CLOSED"}


class SUPPLE_PT_look(_PoseSettings, bpy.types.Panel):
    bl_label = "Where and How"

    def draw(self, context):
        layout = self.layout
        layout.enabled = background.running is None
        layout.use_property_split = True
        layout.use_property_decorate = False
        obj = handles.body_of(context.object)
        layout.prop_search(obj.supple, "mask", obj, "vertex_groups")
        layout.prop(obj.supple, "falloff")
        layout.prop(obj.supple, "method")
        column = layout.column()
        column.active = obj.supple.method == "SUPPLE"
        column.prop(obj.supple, "network", text="Learned")
        column.prop(obj.supple, "keep_volume")


class SUPPLE_PT_distortion(_PoseSettings, bpy.types.Panel):
    bl_label = "Show Distortion"

    def draw_header(self, context):
        obj = handles.body_of(context.object)
        is_shown = distortion.is_shown(obj)
        icon = "CHECKBOX_HLT" if is_shown else "CHECKBOX_DEHLT"
        button = self.layout.operator(
            SUPPLE_OT_distortion.bl_idname, text="", icon=icon, emboss=False
        )
        button.show = not is_shown

    def draw(self, context):
        layout = self.layout
        obj = handles.body_of(context.object)
        layout.active = distortion.is_shown(obj)
        row = layout.row(align=True)
        for index in range(len(distortion.LEVELS)):
            row.prop(context.window_manager.supple_legend, f"colour_{index}", text="")
        row = layout.row(align=True)
        for level in distortion.LEVELS:
            row.label(text=f"{level:g}")
        row = layout.row()
        is_viewed = distortion.is_shown(obj) and distortion.is_viewed(obj, context.space_data)
        row.enabled = not is_viewed
        row.operator(SUPPLE_OT_distortion_view.bl_idname, icon="SHADING_SOLID")


register, unregister = bpy.utils.register_classes_factory(
    (
        SUPPLE_UL_handles,
        SUPPLE_PT_mesh,
        SUPPLE_PT_pose,
        SUPPLE_PT_look,
        SUPPLE_PT_distortion,
    )
)
