# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators of the Sequence panel."""

import bpy
from bpy.props import BoolProperty, StringProperty

from . import (
    inbetween_bake,
    live,
    sequence_bake,
    sequence_frames,
    sequence_keys,
    sequence_output,
    sequence_preview,
)
from .errors import UserError, count
from .frame_work import FrameOperator
from .handle_operators import HandleOperator, names_in
from .modifier_stack import INBETWEEN
from .pose_operators import active_body
from .stages import FrameStages


class SUPPLE_OT_sequence_follow(FrameOperator, bpy.types.Operator):
    """Let the handles travel with the moving mesh over the range, so that each is where its vertices are"""  # noqa: E501

    bl_idname = "supple.sequence_follow"
    bl_label = "Handles Follow"
    bl_options = {"REGISTER", "UNDO"}

    def start(self, context):
        obj = active_body(context)
        sequence_preview.end()
        range = sequence_bake.range_of(obj)
        stages = FrameStages(len(range.frames), "Following")
        return obj.name, stages, sequence_frames.collect(context, obj, range, stages)

    def write(self, context, result):
        obj = bpy.data.objects[self._name]
        range = sequence_bake.range_of(obj)
        sequence_frames.attach(context, obj, range, result)
        handles = count(len(result), "handle follows", "handles follow")
        return "INFO", f"{obj.name}: {handles} the mesh, frames {range.first} to {range.last}"


class SUPPLE_OT_sequence_key(HandleOperator, bpy.types.Operator):
    """Key the corrections of all moved handles at this frame, as they are now"""

    bl_idname = "supple.sequence_key"
    bl_label = "Key Handles"

    def change(self, context, obj):
        frame = context.scene.frame_current
        sequence_keys.key(obj, frame)
        return "INFO", f"{obj.name}: its handles are keyed at frame {frame}"


class SUPPLE_OT_sequence_clear(HandleOperator, bpy.types.Operator):
    """Remove the keys of all handles at this frame"""

    bl_idname = "supple.sequence_clear"
    bl_label = "Clear"

    def change(self, context, obj):
        frame = context.scene.frame_current
        sequence_keys.clear(obj, frame)
        return "INFO", f"{obj.name}: the keys of its handles at frame {frame} are gone"


class SUPPLE_OT_sequence_preview(HandleOperator, bpy.types.Operator):
    """Show the corrected frame while you scrub and move handles; nothing of it is rendered or saved"""  # noqa: E501

    bl_idname = "supple.sequence_preview"
    bl_label = "Preview"
    bl_options = {"REGISTER"}

    def change(self, context, obj):
        if sequence_preview.is_on(obj):
            sequence_preview.end()
            return "INFO", f"{obj.name}: preview off"
        live.end(keep=True)
        sequence_preview.start(context, obj)
        return "INFO", f"{obj.name}: the corrected frames are shown while you scrub"


class SUPPLE_OT_sequence_bake(FrameOperator, bpy.types.Operator):
    """Correct every frame of the range and let the mesh show the result. Frames baked before from the same are not solved again"""  # noqa: E501

    bl_idname = "supple.sequence_bake"
    bl_label = "Bake"
    bl_options = {"REGISTER", "UNDO"}

    file: StringProperty(
        name="File",
        description="The PC2 file to write; empty for the one in the panel",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    overwrite: BoolProperty(
        name="Overwrite",
        description="Write over shape keys of the same names that Supple did not make",
        default=False,
        options={"SKIP_SAVE"},
    )
    stopped = "stopped; the frames that are done are kept, and Bake goes on from there"

    def start(self, context):
        obj = active_body(context)
        live.end(keep=True)
        sequence_preview.end()
        if self.file:
            obj.supple_sequence.file = self.file
        stages = FrameStages(len(sequence_bake.range_of(obj).frames))
        return obj.name, stages, sequence_bake.to_output(context, obj, stages, self.overwrite)

    def write(self, context, result):
        return "INFO", f"{self._name}: {sequence_bake.sentence(result)}"


class SUPPLE_OT_sequence_show(HandleOperator, bpy.types.Operator):
    """Show the baked result, or the animation as it was before"""

    bl_idname = "supple.sequence_show"
    bl_label = "After"

    show: BoolProperty(name="After", default=True, options={"SKIP_SAVE"})

    def change(self, context, obj):
        sequence_output.show(obj, self.show)
        what = "the corrected frames" if self.show else "the animation without the correction"
        return "INFO", f"{obj.name}: {what}"


class SUPPLE_OT_sequence_remove(HandleOperator, bpy.types.Operator):
    """Take the baked result off the mesh; the cache file and the keys of the handles stay"""

    bl_idname = "supple.sequence_remove"
    bl_label = "Remove Result"

    def change(self, context, obj):
        path = sequence_output.detach(obj)
        kept = f"; {path} is still there" if path else ""
        return "INFO", f"{obj.name}: as it was before{kept}"


class SUPPLE_OT_inbetween(FrameOperator, bpy.types.Operator):
    """Fill the range between shape keys: parts turn on arcs and keep their volume, as blending does not"""  # noqa: E501

    bl_idname = "supple.inbetween"
    bl_label = "In-betweens"
    bl_options = {"REGISTER", "UNDO"}

    keys: StringProperty(
        name="Shape Keys",
        description="The poses, separated by commas; empty for the two in the panel",
        options={"SKIP_SAVE"},
    )
    frames: StringProperty(
        name="Frames",
        description="A frame for each, separated by commas; empty to spread them over the range",
        options={"SKIP_SAVE"},
    )
    overwrite: BoolProperty(
        name="Overwrite",
        description="Write over shape keys of the same names that Supple did not make",
        default=False,
        options={"SKIP_SAVE"},
    )

    def start(self, context):
        obj = active_body(context)
        live.end(keep=True)
        body = obj.supple_sequence
        keys = names_in(self.keys) or [body.from_key, body.to_key]
        steps = max(1, len(keys) - 1)
        times = [body.first + round(k * (body.last - body.first) / steps) for k in range(len(keys))]
        if self.frames:
            times = _whole_numbers(obj, self.frames)
        inputs = inbetween_bake.collect(context, obj, keys, times)
        stages = FrameStages(len(inputs.frames), "Filling")
        work = inbetween_bake.to_output(context, obj, inputs, stages, self.overwrite)
        return obj.name, stages, work

    def write(self, context, result):
        return "INFO", f"{self._name}: in-betweens {result}"


def _whole_numbers(obj, text):
    try:
        return [int(part) for part in names_in(text)]
    except ValueError:
        raise UserError(
            f"{obj.name}: '{text}' must be whole numbers, separated by commas."
        ) from None


class SUPPLE_OT_inbetween_remove(HandleOperator, bpy.types.Operator):
    """Take the in-betweens off the mesh; the cache file stays"""

    bl_idname = "supple.inbetween_remove"
    bl_label = "Remove In-betweens"

    def change(self, context, obj):
        path = sequence_output.detach(obj, INBETWEEN)
        return "INFO", f"{obj.name}: as it was before; {path} is still there"


register, unregister = bpy.utils.register_classes_factory(
    (
        SUPPLE_OT_sequence_follow,
        SUPPLE_OT_sequence_key,
        SUPPLE_OT_sequence_clear,
        SUPPLE_OT_sequence_preview,
        SUPPLE_OT_sequence_bake,
        SUPPLE_OT_sequence_show,
        SUPPLE_OT_sequence_remove,
        SUPPLE_OT_inbetween,
        SUPPLE_OT_inbetween_remove,
    )
)
