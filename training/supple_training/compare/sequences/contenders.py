# SPDX-License-Identifier: GPL-3.0-or-later
"""Who makes the frames: those of `edits.contenders`, bound once a sequence."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import supple
from numpy.typing import NDArray

from supple_training.compare.contender import Contender
from supple_training.compare.edits.contenders import (
    ARAP,
    NATURAL,
    NO_NETWORK,
    STIFF,
    Bench,
    LibiglArap,
)
from supple_training.compare.edits.figures import held_vertices, targets

Solve = Callable[[list[supple.Handle]], NDArray[np.float64]]
"""From the handles at their targets of a frame to the vertices (n, 3)."""


def _supple(bench: Bench, _: int, **options: object) -> Solve:
    """Ours with these options of `Editor.solve`."""
    editor = bench.editor
    return lambda handles: editor.solve(handles, **options).vertices


def _libigl_arap(bench: Bench, _: int, *, iterations: int) -> Solve:
    """Each frame from libigl's usual first guess; that from the frame before is no frame alone."""
    case = bench.case
    arap = LibiglArap(case.vertices, case.faces, held_vertices(case.handles))

    def solve(handles: list[supple.Handle]) -> NDArray[np.float64]:
        wanted = targets(case.vertices, handles)
        return arap.iterate(arap.guess(wanted), wanted, iterations)

    return solve


def table(iterations: int, *, stiff: bool = False) -> tuple[Contender, ...]:
    """All of them, the reference first. Their `setup` takes a Bench and a number of threads."""
    listed = (
        Contender(ARAP, partial(_libigl_arap, iterations=iterations), threaded=False),
        Contender(NATURAL, partial(_supple, mode="natural"), ours=True),
        Contender(NO_NETWORK, partial(_supple, mode="natural", network=False), ours=True),
        Contender(STIFF, partial(_supple, mode="stiff"), ours=True),
    )
    return listed if stiff else listed[:-1]
