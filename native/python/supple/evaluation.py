# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to refine maps and to find them, measured on a set with known correspondences."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import map_metrics
from .errors import SuppleError
from .initial_maps import automatic_map, zoomout_map
from .match_model import MatchModel
from .match_sets import MatchSet, MatchShape
from .matching import CONFIGURATIONS, EPOCHS, Epoch, Matcher, MatchResult
from .mesh import PreparedMesh
from .model import Model
from .refining import Refiner

Map = NDArray[np.int32]
INITIAL, NO_NETWORK = "initial", "no_network"
# The columns of a report, and whether more is better.
COLUMNS = {"geodesic": False, "inversion": False, "dirichlet": False, "coverage": True}
SECONDS = "seconds_per_pair"
FLIPPED = "flipped"
_FLIP_POINTS = 100  # the first of a set are the farthest from each other

ZOOMOUT_FROM, ZOOMOUT_TO, ZOOMOUT_STEP = 20, 120, 5  # the paper's


@dataclass(frozen=True)
class Method:
    """One way to refine a map or to find one.

    Attributes:
        bind: from both prepared meshes to what refines maps between them, or finds one and is given
            none. Only the latter's time is "seconds_per_pair": meshes are prepared, and what bind
            does is done.
        refines: whether it needs a map to start from.
        shared: what several rows of a pair begin with: done once, its time counted to each, and its
            result given to bind as the third argument.
    """

    name: str
    bind: Callable[..., Callable[[Map | None], Map]]
    refines: bool = True
    shared: Callable[[PreparedMesh, PreparedMesh], object] | None = None


def _refiner(**options: object) -> Callable[[PreparedMesh, PreparedMesh], Callable[[Map], Map]]:
    def bind(source: PreparedMesh, target: PreparedMesh) -> Callable[[Map], Map]:
        refiner = Refiner(source, target, **options)
        return lambda initial: refiner.refine(initial).point_map

    return bind


def _zoomout(sampled: bool) -> Callable[[PreparedMesh, PreparedMesh], Callable[[Map], Map]]:
    def bind(source: PreparedMesh, target: PreparedMesh) -> Callable[[Map], Map]:
        end = min(ZOOMOUT_TO, *(mesh.native.eigenvalues.size for mesh in (source, target)))
        rounds = {"start": min(ZOOMOUT_FROM, end), "end": end, "step": ZOOMOUT_STEP}
        return lambda initial: zoomout_map(source, target, initial, sampled=sampled, **rounds)

    return bind


def methods(model: str | Model = "spectral", **options: object) -> list[Method]:
    """The rows beside "initial": the same rounds and recovery with and without the network, and the
    classical ways. options: of Refiner."""
    return [
        Method("spectral_projection", _refiner(method="spectral_projection")),
        Method(NO_NETWORK, _refiner(model=None, **options)),
        Method("ljn", _refiner(model=model, **options)),
        Method("zoomout", _zoomout(sampled=False)),
        Method("zoomout_samples", _zoomout(sampled=True)),
    ]


def match_methods(
    model: MatchModel, configs: Sequence[str], *, epochs: int = EPOCHS
) -> list[Method]:
    """Ways to match without a map: "automatic" (no features), "features" (as they are), and those
    named by `configs`, adaptation included.

    "ljn" is all that Matcher.run does, and "no_network" the same with the identity in the network's
    place when the map is refined. Other configurations of Matcher end with the functional map of
    the adapted features; "without_ljn" is the paper's "W/o LJN".

    Raises:
        SuppleError: bad_option.
    """
    found = _matches(model, epochs)
    rows = {
        NO_NETWORK: Method(NO_NETWORK, _unaided, refines=False, shared=found),
        "ljn": Method("ljn", _refined, refines=False, shared=found),
    }
    for config in configs:
        if config not in (*rows, *CONFIGURATIONS):
            raise SuppleError(
                "bad_option",
                f"'{config}' is no way to match. Use {', '.join((NO_NETWORK, *CONFIGURATIONS))}.",
            )
        if config not in rows:
            rows[config] = Method(config, _features(model, config, epochs), refines=False)
    return [
        Method("automatic", _automatic, refines=False),
        Method("features", _features(model, "ljn", 0), refines=False),
        *(rows[config] for config in configs),
    ]


def _automatic(source: PreparedMesh, target: PreparedMesh) -> Callable[[None], Map]:
    return lambda _: automatic_map(source, target).point_map


def _features(
    model: MatchModel, config: str, epochs: int
) -> Callable[[PreparedMesh, PreparedMesh], Callable[[None], Map]]:
    def bind(source: PreparedMesh, target: PreparedMesh) -> Callable[[None], Map]:
        def find(_: None) -> Map:
            matcher = Matcher(source, target, model=model, config=config, epochs=epochs)
            matcher.adapt(callback=_interruptible)
            return matcher.features_map().point_map

        return find

    return bind


def _matches(model: MatchModel, epochs: int) -> Callable[[PreparedMesh, PreparedMesh], MatchResult]:
    def find(source: PreparedMesh, target: PreparedMesh) -> MatchResult:
        return Matcher(source, target, model=model, epochs=epochs).run(callback=_interruptible)

    return find


def _refined(
    source: PreparedMesh, target: PreparedMesh, found: MatchResult
) -> Callable[[None], Map]:
    return lambda _: found.point_map


def _unaided(
    source: PreparedMesh, target: PreparedMesh, found: MatchResult
) -> Callable[[None], Map]:
    refiner = Refiner(source, target, model=None)
    return lambda _: refiner.refine(found.initial.point_map).point_map


def _interruptible(epoch: Epoch) -> None:
    """Back in Python after each epoch, where Ctrl+C takes effect."""


def _timed(call: Callable, *arguments: object) -> tuple[object, float]:
    """What a call returns, and its seconds."""
    began = time.perf_counter()
    result = call(*arguments)
    return result, time.perf_counter() - began


class Evaluation:
    """Measures pair after pair; meshes are prepared once each.

    Args:
        chosen: the methods. Where one refines, the set must have maps to refine; they are a row.
        runs: times each method is measured; the least counts.
        cache: as of PreparedMesh.
        note: called with what is being done, and the part of it all that is done.
    """

    def __init__(
        self,
        match_set: MatchSet,
        chosen: Sequence[Method],
        *,
        runs: int = 1,
        cache: bool = True,
        note: Callable[[str, float], None] = lambda text, done: None,
    ) -> None:
        self._set = match_set
        self._chosen = list(chosen)
        self._runs = runs
        self._cache = cache
        self._note = note
        self._refines = any(method.refines for method in self._chosen)
        self._prepared: dict[str, PreparedMesh] = {}
        self._steps = len(match_set.pairs) * (len(self._chosen) + 2)
        self._done = 0

    def run(self) -> dict:
        """{"rows": {NAME: means, and "change_percent" from initial}, "pairs": count, ...}."""
        measured = {f"{a} {b}": self._pair(a, b) for a, b in self._set.pairs}
        return {**summary(list(measured.values())), "set": self._set.name, "measured": measured}

    def _step(self, text: str) -> None:
        self._note(text, self._done / self._steps)
        self._done += 1

    def _pair(self, a: str, b: str) -> dict[str, dict[str, float]]:
        self._step(f"{a} {b}: preparing")
        source, target = (self._prepare(self._set.shapes[name]) for name in (a, b))
        maps: dict[str, Map] = {}
        rows: dict[str, dict[str, float]] = {}
        start = self._set.initial[a, b] if self._refines else None
        if start is not None:
            maps[INITIAL], rows[INITIAL] = start, {SECONDS: 0.0, "bind_seconds": 0.0}
        shared: dict[Callable, tuple[object, float]] = {}
        for method in self._chosen:
            self._step(f"{a} {b}: {method.name}")
            given, before = [], 0.0
            if method.shared is not None:
                if method.shared not in shared:
                    shared[method.shared] = _timed(method.shared, source, target)
                given, before = [shared[method.shared][0]], shared[method.shared][1]
            refine, bound = _timed(method.bind, source, target, *given)
            if method.refines and self._done <= len(self._chosen) + 2:
                refine(start)  # the first call of all warms up
            seconds = []
            for _ in range(self._runs):
                maps[method.name], once = _timed(refine, start)
                seconds.append(once)
            rows[method.name] = {SECONDS: before + min(seconds), "bind_seconds": bound}
        self._step(f"{a} {b}: measuring")
        self._measure(a, b, maps, rows)
        return rows

    def _measure(self, a: str, b: str, maps: dict[str, Map], rows: dict[str, dict]) -> None:
        source, target = (self._prepared[name] for name in (a, b))
        template, truth = (self._set.shapes[name].template for name in (a, b))
        mirror = self._set.shapes[b].mirror
        images = np.stack([point_map[template] for point_map in maps.values()], axis=1)
        geodesics = map_metrics.Geodesics(target.vertices, target.faces)
        errors = map_metrics.geodesic_errors(target, truth, images, geodesics=geodesics)
        if mirror is not None:
            few = slice(_FLIP_POINTS)
            wrong = map_metrics.flipped(
                target, truth[few], mirror[few], images[few], geodesics=geodesics
            )
            for name, flip in zip(maps, wrong, strict=True):
                rows[name][FLIPPED] = float(flip)
        for (name, point_map), error in zip(maps.items(), errors, strict=True):
            rows[name] |= {
                "geodesic": error.mean,
                "unreachable": error.unreachable,
                "inversion": map_metrics.face_inversion(source, target, point_map),
                "vertex_inversion": map_metrics.vertex_inversion(source, target, point_map),
                "dirichlet": map_metrics.map_dirichlet(source, target, point_map),
                "coverage": map_metrics.coverage(source, target, point_map),
            }

    def _prepare(self, shape: MatchShape) -> PreparedMesh:
        if shape.name not in self._prepared:
            self._prepared[shape.name] = PreparedMesh(
                shape.vertices, shape.faces, cache=self._cache
            )
        return self._prepared[shape.name]


def summary(measured: list[dict[str, dict[str, float]]]) -> dict:
    """Plain means over pairs ("flipped": over those with mirrored truth), and where there are
    initial maps, for each row the change from them in percent (None where that is 0)."""
    rows: dict[str, dict] = {}
    for name in measured[0]:
        rows[name] = {
            column: float(
                np.mean([pair[name][column] for pair in measured if column in pair[name]])
            )
            for column in dict.fromkeys(column for pair in measured for column in pair[name])
        }
    first = rows.get(INITIAL)
    for row in rows.values() if first else ():
        row["change_percent"] = {
            column: 100.0 * (row[column] / first[column] - 1.0) if first[column] > 0 else None
            for column in COLUMNS
        }
    return {"rows": rows, "pairs": len(measured)}


def cells(row: dict) -> list[str]:
    """The columns of a row as text: each figure with its change from the initial map, if any."""
    texts = []
    for column in COLUMNS:
        change = row.get("change_percent", {}).get(column)
        beside = "" if not change else f" ({change:+.1f}%)"
        texts.append(f"{row[column]:.3f}{beside}")
    if FLIPPED in row:
        texts.append(f"{100.0 * row[FLIPPED]:.0f}%")
    seconds = row[SECONDS]
    return [*texts, f"{1e3 * seconds:.0f} ms" if seconds else "-"]


def head(report: dict) -> list[str]:
    """Names of the columns of `cells`, the row's first."""
    flips = any(FLIPPED in row for row in report["rows"].values())
    return ["map", *COLUMNS, *([FLIPPED] if flips else []), "per pair"]


def markdown(report: dict) -> str:
    """The rows as a table."""
    columns = head(report)
    changes = INITIAL in report["rows"]
    lines = [
        f"# {report['set']}: {report['pairs']} pairs",
        "",
        "Geodesic error x100 of the root of the target's area, exact paths; inverted faces and "
        "covered area in percent; Dirichlet energy at area 1 (2 for the identity). Means over "
        f"pairs{', in brackets the change from the initial map' if changes else ''}.",
        "",
        "| " + " | ".join(columns) + " |",
        "|---|" + "---:|" * (len(columns) - 1),
    ]
    lines += [f"| {name} | {' | '.join(cells(row))} |" for name, row in report["rows"].items()]
    lost = sum(row["unreachable"] for row in report["rows"].values())
    if lost:
        lines += ["", "Points whose image no path reaches are left out of the geodesic error:"]
        lines += [
            f"- {name}: {row['unreachable']:.1f} a pair" for name, row in report["rows"].items()
        ]
    return "\n".join(lines) + "\n"
