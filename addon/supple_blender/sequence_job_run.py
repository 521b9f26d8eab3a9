# SPDX-License-Identifier: GPL-3.0-or-later
"""Running a job that corrects a sequence. The cache is finished first, then all else is written."""

import glob
import sys
import time

import bpy
from mathutils import Matrix

from . import (
    frame_work,
    handles,
    job_output,
    job_run,
    mesh_data,
    native,
    sequence_bake,
    sequence_keys,
)
from .errors import UserError
from .stages import FrameStages

# Seconds between two lines about how far it is.
SAY_SECONDS = 5.0


class _SpokenStages(FrameStages):
    """Says on the terminal how far it is."""

    _said = 0.0

    def count(self, frames):
        super().count(frames)
        now = time.monotonic()
        if now - self._said >= SAY_SECONDS:
            self._said = now
            job_output.say("   ".join(text for text in (self.doing(), self.left()) if text))


def _make_handles(job, obj):
    """Make the handles that the job lists, and key their Empties."""
    if obj.supple.handles:
        raise UserError(
            f"{job.path}: handles: {obj.name} has handles already. Leave [[handles]] out to use "
            "them with their keys."
        )
    held = [handle.group for handle in job.handles if not handle.keys]
    handles.create(bpy.context, obj, [handle.group for handle in job.handles], held)
    for handle in job.handles:
        empty = obj.supple.handles[handle.group].empty
        empty.rotation_mode = "QUATERNION"
        for key in handle.keys:
            empty.matrix_basis = Matrix(key.motion.tolist())
            sequence_keys.key_empty(empty, key.frame)


def _set(job, obj):
    settings = obj.supple_sequence
    settings.first, settings.last = job.first, job.last
    settings.ease_in, settings.ease_out = job.ease
    settings.output = "KEYS" if job.shape_keys else "CACHE"
    if job.stiffness is not None:
        obj.supple.stiffness = job.stiffness
    if job.network is not None:
        obj.supple.network = job.network
    if job.keep_volume is not None:
        obj.supple.keep_volume = job.keep_volume
    if job.cache:
        settings.file = str(job.cache)


def _pieces(cache):
    """Return the caches that parts of the job have baked."""
    return sorted(cache.parent.glob(f"{glob.escape(cache.stem)}.*-of-*.pc2"))


def _piece(job):
    number, count = job.part
    return job.cache.with_name(f"{job.cache.stem}.{number}-of-{count}.pc2")


def _export(obj, name, path, job):
    bpy.ops.object.select_all(action="DESELECT")
    obj.select_set(True)
    try:
        if name == "alembic":
            bpy.ops.wm.alembic_export(
                filepath=str(path),
                start=job.first,
                end=job.last,
                selected=True,
                as_background_job=False,
            )
        else:
            scene = bpy.context.scene
            scene.frame_start, scene.frame_end = job.first, job.last
            bpy.ops.wm.usd_export(
                filepath=str(path), selected_objects_only=True, export_animation=True
            )
    except (AttributeError, RuntimeError) as error:
        raise UserError(f"{path}: this Blender can't export {name}: {error}") from error


def run(job):
    """Run a SequenceJob. Raises UserError; then nothing but finished frames of a cache is new."""
    native.supple()
    start = time.perf_counter()
    obj = job_run.find_object(job.source, job.path)
    mesh_data.require_mesh(obj)
    if job.handles is not None:
        mesh_data.require_writable(obj)
        _make_handles(job, obj)
    _set(job, obj)
    context, stages = bpy.context, _SpokenStages(len(job.frames))
    frames = f"frames {job.frames[0]} to {job.frames[-1]}"
    job_output.say(f"{obj.name}: {len(obj.data.vertices):,} vertices, {frames}")
    if job.cache:
        job.cache.parent.mkdir(parents=True, exist_ok=True)
    if job.part:
        wanted, path = sequence_bake.range_of(obj), _piece(job)
        baked = frame_work.run(
            sequence_bake.bake(context, obj, wanted, path, stages, frames=job.frames)
        )
        job_output.say(f"{obj.name}: {sequence_bake.sentence(baked)}")
        return
    pieces = _pieces(job.cache) if job.cache else []
    baked = frame_work.run(
        sequence_bake.to_output(context, obj, stages, job.overwrite, pieces=pieces)
    )
    seconds = time.perf_counter() - start
    job_output.say(f"{obj.name}: {sequence_bake.sentence(baked)}")
    targets = [job.blend, *job.exports.values(), *([job.report] if job.report else [])]
    with job_output.all_or_nothing(targets) as partial:
        job_output.save(partial[job.blend])
        for name, path in job.exports.items():
            _export(obj, name, partial[path], job)
        if job.report:
            job_output.write_json(partial[job.report], _report(job, obj, baked, seconds))
    for path in targets:
        job_output.say(f"wrote {path}")


def _report(job, obj, baked, seconds):
    count = baked.last - baked.first + 1
    return {
        "object": obj.name,
        "vertices": len(obj.data.vertices),
        "frames": [baked.first, baked.last],
        "handles": {
            row.name: "held" if row.kind == "HELD" else "moved" for row in obj.supple.handles
        },
        "kept": baked.kept,
        "notes": baked.notes,
        "seconds": seconds,
        "milliseconds_a_frame": 1e3 * seconds / count,
        "peak_memory_mebibytes": _peak_memory(),
        **job_output.versions(),
    }


def _peak_memory():
    """Return the most memory this process has taken, MiB, or None where the system won't say."""
    try:
        import resource
    except ImportError:
        return None
    unit = 1024**2 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
