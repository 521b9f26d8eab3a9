# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets of meshes with known correspondences and maps to refine, on disk.

shapes/NAME.off      a mesh, in its own units and triangulation
corres/NAME.vts      line t: the 1-based vertex of NAME that stands for template point t
corres/NAME.mirror.vts   optional: the same for the mirror image of template point t
init/A__B.map        line i: the 1-based vertex of B that vertex i of A maps to; to refine only
pairs.txt            "A B" a line: the pairs, source A, target B
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import SuppleError
from .mesh_files import read_mesh


@dataclass(frozen=True)
class MatchShape:
    """A mesh of a set.

    Attributes:
        name: as in pairs.txt.
        vertices, faces: (n, 3) and (m, 3).
        template: (p,) the vertex, 0-based, of each template point.
        mirror: (p,) the vertex of each one's mirror image, left for right; None where the set does
            not say.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    template: NDArray[np.int32]
    mirror: NDArray[np.int32] | None = None


@dataclass(frozen=True)
class MatchSet:
    """A set, read and checked.

    Attributes:
        name: the folder's name.
        shapes: by name.
        pairs: (source, target) names.
        initial: (n_source,) the map of each pair, 0-based; None where the set has no maps.
    """

    name: str
    shapes: dict[str, MatchShape]
    pairs: list[tuple[str, str]]
    initial: dict[tuple[str, str], NDArray[np.int32] | None]


def read_match_set(folder: str | os.PathLike, *, refine: bool = True) -> MatchSet:
    """Read a set, all of it.

    Args:
        refine: the set must have maps to refine; otherwise the folder `init` may be missing.

    Raises:
        SuppleError: bad_set, naming the file and what is wrong with it.
    """
    folder = Path(folder)
    pairs = _read_pairs(folder / "pairs.txt")
    shapes = {
        name: _read_shape(folder, name) for name in dict.fromkeys(n for pair in pairs for n in pair)
    }
    initial = {}
    for a, b in pairs:
        points = [len(shapes[name].template) for name in (a, b)]
        if points[0] != points[1]:
            raise SuppleError(
                "bad_set",
                f"{folder / 'corres' / a}.vts has {points[0]} lines, {b}.vts {points[1]}; both are "
                "of the same template points.",
            )
        if not refine and not (folder / "init").is_dir():
            initial[a, b] = None
            continue
        path = folder / "init" / f"{a}__{b}.map"
        initial[a, b] = read_indices(path, len(shapes[b].vertices), f"vertices of {b}")
        if len(initial[a, b]) != len(shapes[a].vertices):
            raise SuppleError(
                "bad_set",
                f"{path} has {len(initial[a, b])} lines for the {len(shapes[a].vertices)} vertices "
                f"of {a}; it must have one for each.",
            )
    return MatchSet(folder.resolve().name, shapes, pairs, initial)


def read_indices(path: Path, count: int, of_what: str) -> NDArray[np.int32]:
    """A file of one 1-based index a line, 0-based. Raises SuppleError: bad_set."""
    lines = read_text(path).split()
    bad = next((i for i, line in enumerate(lines) if not is_index(line)), None)
    if bad is not None:
        raise SuppleError(
            "bad_set",
            f"{path}, entry {bad + 1}: '{lines[bad][:40]}' is no whole number of 1 or more.",
        )
    found = np.array([int(line) for line in lines], dtype=np.int64)
    outside = np.flatnonzero((found < 1) | (found > count))
    if len(outside):
        raise SuppleError(
            "bad_set",
            f"{path}, entry {outside[0] + 1}: {found[outside[0]]} is not among the {count} "
            f"{of_what}, which are counted from 1.",
        )
    return (found - 1).astype(np.int32)


def is_index(word: str) -> bool:
    """Whether a word is a whole number that a mesh could have."""
    return word.isascii() and word.isdigit() and len(word) < 19


def read_text(path: Path) -> str:
    """Raises SuppleError: bad_set."""
    if not path.is_file():
        raise SuppleError("bad_set", f"There is no file {path}.")
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise SuppleError("bad_set", f"{path} is no text file.") from None


def _read_pairs(path: Path) -> list[tuple[str, str]]:
    pairs = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        names = line.split()
        if not names:
            continue
        if len(names) != 2:
            raise SuppleError(
                "bad_set", f"{path}, line {number}: '{line}' is no pair of two names."
            )
        pairs.append((names[0], names[1]))
    if not pairs:
        raise SuppleError("bad_set", f"{path} names no pairs.")
    return pairs


def _read_shape(folder: Path, name: str) -> MatchShape:
    path = folder / "shapes" / f"{name}.off"
    try:
        vertices, faces = read_mesh(path)
    except SuppleError as error:
        raise SuppleError("bad_set", str(error)) from error
    template = read_indices(folder / "corres" / f"{name}.vts", len(vertices), f"vertices of {name}")
    if len(template) == 0:
        raise SuppleError(
            "bad_set", f"{folder / 'corres' / name}.vts is empty; it says nothing of the truth."
        )
    mirror = None
    path = folder / "corres" / f"{name}.mirror.vts"
    if path.is_file():
        mirror = read_indices(path, len(vertices), f"vertices of {name}")
        if len(mirror) != len(template):
            raise SuppleError(
                "bad_set",
                f"{path} has {len(mirror)} lines, {name}.vts {len(template)}; both are of the same "
                "template points.",
            )
    return MatchShape(name, vertices, faces, template, mirror)
