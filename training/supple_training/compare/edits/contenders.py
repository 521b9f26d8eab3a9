# SPDX-License-Identifier: GPL-3.0-or-later
"""Who makes the edits. To add one: write its `setup`, add a line to `table`."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
import supple
from numpy.typing import NDArray
from supple.cases import EditCase

from supple_training.compare.contender import Contender, NotAvailable, Ready, accepts
from supple_training.compare.edits.figures import held_vertices, targets

ARAP = "libigl ARAP"
NATURAL = "supple natural"
NO_NETWORK = "supple natural, no network"
STIFF = "supple stiff"
NATIVE_ARAP = "supple ARAP"

CHECKPOINTS = (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 150, 200, 300, 500, 700, 1000)
"""After how many iterations the energy of an iterative contender is looked at."""

BINDS = 3
"""Binding is measured this often; the middle one is reported."""

Stage = tuple[int, float, NDArray[np.float64]]
"""Iterations (0 where it has none to choose), seconds of them, and the vertices they made."""


@dataclass
class Work(Ready):
    """A contender that is set up for one case; `call` is one warm frame and returns vertices.

    Attributes:
        stages: results of growing effort, to see how soon ARAP's converged energy is reached.
        prepare_seconds: of what depends on the mesh alone; 0 where it is part of `bind`.
        bind_seconds: of what depends on which vertices are held.
        frame: what `call` does, in words.
        settled: whether the last stage is judged, rather than the first, which is that of `call`.
    """

    stages: Callable[[], Iterator[Stage]] = field(default=lambda: iter(()))
    prepare_seconds: float = 0.0
    bind_seconds: float = 0.0
    frame: str = "one solve"
    settled: bool = False


def timed(call: Callable[[], object]) -> tuple[float, object]:
    """Seconds, and what it returned."""
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result


def _bind_seconds(bind: Callable[[], object]) -> float:
    return statistics.median(timed(bind)[0] for _ in range(BINDS))


class Bench:
    """A case and what our contenders share on it, made when it is first wanted."""

    def __init__(self, case: EditCase, model: supple.Model) -> None:
        self.case, self.model = case, model

    @cached_property
    def prepared(self) -> supple.PreparedMesh:
        """Without the disk cache, so that its time is that of the work."""
        return supple.PreparedMesh(self.case.vertices, self.case.faces, cache=False)

    def bound(self) -> supple.Editor:
        return supple.Editor(self.prepared, self.case.handles, model=self.model)

    @cached_property
    def editor(self) -> supple.Editor:
        return self.bound()

    @cached_property
    def bind_seconds(self) -> float:
        return _bind_seconds(self.bound)


def _solve(bench: Bench, **options: object) -> NDArray[np.float64]:
    return bench.editor.solve(**options).vertices


def _supple(bench: Bench, _: int, *, growing: tuple[str, ...] = (), **options: object) -> Work:
    """Ours with these options of `Editor.solve`.

    `growing` names options that say how many iterations to do; the first that this build has is
    tried with growing numbers, to find how soon ARAP's energy is reached.
    """
    for name in options:
        accepts(supple.Editor.solve, name, "Editor.solve")
    call = partial(_solve, bench, **options)
    try:
        call()
    except (supple.SuppleError, ValueError) as error:
        if "mode" in options and f"'{options['mode']}'" in str(error):
            raise NotAvailable(f"Editor.solve(mode='{options['mode']}')") from error
        raise

    def stages() -> Iterator[Stage]:
        yield (0, *timed(call))
        for name in growing:
            try:
                accepts(supple.Editor.solve, name, "Editor.solve")
            except NotAvailable:
                continue
            try:
                for count in CHECKPOINTS:  # each from the start: an Editor does not go on
                    yield (count, *timed(partial(call, **{name: count})))
            except supple.SuppleError:
                continue  # another mode's option
            return

    prepare = bench.prepared.seconds
    return Work(call, stages=stages, prepare_seconds=prepare, bind_seconds=bench.bind_seconds)


class LibiglArap:
    """libigl's ARAP (spokes and rims) of one mesh with these vertices (k,) held."""

    def __init__(self, rest: NDArray, faces: NDArray, held: NDArray) -> None:
        import igl

        self.rest = np.ascontiguousarray(rest)
        self.held = held.astype(np.int32)
        self._data = igl.ARAPData()
        self._data.energy = igl.ARAPEnergyType.ARAP_ENERGY_TYPE_SPOKES_AND_RIMS
        triangles = np.ascontiguousarray(faces, dtype=np.int64)
        igl.arap_precomputation(self.rest, triangles, 3, self.held, self._data)

    def guess(self, wanted: NDArray) -> NDArray[np.float64]:
        """libigl's usual first guess, the rest shape with held vertices at their targets (k, 3)."""
        vertices = self.rest.copy()
        vertices[self.held] = wanted
        return vertices

    def iterate(self, vertices: NDArray, wanted: NDArray, count: int) -> NDArray[np.float64]:
        """The vertices (n, 3) after `count` iterations from these.

        Errors: FloatingPointError.
        """
        import igl

        self._data.max_iter = count
        posed = igl.arap_solve(wanted, self._data, vertices)
        if not np.isfinite(posed).all():
            raise FloatingPointError("libigl's result is not finite")
        return posed


def _libigl_arap(bench: Bench, _: int, *, iterations: int) -> Work:
    case = bench.case
    wanted = targets(case.vertices, case.handles)
    bind = partial(LibiglArap, case.vertices, case.faces, held_vertices(case.handles))
    arap = bind()
    guess = arap.guess(wanted)

    def stages() -> Iterator[Stage]:
        # An iteration starts from the vertices alone, so stopping in between changes nothing.
        vertices, done, seconds = guess, 0, 0.0
        for count in [c for c in CHECKPOINTS if c < iterations] + [iterations]:
            more, vertices = timed(partial(arap.iterate, vertices, wanted, count - done))
            done, seconds = count, seconds + more
            yield done, seconds, vertices

    return Work(
        partial(arap.iterate, guess, wanted, 1),
        stages=stages,
        bind_seconds=_bind_seconds(bind),
        frame="one iteration",
        settled=True,
    )


def table(iterations: int) -> tuple[Contender, ...]:
    """All of them, the reference first. Their `setup` takes a Bench and a number of threads."""
    return (
        Contender(ARAP, partial(_libigl_arap, iterations=iterations), threaded=False),
        Contender(NATURAL, partial(_supple, mode="natural"), ours=True),
        Contender(NO_NETWORK, partial(_supple, mode="natural", network=False), ours=True),
        Contender(STIFF, partial(_supple, mode="stiff"), ours=True),
        Contender(
            NATIVE_ARAP,
            partial(_supple, mode="arap", growing=("iterations", "passes")),
            ours=True,
        ),
    )
