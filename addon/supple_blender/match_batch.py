# SPDX-License-Identifier: GPL-3.0-or-later
"""One source to many targets. A target that fails is named with the reason; the others go on."""

from dataclasses import dataclass, replace

from . import match, match_collect, match_solving, transfer, transfer_collect, transfer_write
from .errors import UserError
from .pose_operators import find_unchanged
from .stages import Part


@dataclass(frozen=True)
class BatchInput:
    """jobs: {target: (MatchInput, TransferInput)}. failed: {target: message}."""

    name: str
    jobs: dict
    failed: dict
    options: transfer_collect.Options


def collect(context, source, targets, match_options, options):
    """Return the BatchInput. Raises UserError where nothing can be carried to any target."""
    if source is None:
        raise UserError("There is no source. Choose the mesh that has what is carried.")
    if not targets:
        raise UserError(f"{source.name}: no other mesh is selected. Select the targets too.")
    jobs, failed = {}, {}
    for target in targets:
        try:
            match_input = match_collect.collect(context, source, target, match_options)
            order, _ = transfer_collect.collect(context, source, target, options, matched=False)
            jobs[target.name] = match_input, order
        except UserError as error:
            failed[target.name] = str(error)
    if not jobs:
        raise UserError("; ".join(dict.fromkeys(failed.values())))
    return BatchInput(source.name, jobs, failed, options)


def solve(inputs, stages):
    """Return {target: (Match, Transferred), or the UserError}."""
    results = {}
    for name, (match_input, order) in inputs.jobs.items():
        part = 1 / len(inputs.jobs)
        try:
            found = match.solve(match_input, Part(stages, 0.8 * part))
            carried = transfer.solve(replace(order, match=found), Part(stages, 0.2 * part))
            results[name] = found, carried
        except UserError as error:
            results[name] = error
    return results


def _write(context, inputs, name, found, carried):
    match_input, order = inputs.jobs[name]
    source = find_unchanged(inputs.name, match_input.source)
    target = find_unchanged(name, match_input.target)
    transfer_collect.require_free(source, target, order.layers, inputs.options.overwrite)
    match_solving.keep(context, source, target, match_input, found)
    transfer_write.write(context, source, target, carried.layers, inputs.options)


def write(context, inputs, results):
    """Write what was found; return {target: (Match, Transferred)} and {target: message}."""
    done, failed = {}, dict(inputs.failed)
    for name, result in results.items():
        try:
            if isinstance(result, UserError):
                raise result
            _write(context, inputs, name, *result)
            done[name] = result
        except UserError as error:
            failed[name] = str(error)
    return done, failed
