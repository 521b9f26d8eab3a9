# SPDX-License-Identifier: GPL-3.0-or-later
"""Running a job that matches: what can be done is saved, and what failed is named."""

import time

import bpy

from . import job_output, match_batch, native, transfer_write
from .errors import UserError, count
from .stages import Stages


def _find(job):
    """Return the source and the targets, as objects."""
    source = job_output.scene_object(job.source, job.path, "match.source")
    targets = [job_output.scene_object(name, job.path, "match.targets") for name in job.targets]
    return source, targets


def _report(job, done, failed, seconds):
    targets = {}
    for name, (found, carried) in done.items():
        targets[name] = {
            "confidence": found.confidence.mean(),
            "notes": [*found.notes, *carried.notes],
            "carried": transfer_write.counts(carried.layers),
            "fitted": carried.layers.fit is not None,
        }
    return {
        "source": job.source,
        "start": job.options.start.lower(),
        "refined": job.options.refine,
        "targets": targets,
        "failed": failed,
        "seconds": seconds,
        **job_output.versions(),
    }


def run(job):
    """Run a MatchJob. Raises UserError: nothing was written, or all but the targets it names."""
    native.supple()
    start = time.perf_counter()
    if job.input:
        job_output.open_blend(job.input, job.path)
    source, targets = _find(job)
    context = bpy.context
    inputs = match_batch.collect(context, source, targets, job.options, job.transfer)
    done, failed = match_batch.write(context, inputs, match_batch.solve(inputs, Stages()))
    if not done:
        raise UserError("; ".join(failed.values()))
    for name, (found, carried) in done.items():
        job_output.say(f"{name}: matched to '{job.source}', {found.confidence.mean():.2f}")
        for note in (*found.notes, *carried.notes):
            job_output.say(f"{name}: {note}")
    with job_output.all_or_nothing([p for p in (job.blend, job.report) if p]) as partial:
        job_output.save(partial[job.blend])
        if job.report:
            seconds = time.perf_counter() - start
            job_output.write_json(partial[job.report], _report(job, done, failed, seconds))
    for path in partial:
        job_output.say(f"wrote {path}")
    if failed:
        number = count(len(failed), "target", "targets")
        raise UserError(f"{number} left out, the others are saved: {'; '.join(failed.values())}")
