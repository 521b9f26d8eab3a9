# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing what was carried to the target, without touching what others made there."""

from . import compat, fitted, groups, made, mesh_data, shape_keys
from .errors import count


def _write_uvs(source, target, uvs):
    layers = target.data.uv_layers
    had = len(layers)
    for name, values in uvs.items():
        if name not in layers:
            layers.new(name=name, do_init=False)
        compat.write_uvs(layers[name], values)
        made.remember(target, "UV map", name, compat.read_uvs(layers[name]))
    if uvs and not had and source.data.uv_layers.active:
        layers.active = layers[source.data.uv_layers.active.name]


def _write_weights(target, weights):
    for name, values in weights.items():
        groups.write(target, name, values)
    written = groups.read(target, target.data) if weights else None
    for name in weights:
        values = written[:, target.vertex_groups[name].index]
        made.remember(target, "vertex group", name, values)


def _write_colours(target, colours):
    layers = target.data.color_attributes
    for colour in colours:
        layer = layers.get(colour.name)
        kind = (colour.data_type, colour.domain)
        if layer and (layer.data_type, layer.domain) != kind:
            layers.remove(layer)
            layer = None
        if layer is None:
            layers.new(colour.name, *kind)
        compat.write_attribute(layers[colour.name], colour.values)
        values = compat.read_attribute(layers[colour.name])
        made.remember(target, "colour attribute", colour.name, values)


def _write_keys(target, keys):
    active = target.active_shape_key_index if target.data.shape_keys else None
    for key in keys:
        is_new = shape_keys.find(target, key.name) is None
        shape_keys.put(target, key.name, key.positions)
        block = shape_keys.find(target, key.name)
        for name, value in key.settings.items() if is_new else ():
            if name != "vertex_group" or value in target.vertex_groups:
                setattr(block, name, value)
    if keys:
        target.supple.made_basis = False  # the carried keys need it
        if active is not None:
            target.active_shape_key_index = active


def _write_drivers(source, target, keys):
    """Copy the drivers of the values of shape keys; what they read stays the same."""
    of_source, of_target = source.data.shape_keys, target.data.shape_keys
    animation = of_source.animation_data if keys else None
    for driver in animation.drivers if animation else ():
        if driver.data_path in {f'key_blocks["{key.name}"].value' for key in keys}:
            data = of_target.animation_data or of_target.animation_data_create()
            present = data.drivers.find(driver.data_path)
            if present:
                data.drivers.remove(present)
            data.drivers.from_existing(src_driver=driver)


def write(context, source, target, layers, options):
    """Write Layers to target. Ends Edit Mode. Call `transfer_collect.require_free` before."""
    mesh_data.leave_modes(context, target)
    _write_uvs(source, target, layers.uvs)
    _write_weights(target, layers.weights)
    _write_colours(target, layers.colours)
    _write_keys(target, layers.keys)
    if options.drivers:
        _write_drivers(source, target, layers.keys)
    target.data.update()
    if layers.fit is not None:
        fitted.write(context, source, target, layers.fit)


def counts(layers):
    """Return what Layers hold in words, such as ['2 UV maps']."""
    kinds = (
        (layers.uvs, "UV map", "UV maps"),
        (layers.weights, "vertex group", "vertex groups"),
        (layers.colours, "colour attribute", "colour attributes"),
        (layers.keys, "shape key", "shape keys"),
    )
    return [count(len(values), one, many) for values, one, many in kinds if values]


def summary(source, target, layers):
    """Return in words what was carried."""
    parts = counts(layers)
    said = [f"{target.name}: {', '.join(parts)} carried from '{source.name}'"] if parts else []
    if layers.fit is not None:
        said.append(f"made '{fitted.name_of(source, target)}'")
    return "; ".join(said)
