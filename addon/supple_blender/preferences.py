# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: whether and how much is kept on disk."""

import bpy
from bpy.props import BoolProperty, IntProperty

from . import native, prepared
from .errors import count

MEBIBYTE = 1 << 20


def _apply(preferences, _context=None):
    prepared.use_disk(preferences.disk_cache, preferences.cache_mebibytes)


class SUPPLE_OT_cache_clear(bpy.types.Operator):
    """Remove all prepared meshes from the disk; the next pose of a mesh prepares it again"""

    bl_idname = "supple.cache_clear"
    bl_label = "Clear"
    bl_options = {"REGISTER"}

    def execute(self, context):
        if native.problem():
            self.report({"ERROR"}, native.problem())
            return {"CANCELLED"}
        supple = native.supple()
        try:
            removed = supple.cache.clear()
        except supple.SuppleError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Disk cache: removed {_amount(removed)}")
        return {"FINISHED"}


class SUPPLE_AP_preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    disk_cache: BoolProperty(
        name="Disk Cache",
        description="Keep prepared meshes on disk, so that a file opened again poses at once",
        default=True,
        update=_apply,
    )
    cache_mebibytes: IntProperty(
        name="Size (MiB)",
        description="The most they may take; those not used for longest go first",
        default=2048,
        min=1,
        soft_max=65536,
        update=_apply,
    )

    def draw(self, context):
        layout = self.layout
        if native.problem():
            layout.label(text=native.problem(), icon="ERROR")
            return
        row = layout.row()
        row.prop(self, "disk_cache")
        size = row.row()
        size.enabled = self.disk_cache
        size.prop(self, "cache_mebibytes")
        supple = native.supple()
        try:
            folder, kept = supple.cache.folder(), supple.cache.size()
        except supple.SuppleError as error:
            layout.label(text=str(error), icon="ERROR")
            return
        layout.label(text=str(folder), icon="FILE_FOLDER")
        row = layout.row()
        row.label(text=_amount(kept), icon="BLANK1")
        row.operator(SUPPLE_OT_cache_clear.bl_idname, icon="TRASH")
        if not supple.cache.enabled():
            layout.label(text="Off: SUPPLE_CACHE=0 is set in the environment", icon="INFO")


def _amount(size):
    return f"{count(size.files, 'mesh', 'meshes')}, {size.bytes / MEBIBYTE:.1f} MiB"


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (SUPPLE_OT_cache_clear, SUPPLE_AP_preferences)
)


def register():
    _register_classes()
    # Not there where the add-on is registered by a script that did not enable it.
    addon = bpy.context.preferences.addons.get(__package__)
    if addon is not None and addon.preferences is not None:
        _apply(addon.preferences)


def unregister():
    _unregister_classes()
