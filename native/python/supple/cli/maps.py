# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands that map one mesh to another share."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

import supple

from ..files import write_whole
from ..mesh_files import read_mesh
from .console import console, watched


def prepared(paths: Iterable[Path], *, cache: bool) -> list[supple.PreparedMesh]:
    """Mesh files, each under a progress bar."""
    meshes = []
    for path in paths:
        vertices, faces = read_mesh(path)
        try:
            mesh = watched(
                f"{path.name}: preparing",
                lambda p, v=vertices, f=faces: supple.PreparedMesh(v, f, progress=p, cache=cache),
            )
        except supple.SuppleError as error:
            raise supple.SuppleError(error.code, f"{path}: {error}") from error
        print_notes(mesh.notes, path.name)
        meshes.append(mesh)
    return meshes


def print_notes(notes: Iterable[supple.Note], about: str = "") -> None:
    """A line each."""
    for note in notes:
        text = f"note: {about}: {note.message}" if about else f"note: {note.message}"
        console.print(text, highlight=False, markup=False)


def write_map(path: Path, point_map: np.ndarray) -> None:
    """A target vertex a line, from 1."""
    write_whole(path, "".join(f"{vertex + 1}\n" for vertex in point_map))


def written(path: Path, point_map: np.ndarray, score: supple.MapScore) -> str:
    """What to say of a map that was written."""
    return (
        f"wrote {path}: {len(point_map)} lines, from 1; plausibility {score.value:.2f} "
        f"(orientation {score.orientation:.2f}, smoothness {score.smoothness:.2f}, area "
        f"{score.area:.2f})"
    )
