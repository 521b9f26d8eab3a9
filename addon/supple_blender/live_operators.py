# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that start and end Live, and that show distortion; the keys that end Live."""

import bpy
from bpy.props import BoolProperty

from . import distortion, live, motions, native
from .errors import UserError
from .handle_operators import HandleOperator
from .pose_operators import active_body


class SUPPLE_OT_live(bpy.types.Operator):
    """Let the mesh follow its handles while they are dragged or animated. Enter keeps the pose, Esc takes it back"""  # noqa: E501

    bl_idname = "supple.live"
    bl_label = "Live"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        return self._toggle(context, wait=True)

    def invoke(self, context, event):
        return self._toggle(context, wait=bpy.app.background)

    def _toggle(self, context, wait):
        try:
            obj = active_body(context)
            if live.is_live(obj):
                live.end(keep=True)
                return {"FINISHED"}
            native.supple()
            live.start(obj, motions.Place.of(context), wait)
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class SUPPLE_OT_live_keep(bpy.types.Operator):
    """End Live and keep the pose"""

    bl_idname = "supple.live_keep"
    bl_label = "End Live"
    bl_options = {"REGISTER"}  # no undo step: what there is to undo is the drags before it

    @classmethod
    def poll(cls, context):
        return live.running is not None

    def execute(self, context):
        name = live.running.name
        live.end(keep=True)
        self.report({"INFO"}, f"{name}: the pose is kept")
        return {"FINISHED"}


class SUPPLE_OT_live_cancel(bpy.types.Operator):
    """End Live and put the handles and the mesh back as they were before it"""

    bl_idname = "supple.live_cancel"
    bl_label = "Take Back Live"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return live.running is not None and not live.is_playing()

    def execute(self, context):
        name = live.running.name
        live.end(keep=False)
        self.report({"INFO"}, f"{name}: as it was before Live")
        return {"FINISHED"}


class SUPPLE_OT_distortion(HandleOperator, bpy.types.Operator):
    """Colour the mesh by how much the pose stretches it, in a colour attribute, or remove that"""

    bl_idname = "supple.distortion"
    bl_label = "Show Distortion"

    show: BoolProperty(name="Show", default=True, options={"SKIP_SAVE"})

    def change(self, context, obj):
        if not self.show and distortion.is_shown(obj):
            distortion.hide(obj)
        elif self.show and not distortion.is_shown(obj):
            distortion.show(context, obj)
        what = f"in colour attribute '{distortion.ATTRIBUTE}'" if self.show else "not shown"
        return "INFO", f"{obj.name}: distortion {what}"


class SUPPLE_OT_distortion_view(HandleOperator, bpy.types.Operator):
    """Show the distortion's colours in this 3D View"""

    bl_idname = "supple.distortion_view"
    bl_label = "Show in Viewport"

    @classmethod
    def poll(cls, context):
        return context.space_data is not None and context.space_data.type == "VIEW_3D"

    def change(self, context, obj):
        if not distortion.is_shown(obj):
            distortion.show(context, obj)
        distortion.view(obj, context.space_data)
        return "INFO", f"{obj.name}: this 3D View shows '{distortion.ATTRIBUTE}'"


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (
        SUPPLE_OT_live,
        SUPPLE_OT_live_keep,
        SUPPLE_OT_live_cancel,
        SUPPLE_OT_distortion,
        SUPPLE_OT_distortion_view,
    )
)

# What a drag or another tool does not take reaches these, wherever the mouse is in a 3D View.
KEYS = (
    ("RET", SUPPLE_OT_live_keep),
    ("NUMPAD_ENTER", SUPPLE_OT_live_keep),
    ("ESC", SUPPLE_OT_live_cancel),
)
_items = []


def register():
    _register_classes()
    live.register()
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is None:  # without a window
        return
    keymap = configuration.keymaps.new(name="3D View Generic", space_type="VIEW_3D")
    for key, operator in KEYS:
        _items.append((keymap, keymap.keymap_items.new(operator.bl_idname, key, "PRESS")))


def unregister():
    while _items:
        keymap, item = _items.pop()
        keymap.keymap_items.remove(item)
    live.unregister()
    _unregister_classes()
