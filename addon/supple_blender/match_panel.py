# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel "Match" of the sidebar tab "Supple"."""

import bpy

from . import background, loss_curve, match_collect, match_map, match_show, native
from .landmark_click import SUPPLE_OT_landmark_click
from .landmark_operators import (
    SUPPLE_OT_landmark_add,
    SUPPLE_OT_landmark_remove,
    SUPPLE_OT_landmarks_clear,
)
from .match import FEATURES
from .match_operators import (
    SUPPLE_OT_find_correspondence,
    SUPPLE_OT_match,
    SUPPLE_OT_match_load,
    SUPPLE_OT_match_save,
    SUPPLE_OT_match_swap,
    SUPPLE_OT_refine_match,
)
from .match_view_operators import SUPPLE_OT_match_partner, SUPPLE_OT_match_show
from .panel import Sidebar, draw_text
from .transfer_operators import SUPPLE_OT_match_transfer_many, SUPPLE_OT_transfer

LABEL_WIDTH = 0.27  # of the sidebar


class SUPPLE_UL_pairs(bpy.types.UIList):
    """One row a pair: its number and the two vertices."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        layout.label(text=f"{index + 1}:  {item.source_vertex} - {item.target_vertex}")


class SUPPLE_PT_match(Sidebar, bpy.types.Panel):
    bl_label = "Match"

    @classmethod
    def poll(cls, context):
        return not native.problem()

    def draw(self, context):
        learning = background.running and background.running.learning
        if learning and learning.epochs:
            self._draw_learning(self.layout.box().column(align=True), learning)
        layout = self.layout.column()
        layout.enabled = background.running is None
        settings = context.scene.supple_match
        source = match_collect.source_chosen(context)
        target = match_collect.target_chosen(context)
        self._draw_objects(layout, settings, source, target)
        self._draw_start(layout, settings)
        kept = target is not None and match_map.source_of(target) == source is not None
        is_learned = settings.start == FEATURES
        row = layout.column(align=True) if is_learned else layout.row(align=True)
        row.scale_y = 1.3
        main = SUPPLE_OT_find_correspondence if is_learned else SUPPLE_OT_match
        row.operator(main.bl_idname)
        again = row.row(align=True)
        again.enabled = kept
        again.operator(SUPPLE_OT_refine_match.bl_idname)
        if kept:
            self._draw_map(layout, target)

    def _draw_learning(self, layout, learning):
        """Draw the losses so far."""
        layout.label(text=f"{len(learning.losses)} of {learning.epochs} epochs")
        if learning.losses:
            layout.label(text=loss_curve.curve(learning.losses))
            layout.label(text=loss_curve.figures(learning.losses))

    def _draw_objects(self, layout, settings, source, target):
        for name, obj in (("source", source), ("target", target)):
            row = self._labelled(layout, name.title())
            row.prop(settings, name, text="")
            if name == "target":
                row.operator(SUPPLE_OT_match_swap.bl_idname, text="", icon="ARROW_LEFTRIGHT")
            if getattr(settings, name) is None and obj is not None:
                self._labelled(layout, "").label(text=f"{obj.name}, selected")

    def _labelled(self, layout, text):
        """Return a row of the layout with a label before it."""
        split = layout.split(factor=LABEL_WIDTH, align=True)
        split.label(text=text)
        return split.row(align=True)

    def _draw_start(self, layout, settings):
        row = self._labelled(layout, "Start")
        row.prop(settings, "start", text="")
        row.operator(SUPPLE_OT_match_load.bl_idname, text="", icon="IMPORT")
        if settings.start == "FILE":
            layout.prop(settings, "file", text="")
        if settings.start == "LANDMARKS":
            layout.operator(SUPPLE_OT_landmark_click.bl_idname, icon="RESTRICT_SELECT_OFF")
            row = layout.row()
            row.template_list(
                "SUPPLE_UL_pairs", "", settings, "pairs", settings, "active_pair", rows=3
            )
            column = row.column(align=True)
            column.operator(SUPPLE_OT_landmark_add.bl_idname, text="", icon="ADD")
            column.operator(SUPPLE_OT_landmark_remove.bl_idname, text="", icon="REMOVE")
            column.operator(SUPPLE_OT_landmarks_clear.bl_idname, text="", icon="X")
        layout.prop(settings, "refine", text="Match, then refine")

    def _draw_map(self, layout, target):
        row = layout.row(align=True)
        shown = match_show.is_shown(target)
        show = row.operator(SUPPLE_OT_match_show.bl_idname, depress=shown, icon="COLOR")
        show.show = not shown
        row.operator(SUPPLE_OT_match_partner.bl_idname, text="Partner", icon="PIVOT_CURSOR")
        row.operator(SUPPLE_OT_match_save.bl_idname, text="", icon="EXPORT")
        layout.label(text=f"Confidence {target.supple_map.confidence:.2f}")
        if target.supple_map.notes:
            draw_text(layout, target.supple_map.notes, "ERROR")


class SUPPLE_PT_match_advanced(Sidebar, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = "SUPPLE_PT_match"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.scene.supple_match.start == FEATURES

    def draw(self, context):
        layout = self.layout
        layout.enabled = background.running is None
        layout.use_property_split = True
        layout.use_property_decorate = False
        settings = context.scene.supple_match
        layout.prop(settings, "epochs")
        layout.prop(settings, "preview")
        layout.prop(settings, "model")


class SUPPLE_PT_transfer(Sidebar, bpy.types.Panel):
    bl_label = "Transfer"
    bl_parent_id = "SUPPLE_PT_match"

    def draw(self, context):
        layout = self.layout
        layout.enabled = background.running is None
        settings = context.scene.supple_match
        layout.column_flow(columns=2, align=True).prop(settings, "transfer")
        if "KEYS" in settings.transfer:
            layout.prop(settings, "only_active_key")
            layout.prop(settings, "drivers")
        layout.prop(settings, "overwrite")
        row = layout.row()
        row.scale_y = 1.3
        row.operator(SUPPLE_OT_transfer.bl_idname)
        layout.operator(SUPPLE_OT_match_transfer_many.bl_idname)


register, unregister = bpy.utils.register_classes_factory(
    (SUPPLE_UL_pairs, SUPPLE_PT_match, SUPPLE_PT_match_advanced, SUPPLE_PT_transfer)
)
