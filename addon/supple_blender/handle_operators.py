# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that make, find and remove handles."""

import bpy
from bpy.props import EnumProperty, IntProperty, StringProperty

from . import compat, distortion, handle_sources, handles, live, motion_handles, shape_keys
from .background import LongOperator
from .errors import UserError, count, some
from .pose_operators import active_body, find_unchanged
from .properties import KINDS


def names_in(text):
    """Return the parts of a text that commas separate."""
    return [name.strip() for name in text.split(",") if name.strip()]


def _keep_active(context, obj):
    """Make obj the active object where that was an Empty that is gone now."""
    if context.view_layer.objects.active is None and obj.name in context.view_layer.objects:
        context.view_layer.objects.active = obj
        obj.select_set(True)


class HandleOperator:
    """Mixin: `change` does the work and returns the message; its UserError becomes a report."""

    bl_options = {"REGISTER", "UNDO"}

    def body(self, context):
        """Return the mesh object meant."""
        return active_body(context)

    def execute(self, context):
        try:
            level, message = self.change(context, self.body(context))
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
        held = names_in(self.held) or None
        added, left_out = handles.create(context, obj, names_in(self.groups), held)
        obj.supple.active_handle = len(obj.supple.handles) - 1
        text = f"{obj.name}: {count(len(added), 'handle', 'handles')} added"
        if left_out:
            return "WARNING", f"{text}; left out, with no vertices: {some(left_out)}"
        return "INFO", text


class SUPPLE_OT_handles_from_selection(HandleOperator, bpy.types.Operator):
    """Make a handle of the vertices selected in Edit Mode, with a vertex group and an Empty"""

    bl_idname = "supple.handles_from_selection"
    bl_label = "Selection"

    name: StringProperty(name="Name", default="Handle", options={"SKIP_SAVE"})
    kind: EnumProperty(name="Kind", items=KINDS, default="MOVED", options={"SKIP_SAVE"})

    def change(self, context, obj):
        name = handle_sources.from_selection(context, obj, self.name, self.kind)
        obj.supple.active_handle = len(obj.supple.handles) - 1
        return "INFO", f"{obj.name}: handle '{name}' added"


class SUPPLE_OT_handles_from_bones(HandleOperator, bpy.types.Operator):
    """Make a handle of each bone's vertex group: the selected bones in Pose Mode, else all"""

    bl_idname = "supple.handles_from_bones"
    bl_label = "Bones"

    armature: StringProperty(
        name="Armature",
        description="The armature object; empty for the mesh's own",
        options={"SKIP_SAVE"},
    )
    bones: StringProperty(
        name="Bones",
        description="Bones, separated by commas; empty for the selected ones, or all",
        options={"SKIP_SAVE"},
    )
    held: StringProperty(
        name="Held", description="Bones to hold, separated by commas", options={"SKIP_SAVE"}
    )

    def body(self, context):
        obj = context.object
        if obj is not None and obj.type == "ARMATURE":
            return handle_sources.body_of_armature(context, obj)
        return active_body(context)

    def change(self, context, obj):
        armature = bpy.data.objects.get(self.armature) if self.armature else None
        if self.armature and (armature is None or armature.type != "ARMATURE"):
            raise UserError(f"{obj.name}: there is no armature '{self.armature}'.")
        if armature is None and context.object.type == "ARMATURE":
            armature = context.object
        added, left_out = handle_sources.from_bones(
            context, obj, armature, names_in(self.bones), names_in(self.held)
        )
        text = f"{obj.name}: {count(len(added), 'handle', 'handles')} added"
        if left_out:
            limit = handle_sources.BONE_WEIGHT
            text += f"; left out, with no vertices of weight {limit} or more: {some(left_out)}"
        twice = handle_sources.also_deformed_by(obj)
        if twice:
            text += f". Modifier {some(twice)} moves it too: switch that off in viewports"
        return ("WARNING" if left_out or twice else "INFO"), text


class SUPPLE_OT_propose_handles(HandleOperator, bpy.types.Operator):
    """Spread handles over the mesh, each with an Empty and a vertex group of its own"""

    bl_idname = "supple.propose_handles"
    bl_label = "Propose"

    count: IntProperty(name="Handles", default=12, min=1, soft_max=100)

    def change(self, context, obj):
        names = handle_sources.propose(context, obj, self.count)
        obj.supple.active_handle = len(obj.supple.handles) - 1
        return "INFO", f"{obj.name}: {count(len(names), 'handle', 'handles')} added"


class SUPPLE_OT_handles_from_motion(LongOperator, bpy.types.Operator):
    """Make handles where the mesh moves most from its rest shape to this frame, or to the other selected mesh, each moved there"""  # noqa: E501

    bl_idname = "supple.handles_from_motion"
    bl_label = "Motion"
    bl_options = {"REGISTER", "UNDO"}

    count: IntProperty(name="Handles", default=16, min=1, soft_max=100)

    def collect(self, context):
        obj = active_body(context)
        others = [o for o in context.selected_objects if o.type == "MESH" and o != obj]
        if len(others) > 1:
            raise UserError(f"{obj.name}: select one other mesh, or none, not {len(others)}.")
        return motion_handles.collect(context, obj, others[0] if others else None, self.count)

    def compute(self, inputs, stages):
        return motion_handles.find(inputs, stages)

    def write(self, context, inputs, result):
        obj = find_unchanged(inputs.name, inputs.rest)
        names = motion_handles.create(context, obj, inputs, result)
        obj.supple.active_handle = len(obj.supple.handles) - 1
        return (
            "INFO",
            f"{obj.name}: {count(len(names), 'handle', 'handles')} moved as the mesh moves",
        )


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
        _keep_active(context, obj)
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
        _keep_active(context, obj)
        return "INFO", f"{obj.name}: handles removed"


class SUPPLE_OT_handle_select(HandleOperator, bpy.types.Operator):
    """Select the Empty or the bone of a handle, ready for G, R or S"""

    bl_idname = "supple.handle_select"
    bl_label = "Select Handle"

    name: StringProperty(name="Handle", options={"SKIP_SAVE"})

    def change(self, context, obj):
        row = obj.supple.handles.get(self.name)
        carrier = (row.armature if row.bone else row.empty) if row else None
        if carrier is None or carrier.name not in context.view_layer.objects:
            what = "armature" if row and row.bone else "Empty"
            raise UserError(
                f"{obj.name}: handle '{self.name}' has no {what} in this view layer. "
                "Remove the handle, then add its group again."
            )
        if context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        for other in context.selected_objects:
            other.select_set(False)
        carrier.select_set(True)
        context.view_layer.objects.active = carrier
        if row.bone:
            bpy.ops.object.mode_set(mode="POSE")
            for bone in carrier.pose.bones:
                compat.select_bone(bone, bone.name == row.bone)
            carrier.data.bones.active = carrier.data.bones.get(row.bone)
        return "INFO", f"'{row.bone or carrier.name}' selected"


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
        SUPPLE_OT_handles_from_selection,
        SUPPLE_OT_handles_from_bones,
        SUPPLE_OT_propose_handles,
        SUPPLE_OT_handles_from_motion,
        SUPPLE_OT_handle_remove,
        SUPPLE_OT_handles_clear,
        SUPPLE_OT_handle_select,
        SUPPLE_OT_rebind,
    )
)
