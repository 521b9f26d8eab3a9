# SPDX-License-Identifier: GPL-3.0-or-later
"""From a rest shape and handle motions to posed positions. No bpy: it runs on any thread."""

from dataclasses import dataclass, field

import numpy as np

from . import live_solver, native, prepared, space
from .errors import CancelledError, UserError
from .live_solver import Options
from .mesh_data import RestMesh

MODEL = "rotation"


@dataclass(frozen=True)
class Blend:
    """How much of a pose is taken. mask: (n,) in [0, 1] or None. falloff: the distance from the
    moved handles, in solve space, at which nothing of it is left; 0: it is taken everywhere.
    """

    strength: float = 1.0
    mask: np.ndarray | None = None
    falloff: float = 0.0


@dataclass(frozen=True)
class PoseInput:
    """Everything a solve needs; motions: a list of motions.Motion."""

    rest: RestMesh
    motions: list
    options: Options = field(default_factory=Options)
    blend: Blend = field(default_factory=Blend)


@dataclass(frozen=True)
class Pose:
    """A solved pose: positions (n, 3) float64 in local coordinates, what was noted, figures."""

    positions: np.ndarray
    notes: list = field(default_factory=list)
    report: dict = field(default_factory=dict)


def guarded(name, compute):
    """Run `compute`, turning the native package's errors into messages that name the object."""
    supple = native.supple()
    try:
        return compute()
    except supple.Cancelled as error:
        raise CancelledError from error
    except supple.SuppleError as error:
        raise UserError(f"{name}: {error}") from error


def prepare(rest, stages):
    """Prepare a RestMesh; return its `supple.PreparedMesh`."""
    return guarded(rest.name, lambda: prepared.mesh(rest, stages))


def check(rest):
    """Return the messages of what the native package finds unusual in a RestMesh."""
    supple = native.supple()
    mesh = guarded(rest.name, lambda: supple.Mesh(rest.positions, rest.triangles))
    return [note.message for note in mesh.notes]


def native_handles(rest, motions):
    """Return motions.Motion as a list of `supple.Handle` in the solve space of RestMesh rest."""
    handle = native.supple().Handle
    return [
        handle(
            name=motion.name,
            vertices=motion.vertices,
            matrix=None
            if motion.matrix is None
            else space.to_solve_matrix(rest.stretch, motion.matrix),
            weight=motion.weight,
        )
        for motion in motions
    ]


def blend_weights(mesh, motions, blend):
    """Return how much of the pose each vertex takes, (n,), or None for all of it."""
    if blend.falloff <= 0:
        return blend.mask
    moved = [motion.vertices for motion in motions if motion.matrix is not None]
    if not moved:
        return blend.mask
    weights = native.supple().falloff_weights(mesh, np.concatenate(moved), blend.falloff)
    return weights if blend.mask is None else weights * blend.mask


def to_local(rest, vertices, strength, weights):
    """Return solved vertices (n, 3) as local positions, as far as strength and weights say."""
    vertices = np.asarray(vertices)
    if strength != 1.0 or weights is not None:
        at_rest = space.to_solve_points(rest.stretch, rest.positions)
        vertices = native.supple().blend(at_rest, vertices, strength, weights)
    return space.to_local_points(rest.stretch, vertices)


def solve(pose_input, stages):
    """Return the Pose. Raises UserError, or CancelledError after `stages.cancel()`."""
    return guarded(pose_input.rest.name, lambda: _solve(pose_input, stages))


def _solve(pose_input, stages):
    rest, blend = pose_input.rest, pose_input.blend
    handles = native_handles(rest, pose_input.motions)
    mesh = prepared.mesh(rest, stages, share=0.7)
    editor = prepared.editor(rest, mesh, handles, MODEL, stages, share=0.2)
    result = live_solver.solve(editor, handles, pose_input.options, stages.begin("Solving", 0.1))
    weights = blend_weights(mesh, pose_input.motions, blend)
    return Pose(
        positions=to_local(rest, result.vertices, blend.strength, weights),
        notes=[note.message for note in result.notes],
        report={**result.report, "from_cache": mesh.from_cache},
    )


def figures(pose_input, pose):
    """Return how good a Pose is: handle_error (largest distance to its target of a vertex whose
    handle has weight 1, as a part of the bounding box's diagonal), symmetric_dirichlet and
    flipped_faces, in the shape as the object's scale shows it.
    """
    supple = native.supple()
    rest = pose_input.rest
    error = 0.0
    for motion in pose_input.motions:
        if motion.weight < 1:
            continue
        at_rest, posed = rest.positions[motion.vertices], pose.positions[motion.vertices]
        matrix = np.eye(4) if motion.matrix is None else motion.matrix
        target = at_rest @ matrix[:3, :3].T + matrix[:3, 3]
        offsets = space.to_solve_points(rest.stretch, posed - target)
        error = max(error, float(np.linalg.norm(offsets, axis=1).max()))
    before, after = (
        space.to_solve_points(rest.stretch, p) for p in (rest.positions, pose.positions)
    )
    return {
        "handle_error": error / float(np.linalg.norm(np.ptp(before, axis=0))),
        "symmetric_dirichlet": supple.symmetric_dirichlet(before, rest.triangles, after),
        "flipped_faces": supple.flipped_faces(before, rest.triangles, after),
    }
