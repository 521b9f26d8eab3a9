# SPDX-License-Identifier: GPL-3.0-or-later
"""Which layers of an object Supple made and nobody changed since; those alone it writes again."""

from . import mesh_data
from .errors import UserError


def is_ours(obj, kind, name, values):
    """Return whether layer `name` of this kind, which holds `values` now, is as Supple wrote it."""
    record = obj.supple_map.made.get(f"{kind}/{name}")
    return record is not None and record.digest == mesh_data.digest_of(values)


def require_free(obj, kind, name, values, overwrite):
    """Raise UserError unless the layer, which is there and holds `values`, may be written."""
    if not overwrite and not is_ours(obj, kind, name, values):
        raise UserError(
            f"{obj.name}: {kind} '{name}' was made or changed by someone else. Rename or remove "
            "it, or switch on Overwrite."
        )


def remember(obj, kind, name, values):
    """Record that Supple wrote the layer, which holds `values` now."""
    made = obj.supple_map.made
    key = f"{kind}/{name}"
    record = made.get(key)
    if record is None:
        record = made.add()
        record.name = key
    record.digest = mesh_data.digest_of(values)
