# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of shapes to train on without labels: a subfolder is a group; a folder without subfolders
is one group."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import SuppleError
from .mesh import Mesh
from .mesh_files import read_mesh

ENDINGS = (".obj", ".off", ".ply", ".stl")


@dataclass(frozen=True)
class FolderShape:
    """A mesh of a folder, its vertices and faces in an order of their own.

    Attributes:
        name: the path within the folder.
        group: a number; shapes of one group can be matched.
        vertices, faces: (n, 3) and (m, 3).
    """

    name: str
    group: int
    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]


def shuffled(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], random: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """The same surface with its vertices and faces in a random order.

    Files of one template often have corresponding vertices at the same numbers; training that is to
    learn without labels must not see them.
    """
    order = random.permutation(len(vertices))
    moved = np.empty_like(vertices)
    moved[order] = vertices
    return moved, order[faces[random.permutation(len(faces))]].astype(np.int32)


def read_shapes(
    folder: str | os.PathLike, *, seed: int = 0, leave_out: Path | None = None
) -> list[FolderShape]:
    """Every mesh file of a folder, by name, shuffled in another order each.

    Hidden files and files that are no meshes (ENDINGS) are passed over.

    Args:
        seed: of the orders.
        leave_out: a subfolder that is no group, as a checkpoint's.

    Raises:
        SuppleError: bad_set, naming the file or folder and what is wrong with it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise SuppleError("bad_set", f"There is no folder {folder}.")
    groups = sorted(
        path
        for path in folder.iterdir()
        if path.is_dir()
        and not path.name.startswith(".")
        and (leave_out is None or path.resolve() != leave_out.resolve())
    )
    loose = _mesh_files(folder)
    if groups and loose:
        raise SuppleError(
            "bad_set",
            f"{folder} has meshes ({loose[0].name}) beside folders ({groups[0].name}). Each folder "
            "is a group; move the meshes into one.",
        )
    shapes: list[FolderShape] = []
    for number, group in enumerate(groups or [folder]):
        files = _mesh_files(group)
        if len(files) < 2:
            raise SuppleError(
                "bad_set",
                f"{group} holds {f'only one mesh, {files[0].name}' if files else 'no meshes'} "
                f"({', '.join(ENDINGS)}); training needs two or more that can be matched.",
            )
        for path in files:
            vertices, faces = _checked_mesh(path)
            random = np.random.default_rng([seed, len(shapes)])
            name = path.relative_to(folder).as_posix()
            shapes.append(FolderShape(name, number, *shuffled(vertices, faces, random)))
    return shapes


def _mesh_files(folder: Path) -> list[Path]:
    return sorted(
        path
        for path in folder.iterdir()
        if path.is_file() and path.suffix.lower() in ENDINGS and not path.name.startswith(".")
    )


def _checked_mesh(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    try:
        mesh = Mesh(*read_mesh(path))
    except SuppleError as error:
        about = str(error) if str(path) in str(error) else f"{path}: {error}"
        raise SuppleError("bad_set", about) from error
    return mesh.vertices, mesh.faces
