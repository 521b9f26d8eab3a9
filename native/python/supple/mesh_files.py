# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files: what meshio reads and writes, and texture coordinates by face corner."""

import contextlib
import io
import os
import threading
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray

from . import files
from .errors import SuppleError

COMMON = (".obj", ".off", ".ply", ".stl", ".vtk")
_SURFACE = ("triangle", "quad", "polygon")
_IGNORED = ("line", "vertex")
_ONE_AT_A_TIME = threading.Lock()  # what is printed goes elsewhere for the whole process


def read_mesh(path: str | os.PathLike) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """(n, 3) vertices in file order and (m, 3) triangles of OBJ and any format meshio reads; larger
    polygons are split into fans.

    Raises:
        SuppleError: bad_case.
    """
    path = Path(path)
    if path.suffix.lower() == ".obj":
        found = _read_obj(path)
        return found.vertices, _whole(path, _fans(found.corners))
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
        triangles.append(_fans(np.asarray(block.data)))
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] < 3:
        raise SuppleError("bad_case", f"{path} has no vertices with three coordinates.")
    faces = np.concatenate(triangles) if triangles else np.zeros((0, 3), dtype=np.int64)
    return points[:, :3], _whole(path, faces)


def read_uvs(path: str | os.PathLike) -> NDArray[np.float64]:
    """(m, 3, 2) texture coordinates at the corners of the triangles of `read_mesh`.

    Raises:
        SuppleError: bad_case.
    """
    path = Path(path)
    if path.suffix.lower() == ".obj":
        found = _read_obj(path)
        corners = _fans(found.uv_corners)
        if len(corners) and corners.min() >= 0:
            return found.uvs[corners]
    else:
        faces = read_mesh(path)[1]
        values = _vertex_uvs(path)
        if values is not None and len(faces) and faces.max() < len(values):
            return values[faces]
    raise SuppleError(
        "bad_case",
        f"{path} has no texture coordinates at all corners of its faces; start otherwise.",
    )


def check_ending(path: str | os.PathLike) -> None:
    """Whether a mesh can be written to such a file.

    Raises:
        SuppleError: cannot_write.
    """
    if Path(path).suffix.lower() not in meshio.extension_to_filetypes:
        raise SuppleError(
            "cannot_write", f"{path} must end in {', '.join(COMMON)} or the like to hold a mesh."
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
    _check_header(path)
    said = io.StringIO()  # by meshio, which prints what it refuses and leaves
    try:
        with _ONE_AT_A_TIME, contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        words = " ".join(said.getvalue().split()) or str(error)
        raise SuppleError(
            "bad_case",
            f"{path} cannot be read as a mesh ({', '.join(COMMON)} and what else meshio reads): "
            f"{words.rstrip('.')}.",
        ) from error


def _check_header(path: Path) -> None:
    """meshio waits for ever without the counts of an OFF file or the end of a PLY header."""
    with open(path, "rb") as file:
        start = file.read(1 << 16)
    if path.suffix.lower() == ".ply" and b"end_header" not in start:
        raise SuppleError(
            "bad_case", f"{path} cannot be read as a mesh: its header has no end_header."
        )
    if path.suffix.lower() == ".off":
        words = [word for line in start.splitlines() for word in line.split(b"#")[0].split()]
        if len(words) < 4 or words[0] != b"OFF":
            raise SuppleError(
                "bad_case",
                f"{path} cannot be read as a mesh: it must begin with OFF and three counts.",
            )


def _fans(polygons: NDArray | list[list[int]]) -> NDArray[np.int64]:
    """(m, 3) triangles from the first corner of each polygon."""
    if isinstance(polygons, np.ndarray):
        columns = [polygons[:, [0, i, i + 1]] for i in range(1, polygons.shape[1] - 1)]
        return np.concatenate(columns) if columns else np.zeros((0, 3), dtype=np.int64)
    found = [(p[0], p[i], p[i + 1]) for p in polygons for i in range(1, len(p) - 1)]
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def _whole(path: Path, faces: NDArray) -> NDArray[np.int32]:
    if faces.size and (faces.max() >= 2**31 or faces.min() < -(2**31)):
        raise SuppleError("bad_case", f"{path} has faces with indices beyond 2**31.")
    return faces.astype(np.int32)


@dataclass
class _Obj:
    vertices: NDArray[np.float64]
    uvs: NDArray[np.float64]
    corners: list[list[int]]  # of each face, 0-based
    uv_corners: list[list[int]]  # -1 where a corner has none


def _read_obj(path: Path) -> _Obj:
    """Vertices, faces and texture coordinates. Not by meshio, which takes texture coordinates for
    values at vertices and knows no indices that count backwards."""
    if not path.is_file():
        raise SuppleError("bad_case", f"There is no file {path}.")
    content = path.read_bytes()
    if b"\0" in content:
        raise SuppleError("bad_case", f"{path} is no text file.")
    vertices: list[list[float]] = []
    uvs: list[list[float]] = []
    corners: list[list[int]] = []
    uv_corners: list[list[int]] = []
    for number, line in enumerate(content.removeprefix(b"\xef\xbb\xbf").splitlines(), start=1):
        words = line.split()
        kind = words[0] if words else b""
        try:
            if kind == b"v":
                vertices.append([float(words[1]), float(words[2]), float(words[3])])
            elif kind == b"vt":
                uvs.append([float(words[1]), float(words[2]) if len(words) > 2 else 0.0])
            elif kind == b"f":
                parts = [word.split(b"/") for word in words[1:]]
                corners.append([_index(part[0], len(vertices)) for part in parts])
                uv_corners.append(
                    [_index(p[1], len(uvs), len(uvs)) if len(p) > 1 and p[1] else -1 for p in parts]
                )
        except (ValueError, IndexError):
            text = line.decode(errors="replace")[:60]
            raise SuppleError(
                "bad_case", f"{path}, line {number}: '{text}' makes no sense."
            ) from None
    if not vertices:
        raise SuppleError("bad_case", f"{path} has no vertices.")
    return _Obj(np.array(vertices), np.array(uvs).reshape(-1, 2), corners, uv_corners)


def _index(word: bytes, count: int, most: int = 2**31) -> int:
    """0-based, of one from 1 or, below 0, backwards from the last of `count` so far."""
    index = int(word)
    if index == 0 or index > most:
        raise ValueError(word)
    return index - 1 if index > 0 else count + index


def _vertex_uvs(path: Path) -> NDArray[np.float64] | None:
    mesh = _read(path)
    for names in (("texture",), ("uv",), ("st",), ("u", "v"), ("s", "t")):
        if all(name in mesh.point_data for name in names):
            columns = [np.asarray(mesh.point_data[name], dtype=np.float64) for name in names]
            values = np.column_stack(columns)
            if values.shape[1] >= 2 and len(values) == len(mesh.points):
                return values[:, :2]
    return None
