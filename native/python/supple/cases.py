# SPDX-License-Identifier: GPL-3.0-or-later
"""Edit cases on disk: a folder with mesh.obj, case.json and, where it is known, truth.obj."""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .editing import Handle
from .errors import SuppleError
from .mesh_files import read_mesh


@dataclass
class EditCase:
    """One edit to make.

    Attributes:
        name: the folder's name.
        vertices: (n, 3) rest positions.
        faces: (m, 3) triangles; larger polygons are split into fans.
        handles: what to hold and move.
        truth: (n, 3) the true pose, or None.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    handles: list[Handle]
    truth: NDArray[np.float64] | None


def read_case(folder: str | os.PathLike) -> EditCase:
    """Read a case folder.

    case.json: {"handles": [{"name", "vertices": [0-based], and "matrix": 4x4 for column vectors
    or "positions": [[x, y, z], ...] or neither (held)}]}.

    Raises:
        SuppleError: bad_case, naming the file and what is wrong with it.
    """
    folder = Path(folder)
    vertices, faces = read_mesh(folder / "mesh.obj")
    handles = _read_handles(folder / "case.json")
    truth = None
    if (folder / "truth.obj").is_file():
        truth, _ = read_mesh(folder / "truth.obj")
        if len(truth) != len(vertices):
            raise SuppleError(
                "bad_case",
                f"{folder / 'truth.obj'} has {len(truth)} vertices, mesh.obj {len(vertices)}; they "
                "must be the same vertices.",
            )
    return EditCase(folder.resolve().name, vertices, faces, handles, truth)


def _read_handles(path: Path) -> list[Handle]:
    if not path.is_file():
        raise SuppleError("bad_case", f"There is no file {path}.")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise SuppleError("bad_case", f"{path} is not valid JSON: {error}.") from error
    if not isinstance(content, dict) or not isinstance(content.get("handles"), Sequence):
        raise SuppleError("bad_case", f'{path} must hold {{"handles": [...]}}.')
    handles = []
    for i, entry in enumerate(content["handles"]):
        if not isinstance(entry, dict) or "vertices" not in entry:
            raise SuppleError("bad_case", f"{path}: handle {i} has no 'vertices'.")
        unknown = set(entry) - {"name", "vertices", "matrix", "positions", "weight"}
        if unknown:
            raise SuppleError(
                "bad_case",
                f"{path}: handle {i} has '{sorted(unknown)[0]}', which is none of name, vertices, "
                "matrix, positions, weight.",
            )
        handles.append(
            Handle(
                str(entry.get("name", f"handle {i}")),
                entry["vertices"],
                entry.get("matrix"),
                entry.get("positions"),
                entry.get("weight", 1.0),
            )
        )
    return handles
