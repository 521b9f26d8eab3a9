# SPDX-License-Identifier: GPL-3.0-or-later
"""The map that a target keeps: attributes of its mesh, and the shapes of both when it was made."""

import numpy as np

from . import compat, mesh_data, native
from .errors import UserError
from .match import Match

FACE = "Supple Match Face"
WEIGHTS = "Supple Match Weights"
CONFIDENCE = "Supple Confidence"
KINDS = {FACE: "INT", WEIGHTS: "FLOAT_VECTOR", CONFIDENCE: "FLOAT"}


def shape_of(rest):
    """Return the fingerprint of a RestMesh's shape and faces, whatever the object's scale."""
    return mesh_data.digest_of(rest.positions, rest.triangles)


def source_of(target):
    """Return the object that mesh object target was matched to, or None."""
    return target.supple_map.source if target.supple_map.target_digest else None


def require_writable(target):
    """Raise UserError unless a map can be kept on mesh object target."""
    mesh_data.require_writable(target)
    for name, kind in KINDS.items():
        layer = target.data.attributes.get(name)
        if layer and (layer.domain, layer.data_type) != ("POINT", kind):
            raise UserError(
                f"{target.name}: it has an attribute '{name}' of another kind. Rename or remove it."
            )


def write(target, source, source_rest, target_rest, match):
    """Keep a Match of RestMesh target_rest to source_rest on `target`, which is in Object Mode."""
    surface_map = match.surface_map
    values = {FACE: surface_map.face, WEIGHTS: surface_map.weights, CONFIDENCE: match.confidence}
    attributes = target.data.attributes
    for name, kind in KINDS.items():
        if name not in attributes:
            attributes.new(name, kind, "POINT")
        compat.write_attribute(attributes[name], values[name])
    target.data.update()
    kept = target.supple_map
    kept.source = source
    kept.source_digest, kept.target_digest = shape_of(source_rest), shape_of(target_rest)
    kept.confidence = float(match.confidence.mean())
    kept.notes = " ".join(match.notes)


def require(target, source, source_rest, target_rest):
    """Raise UserError unless target keeps a map to source, and both are as they were then."""
    kept = target.supple_map
    found = [name for name in KINDS if name in target.data.attributes]
    if not kept.target_digest or len(found) < len(KINDS):
        raise UserError(f"{target.name}: it is not matched yet. Press Match.")
    if kept.source != source:
        other = f"'{kept.source.name}'" if kept.source else "an object that is gone"
        raise UserError(
            f"{target.name}: it was matched to {other}, not to '{source.name}'. "
            "Press Match, or choose that source."
        )
    for obj, rest, digest in (
        (source, source_rest, kept.source_digest),
        (target, target_rest, kept.target_digest),
    ):
        if shape_of(rest) != digest:
            raise UserError(f"{obj.name}: it was changed since the match. Match again.")


def read(target):
    """Return the Match that target keeps. Call `require` before."""
    with mesh_data.readable(target) as mesh:
        face, weights, confidence = (compat.read_attribute(mesh.attributes[n]) for n in KINDS)
    sums = weights.sum(axis=1, keepdims=True)  # kept in single precision
    weights = np.where(sums > 0, weights / np.where(sums > 0, sums, 1), 0)
    return Match(native.supple().SurfaceMap(face, weights), confidence)


def remove(target):
    """Forget the map of target, which is in Object Mode."""
    attributes = target.data.attributes
    for name in KINDS:
        if name in attributes:
            attributes.remove(attributes[name])
    kept = target.supple_map
    kept.source = None
    kept.source_digest = kept.target_digest = ""
    kept.confidence = 0.0
    kept.notes = ""
