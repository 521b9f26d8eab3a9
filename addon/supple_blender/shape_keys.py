# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing shape keys without touching those that others made."""

import hashlib

import numpy as np

from . import compat, mesh_data
from .errors import UserError

PREVIEW = "Supple Preview"
MAX_NAME_BYTES = 63


def _digest(positions):
    return hashlib.blake2b(np.ascontiguousarray(positions).tobytes(), digest_size=16).hexdigest()


def find(obj, name):
    """Return shape key `name` of obj, or None."""
    keys = obj.data.shape_keys
    return keys.key_blocks.get(name) if keys else None


def is_ours(obj, name):
    """Return whether Supple wrote shape key `name` and nobody changed its shape since."""
    key, record = find(obj, name), obj.supple.keys.get(name)
    return bool(key and record) and record.digest == _digest(compat.read_key(key))


def require_free(obj, name, overwrite=False):
    """Raise UserError unless shape key `name` may be written on mesh object obj."""
    if not name.strip():
        raise UserError(f"{obj.name}: the shape key has no name. Give it one.")
    if len(name.encode()) > MAX_NAME_BYTES:
        raise UserError(
            f"{obj.name}: the shape key name '{name}' is too long. "
            f"Blender keeps at most {MAX_NAME_BYTES} bytes of it."
        )
    keys = obj.data.shape_keys
    if keys and not keys.use_relative:
        raise UserError(
            f"{obj.name}: its shape keys are absolute. "
            "Switch on Relative (Properties > Data > Shape Keys)."
        )
    key = find(obj, name)
    if key is None:
        return
    if key == keys.reference_key:
        raise UserError(f"{obj.name}: '{name}' is the rest shape. Choose another name.")
    if not overwrite and not is_ours(obj, name):
        fix = "Choose another name, or switch on Overwrite."
        if name == PREVIEW:
            fix = "Rename or remove it; previews take this name."
        raise UserError(
            f"{obj.name}: shape key '{name}' was made or changed by someone else. {fix}"
        )


def put(obj, name, positions):
    """Write local positions (n, 3) to shape key `name` and make it the active key.

    Adds the Basis if there is none and the key if there is none, with value 1; a key that exists
    keeps its value. Every other key is left as it is. Call `require_free` before.
    """
    if not obj.data.shape_keys:
        compat.add_key(obj, "Basis")
        obj.supple.made_basis = True
    if find(obj, name) is None:
        compat.add_key(obj, name)
    if name not in obj.supple.keys:
        obj.supple.keys.add().name = name
    rewrite(obj, name, positions)
    obj.active_shape_key_index = obj.data.shape_keys.key_blocks.find(name)


def rewrite(obj, name, positions):
    """Write local positions (n, 3) to shape key `name`, which Supple wrote before; nothing else."""
    positions = np.ascontiguousarray(positions, dtype=np.float32)
    compat.write_key(obj.data, find(obj, name), positions)
    obj.supple.keys[name].digest = _digest(positions)


def _remove_preview(obj):
    if not is_ours(obj, PREVIEW):
        return
    obj.shape_key_remove(find(obj, PREVIEW))
    obj.supple.keys.remove(obj.supple.keys.find(PREVIEW))
    if obj.supple.made_basis and len(obj.data.shape_keys.key_blocks) == 1:
        obj.shape_key_clear()
        obj.supple.made_basis = False


def write(obj, name, positions):
    """As `put`, except that the preview goes. Ends Edit Mode."""
    mesh_data.leave_mode(obj)
    if name == PREVIEW:
        put(obj, name, positions)
        return
    _remove_preview(obj)
    put(obj, name, positions)
    obj.supple.overwrite = False  # meant for one bake
    obj.supple.made_basis = False  # a baked key needs it: it is the user's from now on


def remove_preview(obj):
    """Remove the preview key, and the Basis if it came with it and nothing else needs it."""
    mesh_data.leave_mode(obj)
    _remove_preview(obj)


def others_on(obj, name):
    """Return the names of keys other than `name` that add to what is seen."""
    blocks = obj.data.shape_keys.key_blocks[1:]
    on = [key.name for key in blocks if not key.mute and abs(key.value) > 1e-6]
    return [other for other in on if other != name]
