# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab "Supple"."""

import textwrap

import bpy

from . import background, compat, handles, native, status
from .handle_operators import (
    SUPPLE_OT_handle_remove,
    SUPPLE_OT_handle_select,
    SUPPLE_OT_handles_clear,
    SUPPLE_OT_handles_from_groups,
    SUPPLE_OT_rebind,
)
from .pose_operators import (
    SUPPLE_OT_bake,
    SUPPLE_OT_check_mesh,
    SUPPLE_OT_prepare,
    SUPPLE_OT_solve,
)


def _draw_text(layout, text, icon):
    """Draw a long message, wrapped to the sidebar's usual width."""
    column = layout.column(align=True)
    for index, line in enumerate(textwrap.wrap(text, 42)):
        column.label(text=line, icon=icon if index == 0 else "BLANK1")


class SUPPLE_UL_handles(bpy.types.UIList):
    """One row a handle: its group, its kind, a button that selects its Empty."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property):
        row = layout.row(align=True)
        row.label(text=item.name, icon="PINNED" if item.kind == "HELD" else "EMPTY_AXIS")
        row.prop(item, "kind", text="")
        row.operator(
            SUPPLE_OT_handle_select.bl_idname, text="", icon="RESTRICT_SELECT_OFF"
        ).name = item.name


class _Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Supple"


class SUPPLE_PT_mesh(_Sidebar, bpy.types.Panel):
    bl_label = "Mesh"

    def draw(self, context):
        layout = self.layout
        if native.problem():
            _draw_text(layout, native.problem(), "ERROR")
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
            _draw_text(layout, note, "INFO")


class SUPPLE_PT_pose(_Sidebar, bpy.types.Panel):
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
        row = layout.row(align=True)
        row.operator(SUPPLE_OT_handles_from_groups.bl_idname, icon="ADD")
        row.operator(SUPPLE_OT_handle_remove.bl_idname, text="", icon="REMOVE")
        row.operator(SUPPLE_OT_handles_clear.bl_idname, icon="X")
        if body.handles and body.bound_vertices != len(obj.data.vertices):
            _draw_text(layout, f"It had {body.bound_vertices:,} vertices before", "ERROR")
            layout.operator(SUPPLE_OT_rebind.bl_idname)
        layout.prop(body, "stiffness", slider=True)
        self._draw_key(layout, obj)

    def _draw_key(self, layout, obj):
        name = obj.supple.key_name
        keys = obj.data.shape_keys
        row = layout.row()
        row.prop(obj.supple, "key_name", text="Key")
        column = layout.column(align=True)
        column.operator(SUPPLE_OT_solve.bl_idname)
        bake = column.operator(SUPPLE_OT_bake.bl_idname, text="Bake")
        bake.name = name
        bake.overwrite = obj.supple.overwrite
        if keys and name in keys.key_blocks:
            layout.prop(obj.supple, "overwrite", text=f"Overwrite '{name}'")


register, unregister = bpy.utils.register_classes_factory(
    (SUPPLE_UL_handles, SUPPLE_PT_mesh, SUPPLE_PT_pose)
)
