# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading from the scene which two meshes are matched, and what a match of them needs."""

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from . import compat, handles, match_features, match_map, mesh_data
from .errors import UserError
from .match import FEATURES, STARTS, MatchInput


@dataclass(frozen=True)
class Options:
    """How to match. start: as `match.STARTS`. pairs: (source vertex, target vertex) each. epochs:
    that features adapt for, 0 or more. model: their name, or a file of them.
    """

    start: str = "AUTOMATIC"
    refine: bool = True
    pairs: tuple = ()
    file: str = ""
    epochs: int = match_features.EPOCHS
    model: str = match_features.MODEL


@dataclass(frozen=True)
class Corners:
    """The triangles' corners: loops (m, 3), polygons (m,) they are part of, how many loops."""

    loops: np.ndarray
    polygons: np.ndarray
    count: int


def options_of(scene):
    """Return the Options set in the panel."""
    settings = scene.supple_match
    pairs = tuple((pair.source_vertex, pair.target_vertex) for pair in settings.pairs)
    file = bpy.path.abspath(settings.file) if settings.file else ""
    model = bpy.path.abspath(settings.model)
    return Options(settings.start, settings.refine, pairs, file, settings.epochs, model)


def source_chosen(context):
    """Return the object that is the source now, or None."""
    return context.scene.supple_match.source or context.view_layer.objects.active


def other_meshes(context, source):
    """Return the selected mesh objects but the source."""
    return [obj for obj in context.selected_objects if obj.type == "MESH" and obj != source]


def target_chosen(context):
    """Return the object that is the target now: the one chosen, the other one selected, or None."""
    chosen = context.scene.supple_match.target
    others = other_meshes(context, source_chosen(context))
    return chosen or (others[0] if len(others) == 1 else None)


def require_pair(source, target):
    """Raise UserError unless these are two mesh objects with meshes of their own."""
    if source is None:
        raise UserError("There is no source. Choose the mesh that has what is carried.")
    if target is None:
        raise UserError(
            f"{source.name}: it has no target. Choose the mesh that gets what is carried, or "
            "select it too."
        )
    for obj in (source, target):
        mesh_data.require_mesh(obj)
        if not obj.users_scene:
            raise UserError(f"{obj.name}: it was deleted from the scene. Choose another object.")
    if source == target:
        raise UserError(f"{source.name}: it is both source and target. Choose two objects.")
    match_map.require_writable(target)


def chosen(context):
    """Return the source and the target of the panel, or raise UserError."""
    source, target = source_chosen(context), target_chosen(context)
    require_pair(source, target)
    return source, target


def rest_of(context, obj):
    """Return the RestMesh of obj."""
    return mesh_data.collect(obj, handles.world_matrix(context, obj))


def corners_of(mesh):
    """Return the Corners of a mesh, in the order of its triangles."""
    mesh.calc_loop_triangles()
    triangles = mesh.loop_triangles
    loops = np.empty(3 * len(triangles), dtype=np.int32)
    polygons = np.empty(len(triangles), dtype=np.int32)
    triangles.foreach_get("loops", loops)
    triangles.foreach_get("polygon_index", polygons)
    return Corners(loops.reshape(-1, 3), polygons, len(mesh.loops))


def _active_uvs(obj):
    with mesh_data.readable(obj) as mesh:
        layer = mesh.uv_layers.active
        if layer is None:
            raise UserError(f"{obj.name}: it has no UV map. Add one, or choose another start.")
        return compat.read_uvs(layer)[corners_of(mesh).loops]


def _pairs(options, source, target):
    if not options.pairs:
        raise UserError(
            f"{target.name}: there are no landmarks. Select a vertex of each mesh in Edit Mode and "
            "press Add Pair, or choose another start."
        )
    for number, pair in enumerate(options.pairs, 1):
        for obj, vertex in zip((source, target), pair, strict=True):
            if not 0 <= vertex < len(obj.data.vertices):
                raise UserError(
                    f"{obj.name}: pair {number} names vertex {vertex}, but it has "
                    f"{len(obj.data.vertices)} vertices. Remove that pair."
                )
    return np.array(options.pairs, dtype=np.int64).reshape(-1, 2)


def _file(options, target):
    if not options.file:
        raise UserError(f"{target.name}: no file is chosen to start from. Choose a map.")
    if not Path(options.file).is_file():
        raise UserError(f"{target.name}: there is no file {options.file}. Choose a saved map.")
    return options.file


def collect(context, source, target, options):
    """Return the MatchInput for mesh objects source and target."""
    require_pair(source, target)
    if options.start not in STARTS:
        raise UserError(f"There is no start '{options.start}'. The starts are {', '.join(STARTS)}.")
    rests = [rest_of(context, obj) for obj in (source, target)]
    given = {}
    if options.start == "NEAREST":
        given["worlds"] = tuple(handles.world_matrix(context, obj) for obj in (source, target))
    elif options.start == "LANDMARKS":
        given["landmarks"] = _pairs(options, source, target)
    elif options.start == "UVS":
        given["uvs"] = tuple(_active_uvs(obj) for obj in (source, target))
    elif options.start == "FILE":
        given["file"] = _file(options, target)
    elif options.start == FEATURES:
        given["epochs"], given["model"] = options.epochs, options.model
    elif options.start == "CURRENT":
        match_map.require(target, source, *rests)
        given["current"] = match_map.read(target).surface_map
    return MatchInput(*rests, options.start, options.refine, **given)
