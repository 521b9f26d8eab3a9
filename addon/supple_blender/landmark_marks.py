# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers in the 3D Views at the vertices of each pair, while a match starts from landmarks."""

import blf
import bpy
from bpy_extras import view3d_utils

from . import match_collect

COLOURS = ((1.0, 0.75, 0.1, 1.0), (0.2, 0.9, 1.0, 1.0))
SIZE = 14

# The vertex that was clicked on the source and has no partner yet, or None.
waiting = None
_handler = None


def seen_points(depsgraph, obj):
    """Return the vertices of obj as they are seen, or as they are before modifiers that add some,
    and the matrix that takes them to the world.
    """
    evaluated = obj.evaluated_get(depsgraph)
    seen = evaluated.data.vertices
    same = len(seen) == len(obj.data.vertices)
    return (seen if same else obj.data.vertices), evaluated.matrix_world


def _marks(settings):
    """Return [(object's index, vertex, text)]."""
    marks = []
    for number, row in enumerate(settings.pairs, 1):
        marks += [(0, row.source_vertex, f"{number}"), (1, row.target_vertex, f"{number}")]
    if waiting is not None:
        marks.append((0, waiting, f"{len(settings.pairs) + 1}"))
    return marks


def _draw():
    context = bpy.context
    settings = context.scene.supple_match
    if settings.start != "LANDMARKS" or not context.space_data.overlay.show_overlays:
        return
    pair = match_collect.source_chosen(context), match_collect.target_chosen(context)
    if any(obj is None or obj.type != "MESH" for obj in pair):
        return
    depsgraph = context.evaluated_depsgraph_get()
    points = [seen_points(depsgraph, obj) for obj in pair]
    scale = context.preferences.system.ui_scale
    blf.size(0, *((SIZE * scale,) if bpy.app.version >= (4, 0, 0) else (round(SIZE * scale), 72)))
    for which, vertex, text in _marks(settings):
        vertices, world = points[which]
        if vertex >= len(vertices):
            continue
        at = view3d_utils.location_3d_to_region_2d(
            context.region, context.region_data, world @ vertices[vertex].co
        )
        if at is not None:
            blf.color(0, *COLOURS[which])
            blf.position(0, at.x - blf.dimensions(0, "●")[0] / 2, at.y - SIZE * scale / 3, 0)
            blf.draw(0, f"● {text}")


def register():
    global _handler
    _handler = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL")


def unregister():
    global _handler, waiting
    bpy.types.SpaceView3D.draw_handler_remove(_handler, "WINDOW")
    _handler = waiting = None
