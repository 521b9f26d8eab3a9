# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators, jobs and scripts do with the map that a target keeps."""

from . import match, match_collect, match_map, mesh_data, native
from .errors import UserError


def keep(context, source, target, inputs, found):
    """Keep `found`, the Match of MatchInput inputs, on target. Ends Edit Mode."""
    mesh_data.leave_modes(context, target)
    match_map.write(target, source, inputs.source, inputs.target, found)


def fitting(context, source, target):
    """Return the RestMeshes of source and target, whose map fits them, or raise UserError."""
    rests = [match_collect.rest_of(context, obj) for obj in (source, target)]
    match_map.require(target, source, *rests)
    return rests


def reversed_match(source_rest, target_rest, kept):
    """Return the Match of the source to the target, of `kept`, one of the target to the source."""
    supple = native.supple()
    source, target = match.solve_arrays(source_rest), match.solve_arrays(target_rest)
    try:
        turned = supple.reversed_map(kept.surface_map, target, source)
        confidence = supple.transfer_field(turned, target, kept.confidence).values
    except supple.SuppleError as error:
        raise UserError(f"{target_rest.name}: {error}") from error
    return match.Match(turned, confidence)
