# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading what a source has to carry, and whether the target may get it."""

from dataclasses import dataclass

from . import (
    colour_view,
    compat,
    fitted,
    groups,
    made,
    match_collect,
    match_map,
    mesh_data,
    shape_keys,
)
from .errors import UserError
from .transfer import Colour, Key, Layers, TransferInput

NOUNS = {
    "UVS": "UV maps",
    "WEIGHTS": "vertex groups",
    "COLOURS": "colour attributes",
    "KEYS": "shape keys",
}
MAX_UV_MAPS = 8
KEY_SETTINGS = ("slider_min", "slider_max", "value", "mute", "vertex_group")


@dataclass(frozen=True)
class Options:
    """What to carry: parts, a set of match_properties.PARTS, and how."""

    parts: frozenset = frozenset({"UVS", "WEIGHTS"})
    only_active_key: bool = False
    drivers: bool = False
    overwrite: bool = False


def options_of(scene):
    """Return the Options set in the panel."""
    settings = scene.supple_match
    return Options(
        frozenset(settings.transfer),
        settings.only_active_key,
        settings.drivers,
        settings.overwrite,
    )


def _uvs(obj, mesh):
    return {layer.name: compat.read_uvs(layer).astype("f8") for layer in mesh.uv_layers}


def _weights(obj, mesh):
    names = [group.name for group in obj.vertex_groups]
    return dict(zip(names, groups.read(obj, mesh).T, strict=True)) if names else {}


def _colours(obj, mesh):
    return [
        Colour(layer.name, layer.domain, layer.data_type, compat.read_attribute(layer))
        for layer in mesh.color_attributes
        if not layer.name.startswith(colour_view.PREFIX)
    ]


def _keys(obj, only_active):
    """Return the shape keys of obj, each as the rest shape moved by what it adds."""
    keys = obj.data.shape_keys
    if not keys:
        return []
    if not keys.use_relative:
        raise UserError(
            f"{obj.name}: its shape keys are absolute. "
            "Switch on Relative (Properties > Data > Shape Keys)."
        )
    blocks = [key for key in keys.key_blocks[1:] if key.name != shape_keys.PREVIEW]
    if only_active:
        blocks = [key for key in blocks if key == obj.active_shape_key]
    rest = mesh_data.rest_positions(obj).astype("f8")
    found = []
    for key in blocks:
        added = compat.read_key(key).astype("f8") - compat.read_key(key.relative_key)
        settings = {name: getattr(key, name) for name in KEY_SETTINGS}
        found.append(Key(key.name, rest + added, settings))
    return found


def layers_of(source, options):
    """Return the Layers of mesh object source, and the nouns of what was asked for in vain."""
    parts = options.parts
    if not parts:
        raise UserError(f"{source.name}: nothing is chosen to be carried. Switch something on.")
    with mesh_data.readable(source) as mesh:
        found = {
            "UVS": _uvs(source, mesh) if "UVS" in parts else {},
            "WEIGHTS": _weights(source, mesh) if "WEIGHTS" in parts else {},
            "COLOURS": _colours(source, mesh) if "COLOURS" in parts else [],
            "KEYS": _keys(source, options.only_active_key) if "KEYS" in parts else [],
        }
    missing = [noun for part, noun in NOUNS.items() if part in parts and not found[part]]
    if len(missing) == len(parts):
        raise UserError(f"{source.name}: it has no {' and no '.join(missing)} to carry.")
    return Layers(*found.values(), "FIT" in parts), missing


def _require_name(obj, mesh, kind, name):
    """Another attribute of this name would make Blender number the new one."""
    if name in mesh.attributes:
        raise UserError(
            f"{obj.name}: the name of {kind} '{name}' is taken by an attribute of another kind. "
            "Rename or remove that."
        )


def _require_uvs(target, mesh, layers, overwrite):
    for name in layers.uvs:
        if name in mesh.uv_layers:
            values = compat.read_uvs(mesh.uv_layers[name])
            made.require_free(target, "UV map", name, values, overwrite)
        else:
            _require_name(target, mesh, "UV map", name)
    number = len({*layers.uvs, *mesh.uv_layers.keys()})
    if number > MAX_UV_MAPS:
        raise UserError(
            f"{target.name}: it would have {number} UV maps, and Blender keeps {MAX_UV_MAPS}. "
            "Remove some."
        )


def _require_colours(target, mesh, layers, overwrite):
    for colour in layers.colours:
        layer = mesh.color_attributes.get(colour.name)
        if layer:
            values = compat.read_attribute(layer)
            made.require_free(target, "colour attribute", colour.name, values, overwrite)
        else:
            _require_name(target, mesh, "colour attribute", colour.name)


def _require_weights(target, mesh, layers, overwrite):
    present = _weights(target, mesh) if layers.weights else {}
    for name in layers.weights:
        if name in present:
            made.require_free(target, "vertex group", name, present[name], overwrite)


def require_free(source, target, layers, overwrite):
    """Raise UserError unless mesh object target may get these Layers of source."""
    match_map.require_writable(target)
    with mesh_data.readable(target) as mesh:
        _require_uvs(target, mesh, layers, overwrite)
        _require_weights(target, mesh, layers, overwrite)
        _require_colours(target, mesh, layers, overwrite)
    for key in layers.keys:
        shape_keys.require_free(target, key.name, overwrite)
    if layers.fit is not False:
        fitted.require_free(source, target, overwrite)


def corners_of(obj):
    """Return the `match_collect.Corners` of a mesh object."""
    with mesh_data.readable(obj) as mesh:
        return match_collect.corners_of(mesh)


def collect(context, source, target, options, *, matched=True):
    """Return the TransferInput and the nouns of what source does not have.

    matched: along the map that target keeps; otherwise the input's match is None.
    """
    match_collect.require_pair(source, target)
    rests = [match_collect.rest_of(context, obj) for obj in (source, target)]
    if matched:
        match_map.require(target, source, *rests)
    layers, missing = layers_of(source, options)
    require_free(source, target, layers, options.overwrite)
    match = match_map.read(target) if matched else None
    corners = tuple(corners_of(obj) for obj in (source, target))
    return TransferInput(*rests, corners, layers, match), missing
