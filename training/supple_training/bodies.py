# SPDX-License-Identifier: GPL-3.0-or-later
"""Human bodies and poses from the parametric model `anny`.

The body is anny's MakeHuman mesh without eyes and tongue: 13,348 vertices and 13,346 quads, one
closed component of genus 0. Lengths are metres, Z is up, the body looks along -Y and its left side
is at +X. anny's code is Apache-2.0 and its MakeHuman assets are CC0, so a body made here, and
whatever is learnt from it, may be used by anyone.

Everything random takes a `numpy.random.Generator`; nothing depends on global state.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import igl
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

PHENOTYPES = (
    "gender",
    "age",
    "muscle",
    "weight",
    "height",
    "proportions",
    "cupsize",
    "firmness",
    "african",
    "asian",
    "caucasian",
)
"""The numbers in [0, 1] that shape a body, in the order of the arrays below."""

HELD_OUT_GRID = 4
"""Held-out bodies take one cell in four of a grid of this many cells over (muscle, weight)."""


@dataclass(frozen=True)
class JointRange:
    """How far a bone turns about its own axes, in degrees, from the rest pose.

    The bone points along its y axis: x is flexion, y twist, z sideways. Angles are for the left
    side; on the right, y and z change sign.
    """

    bones: tuple[str, ...]
    """Bones that share the turn in equal parts."""
    x: tuple[float, float]
    y: tuple[float, float] = (0.0, 0.0)
    z: tuple[float, float] = (0.0, 0.0)
    strong: float = 0.35
    """Chance that a pose uses the whole range; otherwise it stays near rest."""


_MIDDLE = (
    JointRange(
        ("spine05", "spine04", "spine03", "spine02", "spine01"), (-20, 55), (-30, 30), (-22, 22)
    ),
    JointRange(("neck01", "neck02", "neck03", "head"), (-30, 35), (-50, 50), (-22, 22)),
)

# The arms rest half raised (45 degrees) with elbows bent by about 42 degrees; the legs straight.
_SIDES = (
    JointRange(("clavicle",), (-6, 6), (0, 0), (-6, 12)),
    JointRange(("upperarm01",), (-30, 75), (-25, 25), (-38, 70)),
    JointRange(("upperarm02",), (0, 0), (-15, 15)),
    JointRange(("lowerarm01",), (-38, 92), strong=0.6),
    JointRange(("lowerarm02",), (0, 0), (-45, 45)),
    JointRange(("wrist",), (-40, 40), (-10, 10), (-18, 18)),
    JointRange(("finger1-1", "finger1-2", "finger1-3"), (-10, 40), (0, 0), (-8, 8)),
    JointRange(("upperleg01",), (-105, 20), (-20, 20), (-38, 5), strong=0.5),
    JointRange(("lowerleg01",), (0, 125), strong=0.5),
    JointRange(("foot",), (-18, 32), (-8, 8), (-10, 10)),
)
_FINGERS = tuple(
    JointRange((f"finger{i}-1", f"finger{i}-2", f"finger{i}-3"), (-20, 150), (0, 0), (-8, 8))
    for i in range(2, 6)
)


@lru_cache(maxsize=1)
def _model():
    """The anny model, built once a process (its own cache makes later processes quick)."""
    try:
        import anny
        import torch
        from anny.models.model_data import TopologyConfig
    except ImportError as error:
        raise ImportError(
            f"training bodies need the package anny, which failed to import ({error}); "
            "install the training package: pip install ./training"
        ) from error
    torch.set_num_threads(1)  # two processes of one thread each make pairs faster than one of two
    return anny.Anny(
        topology=TopologyConfig(
            base_mesh="makehuman", triangulate_faces=False, eyes=False, tongue=False
        ),
        phenotypes="all",
        skinning_method="lbs",
        pose_parameterization="local-bone-world",
    )


def quads() -> IntArray:
    """The body's faces: (13346, 4), 0-based, counterclockwise from outside."""
    return _model().faces.numpy().astype(np.int64)


def triangles(rng: np.random.Generator | None = None) -> IntArray:
    """The body's quads cut into triangles: (26692, 3).

    Each quad is cut along its first diagonal or, with `rng`, along a random one.
    """
    q = quads()
    first = np.zeros(len(q), bool) if rng is None else rng.random(len(q)) < 0.5
    q = np.where(first[:, None], np.roll(q, 1, axis=1), q)
    return np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]])


def bone_weights() -> dict[str, FloatArray]:
    """How far each vertex follows each bone: name -> (13348,), summing to 1 over the bones."""
    model = _model()
    dense = model.dense_vertex_bone_weights.numpy().astype(np.float64)
    return dict(zip(model.bone_labels, dense.T, strict=True))


def is_held_out(phenotype: FloatArray) -> bool:
    """Whether a body belongs to the held-out part of phenotype space.

    The cells (i, j) of a grid over (muscle, weight) with (i + j) % 4 == 3 are held out, so no
    training body, of whatever seed, is also a held-out one.
    """
    muscle, weight = phenotype[PHENOTYPES.index("muscle")], phenotype[PHENOTYPES.index("weight")]
    cell = np.minimum((np.array([muscle, weight]) * HELD_OUT_GRID).astype(int), HELD_OUT_GRID - 1)
    return bool(cell.sum() % 4 == 3)


def sample_phenotype(rng: np.random.Generator, *, held_out: bool = False) -> FloatArray:
    """One random body: (11,) numbers in [0, 1] in the order of `PHENOTYPES`.

    All genders, muscles, weights, heights and origins; three in four are adults, the others from
    about six years up. `held_out` chooses the part of phenotype space (see `is_held_out`).
    """
    while True:
        value = dict.fromkeys(PHENOTYPES, 0.0)
        for name in ("muscle", "weight", "height", "proportions", "cupsize", "firmness"):
            value[name] = rng.uniform(0.05, 0.95)
        value["gender"] = rng.beta(0.6, 0.6)
        value["age"] = rng.uniform(0.6, 1.0) if rng.random() < 0.75 else rng.uniform(0.25, 0.6)
        for name, share in zip(PHENOTYPES[-3:], rng.dirichlet(np.ones(3)), strict=True):
            value[name] = share
        phenotype = np.array([value[name] for name in PHENOTYPES])
        if is_held_out(phenotype) == held_out:
            return phenotype


def _sample_angles(joint: JointRange, rng: np.random.Generator) -> FloatArray:
    """Turns about x, y, z in degrees for the whole chain of a joint."""
    low, high = np.array([joint.x, joint.y, joint.z], dtype=np.float64).T
    if rng.random() < joint.strong:
        return rng.uniform(low, high)
    return np.clip(rng.normal(0.0, 0.18, 3) * (high - low), low, high)


def rotation(degrees: FloatArray) -> FloatArray:
    """(3, 3) rotation from turns about x, y, z: flexion after sideways after twist."""
    matrix = np.eye(3)
    for axis in (0, 2, 1):  # the last factor acts first
        turn = np.radians(degrees[axis])
        i, j = (axis + 1) % 3, (axis + 2) % 3
        factor = np.eye(3)
        factor[i, i] = factor[j, j] = np.cos(turn)
        factor[i, j], factor[j, i] = -np.sin(turn), np.sin(turn)
        matrix = matrix @ factor
    return matrix


def _sample_bones(rng: np.random.Generator) -> dict[str, FloatArray]:
    """A (3, 3) rotation for each moved bone, in the bone's own frame."""
    bones: dict[str, FloatArray] = {}
    for joint in _MIDDLE:
        turn = rotation(_sample_angles(joint, rng) / len(joint.bones))
        bones.update(dict.fromkeys(joint.bones, turn))
    for side, mirror in ((".L", 1.0), (".R", -1.0)):
        signs = np.array([1.0, mirror, mirror])
        for joint in _SIDES:
            turn = rotation(signs * _sample_angles(joint, rng) / len(joint.bones))
            bones.update({bone + side: turn for bone in joint.bones})
        curl = rng.uniform(-0.1, 0.6)  # the fingers of a hand mostly curl together
        for joint in _FINGERS:
            degrees = np.array([joint.x[1] * (curl + rng.normal(0, 0.08)), 0, rng.normal(0, 3)])
            degrees[0] = np.clip(degrees[0], *joint.x)
            turn = rotation(signs * degrees / len(joint.bones))
            bones.update({bone + side: turn for bone in joint.bones})
    return bones


def _posed(
    phenotype: FloatArray, bones: dict[str, FloatArray] | None
) -> tuple[FloatArray, FloatArray]:
    """The posed surface (13348, 3) and the starts of the posed bones, (bones, 3)."""
    import torch

    model = _model()
    pose = np.tile(np.eye(4), (1, len(model.bone_labels), 1, 1))
    for name, rotation in (bones or {}).items():
        pose[0, model.bone_labels.index(name), :3, :3] = rotation
    named = dict(zip(PHENOTYPES, phenotype.tolist(), strict=True))
    with torch.no_grad():
        result = model(torch.from_numpy(pose), phenotype_kwargs=named)
    points, starts = result["vertices"][0], result["bone_poses"][0, :, :3, 3]
    return points.numpy().astype(np.float64), starts.numpy().astype(np.float64)


def vertices(phenotype: FloatArray, bones: dict[str, FloatArray] | None = None) -> FloatArray:
    """The body's surface: (13348, 3) in metres.

    `phenotype` is (11,) in [0, 1]; `bones` has a (3, 3) rotation in the bone's own frame for each
    bone that moves, None the rest pose.
    """
    return _posed(phenotype, bones)[0]


def joints(
    phenotype: FloatArray, bones: dict[str, FloatArray] | None = None
) -> dict[str, FloatArray]:
    """Where each bone starts: name -> (3,) in metres. Arguments as for `vertices`."""
    return dict(zip(_model().bone_labels, _posed(phenotype, bones)[1], strict=True))


def self_intersection(points: FloatArray, faces: IntArray, samples: int = 1500) -> float:
    """The share of a closed body's vertices whose outside is inside the body, from 0 to 1.

    `samples` vertices, evenly spread over the indices, are moved outwards by 4 mm and tested by
    the winding number (Barill et al. 2018, "Fast winding numbers for soups and clouds").
    """
    chosen = np.linspace(0, len(points) - 1, samples).astype(int)
    outside = points[chosen] + 4e-3 * igl.per_vertex_normals(points, faces)[chosen]
    winding = igl.fast_winding_number(points, faces, outside)
    return float(np.mean(winding > 0.5))


def sample_pose(
    phenotype: FloatArray,
    rng: np.random.Generator,
    *,
    intersection_limit: float = 0.015,
    attempts: int = 40,
) -> FloatArray:
    """The body in a random plausible pose: (13348, 3) in metres.

    Joints turn within the ranges of this module; poses in which more than `intersection_limit` of
    the surface is inside the body, beyond what already is at rest, are drawn again.

    Raises RuntimeError when none of `attempts` poses is free enough of intersections.
    """
    faces = triangles()
    allowed = self_intersection(vertices(phenotype), faces) + intersection_limit
    for _ in range(attempts):
        posed = vertices(phenotype, _sample_bones(rng))
        if self_intersection(posed, faces) <= allowed:
            return posed
    raise RuntimeError(
        f"no pose out of {attempts} kept self intersection below {allowed:.3f}; "
        "widen intersection_limit or narrow the joint ranges"
    )
