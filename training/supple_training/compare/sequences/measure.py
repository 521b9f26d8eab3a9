# SPDX-License-Identifier: GPL-3.0-or-later
"""Contenders on sequences: every frame of each, and their figures."""

from __future__ import annotations

import os
import statistics
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import supple
from numpy.typing import NDArray

from supple_training.compare.contender import Contender
from supple_training.compare.edits.contenders import Bench, timed
from supple_training.compare.edits.figures import held_vertices
from supple_training.compare.edits.measure import FAILURES, MEASURED, failure
from supple_training.compare.sequences.figures import accelerations, figures, percent_of_size
from supple_training.sequences import Sequence, read_sequence

Motions = dict[str, NDArray[np.float64]]
"""(frames, n, 3) of each contender that made all frames."""


@dataclass(frozen=True)
class Settings:
    """How it is measured."""

    iterations: int = 1000
    """Of the reference, libigl's ARAP, each frame."""
    model: str = "rotation"
    threads: int | None = None
    """Ours; None for the library's default."""


def measure_sequence(
    sequence: Sequence,
    contenders: Iterable[Contender],
    settings: Settings,
    model: supple.Model,
    note: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, dict], Motions]:
    """A row for each contender, by name, and what those made that made all frames.

    Rows say in "status" why there are no figures; one contender's failure leaves the others alone.
    """
    case = sequence.case
    bench = Bench(case, model)
    threads = settings.threads or supple.thread_count()
    rows: dict[str, dict] = {}
    motions: Motions = {}
    for contender in contenders:
        name = contender.name
        note(f"{case.name}: {name}")
        posed, taken = np.empty_like(sequence.truth), []
        try:
            solve = contender.setup(bench, threads)
            for frame in range(len(posed)):
                seconds, posed[frame] = timed(partial(solve, sequence.handles(frame)))
                taken.append(seconds)
            row = figures(sequence, posed)
        except FAILURES as error:
            rows[name] = failure(error)
        else:
            motions[name] = posed
            middle = 1e3 * statistics.median(taken)
            rows[name] = {"status": MEASURED, **row, "frame_milliseconds": middle}
    return rows, motions


def measure(
    folders: Iterable[Path],
    contenders: Iterable[Contender],
    settings: Settings,
    *,
    note: Callable[[str], None] = lambda _: None,
    done: Callable[[Sequence, dict[str, dict], Motions], None] = lambda *_: None,
) -> tuple[dict[str, dict], dict[str, str]]:
    """All sequences, by name, and the errors of those that could not be read.

    A sequence: {"vertices", "faces", "frames", "handles", "held_vertices", "acceleration": the
    truth's own, in the unit of its errors, "load", "rows"}. `done` is called with each.

    Errors: SuppleError where the model cannot be loaded.
    """
    model = supple.load_model(settings.model)
    if settings.threads:
        supple.set_thread_count(settings.threads)
    cases: dict[str, dict] = {}
    errors: dict[str, str] = {}
    for folder in folders:
        try:
            sequence = read_sequence(folder)
            case, truth = sequence.case, sequence.truth
            supple.Mesh(case.vertices, case.faces)
            rows, motions = measure_sequence(sequence, contenders, settings, model, note)
        except (supple.SuppleError, OSError) as error:
            errors[folder.resolve().name] = str(error)
            continue
        own = np.linalg.norm(accelerations(truth), axis=2).mean()
        cases[case.name] = {
            "vertices": len(case.vertices),
            "faces": len(case.faces),
            "frames": len(truth),
            "handles": len(case.handles),
            "held_vertices": len(held_vertices(case.handles)),
            "acceleration": float(percent_of_size(case.vertices, case.faces) * own),
            "load": os.getloadavg()[0],
            "rows": rows,
        }
        done(sequence, rows, motions)
    return cases, errors
