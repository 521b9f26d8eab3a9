# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking in-betweens of shape keys into what an object shows; before its modifiers."""

import concurrent.futures
import itertools
import tempfile
from pathlib import Path

import bpy

from . import (
    compat,
    handles,
    inbetween,
    mesh_data,
    sequence_bake,
    sequence_output,
    shape_key_frames,
)
from .errors import CancelledError, UserError
from .modifier_stack import INBETWEEN, INBETWEEN_KEYS


def collect(context, obj, keys, times):
    """Return the InbetweenInput of shape keys of obj, by name, at frames. Raises UserError."""
    mesh_data.require_mesh(obj)
    if len(keys) < 2 or len(keys) != len(times):
        raise UserError(
            f"{obj.name}: in-betweens need 2 or more shape keys and as many frames, not "
            f"{len(keys)} and {len(times)}."
        )
    if any(after <= before for before, after in itertools.pairwise(times)):
        raise UserError(f"{obj.name}: the frames {times} of the keys must ascend.")
    blocks = obj.data.shape_keys.key_blocks if obj.data.shape_keys else {}
    missing = [name for name in keys if name not in blocks]
    if missing:
        raise UserError(f"{obj.name}: there is no shape key '{missing[0]}'.")
    rest = mesh_data.collect(obj, handles.world_matrix(context, obj))
    basis = mesh_data.rest_positions(obj)
    poses = []
    for name in keys:
        block = blocks[name]
        positions = compat.read_key(block)
        if block.relative_key != obj.data.shape_keys.reference_key:
            # As it is shown alone, at value 1.
            positions = basis + (positions - compat.read_key(block.relative_key))
        poses.append(positions)
    return inbetween.InbetweenInput(rest, poses, list(times))


def file_of(obj):
    """Return the Path of the cache of in-betweens: beside that of the sequence."""
    path = sequence_bake.file_of(obj)
    return path.with_name(f"{path.stem}_between.pc2")


def to_output(context, obj, inputs, stages, overwrite=False):
    """Bake an InbetweenInput to what the settings of obj say, and let obj show it; a generator for
    `frame_work`, which returns how it is shown. Raises UserError, CancelledError; then obj is as
    it was.
    """
    if obj.supple_sequence.output == "KEYS":
        shape_key_frames.require_free(obj, INBETWEEN_KEYS, inputs.frames, overwrite)
        with tempfile.TemporaryDirectory(prefix="supple-") as folder:
            path = Path(folder) / "frames.pc2"
            yield from _written(inputs, path, stages)
            yield from shape_key_frames.write(
                context, obj, INBETWEEN_KEYS, inputs.frames, path, stages, bare=True
            )
        return "as shape keys"
    sequence_output.require_free(obj, INBETWEEN)
    path, name = file_of(obj), obj.name
    sequence_bake.require_free_file(obj, path, overwrite)
    yield from _written(inputs, path, stages)
    obj = bpy.data.objects[name]
    sequence_output.attach_cache(obj, INBETWEEN, path, inputs.frames, after="")
    return f"in {path.name}"


def _written(inputs, path, stages):
    with concurrent.futures.ThreadPoolExecutor(max_workers=1) as pool:
        future = pool.submit(inbetween.write, inputs, path, stages)
        try:
            while not future.done():
                yield future
        except GeneratorExit:
            stages.cancel()
            raise
        future.result()
    if stages.cancelled:
        raise CancelledError
