# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files: what meshio reads and writes, and texture coordinates by face corner."""

import contextlib
import io
import os
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray

from . import files
from .errors import SuppleError

COMMON = (".obj", ".off", ".ply", ".stl", ".vtk")
_SURFACE = ("triangle", "quad", "polygon")
_IGNORED = ("line", "vertex")


def read_mesh(path: str | os.PathLike) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """(n, 3) vertices in file order and (m, 3) triangles of any format meshio reads; larger
    polygons are split into fans.

    Raises:
        SuppleError: bad_case.
    """
    path = Path(path)
    mesh = _read(path)
    triangles = []
    for block in mesh.cells:
        kind = block.type.rstrip("0123456789")
        if block.type not in _SURFACE and kind != "polygon":
            if kind in _IGNORED:
                continue
            raise SuppleError(
                "bad_case",
                f"{path} holds cells of the kind '{block.type}', which are no flat polygons. Save "
                "the surface as triangles.",
            )
        data = np.asarray(block.data)
        triangles += [
            np.stack([data[:, 0], data[:, i], data[:, i + 1]], axis=1)
            for i in range(1, data.shape[1] - 1)
        ]
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] < 3:
        raise SuppleError("bad_case", f"{path} has no vertices with three coordinates.")
    faces = np.concatenate(triangles) if triangles else np.zeros((0, 3))
    return points[:, :3], faces.astype(np.int32)


def read_uvs(path: str | os.PathLike) -> NDArray[np.float64]:
    """(m, 3, 2) texture coordinates at the corners of the triangles of `read_mesh`.

    Raises:
        SuppleError: bad_case.
    """
    path = Path(path)
    faces = read_mesh(path)[1]
    found = _obj_uvs(path) if path.suffix.lower() == ".obj" else _vertex_uvs(path, faces)
    if found is None or len(found) != len(faces):
        raise SuppleError(
            "bad_case",
            f"{path} has no texture coordinates at all corners of its faces; start otherwise.",
        )
    return found


def check_ending(path: str | os.PathLike) -> None:
    """Whether a mesh can be written to such a file.

    Raises:
        SuppleError: cannot_write.
    """
    if Path(path).suffix.lower() not in COMMON:
        raise SuppleError(
            "cannot_write", f"{path} must end in one of {', '.join(COMMON)} to hold a mesh."
        )


def write_mesh(path: str | os.PathLike, vertices: NDArray, faces: NDArray) -> None:
    """Write triangles, whole or not at all; the format follows the file's ending.

    Raises:
        SuppleError: cannot_write.
    """
    check_ending(path)
    cells = [("triangle", faces)]
    files.replace_whole(path, lambda partial: meshio.write_points_cells(partial, vertices, cells))


def _read(path: Path) -> meshio.Mesh:
    if not path.is_file():
        raise SuppleError("bad_case", f"There is no file {path}.")
    said = io.StringIO()  # by meshio, which prints what it refuses and leaves
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            if path.suffix.lower() == ".obj":
                return meshio.read(io.StringIO(_plain_obj(path)), file_format="obj")
            if path.suffix.lower() == ".off":
                _check_off(path)
            if path.suffix.lower() == ".ply":
                _check_ply(path)
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        if isinstance(error, SuppleError):
            raise
        words = " ".join(said.getvalue().split()) or str(error)
        raise SuppleError(
            "bad_case",
            f"{path} cannot be read as a mesh ({', '.join(COMMON)} and what else meshio reads): "
            f"{words.rstrip('.')}.",
        ) from error


def _text(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8", errors="strict").splitlines()
    except UnicodeDecodeError:
        raise SuppleError("bad_case", f"{path} is no text file.") from None


def _check_off(path: Path) -> None:
    """meshio waits for ever where the counts are missing."""
    words = [word for line in _text(path) for word in line.split("#")[0].split()]
    if len(words) < 4 or words[0] != "OFF":
        raise SuppleError(
            "bad_case", f"{path} cannot be read as a mesh: it must begin with OFF and three counts."
        )


def _check_ply(path: Path) -> None:
    """As with OFF, without the header's end."""
    with open(path, "rb") as file:
        if b"end_header" not in file.read(1 << 16):
            raise SuppleError(
                "bad_case", f"{path} cannot be read as a mesh: its header has no end_header."
            )


def _plain_obj(path: Path) -> str:
    """The vertices and faces alone. meshio takes texture coordinates for values at vertices, and
    knows no indices that count backwards."""
    lines, count = [], 0
    for number, line in enumerate(_text(path), start=1):
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            count += 1
            lines.append(" ".join(words[:4]))
        elif words[0] == "f":
            lines.append("f " + " ".join(_corner(w, 0, count, path, number) for w in words[1:]))
    if not lines:
        raise SuppleError("bad_case", f"{path} has no vertices.")
    return "\n".join(lines) + "\n"


def _corner(word: str, part: int, count: int, path: Path, line: int) -> str:
    """A corner's index into `count` elements read so far, from 1."""
    parts = word.split("/")
    try:
        index = int(parts[part])
    except (ValueError, IndexError):
        raise SuppleError(
            "bad_case", f"{path}, line {line}: '{word}' is no corner of a face."
        ) from None
    return str(index + count + 1 if index < 0 else index)


def _obj_uvs(path: Path) -> NDArray[np.float64] | None:
    uvs: list[list[float]] = []
    runs: list[list[list[int]]] = []
    for number, line in enumerate(_text(path), start=1):
        words = line.split()
        if words and words[0] == "vt":
            try:
                uvs.append([float(word) for word in (*words[1:3], "0")[:2]])
            except ValueError:
                raise SuppleError(
                    "bad_case", f"{path}, line {number}: '{line}' is no texture coordinate."
                ) from None
        elif words and words[0] == "f":
            if any(w.count("/") == 0 or not w.split("/")[1] for w in words[1:]):
                return None
            corners = [int(_corner(w, 1, len(uvs), path, number)) - 1 for w in words[1:]]
            if min(corners) < 0 or max(corners) >= len(uvs):
                raise SuppleError(
                    "bad_case",
                    f"{path}, line {number}: texture coordinate {max(corners) + 1} of {len(uvs)}.",
                )
            if not runs or len(runs[-1][0]) != len(corners):
                runs.append([])
            runs[-1].append(corners)
    triangles: list[list[int]] = []
    # In the order of `read_mesh`: meshio has a block for each run of faces of one size.
    for run in runs:
        for i in range(1, len(run[0]) - 1):
            triangles += [[face[0], face[i], face[i + 1]] for face in run]
    return np.array(uvs)[np.array(triangles)] if triangles else None


def _vertex_uvs(path: Path, faces: NDArray[np.int32]) -> NDArray[np.float64] | None:
    mesh = _read(path)
    for names in (("texture",), ("uv",), ("st",), ("u", "v"), ("s", "t")):
        if all(name in mesh.point_data for name in names):
            columns = [np.asarray(mesh.point_data[name], dtype=np.float64) for name in names]
            values = np.column_stack(columns)
            if values.shape[1] >= 2 and len(values) == len(mesh.points):
                return values[:, :2][faces]
    return None
