# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and checking a job file that matches: one with a table [match]."""

from dataclasses import dataclass
from pathlib import Path

from . import job_table, match_collect, match_features, transfer_collect

STARTS = ("automatic", "landmarks", "nearest", "aligned", "uvs", "file", "features")
PARTS = ("uvs", "weights", "colours", "keys", "fit")


@dataclass(frozen=True)
class MatchJob:
    """A checked job file. input: a .blend, or None for the open file."""

    path: Path
    input: Path | None
    source: str
    targets: list
    options: match_collect.Options
    transfer: transfer_collect.Options
    blend: Path
    report: Path | None


def _names(table, key, *, allowed=None):
    """Return a list of text that is not empty, in `allowed` if that is given."""
    names = table.take(key, list, required=True)
    if not names or not all(type(name) is str for name in names):
        raise table.error(key, "must be a list of names, at least one")
    for name in names:
        if names.count(name) > 1:
            raise table.error(key, f"'{name}' is there twice")
        if allowed and name not in allowed:
            raise table.error(key, f"must be some of {', '.join(allowed)}, not '{name}'")
    return names


def _pairs(table):
    pairs = table.take("landmarks", list, [])
    for pair in pairs:
        if type(pair) is not list or [type(vertex) for vertex in pair] != [int, int]:
            raise table.error("landmarks", "must be pairs [source vertex, target vertex]")
    return tuple(map(tuple, pairs))


def _features(table, folder, start):
    """Return the epochs and the model, a name or a file in `folder`."""
    for key in ("epochs", "model"):
        if table.has(key) and start != "features":
            raise table.error(key, 'may be given with start = "features" only')
    epochs = table.take("epochs", int, match_features.EPOCHS)
    if epochs < 0:
        raise table.error("epochs", f"must be 0 or more, not {epochs}")
    model = table.take("model", str, match_features.MODEL)
    return epochs, str(folder / model) if model.endswith(".safetensors") else model


def _options(table, folder, targets):
    start = table.choice("start", STARTS, "automatic")
    file, pairs = table.path("file", folder), _pairs(table)
    for key, value in (("file", file), ("landmarks", pairs)):
        if bool(value) != (start == key):
            raise table.error(key, f'must be given with start = "{key}", and only then')
        if value and len(targets) > 1:
            raise table.error(key, f"fits one target, not {len(targets)}")
    refine = table.take("refine", bool, True)
    learned = _features(table, folder, start)
    return match_collect.Options(start.upper(), refine, pairs, str(file or ""), *learned)


def _transfer(table):
    return transfer_collect.Options(
        frozenset(name.upper() for name in _names(table, "transfer", allowed=PARTS)),
        table.take("only_active_key", bool, False),
        table.take("drivers", bool, False),
        table.take("overwrite", bool, False),
    )


def read(path, out=None):
    """Return the MatchJob in TOML file `path`. Raises UserError.

    Input paths are relative to the file's folder, output paths to `out` (None: the same folder).
    """
    top = job_table.load(path)
    folder = top.file.parent
    out = folder if out is None else Path(out).absolute()
    given = top.table("input") or job_table.Table({}, top.file, "input.")
    table, output = (top.table(key, required=True) for key in ("match", "output"))
    targets = _names(table, "targets")
    job = MatchJob(
        path=top.file,
        input=given.path("blend", folder),
        source=table.take("source", str, required=True),
        targets=targets,
        options=_options(table, folder, targets),
        transfer=_transfer(table),
        blend=output.path("blend", out, required=True, suffix=".blend"),
        report=output.path("report", out),
    )
    for each in (given, table, output, top):
        each.end()
    if job.input and not job.input.is_file():
        raise given.error("blend", f"there is no file {job.input}")
    if job.source in targets:
        raise table.error("targets", f"'{job.source}' is the source")
    return job
