# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading from a body, where its handles are and how it is set, everything that a solve needs."""

from . import groups, mesh_data, motions, pose, space


def options_of(obj):
    """Return the `pose.Options` set on obj."""
    body = obj.supple
    return pose.Options(
        stiffness=body.stiffness,
        method=body.method.lower(),
        network=body.network,
        keep_volume=body.keep_volume,
    )


def blend_of(obj, world):
    """Return the `pose.Blend` set on obj, whose evaluated world matrix is `world`."""
    body = obj.supple
    return pose.Blend(
        strength=body.strength,
        mask=groups.weights(obj, body.mask) if body.mask else None,
        falloff=body.falloff / space.uniform_scale(world),
    )


def collect_pose(place, obj):
    """Return the `pose.PoseInput` of obj in `place` (motions.Place)."""
    mesh_data.require_writable(obj)
    world = place.world_matrix(obj)
    return pose.PoseInput(
        rest=mesh_data.collect(obj, world),
        motions=motions.collect(place, obj, world, motions.vertices_of(obj)),
        options=options_of(obj),
        blend=blend_of(obj, world),
    )
