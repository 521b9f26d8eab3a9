# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that carry layers along a match, to one target or to many."""

from dataclasses import dataclass

import bpy

from . import match_batch, match_collect, transfer, transfer_collect, transfer_write
from .background import LongOperator
from .errors import UserError, count, some
from .pose_operators import find_unchanged


@dataclass(frozen=True)
class _Order:
    """A transfer to make; missing: nouns of what the source does not have."""

    inputs: transfer.TransferInput
    missing: list
    options: transfer_collect.Options

    @property
    def name(self):
        return self.inputs.name


class SUPPLE_OT_transfer(LongOperator, bpy.types.Operator):
    """Carry what is chosen from the source to the target, along their match"""

    bl_idname = "supple.transfer"
    bl_label = "Transfer"
    bl_options = {"REGISTER", "UNDO"}

    def collect(self, context):
        options = transfer_collect.options_of(context.scene)
        pair = match_collect.chosen(context)
        return _Order(*transfer_collect.collect(context, *pair, options), options)

    def compute(self, inputs, stages):
        return transfer.solve(inputs.inputs, stages)

    def write(self, context, inputs, result):
        source, target = (
            find_unchanged(rest.name, rest) for rest in (inputs.inputs.source, inputs.inputs.target)
        )
        options = inputs.options
        transfer_collect.require_free(source, target, inputs.inputs.layers, options.overwrite)
        transfer_write.write(context, source, target, result.layers, options)
        context.scene.supple_match.overwrite = False  # meant for one transfer
        text = transfer_write.summary(source, target, result.layers)
        if inputs.missing:
            return "WARNING", f"{text}. '{source.name}' has no {' and no '.join(inputs.missing)}"
        return "INFO", ". ".join([text, *result.notes])


class SUPPLE_OT_match_transfer_many(LongOperator, bpy.types.Operator):
    """Match every other selected mesh to the source and carry to it what is chosen"""

    bl_idname = "supple.match_transfer_many"
    bl_label = "Match and Transfer to Selected"
    bl_options = {"REGISTER", "UNDO"}

    def collect(self, context):
        source = match_collect.source_chosen(context)
        targets = match_collect.other_meshes(context, source)
        return match_batch.collect(
            context,
            source,
            targets,
            match_collect.options_of(context.scene),
            transfer_collect.options_of(context.scene),
        )

    def compute(self, inputs, stages):
        return match_batch.solve(inputs, stages)

    def write(self, context, inputs, result):
        done, failed = match_batch.write(context, inputs, result)
        if not done:
            raise UserError("; ".join(failed.values()))
        context.scene.supple_match.overwrite = False
        text = f"{inputs.name}: carried to {count(len(done), 'target', 'targets')}, {some(done, 8)}"
        if failed:
            return "WARNING", "; ".join([text, *failed.values()])
        return "INFO", text


register, unregister = bpy.utils.register_classes_factory(
    (SUPPLE_OT_transfer, SUPPLE_OT_match_transfer_many)
)
