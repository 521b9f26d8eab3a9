# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that make a map, refine it, turn it round, save it and load it."""

from dataclasses import replace
from pathlib import Path

import bpy
from bpy.props import StringProperty

from . import (
    match,
    match_collect,
    match_map,
    match_preview,
    match_show,
    match_solving,
    mesh_data,
    native,
)
from .background import LongOperator
from .errors import UserError
from .handle_operators import HandleOperator
from .pose_operators import find_unchanged

SUFFIX = ".supplemap"


class MatchOperator(LongOperator):
    """Solves a match of the chosen objects and keeps it. Subclasses say from where it starts.

    In a window, colours show what adapting features say so far.
    """

    _preview = None
    _view = None

    def how(self, context):
        raise NotImplementedError

    def collect(self, context):
        pair = match_collect.chosen(context)
        return match_collect.collect(context, *pair, self.how(context))

    def compute(self, inputs, stages):
        return match.solve(inputs, stages)

    def invoke(self, context, event):
        result = super().invoke(context, event)
        if result == {"RUNNING_MODAL"} and context.scene.supple_match.preview:
            self._view = context.space_data
            pair = match_collect.chosen(context)
            self._stages.learning.is_previewed = match_preview.is_possible(*pair, self._view)
        return result

    def watch(self, context):
        point_map = self._stages.learning.take()
        if point_map is None:
            return
        if self._preview is None:
            inputs = self._inputs
            self._preview = match_preview.Preview(inputs.source, inputs.target, self._view)
        self._preview.update(point_map)

    def _leave(self, context):
        if self._preview is not None:
            self._preview.end()
        super()._leave(context)

    def write(self, context, inputs, result):
        source = find_unchanged(inputs.source.name, inputs.source)
        target = find_unchanged(inputs.target.name, inputs.target)
        match_solving.keep(context, source, target, inputs, result)
        if match_show.is_shown(target):
            match_show.show(context, source, target)
        verb = "refined" if inputs.start == "CURRENT" else "matched"
        confidence = f"confidence {target.supple_map.confidence:.2f}"
        text = f"{target.name}: {verb} to '{source.name}', {confidence}"
        if not result.notes:
            return "INFO", text
        return "WARNING", " ".join([f"{text}.", *result.notes])


class SUPPLE_OT_match(MatchOperator, bpy.types.Operator):
    """Find for each vertex of the target where it belongs on the source"""

    bl_idname = "supple.match"
    bl_label = "Match"
    bl_options = {"REGISTER", "UNDO"}

    def how(self, context):
        return match_collect.options_of(context.scene)


class SUPPLE_OT_find_correspondence(MatchOperator, bpy.types.Operator):
    """Let learned features adapt to the two shapes, and match them by these, whatever Start says"""

    bl_idname = "supple.find_correspondence"
    bl_label = "Find Correspondence"
    bl_options = {"REGISTER", "UNDO"}

    def how(self, context):
        return replace(match_collect.options_of(context.scene), start=match.FEATURES)


class SUPPLE_OT_refine_match(MatchOperator, bpy.types.Operator):
    """Refine the match once more, from where it is"""

    bl_idname = "supple.refine_match"
    bl_label = "Refine"
    bl_options = {"REGISTER", "UNDO"}

    def how(self, context):
        return match_collect.Options(start="CURRENT")


class PairOperator(HandleOperator):
    """Mixin for operators on the chosen source and target: `change(context, pair)`."""

    def body(self, context):
        return match_collect.chosen(context)


class _MapFile:
    """Mixin: a file chooser for maps."""

    filepath: StringProperty(name="File", subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default=f"*{SUFFIX}", options={"HIDDEN"})

    def path(self, name):
        if not self.filepath or Path(bpy.path.abspath(self.filepath)).is_dir():
            raise UserError(f"{name}: no file is named. Give it a name.")
        return bpy.path.abspath(self.filepath)

    def ask(self, context):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SUPPLE_OT_match_load(_MapFile, MatchOperator, bpy.types.Operator):
    """Take the match from a file that was saved for these two meshes"""

    bl_idname = "supple.match_load"
    bl_label = "Load Match"
    bl_options = {"REGISTER", "UNDO"}

    def how(self, context):
        path = self.path(match_collect.chosen(context)[1].name)
        return match_collect.Options(start="FILE", refine=False, file=path)

    def invoke(self, context, event):
        return super().invoke(context, event) if self.filepath else self.ask(context)


class SUPPLE_OT_match_save(_MapFile, PairOperator, bpy.types.Operator):
    """Save the match to a file, which also knows the two meshes"""

    bl_idname = "supple.match_save"
    bl_label = "Save Match"
    bl_options = {"REGISTER"}

    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def change(self, context, pair):
        source, target = pair
        rests = match_solving.fitting(context, source, target)
        path = self.path(target.name)
        supple, kept = native.supple(), match_map.read(target)
        try:
            supple.save_map(path, kept.surface_map, *(match.arrays(r) for r in reversed(rests)))
        except supple.SuppleError as error:
            raise UserError(f"{target.name}: {error}") from error
        return "INFO", f"{target.name}: match saved to {path}"

    def invoke(self, context, event):
        if not self.filepath:
            names = [obj.name for obj in (match_collect.target_chosen(context),) if obj]
            self.filepath = f"{names[0] if names else 'match'}{SUFFIX}"
        return self.ask(context)


class SUPPLE_OT_match_swap(PairOperator, bpy.types.Operator):
    """Exchange source and target; their match and landmarks are turned round"""

    bl_idname = "supple.match_swap"
    bl_label = "Swap"

    def change(self, context, pair):
        source, target = pair
        turned = self._turned(context, source, target)
        mesh_data.leave_modes(context, source, target)
        if match_show.is_shown(target):
            match_show.hide(source, target)
        text = f"'{target.name}' is the source now, '{source.name}' the target"
        if turned:
            match_solving.keep(context, target, source, *turned)
            match_map.remove(target)
            text += "; their match is turned round"
        settings = context.scene.supple_match
        settings.source, settings.target = target, source
        for row in settings.pairs:
            row.source_vertex, row.target_vertex = row.target_vertex, row.source_vertex
        return "INFO", text

    def _turned(self, context, source, target):
        """Return the input and the Match the other way, or None where there is no match to turn."""
        if match_map.source_of(target) != source:
            return None
        rests = match_solving.fitting(context, source, target)
        match_map.require_writable(source)
        kept = match_map.read(target)
        found = match_solving.reversed_match(*rests, kept)
        return match.MatchInput(*reversed(rests), "CURRENT", refine=False), found


register, unregister = bpy.utils.register_classes_factory(
    (
        SUPPLE_OT_match,
        SUPPLE_OT_find_correspondence,
        SUPPLE_OT_refine_match,
        SUPPLE_OT_match_load,
        SUPPLE_OT_match_save,
        SUPPLE_OT_match_swap,
    )
)
