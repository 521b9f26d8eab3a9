# SPDX-License-Identifier: GPL-3.0-or-later
"""Contenders on cases: each one's result and its figures, then all of their frames in turns."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import supple
from numpy.typing import NDArray
from supple.cases import EditCase, read_case

from supple_training.compare.contender import Contender, NotAvailable
from supple_training.compare.edits.contenders import ARAP, Bench, Work
from supple_training.compare.edits.figures import ArapEnergy, figures

MEASURED = "measured"

NEAR = 1.01
"""Within this factor of ARAP's converged energy an edit hardly changes any more to the eye."""

Poses = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Settings:
    """How it is measured."""

    runs: int = 7
    iterations: int = 1000
    """Of the reference, libigl's ARAP."""
    model: str = "rotation"
    threads: int | None = None
    """Ours; None for the library's default."""


def case_folders(given: Iterable[Path], kind: str = "edit") -> list[Path]:
    """Case folders among `given`, each one itself or a folder of them, in order of their names.

    Errors: ValueError naming a folder that is and holds none.
    """
    found: list[Path] = []
    for folder in given:
        if (folder / "case.json").is_file():
            inside = [folder]
        else:
            inside = sorted(path.parent for path in folder.glob("*/case.json"))
        if not inside:
            raise ValueError(f"{folder} is no {kind} case (it has no case.json) and holds none")
        found += inside
    names = [folder.resolve().name for folder in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise ValueError(f"two cases are called '{twice}'; rename one folder")
    return found


def _reached(work: Work, energy: ArapEnergy, goal: float | None) -> tuple[dict, NDArray]:
    """Figures about a contender's way to ARAP's converged energy, and the vertices to judge.

    Without a goal it is the reference, whose own last energy is the goal.
    """
    trace, kept = [], None
    for iterations, seconds, vertices in work.stages():
        trace.append([iterations, seconds, float(energy(vertices))])
        if kept is None or work.settled:
            kept, taken = vertices, seconds
        if goal is not None and trace[-1][2] <= goal:
            break
    energies = [value for *_, value in trace]
    limit = energies[-1] if goal is None else goal
    row = {
        "arap_energy": energies[-1 if work.settled else 0],
        "solve_seconds": taken,
        "converged_seconds": next((s for _, s, value in trace if value <= limit), None),
        "near_seconds": next((s for _, s, value in trace if value <= NEAR * limit), None),
    }
    if len(trace) > 1:
        row["trace"] = trace
    return row, kept


FAILURES = (
    NotAvailable,
    ImportError,
    supple.SuppleError,
    ArithmeticError,
    ValueError,
    RuntimeError,
)
"""What a contender may raise and be left out for."""


def failure(error: Exception) -> dict:
    """The row of a contender that raised one of `FAILURES`."""
    if isinstance(error, NotAvailable):
        status = "not available in this build"
    elif isinstance(error, ImportError):
        status = "not installed"
    else:
        status = "failed"
    return {"status": status, "message": str(error)}


def _quartiles(values: list[float]) -> dict:
    low, middle, high = np.percentile(values, [25, 50, 75])
    return {"median": float(middle), "low": float(low), "high": float(high), "runs": len(values)}


def _in_turns(works: dict[str, Work], runs: int) -> dict[str, dict]:
    """Seconds of one warm frame of each, measured ABAB..., after one call that is not counted."""
    taken: dict[str, list[float]] = {name: [] for name in works}
    for turn in range(-1, runs):
        for name, work in works.items():
            start = time.perf_counter()
            work.call()
            if turn >= 0:
                taken[name].append(time.perf_counter() - start)
    return {name: _quartiles(values) for name, values in taken.items()}


def measure_case(
    case: EditCase,
    contenders: Iterable[Contender],
    settings: Settings,
    model: supple.Model,
    note: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, dict], Poses]:
    """A row for each contender, by name, and the vertices of those that made any.

    Rows say in "status" why there are no figures; one contender's failure leaves the others alone.
    """
    bench, energy = Bench(case, model), ArapEnergy(case.vertices, case.faces)
    threads = settings.threads or supple.thread_count()
    rows: dict[str, dict] = {}
    works: dict[str, Work] = {}
    poses: Poses = {}
    goal = None
    for contender in contenders:
        name = contender.name
        note(f"{case.name}: {name}")
        try:
            work = contender.setup(bench, threads)
            reached, posed = _reached(work, energy, goal)
            row = figures(case, posed)
        except FAILURES as error:
            rows[name] = failure(error)
        else:
            works[name], poses[name] = work, posed
            rows[name] = {"status": MEASURED, **row, **reached}
            if name == ARAP:
                goal = reached["arap_energy"]
    if goal is None:
        for name in works:
            rows[name] |= {"converged_seconds": None, "near_seconds": None}
    note(f"{case.name}: frames in turns")
    for name, seconds in _in_turns(works, settings.runs).items():
        work = works[name]
        rows[name] |= {
            "prepare_seconds": work.prepare_seconds,
            "bind_milliseconds": 1e3 * work.bind_seconds,
            "frame_milliseconds": 1e3 * seconds["median"],
            "frame_seconds": seconds,
            "frame_is": work.frame,
        }
        if not work.settled:
            rows[name]["solve_seconds"] = seconds["median"]
    return rows, poses


def measure(
    folders: Iterable[Path],
    contenders: Iterable[Contender],
    settings: Settings,
    *,
    note: Callable[[str], None] = lambda _: None,
    done: Callable[[EditCase, dict[str, dict], Poses], None] = lambda *_: None,
) -> tuple[dict[str, dict], dict[str, str]]:
    """All cases, by name, and the errors of those that could not be read.

    A case: {"vertices", "faces", "handles", "held_vertices", "closed", "truth", "load", "rows"}.
    `done` is called with each case that was measured.

    Errors: SuppleError where the model cannot be loaded.
    """
    model = supple.load_model(settings.model)
    if settings.threads:
        supple.set_thread_count(settings.threads)
    cases: dict[str, dict] = {}
    errors: dict[str, str] = {}
    for folder in folders:
        try:
            case = read_case(folder)
            supple.Mesh(case.vertices, case.faces)
            rows, poses = measure_case(case, contenders, settings, model, note)
        except (supple.SuppleError, OSError) as error:
            errors[folder.resolve().name] = str(error)
            continue
        cases[case.name] = {
            "vertices": len(case.vertices),
            "faces": len(case.faces),
            "handles": len(case.handles),
            "held_vertices": sum(len(np.atleast_1d(h.vertices)) for h in case.handles),
            "truth": case.truth is not None,
            "load": os.getloadavg()[0],
            "rows": rows,
        }
        done(case, rows, poses)
    return cases, errors
