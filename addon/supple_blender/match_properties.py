# SPDX-License-Identifier: GPL-3.0-or-later
"""What matching stores in the .blend: its settings on the scene, a map's origin on its target."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import compat, match_features

STARTS = (
    ("AUTOMATIC", "Automatic", "From the two shapes alone, in whatever pose and place they are"),
    ("LANDMARKS", "Landmarks", "From pairs of vertices that belong together"),
    ("NEAREST", "Nearest Surface", "The nearest point, as the two objects lie in the scene"),
    ("ALIGNED", "Nearest, Aligned", "The nearest point, once one is laid on the other"),
    ("UVS", "Shared UVs", "The same place in the active UV maps, which share a layout"),
    ("FILE", "File", "A map that was saved before"),
    # Files keep the number of a start: new ones come last.
    ("FEATURES", "Features", "Learned features, which adapt to the two shapes"),
)
PARTS = (
    ("UVS", "UVs", "All UV maps; seams stay seams"),
    ("WEIGHTS", "Weights", "All vertex groups"),
    ("COLOURS", "Colours", "All colour attributes, each in its own kind"),
    ("KEYS", "Shape Keys", "All shape keys, or the active one"),
    (
        "FIT",
        "Shrink Fit",
        "A new object: the source's mesh in the target's shape",
    ),
)


def _is_mesh(_settings, obj):
    return obj.type == "MESH"


class SUPPLE_PG_pair(bpy.types.PropertyGroup):
    """Two vertices that belong together."""

    source_vertex: IntProperty(name="Source", min=0)
    target_vertex: IntProperty(name="Target", min=0)


class SUPPLE_PG_match(bpy.types.PropertyGroup):
    """What the panel Match is set to."""

    source: PointerProperty(
        name="Source",
        description="The mesh that has what is carried; empty for the active object",
        type=bpy.types.Object,
        poll=_is_mesh,
    )
    target: PointerProperty(
        name="Target",
        description="The mesh that gets it; empty for the other selected mesh",
        type=bpy.types.Object,
        poll=_is_mesh,
    )
    start: EnumProperty(name="Start", description="Where the first map comes from", items=STARTS)
    refine: BoolProperty(
        name="Refine",
        description="Refine the first map, which makes it smooth and accurate",
        default=True,
    )
    file: StringProperty(
        name="File",
        description="The map that the match starts from",
        subtype="FILE_PATH",
        options=compat.RELATIVE_PATH,
    )
    epochs: IntProperty(
        name="Epochs",
        description="How long the features adapt to the two shapes; 0 takes them as they are",
        default=match_features.EPOCHS,
        min=0,
        soft_max=100,
    )
    model: StringProperty(
        name="Model",
        description="Features that were learned: the name of shipped ones, or a file",
        subtype="FILE_PATH",
        default=match_features.MODEL,
        options=compat.RELATIVE_PATH,
    )
    preview: BoolProperty(
        name="Preview",
        description="Show the match as colours in the 3D View while the features adapt",
        default=True,
    )
    pairs: CollectionProperty(type=SUPPLE_PG_pair)
    active_pair: IntProperty(name="Active Pair")
    transfer: EnumProperty(
        name="Transfer",
        description="What is carried from the source to the target",
        items=PARTS,
        options={"ENUM_FLAG"},
        default={"UVS", "WEIGHTS"},
    )
    only_active_key: BoolProperty(
        name="Only the Active Key", description="Carry the source's active shape key, not all"
    )
    drivers: BoolProperty(
        name="Drivers", description="Carry the drivers of the shape keys' values too"
    )
    overwrite: BoolProperty(
        name="Overwrite",
        description="Let the next Transfer write over what Supple did not make on the target",
    )


class SUPPLE_PG_made(bpy.types.PropertyGroup):
    """A layer that Supple wrote (its name: the kind, a slash, the layer's), and its fingerprint."""

    digest: StringProperty()


class SUPPLE_PG_map(bpy.types.PropertyGroup):
    """Where the map kept on a target's mesh comes from, and what was carried along it."""

    source: PointerProperty(name="Source", type=bpy.types.Object)
    source_digest: StringProperty(description="The source's shape when it was matched")
    target_digest: StringProperty(description="The target's shape when it was matched")
    confidence: FloatProperty(name="Confidence", description="The mean over all vertices")
    notes: StringProperty(description="What to know about the match")
    made: CollectionProperty(type=SUPPLE_PG_made)


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (SUPPLE_PG_pair, SUPPLE_PG_match, SUPPLE_PG_made, SUPPLE_PG_map)
)


def register():
    _register_classes()
    bpy.types.Scene.supple_match = PointerProperty(type=SUPPLE_PG_match)
    bpy.types.Object.supple_map = PointerProperty(type=SUPPLE_PG_map)


def unregister():
    del bpy.types.Object.supple_map
    del bpy.types.Scene.supple_match
    _unregister_classes()
