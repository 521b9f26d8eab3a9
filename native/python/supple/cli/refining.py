# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `supple refine`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import supple

from ..files import check_outputs
from ..match_sets import is_index, read_indices, read_text
from ..mesh_files import read_uvs
from .console import console, model_file, print_error, watched
from .maps import prepared, print_notes, write_map, written

FAR_LANDMARK = 0.03


class Start(StrEnum):
    """Where a first map comes from."""

    automatic = "automatic"
    nearest = "nearest"
    aligned = "aligned"
    uv = "uv"


def refine(
    source: Annotated[Path, typer.Argument(help="Mesh file that is mapped.")],
    target: Annotated[Path, typer.Argument(help="Mesh file it is mapped to.")],
    out: Annotated[Path, typer.Option(help="For the map: a target vertex a line, from 1.")],
    first_map: Annotated[
        Path | None,
        typer.Option("--map", help="A map to refine: a target vertex a line, from 1."),
    ] = None,
    landmarks: Annotated[
        Path | None,
        typer.Option(help="Pairs to start from: a source and a target vertex a line, from 1."),
    ] = None,
    start: Annotated[
        Start | None,
        typer.Option(
            help="What to start from, without --map and --landmarks: the shapes alone; the nearest "
            "points as the meshes lie, or after one was laid on the other; the same place in their "
            "UV maps.",
            show_default="automatic",
        ),
    ] = None,
    network: Annotated[bool, typer.Option(help="Use the network, or none.")] = True,
    model: Annotated[str, typer.Option(help="Shipped network or .safetensors file.")] = "spectral",
    cache: Annotated[bool, typer.Option(help="Keep prepared meshes on disk, and use them.")] = True,
) -> None:
    """Map one mesh to another: find or read a rough map, and refine it."""
    try:
        if sum(given is not None for given in (first_map, landmarks, start)) > 1:
            raise supple.SuppleError("bad_option", "Give one of --map, --landmarks and --start.")
        check_outputs((out,), (source, target, first_map, landmarks, model_file(model)))
        meshes = prepared((source, target), cache=cache)
        pairs = None if landmarks is None else _read_landmarks(landmarks)
        initial = _initial(meshes, (source, target), first_map, pairs, start)
        refiner = supple.Refiner(*meshes, model=model if network else None)
        result = watched("refining", lambda p: refiner.refine(initial, progress=p))
        print_notes(refiner.notes)
        if pairs is not None:
            _note_moved(meshes[1], pairs, result.point_map)
        score = supple.map_score(*meshes, result.point_map)
        write_map(out, result.point_map)
    except (supple.SuppleError, OSError) as error:
        print_error(error)
        raise typer.Exit(1) from error
    typer.echo(written(out, result.point_map, score))


def _initial(
    meshes: list[supple.PreparedMesh],
    paths: tuple[Path, Path],
    first_map: Path | None,
    pairs: np.ndarray | None,
    start: Start | None,
) -> np.ndarray:
    """The map to refine; what is to be said of it is printed."""
    if first_map is not None:
        point_map = read_indices(first_map, meshes[1].vertex_count, f"vertices of {paths[1].name}")
        if supple.map_score(*meshes, point_map).orientation < 0.3:
            console.print(
                "note: the map turns the surface inside out in most places; left and right are "
                "probably exchanged"
            )
        return point_map
    if pairs is not None:
        found = watched("landmarks", lambda p: supple.landmark_map(*meshes, pairs, progress=p))
    elif start in (None, Start.automatic):
        found = watched("first map", lambda p: supple.automatic_map(*meshes, progress=p))
    elif start is Start.uv:
        found = supple.uv_map(*meshes, *(read_uvs(path) for path in paths))
    else:
        found = supple.nearest_map(*meshes, aligned=start is Start.nearest)
    print_notes(found.notes)
    return found.point_map


def _read_landmarks(path: Path) -> np.ndarray:
    pairs = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        words = line.replace(",", " ").split()
        if not words or words[0].startswith("#"):
            continue
        if len(words) != 2 or not all(is_index(word) and int(word) > 0 for word in words):
            raise supple.SuppleError(
                "bad_option", f"{path}, line {number}: '{line}' is no pair of vertices, from 1."
            )
        pairs.append([int(word) - 1 for word in words])
    if not pairs:
        raise supple.SuppleError("bad_option", f"{path} has no landmarks.")
    return np.array(pairs)


def _note_moved(target: supple.PreparedMesh, pairs: np.ndarray, point_map: np.ndarray) -> None:
    """Landmarks say where to start; refining may lead away from them."""
    wanted, found = target.vertices[pairs[:, 1]], target.vertices[point_map[pairs[:, 0]]]
    away = np.linalg.norm(found - wanted, axis=1) / target.diagonal
    far = np.flatnonzero(away > FAR_LANDMARK)
    if len(far):
        console.print(
            f"note: {len(far)} of {len(pairs)} landmarks ended farther than {FAR_LANDMARK:.0%} of "
            f"the target's size from where they were put, number {far[0] + 1} by "
            f"{away[far[0]]:.0%}. They may contradict each other or the shapes."
        )
