# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and checking a job file that corrects a sequence: one with a table [sequence]."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import job_file, job_table
from .errors import UserError

EXPORTS = {"alembic": (".abc",), "usd": (".usd", ".usdc", ".usda")}


@dataclass(frozen=True)
class Key:
    """A correction of a group at a frame: (4, 4), about the group's centre, in world axes."""

    frame: int
    motion: np.ndarray


@dataclass(frozen=True)
class HandleKeys:
    """A group to hold (no keys) or to correct."""

    group: str
    keys: list


@dataclass(frozen=True)
class SequenceJob:
    """A checked job file. handles: None for those of the object. ease: frames in and out.
    part: (k, n) to bake the k-th of n parts alone, from 1, or None. exports: {name: path}.
    """

    path: Path
    source: job_file.Source
    first: int
    last: int
    ease: tuple
    handles: list | None
    stiffness: float | None
    network: bool | None
    keep_volume: bool | None
    cache: Path | None
    shape_keys: bool
    overwrite: bool
    blend: Path
    exports: dict
    report: Path | None
    part: tuple | None

    @property
    def frames(self):
        """The frames to bake: all, or those of the part."""
        every = range(self.first, self.last + 1)
        if self.part is None:
            return every
        number, count = self.part
        return every[len(every) * (number - 1) // count : len(every) * number // count]


def _whole(table, key, count, default=None):
    values = table.take(key, list, default, required=default is None)
    if len(values) != count or not all(type(value) is int for value in values):
        raise table.error(key, f"must be {count} whole numbers")
    return values


def _key(table):
    frame = table.take("frame", int, required=True)
    translate = table.numbers("translate", (3,))
    rotate = table.table("rotate")
    table.end()
    motion = np.eye(4)
    motion[:3, :3] = np.eye(3) if rotate is None else job_file.rotation(rotate)
    motion[:3, 3] = 0 if translate is None else translate
    return Key(frame, motion)


def _handles(top, file):
    if not top.has("handles"):
        return None
    found = []
    for index, data in enumerate(top.take("handles", list)):
        where = f"handles[{index}]"
        if not isinstance(data, dict):
            raise UserError(f"{file}: {where}: must be a table ([[handles]])")
        table = job_table.Table(data, file, f"{where}.")
        group = table.take("group", str, required=True)
        held, keys = table.take("held", bool, False), table.take("keys", list, [])
        table.end()
        if held == bool(keys):
            raise table.error("group", f"'{group}' needs one of: held = true, keys")
        if not all(isinstance(key, dict) for key in keys):
            raise table.error("keys", "must be tables { frame, translate, rotate }")
        found.append(
            HandleKeys(
                group,
                [
                    _key(job_table.Table(key, file, f"{where}.keys[{k}]."))
                    for k, key in enumerate(keys)
                ],
            )
        )
        if [handle.group for handle in found].count(group) > 1:
            raise table.error("group", f"'{group}' is there twice")
    return found


def _part(text):
    if not text:
        return None
    match = re.fullmatch(r"([1-9]\d*)/([1-9]\d*)", text)
    if match is None or int(match[1]) > int(match[2]):
        raise UserError(f"--part: must be such as 2/4, not '{text}'")
    return int(match[1]), int(match[2])


def _exports(output, out):
    found = {}
    for name, suffixes in EXPORTS.items():
        path = output.path(name, out)
        if path is None:
            continue
        if path.suffix not in suffixes:
            raise output.error(name, f"must end in {' or '.join(suffixes)}, not '{path.name}'")
        found[name] = path
    return found


def read(path, out=None, part=""):
    """Return the SequenceJob in TOML file `path`. Raises UserError.

    Input paths are relative to the file's folder, output paths to `out` (None: the same folder).
    """
    top = job_table.load(path)
    file, folder = top.file, top.file.parent
    out = folder if out is None else Path(out).absolute()
    table, output = (top.table(key, required=True) for key in ("sequence", "output"))
    options = top.table("options") or job_table.Table({}, file, "options.")
    first, last = _whole(table, "frames", 2)
    ease = tuple(_whole(table, "ease", 2, [12, 12]))
    job = SequenceJob(
        path=file,
        source=job_file.source(top.table("input"), folder),
        first=first,
        last=last,
        ease=ease,
        handles=_handles(top, file),
        stiffness=job_file.stiffness(options),
        network=options.take("network", bool),
        keep_volume=options.take("keep_volume", bool),
        cache=output.path("cache", out, suffix=".pc2"),
        shape_keys=output.take("shape_keys", bool, False),
        overwrite=output.take("overwrite", bool, False),
        blend=output.path("blend", out, required=True, suffix=".blend"),
        exports=_exports(output, out),
        report=output.path("report", out),
        part=_part(part),
    )
    for each in (table, options, output, top):
        each.end()
    if job.source.mesh:
        raise UserError(f"{file}: input.mesh: a sequence moves; give a .blend")
    if last < first:
        raise table.error("frames", f"ends at {last}, before its start at {first}")
    if min(ease) < 0:
        raise table.error("ease", "must be 0 frames or more")
    if (job.cache is None) != job.shape_keys:
        raise output.error("cache", "give either cache, or shape_keys = true")
    if job.part and job.shape_keys:
        raise UserError("--part: shape keys can't be made in parts; name a cache")
    if job.part and not job.frames:
        raise UserError(f"--part: {part} of {last - first + 1} frames is none")
    return job
