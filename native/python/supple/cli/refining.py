# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `supple refine`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import meshio
import numpy as np
import typer

import supple

from ..cases import read_mesh
from ..match_sets import read_indices
from .console import console, watched
from .maps import prepared, print_notes, write_map, written


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
        Start, typer.Option(help="What to start from, without --map and --landmarks.")
    ] = Start.automatic,
    network: Annotated[bool, typer.Option(help="Use the network, or none.")] = True,
    model: Annotated[str, typer.Option(help="Shipped network or .safetensors file.")] = "spectral",
    cache: Annotated[bool, typer.Option(help="Keep prepared meshes on disk, and use them.")] = True,
) -> None:
    """Map one mesh to another: find or read a rough map, and refine it."""
    try:
        if first_map is not None and landmarks is not None:
            raise supple.SuppleError("bad_option", "Give --map or --landmarks, not both.")
        meshes = prepared((source, target), cache=cache)
        initial = _initial(meshes, (source, target), first_map, landmarks, start)
        refiner = supple.Refiner(*meshes, model=model if network else None)
        result = watched("refining", lambda p: refiner.refine(initial, progress=p))
        print_notes(refiner.notes)
        score = supple.map_score(*meshes, result.point_map)
        write_map(out, result.point_map)
    except (supple.SuppleError, OSError) as error:
        console.print(f"[red]error[/red] {error}", highlight=False)
        raise typer.Exit(1) from error
    typer.echo(written(out, result.point_map, score))


def _initial(
    meshes: list[supple.PreparedMesh],
    paths: tuple[Path, Path],
    first_map: Path | None,
    landmarks: Path | None,
    start: Start,
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
    if landmarks is not None:
        pairs = _read_landmarks(landmarks)
        found = watched("landmarks", lambda p: supple.landmark_map(*meshes, pairs, progress=p))
    elif start is Start.automatic:
        found = watched("first map", lambda p: supple.automatic_map(*meshes, progress=p))
    elif start is Start.uv:
        found = supple.uv_map(*meshes, *(_read_uvs(path) for path in paths))
    else:
        found = supple.nearest_map(*meshes, aligned=start is Start.aligned)
    print_notes(found.notes)
    return found.point_map


def _read_landmarks(path: Path) -> np.ndarray:
    if not path.is_file():
        raise supple.SuppleError("bad_option", f"There is no file {path}.")
    pairs = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        words = line.replace(",", " ").split()
        if not words or words[0].startswith("#"):
            continue
        if len(words) != 2 or not all(word.isdigit() and int(word) > 0 for word in words):
            raise supple.SuppleError(
                "bad_option", f"{path}, line {number}: '{line}' is no pair of vertices, from 1."
            )
        pairs.append([int(word) - 1 for word in words])
    if not pairs:
        raise supple.SuppleError("bad_option", f"{path} has no landmarks.")
    return np.array(pairs)


def _read_uvs(path: Path) -> np.ndarray:
    """(m, 3, 2) of a mesh file with texture coordinates at its vertices."""
    mesh = meshio.read(path)
    for name in ("obj:vt", "texture", "uv", "st"):
        if name in mesh.point_data and len(mesh.point_data[name]) == len(mesh.points):
            uvs = np.asarray(mesh.point_data[name], dtype=np.float64)[:, :2]
            return uvs[read_mesh(path)[1]]
    raise supple.SuppleError(
        "bad_option", f"{path} has no texture coordinates at its vertices; start otherwise."
    )
