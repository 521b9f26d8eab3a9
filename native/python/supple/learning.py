# SPDX-License-Identifier: GPL-3.0-or-later
"""Supervised training, all of it native. Source: the paper, sections 4.2 and 4.6."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, arrays
from .mesh import PreparedMesh
from .model import Model, from_tensors


@dataclass
class TrainResult:
    """A trained network and how it got there.

    Attributes:
        model: the network.
        steps: one dict a step: step, pair, eigenfunctions, learning_rate, loss, jacobian, position,
            integrated (the three terms before weighting).
        initial: the weights before the first step, by name.
    """

    model: Model
    steps: list[dict[str, float | int]]
    initial: dict[str, NDArray[np.float32]]


def train(
    pairs: Sequence[tuple[ArrayLike, ...]],
    *,
    signal: str,
    config: str = "equivariant",
    epochs: int = 50,
    seed: int = 0,
    samples: int | None = None,
    width: int = 256,
    eigenfunctions: int = 128,
    signal_eigenfunctions: tuple[int, int] = (20, 100),
    learning_rate: tuple[float, float] = (1e-3, 1e-5),
    loss_weights: tuple[float, float, float] = (1.0, 10.0, 2.0),
    metadata: dict[str, str] | None = None,
    max_steps: int | None = None,
    double: bool = False,
    callback: Callable[[dict], None] | None = None,
    progress: _native.Progress | None = None,
) -> TrainResult:
    """Train a Local Jacobian Network on pairs in 1:1 correspondence.

    Args:
        pairs: (source_vertices (n, 3), faces (m, 3), target_vertices (n, 3)) each, any units,
            optionally with a fourth, of which one is drawn each step. For the rotation signal: a
            sequence of suggestions (vertices (n, 3), held (k,)), what edits start from and the
            vertices that are at their targets there; the signal is taken from it, the losses hold
            those vertices. For the spectral signal: a sequence of rough maps (n,), a target vertex
            for each source vertex, along which the target is pulled back.
        signal: "rotation" (closest rotations of a suggestion's Jacobians, or without one of the
            true ones) or "spectral" (the target in 20 to 100 eigenfunctions, drawn anew each step).
        config: "equivariant" or "paper".
        epochs: every pair once each, in a new random order.
        seed: of the initial weights and every draw. Same seed and threads: same bytes.
        samples: points of each mesh the layers are evaluated at, 0 for every vertex; None for 1024
            ("equivariant") or 0 ("paper").
        width, eigenfunctions: of the network.
        signal_eigenfunctions: fewest and most of the spectral signal, drawn anew each step.
        learning_rate: first and last; between them the same factor every step.
        loss_weights: of the Jacobian, position and integrated terms; the paper's by default.
        metadata: added to the model's.
        max_steps: stop early (the schedule stays that of all epochs).
        double: train in double precision (for checks).
        callback: called with each step's dict, in the calling thread.
        progress: a Progress to watch and cancel.

    Raises:
        SuppleError: bad_option, wrong_shape, and those of Mesh, naming the pair.
        Cancelled: if progress was cancelled.
    """
    options = _native.TrainOptions()
    options.architecture = _native.Architecture(config, signal, eigenfunctions, width)
    options.epochs = epochs
    options.seed = seed
    options.samples = (0 if config == "paper" else 1024) if samples is None else samples
    options.fewest_eigenfunctions, options.most_eigenfunctions = signal_eigenfunctions
    options.first_learning_rate, options.last_learning_rate = learning_rate
    options.loss_weights = list(loss_weights)
    run = _native.train_double if double else _native.train
    result = run(
        [_training_pair(i, signal, *pair) for i, pair in enumerate(pairs)],
        options,
        0 if max_steps is None else max_steps,
        callback,
        progress,
    )
    architecture = {
        "configuration": config,
        "signal": signal,
        "eigenfunctions": str(eigenfunctions),
        "width": str(width),
    }
    return TrainResult(
        from_tensors(result["tensors"], {**(metadata or {}), **architecture}),
        result["steps"],
        {name: np.array(value) for name, value in result["initial"].items()},
    )


def _training_pair(
    i: int,
    signal: str,
    source: ArrayLike,
    faces: ArrayLike,
    target: ArrayLike,
    variants: Sequence = (),
) -> _native.TrainingPair:
    suggestions, maps = [], []
    for j, variant in enumerate(variants):
        if signal == "spectral":
            maps.append(arrays.indices(variant, f"pair {i}: map {j}"))
            continue
        vertices, held = variant
        suggestions.append(
            _native.Suggestion(
                arrays.points(vertices, f"pair {i}: suggestion {j}"),
                arrays.indices(held, f"pair {i}: held vertices of suggestion {j}"),
            )
        )
    return _native.TrainingPair(
        arrays.points(source, f"pair {i}: source"),
        arrays.triangles(faces, f"pair {i}: faces"),
        arrays.points(target, f"pair {i}: target"),
        suggestions,
        maps,
    )


def network_forward(
    prepared: PreparedMesh, model: Model, rotations: ArrayLike
) -> NDArray[np.float64]:
    """(m, 3, 3) Jacobians of a network from a rotation signal; no Poisson solve.

    Evaluated where `prepared` says (`samples`), the configuration "paper" at every vertex.

    Args:
        prepared: the rest mesh.
        model: a network that takes the rotation signal.
        rotations: (m, 3, 3), one a face.

    Raises:
        SuppleError: wrong_shape; bad_option for a network of the spectral signal.
    """
    return _native.network_forward(
        prepared.native, model.native, arrays.matrices(rotations, "rotations")
    ).reshape(-1, 3, 3)


def network_gradient(
    prepared: PreparedMesh, model: Model, rotations: ArrayLike, grad: ArrayLike
) -> dict[str, NDArray[np.float32]]:
    """The gradient with respect to every weight, by name, from the one with respect to Jacobians.

    Evaluates the network first; arguments and errors are those of network_forward.

    Args:
        grad: (m, 3, 3), with respect to what network_forward returns.
    """
    return _native.network_gradient(
        prepared.native,
        model.native,
        arrays.matrices(rotations, "rotations"),
        arrays.matrices(grad, "grad"),
    )
