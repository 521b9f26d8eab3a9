# SPDX-License-Identifier: GPL-3.0-or-later
"""Supple from Python: what the panel does, without operators.

    obj = bpy.data.objects["Body"]
    api.handles_from_groups(obj, held=["feet"])
    bpy.data.objects["hand.L"].location.z += 0.3
    api.bake(obj, "Wave")

    obj.supple_sequence.first, obj.supple_sequence.last = 30, 90
    api.bake_sequence(obj, "//walk.pc2")

    scan = bpy.data.objects["Scan"]
    api.match(obj, scan)
    api.transfer(obj, scan, {"UVS", "WEIGHTS"})

Every function raises `UserError` with one readable message and then leaves the file as it was.
Where one takes `stages` (a `stages.Stages`), another thread may watch it and call its `cancel()`:
then `CancelledError` is raised, and again nothing was changed. Call them from the main thread.
"""

import bpy

from . import (
    collecting,
    frame_work,
    handles,
    inbetween_bake,
    match_collect,
    match_features,
    match_solving,
    mesh_data,
    motions,
    native,
    pose,
    sequence_bake,
    sequence_frames,
    shape_keys,
    transfer_collect,
    transfer_write,
)
from . import match as matching
from . import transfer as carrying
from .errors import CancelledError, UserError, count
from .stages import FrameStages, Stages

__all__ = [
    "CancelledError",
    "UserError",
    "bake",
    "bake_sequence",
    "check_mesh",
    "collect_pose",
    "find_correspondence",
    "follow_animation",
    "handles_from_groups",
    "inbetween",
    "match",
    "prepare",
    "rebind",
    "rest_mesh",
    "solve",
    "transfer",
]


def handles_from_groups(obj, groups=(), held=None):
    """Make a handle with an Empty for each vertex group in `groups` (none: all).

    held: names of groups to hold where they are; None proposes those nearest the ground. Returns
    the names of the handles added. The Empties are named after the groups and are children of obj.
    """
    return handles.create(bpy.context, obj, groups, held)[0]


def rebind(obj):
    """Bind the handles to the mesh as it is now, after its vertex count changed."""
    handles.rebind(bpy.context, obj)


def rest_mesh(obj):
    """Return the rest shape of obj as arrays (`mesh_data.RestMesh`)."""
    mesh_data.require_mesh(obj)
    return mesh_data.collect(obj, handles.world_matrix(bpy.context, obj))


def prepare(obj, stages=None):
    """Compute what every solve on this mesh needs, once. Returns the `supple.PreparedMesh`."""
    mesh_data.require_mesh(obj)
    handles.require_bound(obj)
    return pose.prepare(rest_mesh(obj), stages or Stages())


def collect_pose(obj):
    """Return the `pose.PoseInput` of obj: its rest shape and where its handles are now."""
    mesh_data.require_mesh(obj)
    return collecting.collect_pose(motions.Place.of(bpy.context), obj)


def solve(obj, stages=None):
    """Return the posed positions of obj as a `pose.Pose`; the file is not changed."""
    return pose.solve(collect_pose(obj), stages or Stages())


def bake(obj, name, overwrite=False, stages=None):
    """Solve and write the result to shape key `name`; return the `pose.Pose`.

    A key that Supple made and nobody changed is written again; any other needs overwrite=True.
    """
    mesh_data.require_writable(obj)
    shape_keys.require_free(obj, name, overwrite)
    result = solve(obj, stages)
    shape_keys.write(obj, name, result.positions)
    return result


def follow_animation(obj, stages=None):
    """Let obj's moved handles travel with the mesh over the range set on `obj.supple_sequence`.

    stages: a `stages.FrameStages`, here and below.
    """
    wanted = sequence_bake.range_of(obj)
    stages = stages or FrameStages(len(wanted.frames), "Following")
    work = sequence_frames.collect(bpy.context, obj, wanted, stages)
    sequence_frames.attach(bpy.context, obj, wanted, frame_work.run(work))


def bake_sequence(obj, file="", overwrite=False, stages=None):
    """Correct the range set on `obj.supple_sequence` and let obj show it; return the `Baked`.

    file: the PC2 file, may start with "//"; empty for the one set there, or beside the .blend.
    """
    if file:
        obj.supple_sequence.file = str(file)
    stages = stages or FrameStages(len(sequence_bake.range_of(obj).frames))
    return frame_work.run(sequence_bake.to_output(bpy.context, obj, stages, overwrite))


def inbetween(obj, keys, frames, overwrite=False, stages=None):
    """Fill the frames between shape keys of obj, by name, each at its frame of `frames`.

    Goes where `obj.supple_sequence` says: a cache beside that of the sequence, or shape keys.
    """
    inputs = inbetween_bake.collect(bpy.context, obj, list(keys), list(frames))
    stages = stages or FrameStages(len(inputs.frames), "Filling")
    frame_work.run(inbetween_bake.to_output(bpy.context, obj, inputs, stages, overwrite))


def match(source, target, start="AUTOMATIC", refine=True, landmarks=(), file="", stages=None):
    """Find where target's vertices belong on source, and keep that on target; return the Match.

    start: "AUTOMATIC", "LANDMARKS" (with `landmarks`: pairs of a source and a target vertex),
    "NEAREST", "ALIGNED", "UVS", "FILE" (with `file`), "FEATURES" (as `find_correspondence`), or
    "CURRENT" to refine what target keeps.
    """
    options = match_collect.Options(start, refine, tuple(landmarks), str(file))
    return _match(source, target, options, stages)


def find_correspondence(
    source,
    target,
    epochs=match_features.EPOCHS,
    refine=True,
    model=match_features.MODEL,
    stages=None,
):
    """As `match`, by learned features that adapt to the two shapes; return the Match.

    epochs: how long they adapt; 0 takes them as they are. model: the name of shipped ones, or a
    file. `stages.learning.losses` has the loss of each epoch so far.
    """
    options = match_collect.Options("FEATURES", refine, epochs=epochs, model=str(model))
    return _match(source, target, options, stages)


def _match(source, target, options, stages):
    inputs = match_collect.collect(bpy.context, source, target, options)
    found = matching.solve(inputs, stages or Stages())
    match_solving.keep(bpy.context, source, target, inputs, found)
    return found


def transfer(
    source, target, parts, only_active_key=False, drivers=False, overwrite=False, stages=None
):
    """Carry `parts` of source along the match that target keeps; return what target got.

    parts: a set of "UVS", "WEIGHTS", "COLOURS", "KEYS", "FIT". The result is `transfer.Layers`.
    """
    options = transfer_collect.Options(frozenset(parts), only_active_key, drivers, overwrite)
    inputs, _ = transfer_collect.collect(bpy.context, source, target, options)
    layers = carrying.solve(inputs, stages or Stages()).layers
    transfer_write.write(bpy.context, source, target, layers, options)
    return layers


def check_mesh(obj):
    """Return what is unusual about the mesh and what is done about it, one sentence each."""
    rest = rest_mesh(obj)
    found = pose.check(rest)
    if rest.ngons:
        faces = count(rest.ngons, "face has", "faces have")
        found.append(f"{faces} more than 4 corners; split into triangles.")
    return found


def native_problem():
    """Return why the native part does not load, or ''."""
    return native.problem()
