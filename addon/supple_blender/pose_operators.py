# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that compute: prepare, preview, bake, check."""

import time
from dataclasses import dataclass

import bpy
from bpy.props import BoolProperty, StringProperty

from . import api, distortion, handles, live, mesh_data, pose, prepared, shape_keys, status
from .background import LongOperator
from .errors import UserError, some


def active_body(context):
    """Return the mesh object meant: the active one, or the one that the active Empty poses."""
    obj = handles.body_of(context.object)
    mesh_data.require_mesh(obj)
    return obj


def find_unchanged(name, rest):
    """Return object `name` if its rest shape still is `rest`; the window ran on in the meantime."""
    obj = bpy.data.objects.get(name)
    if obj is None or api.rest_mesh(obj).digest != rest.digest:
        raise UserError(f"{name}: it changed while Supple was at work. Run it again.")
    return obj


class SUPPLE_OT_prepare(LongOperator, bpy.types.Operator):
    """Get the mesh ready, once; the first preview or bake does it by itself"""

    bl_idname = "supple.prepare"
    bl_label = "Prepare"
    bl_options = {"REGISTER"}

    def collect(self, context):
        obj = active_body(context)
        handles.require_bound(obj)
        return api.rest_mesh(obj)

    def compute(self, inputs, stages):
        start = time.perf_counter()
        mesh = pose.prepare(inputs, stages)
        return mesh, time.perf_counter() - start

    def write(self, context, inputs, result):
        mesh, seconds = result
        notes = [note.message for note in mesh.notes]
        status.remember(inputs, mesh.seconds, notes)
        text = f"{inputs.name}: {len(inputs.positions):,} vertices ready in {seconds:.1f} s"
        if mesh.from_cache:
            text += ", from the disk cache"
        return "INFO", ". ".join([text, *notes])


@dataclass(frozen=True)
class _KeyInput:
    """A pose to solve and the shape key to write it to."""

    pose: pose.PoseInput
    key: str

    @property
    def name(self):
        return self.pose.rest.name


class PoseOperator(LongOperator):
    """Solves the active body's pose and writes it to a shape key. Subclasses name the key."""

    overwrite = False

    def key_name(self, obj):
        raise NotImplementedError

    def collect(self, context):
        obj = active_body(context)
        mesh_data.require_writable(obj)
        name = self.key_name(obj)
        shape_keys.require_free(obj, name, self.overwrite)
        return _KeyInput(api.collect_pose(obj), name)

    def compute(self, inputs, stages):
        return pose.solve(inputs.pose, stages)

    def write(self, context, inputs, result):
        obj = find_unchanged(inputs.name, inputs.pose.rest)
        shape_keys.require_free(obj, inputs.key, self.overwrite)
        if live.is_live(obj):
            live.end(keep=True)
        shape_keys.write(obj, inputs.key, result.positions)
        if distortion.is_shown(obj):
            distortion.refresh(context, obj)
        mesh = prepared.mesh_if_ready(inputs.pose.rest)
        if mesh:
            status.remember(inputs.pose.rest, mesh.seconds, [note.message for note in mesh.notes])
        text = f"{obj.name}: wrote shape key '{inputs.key}'"
        others = shape_keys.others_on(obj, inputs.key)
        if others:
            return "WARNING", f"{text}. Keys {some(others)} are on too and add to it"
        return "INFO", ". ".join([text, *result.notes])


class SUPPLE_OT_solve(PoseOperator, bpy.types.Operator):
    """Show the pose in a preview shape key, which goes when you bake or clear the handles"""

    bl_idname = "supple.solve"
    bl_label = "Preview"
    bl_options = {"REGISTER", "UNDO"}

    def key_name(self, obj):
        return shape_keys.PREVIEW


class SUPPLE_OT_bake(PoseOperator, bpy.types.Operator):
    """Write the pose to a shape key, leaving every other key as it is"""

    bl_idname = "supple.bake"
    bl_label = "Bake"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(
        name="Shape Key",
        description="The key to write; empty for the one named in the panel",
        options={"SKIP_SAVE"},
    )
    overwrite: BoolProperty(
        name="Overwrite",
        description="Write over a key of this name that Supple did not make",
        default=False,
        options={"SKIP_SAVE"},
    )

    def key_name(self, obj):
        return self.name or obj.supple.key_name


class SUPPLE_OT_check_mesh(bpy.types.Operator):
    """List what is unusual about the mesh and what is done about it"""

    bl_idname = "supple.check_mesh"
    bl_label = "Check..."
    bl_options = {"REGISTER"}

    def execute(self, context):
        try:
            self.find(context)
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, " ".join([f"{self.object_name}:", *self.lines]))
        return {"FINISHED"}

    def find(self, context):
        obj = active_body(context)
        self.object_name = obj.name
        self.lines = api.check_mesh(obj) or ["nothing unusual."]

    def invoke(self, context, event):
        try:
            self.find(context)
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return context.window_manager.invoke_popup(self, width=480)

    def draw(self, context):
        self.layout.label(text=self.object_name, icon="MESH_DATA")
        for line in self.lines:
            self.layout.label(text=line, icon="DOT")


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (SUPPLE_OT_prepare, SUPPLE_OT_solve, SUPPLE_OT_bake, SUPPLE_OT_check_mesh)
)


def register():
    _register_classes()


def unregister():
    _unregister_classes()
    prepared.clear()
