# SPDX-License-Identifier: GPL-3.0-or-later
"""How near a network comes to the truth on pairs it has not seen, beside no network at all.

Every figure is a pose error: the area-weighted RMS distance to the true target, divided by the
square root of the source's area, x100. "no_network" has the identity in the network's place, with
the same number of rounds, passes and solves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import supple
from numpy.typing import NDArray

from supple_training.edits import farthest_points, true_handles
from supple_training.maps import rough_maps
from supple_training.pairs import Pair
from supple_training.remesh import unit_normals

HANDLE_COUNTS = (8, 16, 40)
"""How many handles a pose is edited by."""

EIGENFUNCTIONS = (40, 80)
"""In how many eigenfunctions the target of the spectral signal is given."""

Row = dict[str, float]
Rows = dict[str, Row]


def rotation_rows(pairs: list[Pair], model: supple.Model) -> list[Rows]:
    """For each pair: editing, in mode natural, by the true positions of 8, 16 and 40 handles.

    Pairs of two different bodies are no edits; leave them out.
    """
    result = []
    for pair in pairs:
        source, faces, target = pair
        prepared = supple.PreparedMesh(source, faces, cache=False)
        rows: Rows = {"network": {}, "no_network": {}}
        for count in HANDLE_COUNTS:
            editor = supple.Editor(
                prepared, true_handles(pair, farthest_points(source, count)), model=model
            )
            for name, row in rows.items():
                posed = editor.solve(mode="natural", network=name == "network").vertices
                row[f"{count} handles"] = supple.pose_error(source, faces, posed, target)
        result.append(rows)
    return result


def map_error(target: NDArray, faces: NDArray, point_map: NDArray) -> float:
    """Of a map whose truth is the identity: the mean distance of an image from where it should be,
    divided by the square root of the target's area, x100."""
    unit = np.sqrt(unit_normals(target, faces)[1].sum())
    return float(100 * np.mean(np.linalg.norm(target[point_map] - target, axis=1)) / unit)


def spectral_rows(pairs: list[Pair], model: supple.Model) -> list[Rows]:
    """For each pair: the target recovered from its coordinates in 40 and 80 eigenfunctions; and the
    error (`map_error`) of a rough map between the two, refined."""
    result = []
    for index, (source, faces, target) in enumerate(pairs):
        prepared = supple.PreparedMesh(source, faces, cache=False)
        rows: Rows = {"network": {}, "no_network": {}}
        for count in EIGENFUNCTIONS:
            for name, row in rows.items():
                recovered = supple.deform(
                    prepared,
                    target,
                    model=model,
                    eigenfunctions=count,
                    network=name == "network",
                )
                row[f"{count} eigenfunctions"] = supple.pose_error(source, faces, recovered, target)
        rough = rough_maps(pairs[index], np.random.default_rng(index), 1)[1]
        other = supple.PreparedMesh(target, faces, cache=False)
        for name, row in rows.items():
            refined = supple.refine(
                prepared, other, rough, model=model if name == "network" else None
            )
            row["refined map"] = map_error(target, faces, refined.point_map)
        result.append(rows)
    return result


def evaluate(pairs: list[Pair], model: supple.Model) -> dict:
    """Plain means over the pairs, and each pair's own figures.

    Returns {"rows": {"network": {case: pose error}, "no_network": {...}}, "each": [...]}; the cases
    are those of the model's signal.
    """
    measure: Callable = rotation_rows if model.signal == "rotation" else spectral_rows
    each = measure(pairs, model)
    rows = {
        name: {case: float(np.mean([e[name][case] for e in each])) for case in each[0][name]}
        for name in each[0]
    }
    return {"rows": rows, "each": each, "pairs": len(pairs)}
