# SPDX-License-Identifier: GPL-3.0-or-later
"""What Supple stores in the .blend, all of it on the posed object (`Object.supple`)."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import distortion
from .groups import MIN_WEIGHT

KINDS = (
    ("MOVED", "Moved", "Follows its Empty or bone", "EMPTY_AXIS", 0),
    ("HELD", "Held", "Stays where the rest shape has it", "PINNED", 1),
)
METHODS = (
    ("SUPPLE", "Supple", "What was learned from bodies, and as stiff as the slider says"),
    ("ARAP", "As Rigid As Possible", "The classic, to compare; the slider does not count"),
)


def _show_kind(handle, _context):
    """Make the Empty of a held handle a cube that is locked, so that nobody drags it in vain."""
    if handle.empty:
        empty = handle.empty
        empty.empty_display_type = "CUBE" if handle.kind == "HELD" else "SPHERE"
        for lock in (empty.lock_location, empty.lock_rotation, empty.lock_scale):
            lock[:] = [handle.kind == "HELD"] * 3


class SUPPLE_PG_handle(bpy.types.PropertyGroup):
    """One handle; its name is its vertex group's."""

    kind: EnumProperty(name="Kind", items=KINDS, default="MOVED", update=_show_kind)
    empty: PointerProperty(name="Empty", type=bpy.types.Object)
    bind: FloatVectorProperty(
        name="Bind",
        description="The Empty's matrix at rest in the mesh's local coordinates, row by row",
        size=16,
    )
    frame: PointerProperty(
        name="Frame",
        description="What carries the Empty along with the moving mesh, in a sequence",
        type=bpy.types.Object,
    )
    armature: PointerProperty(name="Armature", type=bpy.types.Object)
    bone: StringProperty(name="Bone", description="The bone that moves it, in place of an Empty")
    weight: FloatProperty(
        name="Weight",
        description="1: exactly where its Empty or bone asks; less: a pull, which the rest of the "
        "mesh may resist",
        default=1.0,
        min=0.01,
        max=1.0,
        subtype="FACTOR",
    )
    least: FloatProperty(
        name="Least Weight",
        description="Vertices with at least this weight in the group are in the handle",
        default=MIN_WEIGHT,
        min=0.0,
        max=1.0,
    )


class SUPPLE_PG_key(bpy.types.PropertyGroup):
    """A shape key that Supple wrote (its name), and a fingerprint of what it wrote."""

    digest: StringProperty()


class SUPPLE_PG_body(bpy.types.PropertyGroup):
    """A posed mesh object."""

    handles: CollectionProperty(type=SUPPLE_PG_handle)
    active_handle: IntProperty(name="Active Handle")
    collection: PointerProperty(name="Empties", type=bpy.types.Collection)
    bound_vertices: IntProperty(
        name="Bound Vertices", description="The vertex count when the handles were made"
    )
    keys: CollectionProperty(type=SUPPLE_PG_key)
    made_basis: BoolProperty(
        name="Made Basis", description="Supple added the Basis, for its preview alone"
    )
    stiffness: FloatProperty(
        name="Stiffness",
        description="From natural, which bends as bodies do, to stiff, which keeps every part as "
        "rigid as it can",
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )
    method: EnumProperty(name="Method", items=METHODS, default="SUPPLE")
    strength: FloatProperty(
        name="Strength",
        description="How much of the pose is taken: 0 leaves the rest shape",
        default=1.0,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )
    mask: StringProperty(
        name="Mask",
        description="Vertex group whose weights say how much of the pose each vertex takes",
    )
    falloff: FloatProperty(
        name="Falloff",
        description="Distance from the moved handles at which nothing moves; 0: everywhere",
        min=0.0,
        subtype="DISTANCE",
    )
    network: BoolProperty(
        name="Learned Detail",
        description="Use what was learned from bodies; off compares with the plain solve",
        default=True,
    )
    keep_volume: BoolProperty(
        name="Keep Volume",
        description="Give closed bodies back most of the volume that bending takes from them",
        default=True,
    )
    key_name: StringProperty(
        name="Shape Key", description="The shape key that Bake writes", default="Pose 1"
    )
    colour_before: StringProperty(description="The colour attribute shown before the distortion")
    shading_before: StringProperty(description="The viewport's colours before the distortion")
    overwrite: BoolProperty(
        name="Overwrite",
        description="Let the next Bake write over a key that Supple did not make",
    )


def _constant(value):
    return lambda _self: value


class SUPPLE_PG_legend(bpy.types.PropertyGroup):
    """What the colours of the distortion mean, drawn as swatches that can't be changed."""

    __annotations__ = {
        f"colour_{index}": FloatVectorProperty(
            name=f"Distortion {level:g}",
            description="The sum of squared stretches and their inverses, less that at rest",
            size=3,
            subtype="COLOR",
            get=_constant(colour),
        )
        for index, (level, colour) in enumerate(
            zip(distortion.LEVELS, distortion.COLOURS.tolist(), strict=True)
        )
    }


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (SUPPLE_PG_handle, SUPPLE_PG_key, SUPPLE_PG_body, SUPPLE_PG_legend)
)


def register():
    _register_classes()
    bpy.types.Object.supple = PointerProperty(type=SUPPLE_PG_body)
    bpy.types.WindowManager.supple_legend = PointerProperty(type=SUPPLE_PG_legend)


def unregister():
    del bpy.types.WindowManager.supple_legend
    del bpy.types.Object.supple
    _unregister_classes()
