# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking a range of frames into a cache file: read on the main thread, solved and written on one.

Every frame of the file is found again by a key of all that it was made from, so that a bake which
was stopped goes on, one after a change solves only the frames that changed, and one in parts, by
several processes, is put together by the last.
"""

import concurrent.futures
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from . import (
    collecting,
    mesh_data,
    motions,
    native,
    pose,
    sequence,
    sequence_output,
    shape_key_frames,
)
from .errors import CancelledError, UserError, count, some
from .modifier_stack import INBETWEEN, OURS, RESULT, SEQUENCE_KEYS, MovingMesh

# Frames read and not yet written: as many bytes as one frame times this, whatever the range.
BATCH = 8


@dataclass(frozen=True)
class Baked:
    """What a bake did. kept: how many of the frames were taken from files of earlier ones.
    after: the modifier that the result comes after, '' to come first. notes: for people.
    """

    path: Path | None
    first: int
    last: int
    kept: int
    after: str
    notes: list


def collect(context, obj, range):
    """Return the sequence.SequenceInput of obj, evaluated where the scene is."""
    place = motions.Place.of(context)
    mesh_data.require_mesh(obj)
    world = place.world_matrix(obj)
    on_bones = [row.name for row in obj.supple.handles if row.bone and row.kind != "HELD"]
    if on_bones:
        raise UserError(
            f"{obj.name}: handle '{on_bones[0]}' is moved by a bone, and in a sequence the bones "
            "move the mesh already. Make the handle of a group (+ Groups), so that it has an Empty."
        )
    if range.last < range.first:
        raise UserError(
            f"{obj.name}: the range ends at frame {range.last}, before its start at "
            f"{range.first}. Set End to a later frame."
        )
    return sequence.SequenceInput(
        rest=mesh_data.collect(obj, world),
        motions=motions.collect(place, obj, world, motions.vertices_of(obj)),
        range=range,
        options=collecting.options_of(obj),
        blend=collecting.blend_of(obj, world),
    )


class FrameReader:
    """Reads frames of obj with the corrections asked in them."""

    def __init__(self, context, moving, inputs):
        self._context, self._moving, self._inputs = context, moving, inputs
        self._vertices = {motion.name: motion.vertices for motion in inputs.motions}

    def read(self, number):
        """Return the sequence.Frame of that number."""
        self._moving.go_to(number)
        return self.here(number)

    def here(self, number):
        """As `read`, where the scene is."""
        place, obj = motions.Place.of(self._context), self._moving.obj
        return sequence.Frame(
            number,
            self._moving.positions(),
            motions.collect(place, obj, place.world_matrix(obj), self._vertices),
            self._inputs.range.share(number),
        )


class CacheWriter:
    """Solves and writes frames in order, on one thread. Nothing is at `path` before `finish`."""

    def __init__(self, path, inputs, frames, pieces, stages):
        self._path, self._inputs, self._stages = path, inputs, stages
        self._frames, self._pieces = frames, pieces
        self._keys = sequence.FrameKeys(inputs)
        self._solver = self._file = None
        self.done = self.kept = 0

    def open(self):
        self._solver = sequence.Solver(self._inputs, self._stages)
        supple, count = native.supple(), len(self._inputs.rest.positions)
        self._known = self._guarded(lambda: supple.KeptFrames(self._path, *self._pieces))
        self._file = self._guarded(
            lambda: supple.PointCacheWriter(
                self._path, count, frame_count=len(self._frames), start=self._frames[0]
            )
        )

    def add(self, frames):
        """Append frames, a list of sequence.Frame."""
        keys = [self._keys.of(frame) for frame in frames]
        known = [self._guarded(lambda key=key: self._known.find(key)) for key in keys]
        missing = [frame for frame, found in zip(frames, known, strict=True) if found is None]
        solved = iter(self._solver.solve(missing, self._stages.watch()))
        for key, found in zip(keys, known, strict=True):
            positions = next(solved) if found is None else found
            self._guarded(lambda key=key, p=positions: self._file.append(key, p))
            self.done += 1
            self.kept += found is not None
            self._stages.count(self.done)

    def finish(self):
        self._guarded(self._file.finish)

    def close(self):
        """End without `finish`: what was written stays for the next bake to find."""
        if self._file is not None:
            self._file.close()

    @property
    def notes(self):
        return [note.message for note in self._solver.mesh.notes]

    def _guarded(self, call):
        return pose.guarded(self._inputs.name, call)


def bake(context, obj, range, path, stages, frames=None, pieces=()):
    """Write the corrected frames of obj to PC2 file `path`; a generator for `frame_work`, which
    returns Baked. frames: some of the range, ascending (None: all). pieces: other files to take
    finished frames from. Raises UserError, CancelledError; then `path` is as it was.
    """
    frames = range.frames if frames is None else frames
    with MovingMesh(context, obj) as moving:
        moving.go_to(range.first)
        inputs = collect(context, obj, range)
        after, notes = moving.after, _notes(moving, range)
        yield from moving.check_counts(frames)
        reader = FrameReader(context, moving, inputs)
        writer = CacheWriter(path, inputs, frames, pieces, stages)
        pool = concurrent.futures.ThreadPoolExecutor(max_workers=1)
        try:
            yield from _bake(reader, writer, pool, frames, stages)
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
            writer.close()
    return Baked(path, frames[0], frames[-1], writer.kept, after, [*writer.notes, *notes])


def _notes(moving, range):
    """Return what a user would want to know of how the range is corrected, for people."""
    notes = []
    if moving.skipped:
        notes.append(
            f"Modifier {some(moving.skipped)} comes after one that adds or removes vertices, so it "
            "acts on the corrected mesh; move it up to correct what it does"
        )
    most = max(range.share(frame) for frame in range.frames)
    if most < 1:
        notes.append(
            f"The eases leave no frame of the range its whole correction, at most {most:.0%}; make "
            "them shorter or the range longer"
        )
    return notes


def _bake(reader, writer, pool, frames, stages):
    waiting = [pool.submit(writer.open)]
    yield waiting[0]
    batch = []
    for number in frames:
        if stages.cancelled:
            raise CancelledError
        batch.append(reader.read(number))
        if len(batch) == BATCH:
            yield from _submit(pool, writer, batch, waiting)
            batch = []
        yield None
    yield from _submit(pool, writer, batch, waiting)
    for future in waiting:
        if not future.done():
            yield future
        future.result()
    writer.finish()


def _submit(pool, writer, batch, waiting):
    """Hand a batch to the thread, once it has no more than one before it."""
    while len(waiting) > 1:
        if not waiting[0].done():
            yield waiting[0]
        waiting.pop(0).result()
    if batch:
        waiting.append(pool.submit(writer.add, batch))


def range_of(obj):
    """Return the sequence.Range set on obj."""
    body = obj.supple_sequence
    return sequence.Range(body.first, body.last, body.ease_in, body.ease_out)


def to_output(context, obj, stages, overwrite=False, pieces=()):
    """Bake obj's range to what its settings say, and let obj show it; a generator for `frame_work`,
    which returns Baked. pieces: other files to take finished frames from. Raises UserError,
    CancelledError; then obj is as it was.
    """
    wanted = range_of(obj)
    if obj.supple_sequence.output == "KEYS":
        shape_key_frames.require_free(obj, SEQUENCE_KEYS, wanted.frames, overwrite)
        name = obj.name
        baked = yield from _to_keys(context, obj, wanted, stages)
        # A cache of before would be shown in their place.
        sequence_output.detach_cache(bpy.data.objects[name])
        return baked
    sequence_output.require_free(obj)
    path = file_of(obj)
    require_free_file(obj, path, overwrite)
    name = obj.name
    baked = yield from bake(context, obj, wanted, path, stages, pieces=pieces)
    obj = bpy.data.objects[name]
    ends_at_rest = wanted.share(wanted.last) == 0
    sequence_output.attach_cache(obj, RESULT, path, wanted.frames, baked.after, ends_at_rest)
    return baked


def _to_keys(context, obj, wanted, stages):
    with tempfile.TemporaryDirectory(prefix="supple-") as folder:
        path = Path(folder) / "frames.pc2"
        baked = yield from bake(context, obj, wanted, path, stages)
        yield from shape_key_frames.write(context, obj, SEQUENCE_KEYS, wanted.frames, path, stages)
    return replace(baked, path=None)


def sentence(baked):
    """Return what a bake did, for people."""
    frames = count(baked.last - baked.first + 1, "frame", "frames")
    where = f"in {baked.path.name}" if baked.path else "as shape keys"
    kept = f", {baked.kept} of them as they were baked before" if baked.kept else ""
    return ". ".join([f"{frames} {where}{kept}", *baked.notes])


def require_free_file(obj, path, overwrite=False):
    """Raise UserError if a cache at `path` is another's: read by another modifier, or not baked."""
    for other in bpy.data.objects:
        for modifier in other.modifiers:
            ours = other == obj and modifier.name in (*OURS, INBETWEEN)
            if modifier.type != "MESH_CACHE" or ours or not modifier.filepath:
                continue
            if Path(bpy.path.abspath(modifier.filepath)).resolve() == path.resolve():
                raise UserError(
                    f"{obj.name}: {path.name} is read by modifier '{modifier.name}' of "
                    f"'{other.name}'. Name another cache file."
                )
    if path.exists() and not path.with_name(f"{path.name}.keys").exists() and not overwrite:
        raise UserError(
            f"{obj.name}: {path.name} is there and was not baked by Supple. Name another cache "
            "file, or move that one away."
        )


def file_of(obj):
    """Return the absolute Path of the cache file that obj names, or the usual one."""
    given = obj.supple_sequence.file
    if not given:
        if not bpy.data.filepath:
            raise UserError(
                f"{obj.name}: the file is not saved yet, so there is no place beside it for the "
                "cache. Save it, or name a cache file."
            )
        stem = Path(bpy.data.filepath).stem
        name = bpy.path.clean_name(f"{stem}_{obj.name}")
        return Path(bpy.data.filepath).parent / f"{name}.pc2"
    path = Path(bpy.path.abspath(given))
    if path.suffix.lower() != ".pc2":
        raise UserError(f"{obj.name}: the cache file '{path.name}' must end in .pc2.")
    if given.startswith("//") and not bpy.data.filepath:
        raise UserError(
            f"{obj.name}: '{given}' is beside a file that is not saved yet. Save it first."
        )
    return path
