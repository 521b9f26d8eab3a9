# SPDX-License-Identifier: GPL-3.0-or-later
"""The network alone, from Python: its answer to one rotation, its derivative, its refusals."""

import numpy as np
import pytest
import supple
from supple import _native, geometry, learning


@pytest.fixture(scope="module")
def prepared() -> supple.PreparedMesh:
    """A closed ellipsoid of 162 vertices."""
    rings, around = 10, 16
    theta = np.linspace(0, np.pi, rings + 2)[1:-1]
    phi = np.arange(around) * 2 * np.pi / around
    t, p = np.meshgrid(theta, phi, indexing="ij")
    side = np.stack([np.sin(t) * np.cos(p), 1.3 * np.sin(t) * np.sin(p), 1.7 * np.cos(t)], axis=2)
    vertices = np.concatenate([side.reshape(-1, 3), [[0, 0, 1.7], [0, 0, -1.7]]])
    faces = []
    for j in range(around):
        k = (j + 1) % around
        faces.append([len(vertices) - 2, j, k])
        faces.append([len(vertices) - 1, (rings - 1) * around + k, (rings - 1) * around + j])
        for i in range(rings - 1):
            a, b = i * around + j, i * around + k
            faces += [[a, a + around, b], [b, a + around, b + around]]
    return supple.PreparedMesh(vertices, np.array(faces))


@pytest.fixture(scope="module")
def rotations(prepared) -> np.ndarray:
    rng = np.random.default_rng(3)
    m = len(prepared.faces)
    noisy = np.eye(3) + 0.3 * rng.normal(size=(m, 3, 3))
    return geometry.closest_rotations(noisy)


def paper(tensors: dict | None = None) -> supple.Model:
    architecture = _native.Architecture("paper", "rotation", 40, 16)
    if tensors is None:
        return supple.Model(_native.Network.untrained(architecture, 2), {})
    return supple.Model(_native.Network(architecture, tensors), {})


def test_one_rotation_everywhere_is_the_answer(prepared):
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    signal = np.broadcast_to(turn, (len(prepared.faces), 3, 3))
    answer = learning.network_forward(prepared, supple.load_model("rotation"), signal)
    assert answer.shape == signal.shape
    assert np.abs(answer - turn).max() < 1e-5


def test_gradient_is_that_of_the_forward_pass(prepared, rotations):
    model = paper()
    tensors = model.tensors()
    rng = np.random.default_rng(4)
    grad = rng.normal(size=rotations.shape)
    gradient = learning.network_gradient(prepared, model, rotations, grad)
    assert gradient.keys() == {name for name in tensors if name.startswith("layer.")}

    def value(step: float, direction: dict) -> float:
        moved = {
            name: tensor + np.float32(step) * direction.get(name, np.float32(0))
            for name, tensor in tensors.items()
        }
        return float((grad * learning.network_forward(prepared, paper(moved), rotations)).sum())

    for name in gradient:
        # Along the gradient itself, where single precision can tell a difference.
        direction = {name: gradient[name] / np.linalg.norm(gradient[name])}
        slope = (value(1e-2, direction) - value(-1e-2, direction)) / 2e-2
        assert slope == pytest.approx(np.linalg.norm(gradient[name]), rel=1e-2), name


def test_wrong_arrays_are_refused(prepared, rotations):
    model = paper()
    with pytest.raises(supple.SuppleError, match=r"rotations has shape .* must be \(m, 3, 3\)"):
        learning.network_forward(prepared, model, rotations.reshape(-1, 9))
    with pytest.raises(supple.SuppleError, match="rotations for a mesh of") as caught:
        learning.network_forward(prepared, model, rotations[1:])
    assert caught.value.code == "wrong_shape"
    with pytest.raises(supple.SuppleError, match="gradients for"):
        learning.network_gradient(prepared, model, rotations, rotations[1:])


def test_a_network_of_the_other_signal_is_refused(prepared, rotations):
    with pytest.raises(supple.SuppleError, match="spectral signal") as caught:
        learning.network_forward(prepared, supple.load_model("spectral"), rotations)
    assert caught.value.code == "bad_option"
