# SPDX-License-Identifier: GPL-3.0-or-later
"""What Supple stores in the .blend for a sequence, on the corrected object."""

import bpy
from bpy.props import (
    EnumProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import compat

OUTPUTS = (
    ("CACHE", "Cache File", "A PC2 file, read by a Mesh Cache modifier: for long ranges"),
    ("KEYS", "Shape Keys", "A shape key for each frame, with keyed values: for short ranges"),
)


class SUPPLE_PG_sequence(bpy.types.PropertyGroup):
    """The range that is corrected, and where the result goes."""

    first: IntProperty(name="Start", description="First frame that may change", default=1)
    last: IntProperty(name="End", description="Last frame that may change", default=250)
    ease_in: IntProperty(
        name="Ease In",
        description="Frames over which the correction grows from nothing, without a jump",
        default=12,
        min=0,
        soft_max=100,
    )
    ease_out: IntProperty(
        name="Ease Out",
        description="Frames over which the correction ends, without a jump",
        default=12,
        min=0,
        soft_max=100,
    )
    from_key: StringProperty(name="From", description="The shape key at the range's start")
    to_key: StringProperty(name="To", description="The shape key at the range's end")
    output: EnumProperty(name="To", items=OUTPUTS, default="CACHE")
    file: StringProperty(
        name="File",
        description="The cache file; empty for one beside the .blend, named after both",
        subtype="FILE_PATH",
        options=compat.RELATIVE_PATH,
    )


_register_classes, _unregister_classes = bpy.utils.register_classes_factory((SUPPLE_PG_sequence,))


def register():
    _register_classes()
    bpy.types.Object.supple_sequence = PointerProperty(type=SUPPLE_PG_sequence)


def unregister():
    del bpy.types.Object.supple_sequence
    _unregister_classes()
