# SPDX-License-Identifier: GPL-3.0-or-later
"""Twenty training steps of the C++ trainer against an independent implementation in PyTorch."""

from __future__ import annotations

import numpy as np
import pytest
from supple import _native

pytest.importorskip("torch", reason="PyTorch is not installed; ./check installs it")
import torch_reference as reference

STEPS = 20
WIDTH = 256
EIGENFUNCTIONS = 48
TOLERANCE = 1e-4


def bumpy_sphere(rng: np.random.Generator, rings: int = 12, around: int = 17) -> tuple:
    """A closed genus-0 mesh without symmetries: (n, 3) vertices and (m, 3) faces."""
    polar = np.pi * (np.arange(1, rings) / rings)[:, None]
    turn = 2 * np.pi * (np.arange(around) / around)[None, :] + 0.3 * polar
    ring = np.stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar + 0 * turn)], -1
    )
    vertices = np.concatenate([[[0, 0, 1]], ring.reshape(-1, 3), [[0, 0, -1]]])
    radius = (
        1 + 0.25 * np.sin(3 * vertices @ rng.normal(size=3)) + rng.normal(0, 0.02, len(vertices))
    )
    vertices = vertices * radius[:, None] * [1.0, 1.4, 2.1]
    faces = []
    south = len(vertices) - 1
    for j in range(around):
        after = (j + 1) % around
        faces.append((0, 1 + j, 1 + after))
        for i in range(rings - 2):
            a, b = 1 + i * around + j, 1 + i * around + after
            faces += [(a, a + around, b + around), (a, b + around, b)]
        start = 1 + (rings - 2) * around
        faces.append((start + j, south, start + after))
    return vertices, np.array(faces, dtype=np.int32)


def bent(vertices: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The vertices twisted and bent along z, with a little noise: (n, 3)."""
    x, y, z = vertices.T
    twist = rng.uniform(0.2, 0.5) * z
    x, y = np.cos(twist) * x - np.sin(twist) * y, np.sin(twist) * x + np.cos(twist) * y
    angle = rng.uniform(0.2, 0.5) * (z - z.min())
    moved = np.stack(
        [x, np.cos(angle) * y - np.sin(angle) * z, np.sin(angle) * y + np.cos(angle) * z]
    )
    return moved.T * rng.uniform(0.9, 1.2) + rng.normal(0, 0.01, vertices.shape)


def suggestion(target: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """The target with a wave in it, and a few vertices that are where they belong."""
    wave = 0.15 * np.sin(2 * target @ rng.normal(size=(3, 3)))
    held = rng.choice(len(target), 9, replace=False).astype(np.int32)
    wave[held] = 0
    return target + wave, held


@pytest.fixture(scope="module")
def pairs() -> list[tuple]:
    """Three pairs of different size and shape, each with two suggestions."""
    rng = np.random.default_rng(5)
    made = []
    for rings in (11, 12, 14):
        vertices, faces = bumpy_sphere(rng, rings)
        target = bent(vertices, rng)
        made.append((vertices, faces, target, [suggestion(target, rng) for _ in range(2)]))
    return made


@pytest.fixture(scope="module")
def torch_pairs(pairs) -> dict[str, list[reference.Pair]]:
    return {
        kind: [reference.Pair(*pair, kind=kind) for pair in pairs]
        for kind in ("rotation", "spectral")
    }


# The signal, and whether it is taken from suggestions, as the editing network is trained.
KINDS = pytest.mark.parametrize(
    ("kind", "suggested"),
    [("rotation", False), ("spectral", False), ("rotation", True)],
    ids=["rotation", "spectral", "edits"],
)


def native_run(pairs: list[tuple], kind: str, suggested: bool) -> dict:
    options = _native.TrainOptions()
    options.architecture = _native.Architecture(
        "paper", kind, eigenfunctions=EIGENFUNCTIONS, width=WIDTH
    )
    options.samples = 0  # every vertex, as the paper
    options.epochs = 7
    options.fewest_eigenfunctions, options.most_eigenfunctions = 15, 40
    options.seed = 11
    given = [
        _native.TrainingPair(
            source,
            faces,
            target,
            [_native.Suggestion(*each) for each in suggestions] if suggested else [],
        )
        for source, faces, target, suggestions in pairs
    ]
    return _native.train_double(given, options, max_steps=STEPS)


@KINDS
def test_twenty_steps_give_the_losses_and_weights_of_the_reference(
    pairs, torch_pairs, kind, suggested
):
    native = native_run(pairs, kind, suggested)
    assert len(native["steps"]) == STEPS
    assert {row["pair"] for row in native["steps"]} == {0, 1, 2}
    assert {row["suggestion"] for row in native["steps"]} == ({0, 1} if suggested else {-1})

    network = reference.Network(native["initial"])
    trace = reference.train(
        torch_pairs[kind],
        network,
        native["steps"],
        eigenfunctions=EIGENFUNCTIONS,
        first=1e-3,
        last=1e-5,
        total=7 * len(pairs),
    )
    for row, (loss, jacobian, position, integrated) in zip(native["steps"], trace, strict=True):
        assert row["loss"] == pytest.approx(loss, rel=TOLERANCE)
        assert row["jacobian"] == pytest.approx(jacobian, rel=TOLERANCE)
        assert row["position"] == pytest.approx(position, rel=TOLERANCE)
        assert row["integrated"] == pytest.approx(integrated, rel=TOLERANCE)
    assert trace[-1][0] < trace[0][0]

    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        for name, value in (("weight", weight), ("bias", bias)):
            before = native["initial"][f"layer.{layer}.{name}"]
            ours = native["tensors"][f"layer.{layer}.{name}"]
            theirs = value.detach().numpy()
            assert np.abs(ours - theirs).max() <= TOLERANCE, f"layer {layer} {name}"
            # Weights hardly move in twenty steps: what they moved by must agree as well.
            learnt = np.linalg.norm(theirs - before)
            assert learnt > 0.0
            assert np.linalg.norm(ours - theirs) <= TOLERANCE * learnt, f"layer {layer} {name}"


@KINDS
def test_the_comparison_notices_another_loss_weight(
    pairs, torch_pairs, kind, suggested, monkeypatch
):
    """The trace test is worth something only if another training fails it."""
    native = native_run(pairs, kind, suggested)
    monkeypatch.setattr(reference, "LOSS_WEIGHTS", (1.0, 10.0, 4.0))
    trace = reference.train(
        torch_pairs[kind],
        reference.Network(native["initial"]),
        native["steps"][:12],
        eigenfunctions=EIGENFUNCTIONS,
        first=1e-3,
        last=1e-5,
        total=7 * len(pairs),
    )
    assert trace[0][0] != pytest.approx(native["steps"][0]["loss"], rel=TOLERANCE)
    assert trace[11][3] != pytest.approx(native["steps"][11]["integrated"], rel=TOLERANCE)
