# SPDX-License-Identifier: GPL-3.0-or-later
"""Running a job: open, pose, bake, save. Nothing is left behind by a job that fails."""

import json
import time

import bpy
import numpy as np

from . import (
    groups,
    handles,
    job_output,
    job_render,
    mesh_data,
    motions,
    native,
    pose,
    shape_keys,
    space,
)
from .errors import UserError
from .stages import Stages

# The other axis of an OBJ: bodies with Y up look along Z, as Blender's own default has it.
FORWARD = {"Y": "NEGATIVE_Z", "Z": "Y"}


def _import(source, file):
    bpy.ops.wm.read_homefile(use_empty=True)
    if source.mesh.suffix.lower() != ".obj":
        raise UserError(f"{file}: input.mesh: must be a .obj file, not '{source.mesh.name}'")
    try:
        bpy.ops.wm.obj_import(
            filepath=str(source.mesh), up_axis=source.up, forward_axis=FORWARD[source.up]
        )
    except RuntimeError as error:
        raise UserError(f"{file}: input.mesh: {error}") from error
    meshes = [obj for obj in bpy.data.objects if obj.type == "MESH"]
    if len(meshes) != 1:
        raise UserError(
            f"{file}: input.mesh: {source.mesh} gives {len(meshes)} meshes; it must hold one"
        )
    obj = bpy.context.view_layer.objects.active = meshes[0]
    if source.groups:
        _require_file_order(obj, source.mesh, file)
    return obj


def _require_file_order(obj, path, file):
    """Blender's importer drops vertices without faces, which would shift the groups' numbers."""
    with open(path, "rb") as lines:
        in_file = sum(line.startswith(b"v ") for line in lines)
    if in_file != len(obj.data.vertices):
        raise UserError(
            f"{file}: input.groups: {path} has {in_file} vertices, but Blender imports only the "
            f"{len(obj.data.vertices)} that faces use, so the numbers in the groups do not fit. "
            "Remove the other vertices from the OBJ, or give a .blend with vertex groups."
        )


def find_object(source, file):
    """Return the object that a job_file.Source names; opens its .blend."""
    if source.blend:
        job_output.open_blend(source.blend, file)
    if not source.object:
        return bpy.context.view_layer.objects.active
    return job_output.scene_object(source.object, file, "input.object")


def _add_groups(obj, path, file):
    """Add the vertex groups of a JSON file {name: [vertex, ...]}."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise UserError(f"{file}: input.groups: {path} is not JSON: {error}") from error
    if not isinstance(data, dict):
        raise UserError(f"{file}: input.groups: {path} must hold {{name: [vertex, ...]}}")
    count = len(obj.data.vertices)
    for name, vertices in data.items():
        if not isinstance(vertices, list) or not all(type(vertex) is int for vertex in vertices):
            raise UserError(f"{file}: input.groups: '{name}' in {path} must be a list of integers")
        outside = [vertex for vertex in vertices if not 0 <= vertex < count]
        if outside:
            raise UserError(
                f"{file}: input.groups: '{name}' in {path} has vertex {outside[0]}, but "
                f"{obj.name} has vertices 0 to {count - 1}"
            )
        if name in obj.vertex_groups:
            raise UserError(f"{file}: input.groups: {obj.name} has a group '{name}' already")
        obj.vertex_groups.new(name=name).add(vertices, 1.0, "REPLACE")


def _motion(move, vertices, rest, world):
    if move.matrix is None:
        return motions.Motion(move.group, vertices, None, move.weight)
    motion = move.matrix
    if move.about_centroid:
        centre = space.to_world_points(world, rest.positions[vertices]).mean(axis=0)
        to_centre = np.eye(4)
        to_centre[:3, 3] = -centre
        motion = np.linalg.inv(to_centre) @ motion @ to_centre
    return motions.Motion(move.group, vertices, space.to_local_matrix(world, motion), move.weight)


def _pose(job, obj):
    world = handles.world_matrix(bpy.context, obj)
    rest = mesh_data.collect(obj, world)
    found = groups.members(obj, [move.group for move in job.moves])
    groups.require_members(obj.name, found)
    moves = [_motion(move, found[move.group], rest, world) for move in job.moves]
    options = pose.Options(
        stiffness=job.stiffness, network=job.network, keep_volume=job.keep_volume
    )
    pose_input = pose.PoseInput(rest=rest, motions=moves, options=options)
    return pose_input, pose.solve(pose_input, Stages())


def _report(job, pose_input, result, seconds):
    rest = pose_input.rest
    return {
        "object": rest.name,
        "vertices": len(rest.positions),
        "faces": len(rest.triangles),
        "handles": {m.group: "held" if m.matrix is None else "moved" for m in job.moves},
        "stiffness": job.stiffness,
        "network": job.network,
        "shape_key": job.key,
        "notes": result.notes,
        "figures": pose.figures(pose_input, result),
        "solve": result.report,
        "seconds": seconds,
        **job_output.versions(),
    }


def run(job):
    """Run a job_file.Job. Raises UserError; then nothing was written."""
    native.supple()
    start = time.perf_counter()
    file = job.path
    obj = _import(job.source, file) if job.source.mesh else find_object(job.source, file)
    mesh_data.require_writable(obj)
    if job.source.groups:
        _add_groups(obj, job.source.groups, file)
    shape_keys.require_free(obj, job.key, job.overwrite)
    job_output.say(f"{obj.name}: {len(obj.data.vertices):,} vertices, {len(job.moves)} handles")
    pose_input, result = _pose(job, obj)
    seconds = time.perf_counter() - start
    shape_keys.write(obj, job.key, result.positions)
    for note in result.notes:
        job_output.say(f"{obj.name}: {note}")
    render = job.render
    pictures = [path for path in (render.before, render.after) if path] if render else []
    targets = [job.blend, *([job.report] if job.report else []), *pictures]
    with job_output.all_or_nothing(targets) as partial:
        job_output.save(partial[job.blend])
        if pictures:
            job_render.before_and_after(obj, job.key, render, partial)
        if job.report:
            report = _report(job, pose_input, result, seconds)
            job_output.write_json(partial[job.report], report)
    for path in targets:
        job_output.say(f"wrote {path}")
