# SPDX-License-Identifier: GPL-3.0-or-later
"""The losses of unsupervised matching and their derivatives against PyTorch's autograd."""

from __future__ import annotations

import numpy as np
import pytest
import supple
from supple import _native

pytest.importorskip("torch", reason="PyTorch is not installed; ./check installs it")
import torch
import torch_reference
import unsupervised_reference as reference
from test_golden_trace import bent, bumpy_sphere

FUNCTIONS = 20
CHANNELS = 24
TOLERANCE = 1e-4
TERMS = ("orthogonality", "coupling", "bijectivity", "fit", "smoothness", "determinant", "total")

PAPER = reference.Options()
ULRSSM = reference.Options(bijectivity=1.0, jacobian_weights=(0.0, 0.0, 0.0))
SOFTER = reference.Options(temperature=0.5, map_weight=0.01, map_exponent=1.0, coupling=3.0)


@pytest.fixture(scope="module")
def pair() -> tuple:
    """Two meshes of different connectivity: (prepared, torch surface) each."""
    rng = np.random.default_rng(5)
    meshes = []
    for rings, around in ((9, 13), (8, 15)):
        vertices, faces = bumpy_sphere(rng, rings, around)
        vertices = bent(vertices, rng)
        meshes.append(
            (
                supple.PreparedMesh(vertices, faces, eigenfunctions=FUNCTIONS),
                torch_reference.Surface(vertices, faces),
            )
        )
    return tuple(meshes)


def native_options(options: reference.Options) -> _native.UnsupervisedOptions:
    native = _native.UnsupervisedOptions()
    for name, value in vars(options).items():
        setattr(native, name, value)
    return native


def inputs(pair: tuple) -> tuple[list, list]:
    """Smooth features that differ between the surfaces, and Jacobians near the identity."""
    rng = np.random.default_rng(6)
    features, predicted = [], []
    waves = rng.normal(size=(3, CHANNELS))
    for _, surface in pair:
        points = surface.vertices.numpy()
        features.append(np.sin(3 * points @ waves) + 0.1 * rng.normal(size=(len(points), CHANNELS)))
        predicted.append(np.eye(3) + 0.2 * rng.normal(size=(len(surface.faces), 3, 3)))
    return features, predicted


def close(actual: np.ndarray, expected: np.ndarray) -> bool:
    return np.abs(actual - expected).max() <= TOLERANCE * np.abs(expected).max()


@pytest.mark.parametrize("options", [PAPER, ULRSSM, SOFTER], ids=["paper", "ulrssm", "softer"])
def test_values_and_gradients_are_those_of_autograd(pair, options):
    features, predicted = inputs(pair)
    leaves = [torch.tensor(f, requires_grad=True) for f in features]
    jacobians = [torch.tensor(p, requires_grad=True) for p in predicted]
    surfaces = tuple(surface for _, surface in pair)
    expected = reference.loss(surfaces, leaves, jacobians, FUNCTIONS, options)
    expected["total"].backward()
    actual = _native.unsupervised_loss(
        pair[0][0].native,
        pair[1][0].native,
        features,
        [p.reshape(-1, 9) for p in predicted],
        FUNCTIONS,
        native_options(options),
    )
    for name in TERMS:
        assert getattr(actual, name) == pytest.approx(expected[name].item(), rel=TOLERANCE), name
    for d in range(2):
        assert close(actual.grad_features[d], leaves[d].grad.numpy())
        assert close(actual.grad_predicted[d], jacobians[d].grad.numpy().reshape(-1, 9))


def test_defaults_are_the_papers(pair):
    native = _native.UnsupervisedOptions()
    assert native.map_penalty == "resolvent"
    for name, value in vars(PAPER).items():
        assert getattr(native, name) == pytest.approx(value)


def test_a_soft_map_of_any_temperature_is_that_of_softmax():
    rng = np.random.default_rng(7)
    source, target = rng.normal(size=(40, 6)), rng.normal(size=(50, 6))
    values = rng.normal(size=(50, 3))
    for temperature in (1e-4, 0.07, 2.0):
        native = _native.SoftMap(source, target, temperature)
        expected = reference.soft_map(torch.tensor(source), torch.tensor(target), temperature)
        assert np.abs(native.apply(values) - expected.numpy() @ values).max() < 1e-9
        assert (native.hard_map() == expected.argmax(dim=1).numpy()).all()


def test_what_does_not_fit_is_refused(pair):
    features, predicted = inputs(pair)
    flat = [p.reshape(-1, 9) for p in predicted]

    def run(features: list, flat: list, options: _native.UnsupervisedOptions) -> None:
        _native.unsupervised_loss(
            pair[0][0].native, pair[1][0].native, features, flat, FUNCTIONS, options
        )

    with pytest.raises(supple.SuppleError, match="Surface 1 of the pair"):
        run([features[0], features[1][1:]], flat, native_options(PAPER))
    with pytest.raises(supple.SuppleError, match="predicted"):
        run(features, [flat[0][1:], flat[1]], native_options(PAPER))
    with pytest.raises(supple.SuppleError, match="temperature"):
        run(features, flat, native_options(reference.Options(temperature=0.0)))
    with pytest.raises(supple.SuppleError, match="no penalty"):
        native_options(PAPER).map_penalty = "mask"
