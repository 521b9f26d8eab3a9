# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands that map one mesh to another share."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

import supple

from ..cases import read_mesh
from .console import console, watched, write_whole


def prepared(paths: Iterable[Path], *, cache: bool) -> list[supple.PreparedMesh]:
    """Mesh files, each under a progress bar."""
    meshes = []
    for path in paths:
        vertices, faces = read_mesh(path)
        meshes.append(
            watched(
                f"{path.name}: preparing",
                lambda p, v=vertices, f=faces: supple.PreparedMesh(v, f, progress=p, cache=cache),
            )
        )
    return meshes


def print_notes(notes: Iterable[supple.Note]) -> None:
    """A line each."""
    for note in notes:
        console.print(f"note: {note.message}", highlight=False)


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
