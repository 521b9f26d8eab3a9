# SPDX-License-Identifier: GPL-3.0-or-later
"""From a rest shape and handle motions to posed positions. No bpy: it runs on any thread."""

from dataclasses import dataclass, field

import numpy as np

from . import native, prepared, space
from .errors import CancelledError, UserError
from .mesh_data import RestMesh

MODEL = "rotation"


@dataclass(frozen=True)
class PoseInput:
    """Everything a solve needs; motions: a list of handles.Motion, mode: 'natural' or 'stiff'."""

    rest: RestMesh
    motions: list
    mode: str = "natural"
    network: bool = True


@dataclass(frozen=True)
class Pose:
    """A solved pose: positions (n, 3) float64 in local coordinates, what was noted, figures."""

    positions: np.ndarray
    notes: list = field(default_factory=list)
    report: dict = field(default_factory=dict)


def _guarded(name, compute):
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
    return _guarded(rest.name, lambda: prepared.mesh(rest, stages))


def check(rest):
    """Return the messages of what the native package finds unusual in a RestMesh."""
    supple = native.supple()
    mesh = _guarded(rest.name, lambda: supple.Mesh(rest.positions, rest.triangles))
    return [note.message for note in mesh.notes]


def _native_handles(pose_input):
    handle = native.supple().Handle
    stretch = pose_input.rest.stretch
    return [
        handle(
            name=motion.name,
            vertices=motion.vertices,
            matrix=None if motion.matrix is None else space.to_solve_matrix(stretch, motion.matrix),
        )
        for motion in pose_input.motions
    ]


def solve(pose_input, stages):
    """Return the Pose. Raises UserError, or CancelledError after `stages.cancel()`."""
    return _guarded(pose_input.rest.name, lambda: _solve(pose_input, stages))


def _solve(pose_input, stages):
    rest = pose_input.rest
    handles = _native_handles(pose_input)
    model = MODEL if pose_input.network else None
    mesh = prepared.mesh(rest, stages, share=0.7)
    editor = prepared.editor(rest, mesh, handles, model, stages, share=0.2)
    result = editor.solve(
        handles,
        mode=pose_input.mode,
        network=pose_input.network,
        progress=stages.begin("Solving", 0.1),
    )
    return Pose(
        positions=space.to_local_points(rest.stretch, np.asarray(result.vertices)),
        notes=[note.message for note in result.notes],
        report={**result.report, "from_cache": mesh.from_cache},
    )


def figures(pose_input, pose):
    """Return how good a Pose is: handle_error (largest distance of a handle's vertex to its target,
    as a part of the bounding box's diagonal), symmetric_dirichlet and flipped_faces, in the shape
    as the object's scale shows it.
    """
    supple = native.supple()
    rest = pose_input.rest
    error = 0.0
    for motion in pose_input.motions:
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
