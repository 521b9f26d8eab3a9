# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and checking a job file (TOML). Every message names the file and the key."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import job_table
from .errors import UserError

STIFFNESS = {"natural": 0.0, "stiff": 1.0}
ENGINES = {"cycles": "CYCLES", "workbench": "BLENDER_WORKBENCH"}


@dataclass(frozen=True)
class Source:
    """Where the mesh comes from: a mesh file, or an object of a .blend (None: the open one)."""

    mesh: Path | None
    up: str
    groups: Path | None
    blend: Path | None
    object: str


@dataclass(frozen=True)
class Move:
    """What a vertex group does: `matrix` is a world motion (4, 4) or None if the group is held.

    weight: 1 for exactly there, less for a pull.
    about_centroid: the matrix acts about the centre of the group instead of the world's origin.
    """

    group: str
    matrix: np.ndarray | None
    about_centroid: bool
    weight: float = 1.0


@dataclass(frozen=True)
class Render:
    """Pictures from one fixed camera: before and after the pose."""

    before: Path | None
    after: Path | None
    engine: str
    size: tuple
    samples: int


@dataclass(frozen=True)
class Job:
    """A checked job file."""

    path: Path
    source: Source
    moves: list
    stiffness: float
    network: bool
    keep_volume: bool
    key: str
    overwrite: bool
    blend: Path | None
    report: Path | None
    render: Render | None


def source(table, folder):
    """Return the Source of table [input], or None for the open file's active object."""
    if table is None:
        return Source(mesh=None, up="Y", groups=None, blend=None, object="")
    found = Source(
        mesh=table.path("mesh", folder),
        up=table.choice("up", ("Y", "Z"), "Y"),
        groups=table.path("groups", folder),
        blend=table.path("blend", folder),
        object=table.take("object", str, ""),
    )
    if found.mesh and (found.blend or found.object):
        raise table.error("mesh", "give either mesh, or blend and object, not both")
    table.end()
    for key in ("mesh", "groups", "blend"):
        path = getattr(found, key)
        if path and not path.is_file():
            raise table.error(key, f"there is no file {path}")
    return found


def rotation(table):
    """Return the (3, 3) rotation of a table {axis, degrees}."""
    axis = table.numbers("axis", (3,))
    degrees = table.take("degrees", float, required=True)
    table.end()
    if axis is None or not np.linalg.norm(axis) > 0:
        raise table.error("axis", "must be 3 numbers that are not all 0")
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def stiffness(options):
    """Return the stiffness, 0 to 1, that table [options] gives by `mode` or number, or None."""
    has_mode = options.has("mode")
    mode = options.choice("mode", tuple(STIFFNESS), "natural")
    value = options.take("stiffness", float)
    if value is None:
        return STIFFNESS[mode] if has_mode else None
    if has_mode:
        raise options.error("stiffness", "give either mode or stiffness, not both")
    if not 0 <= value <= 1:
        raise options.error("stiffness", f"must be 0 (natural) to 1 (stiff), not {value}")
    return value


def _move(table):
    group = table.take("group", str, required=True)
    held = table.take("held", bool, False)
    matrix = table.numbers("matrix", (4, 4))
    translate = table.numbers("translate", (3,))
    rotate = table.table("rotate")
    weight = table.take("weight", float, 1.0)
    table.end()
    if not 0 < weight <= 1:
        raise table.error("weight", f"must be more than 0 and at most 1, not {weight}")
    moved = [matrix is not None, translate is not None or rotate is not None]
    if held + sum(moved) != 1:
        raise table.error(
            "group", f"'{group}' needs one of: held = true, matrix, translate and/or rotate"
        )
    if held:
        return Move(group, None, about_centroid=False, weight=weight)
    if matrix is None:
        motion = np.eye(4)
        motion[:3, :3] = np.eye(3) if rotate is None else rotation(rotate)
        motion[:3, 3] = 0 if translate is None else translate
        return Move(group, motion, about_centroid=True, weight=weight)
    if not np.array_equal(matrix[3], [0, 0, 0, 1]):
        raise table.error("matrix", "its last row must be 0, 0, 0, 1")
    if abs(np.linalg.det(matrix[:3, :3])) < 1e-12:
        raise table.error("matrix", f"flattens group '{group}' (determinant 0); check its numbers")
    return Move(group, matrix, about_centroid=False, weight=weight)


def _moves(top, file):
    tables = top.take("handles", list, required=True)
    moves = []
    for index, data in enumerate(tables):
        where = f"handles[{index}]"
        if not isinstance(data, dict):
            raise UserError(f"{file}: {where}: must be a table ([[handles]])")
        moves.append(_move(job_table.Table(data, file, f"{where}.")))
    names = [move.group for move in moves]
    for index, name in enumerate(names):
        if name in names[:index]:
            raise UserError(f"{file}: handles[{index}].group: '{name}' is there twice")
    if not moves:
        raise top.error("handles", "is empty; name at least one group")
    return moves


def _render(table, folder):
    if table is None:
        return None
    size = table.take("size", list, [640, 640])
    if len(size) != 2 or not all(type(pixels) is int and 16 <= pixels <= 8192 for pixels in size):
        raise table.error("size", "must be [width, height] in pixels, 16 to 8192")
    samples = table.take("samples", int, 16)
    if not 1 <= samples <= 4096:
        raise table.error("samples", "must be 1 to 4096")
    render = Render(
        before=table.path("before", folder),
        after=table.path("after", folder),
        engine=ENGINES[table.choice("engine", tuple(ENGINES), "cycles")],
        size=tuple(size),
        samples=samples,
    )
    table.end()
    return render


def read(path, out=None):
    """Return the Job in TOML file `path`. Raises UserError.

    Input paths are relative to the file's folder, output paths to `out` (None: the same folder).
    """
    top = job_table.load(path)
    path, folder = top.file, top.file.parent
    out = folder if out is None else Path(out).absolute()
    options = top.table("options") or job_table.Table({}, path, "options.")
    output = top.table("output", required=True)
    job = Job(
        path=path,
        source=source(top.table("input"), folder),
        moves=_moves(top, path),
        stiffness=stiffness(options) or 0.0,
        network=options.take("network", bool, True),
        keep_volume=options.take("keep_volume", bool, True),
        key=output.take("shape_key", str, required=True),
        overwrite=output.take("overwrite", bool, False),
        blend=output.path("blend", out, required=True, suffix=".blend"),
        report=output.path("report", out),
        render=_render(top.table("render"), out),
    )
    for table in (options, output, top):
        table.end()
    return job
