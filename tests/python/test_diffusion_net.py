# SPDX-License-Identifier: GPL-3.0-or-later
"""The C++ DiffusionNet against an independent implementation in PyTorch, and its refusals."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from supple import SuppleError, _native

torch = pytest.importorskip("torch", reason="PyTorch is not installed; ./check installs it")
sys.path.append(str(Path(__file__).parent / "reference"))
import torch_diffusion_net as reference  # noqa: E402

SIZES = {"inputs": 5, "outputs": 7, "width": 12, "blocks": 3}
EIGENFUNCTIONS = 24


def bent_egg(rings: int = 11, around: int = 15) -> tuple[np.ndarray, np.ndarray]:
    """A closed mesh without symmetries: (n, 3) vertices and (m, 3) faces."""
    polar = np.pi * np.arange(1, rings)[:, None] / rings
    turn = 2 * np.pi * np.arange(around)[None, :] / around + 0.3 * polar
    side = np.stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar + 0 * turn)], -1
    )
    x, y, z = np.concatenate([[[0, 0, 1]], side.reshape(-1, 3), [[0, 0, -1]]]).T
    vertices = np.stack(
        [x + 0.3 * z * z, 1.4 * y + 0.2 * x * z, 2 * z + 0.25 * x + 0.1 * y * y], axis=1
    )
    vertices += np.random.default_rng(2).normal(0, 0.02, vertices.shape)
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


@pytest.fixture(scope="module")
def surfaces() -> tuple[_native.FeatureSurface, reference.Surface]:
    vertices, faces = bent_egg()
    ours = _native.FeatureSurface(vertices, faces, EIGENFUNCTIONS)
    return ours, reference.Surface(vertices, faces, ours.eigenfunctions)


@pytest.fixture(scope="module")
def tensors() -> dict[str, np.ndarray]:
    """Weights with every part awake: untrained ones have no bias."""
    rng = np.random.default_rng(5)
    made = {}
    untrained = _native.DiffusionNet.untrained(_native.DiffusionSizes(**SIZES), 3).tensors()
    for name, value in untrained.items():
        if name.endswith("times"):
            value = rng.uniform(0.001, 0.03, value.shape)
        elif name.endswith("bias"):
            value = rng.normal(0, 0.2, value.shape)
        made[name] = np.asarray(value, dtype=np.float32)
    return made


@pytest.fixture(scope="module")
def arrays(surfaces) -> tuple[np.ndarray, np.ndarray]:
    """Inputs (n, 5), smooth enough, and a gradient of the features (n, 7)."""
    rng = np.random.default_rng(6)
    n = len(surfaces[1].mass)
    inputs = np.sin(surfaces[0].inputs("coordinates", 3) @ rng.normal(0, 4, (3, SIZES["inputs"])))
    return inputs.astype(np.float32), rng.normal(size=(n, SIZES["outputs"])).astype(np.float32)


def network(tensors: dict[str, np.ndarray]) -> _native.DiffusionNet:
    return _native.DiffusionNet(_native.DiffusionSizes(**SIZES), tensors)


def test_features_are_those_of_the_reference(surfaces, tensors, arrays):
    ours, theirs = surfaces
    found = network(tensors).features(ours, arrays[0])
    weights = reference.trainable(tensors)
    expected = reference.features(theirs, weights, torch.tensor(arrays[0]).double())
    expected = expected.detach().numpy()
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() < 1e-4 * np.abs(expected).max()
    # The comparison notices another map of the gradients.
    weights["block.1.imaginary"] = -weights["block.1.imaginary"]
    other = reference.features(theirs, weights, torch.tensor(arrays[0]).double()).detach().numpy()
    assert np.abs(found - other).max() > 1e-2 * np.abs(expected).max()


def test_gradients_are_those_of_the_reference(surfaces, tensors, arrays):
    ours, theirs = surfaces
    found, found_input = network(tensors).gradient(ours, *arrays)
    weights = reference.trainable(tensors)
    inputs = torch.tensor(arrays[0]).double().requires_grad_()
    (reference.features(theirs, weights, inputs) * torch.tensor(arrays[1])).sum().backward()
    assert found.keys() == weights.keys()
    for name, weight in weights.items():
        expected = weight.grad.numpy()
        assert np.linalg.norm(found[name] - expected) < 1e-3 * np.linalg.norm(expected), name
    expected = inputs.grad.numpy()
    assert np.linalg.norm(found_input - expected) < 1e-3 * np.linalg.norm(expected)


def test_steps_are_those_of_adam_with_times_from_zero_up(surfaces, tensors, arrays):
    ours, theirs = surfaces
    # Times so short that some steps would take them below 0.
    tensors = {
        name: value * np.float32(0.05) if name.endswith("times") else value
        for name, value in tensors.items()
    }
    net = network(tensors)
    weights = reference.trainable(tensors)
    adam = torch.optim.Adam(weights.values(), lr=2e-3)
    for _ in range(3):
        net.step(ours, *arrays, 2e-3)
        adam.zero_grad()
        inputs = torch.tensor(arrays[0]).double()
        (reference.features(theirs, weights, inputs) * torch.tensor(arrays[1])).sum().backward()
        adam.step()
        with torch.no_grad():
            for name, weight in weights.items():
                if name.endswith("times"):
                    weight.clamp_(min=0)
    after = net.tensors()
    for name, weight in weights.items():
        expected = weight.detach().numpy()
        moved = np.linalg.norm(expected - tensors[name])
        assert moved > 0, name
        assert np.linalg.norm(after[name] - expected) < 1e-2 * moved, name
    assert any((after[f"block.{b}.times"] == 0).any() for b in range(SIZES["blocks"]))


def test_an_untrained_network_takes_wave_kernels_by_default(surfaces):
    sizes = _native.DiffusionSizes()
    assert (sizes.inputs, sizes.outputs, sizes.width, sizes.blocks) == (128, 256, 128, 4)
    inputs = surfaces[0].inputs("wave_kernel", sizes.inputs)
    features = _native.DiffusionNet.untrained(sizes, 1).features(surfaces[0], inputs)
    assert features.shape == (len(inputs), 256)
    assert np.isfinite(features).all()


def test_what_does_not_fit_is_refused(surfaces, tensors, arrays):
    with pytest.raises(SuppleError, match="x 5 inputs for this surface") as caught:
        network(tensors).features(surfaces[0], arrays[0][:, :4])
    assert caught.value.code == "wrong_shape"
    without = {name: value for name, value in tensors.items() if name != "block.2.real"}
    with pytest.raises(SuppleError, match=r"no tensor 'block\.2\.real'") as caught:
        network(without)
    assert caught.value.code == "model_file"
    with pytest.raises(SuppleError, match="'xyz' is no input") as caught:
        surfaces[0].inputs("xyz", 3)
    assert caught.value.code == "bad_option"
