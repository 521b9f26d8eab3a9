# SPDX-License-Identifier: GPL-3.0-or-later
"""The network: forward, backward, one training step."""

from __future__ import annotations

import queue
import threading

import numpy as np
import supple
from supple import geometry

from supple_training.compare.contender import Contender, NotAvailable, Ready, Task, attribute
from supple_training.compare.shapes import Case, bent

SAMPLES = 1024
SEED = 1


def rotations(case: Case) -> np.ndarray:
    """(m, 3, 3): the rotation signal of a large deformation."""
    moved = bent(case.vertices)
    return geometry.closest_rotations(geometry.jacobians(case.vertices, case.faces, moved))


def _untrained_paper() -> supple.Model:
    """The paper's network with its first weights: what they are does not change the time."""
    from supple import _native

    return supple.Model(
        _native.Network.untrained(_native.Architecture("paper", "rotation"), SEED), {}
    )


def _model(config: str) -> supple.Model:
    return supple.load_model("rotation") if config == "equivariant" else _untrained_paper()


def _embedding(case: Case, jacobians: np.ndarray) -> np.ndarray:
    """(n, 3): the Poisson solve for (m, 3, 3) Jacobians, centred."""
    import scipy.sparse as sparse
    from scipy.sparse.linalg import splu

    laplacian = geometry.cotan_laplacian(case.vertices, case.faces).tocsc()
    areas = np.repeat(geometry.face_areas(case.vertices, case.faces), 3)
    gradient = geometry.gradient(case.vertices, case.faces)
    rhs = gradient.T @ (sparse.diags(areas) @ jacobians.reshape(-1, 3))
    factor = splu(
        laplacian[1:, 1:].tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    result = np.zeros((len(case.vertices), 3))
    result[1:] = factor.solve(rhs[1:])
    return result - result.mean(axis=0)


# --- forward --------------------------------------------------------------------------------------


def _forward(config: str, samples: int):
    def setup(case: Case, _: int) -> Ready:
        forward = attribute("supple.learning.network_forward")
        prepared = supple.PreparedMesh(case.vertices, case.faces, samples=samples)
        model, signal = _model(config), rotations(case)

        def facts(result) -> dict:
            if not samples:
                return {}
            every = supple.PreparedMesh(case.vertices, case.faces, samples=0)
            away = _embedding(case, result) - _embedding(case, forward(every, model, signal))
            distance = np.linalg.norm(away, axis=1) / prepared.diagonal
            return {
                "largest distance to every vertex's result / diagonal": float(distance.max()),
                "root mean square distance / diagonal": float(np.sqrt((distance**2).mean())),
            }

        forward(prepared, model, signal)  # builds what is built once
        return Ready(lambda: forward(prepared, model, signal), facts)

    return setup


def _torch_parts(case: Case, threads: int):
    import torch

    from supple_training.compare import torch_paper

    torch.set_num_threads(threads)
    surface = torch_paper.Surface(case)
    model = _untrained_paper()
    signal = rotations(case)
    network = torch_paper.Network(model.tensors())
    return torch, surface, network, torch.from_numpy(signal.astype(np.float32)), model, signal


def _torch_forward(case: Case, threads: int) -> Ready:
    torch, surface, network, signal, model, field = _torch_parts(case, threads)

    def call():
        with torch.inference_mode():
            return network(surface, signal)

    def facts(result) -> dict:
        try:
            forward = attribute("supple.learning.network_forward")
        except NotAvailable:
            return {}
        ours = forward(supple.PreparedMesh(case.vertices, case.faces, samples=0), model, field)
        away = np.abs(result.numpy() - ours).max() / np.abs(ours).max()
        return {"difference from supple, same weights": float(away)}

    return Ready(call, facts)


# --- forward and backward -------------------------------------------------------------------------


def _output_gradient(faces: int) -> np.ndarray:
    return np.random.default_rng(7).normal(size=(faces, 3, 3))


def _gradient(config: str, samples: int):
    def setup(case: Case, _: int) -> Ready:
        gradient = attribute("supple.learning.network_gradient")
        prepared = supple.PreparedMesh(case.vertices, case.faces, samples=samples)
        model, signal = _model(config), rotations(case)
        grad = _output_gradient(len(case.faces))
        gradient(prepared, model, signal, grad)
        return Ready(lambda: gradient(prepared, model, signal, grad))

    return setup


def _torch_gradient(case: Case, threads: int) -> Ready:
    torch, surface, network, signal, model, field = _torch_parts(case, threads)
    output_gradient = _output_gradient(len(case.faces))
    grad = torch.from_numpy(output_gradient.astype(np.float32))

    def call():
        network.zero_grad()
        network(surface, signal).backward(grad)

    def facts(_) -> dict:
        try:
            gradient = attribute("supple.learning.network_gradient")
        except NotAvailable:
            return {}
        prepared = supple.PreparedMesh(case.vertices, case.faces, samples=0)
        ours = gradient(prepared, model, field, output_gradient)["layer.0.weight"]
        away = np.abs(network.weights[0].grad.numpy() - ours).max() / np.abs(ours).max()
        return {"difference from supple, same weights": float(away)}

    return Ready(call, facts)


# --- one training step ----------------------------------------------------------------------------


class _Stepper:
    """`supple.train` in a thread, one step a call: it waits in its callback in between."""

    def __init__(self, case: Case, config: str) -> None:
        self._go: queue.Queue = queue.Queue()
        self._done: queue.Queue = queue.Queue()
        self._progress = supple.Progress()
        pair = (case.vertices, case.faces, bent(case.vertices))

        def work() -> None:
            try:
                supple.train(
                    [pair],
                    signal="rotation",
                    config=config,
                    epochs=1_000_000,
                    callback=self._stepped,
                    progress=self._progress,
                )
            except supple.Cancelled:
                pass
            except BaseException as error:  # handed to the thread that waits
                self._done.put(error)

        self._worker = threading.Thread(target=work, daemon=True)
        self._worker.start()
        self._wait()  # preparation and the first step

    def _stepped(self, step: dict) -> None:
        self._done.put(step)
        if self._go.get() is None:
            self._progress.cancel()

    def _wait(self) -> dict:
        answer = self._done.get()
        if isinstance(answer, BaseException):
            raise answer
        return answer

    def __call__(self) -> dict:
        self._go.put(1)
        return self._wait()

    def close(self) -> None:
        self._go.put(None)
        self._worker.join()


def _training_step(config: str):
    def setup(case: Case, _: int) -> Ready:
        stepper = _Stepper(case, config)
        return Ready(stepper, close=stepper.close)

    return setup


def _torch_training_step(case: Case, threads: int) -> Ready:
    _, surface, network, signal, _, _ = _torch_parts(case, threads)
    from supple_training.compare import torch_paper

    return Ready(torch_paper.TrainingStep(surface, network, signal, bent(case.vertices)))


PAPER = "supple, the paper's network"
TORCH = "PyTorch, the paper's network"

TASKS = (
    Task(
        "forward",
        "network, forward",
        (
            Contender(f"supple, {SAMPLES} samples", _forward("equivariant", SAMPLES), ours=True),
            Contender("supple, every vertex", _forward("equivariant", 0), ours=True),
            Contender(PAPER, _forward("paper", 0), ours=True),
            Contender(TORCH, _torch_forward),
        ),
    ),
    Task(
        "backward",
        "network, forward and backward",
        (
            Contender(f"supple, {SAMPLES} samples", _gradient("equivariant", SAMPLES), ours=True),
            Contender(PAPER, _gradient("paper", 0), ours=True),
            Contender(TORCH, _torch_gradient),
        ),
    ),
    Task(
        "training_step",
        "one step of training",
        (
            Contender(f"supple, {SAMPLES} samples", _training_step("equivariant"), ours=True),
            Contender(PAPER, _training_step("paper"), ours=True),
            Contender(TORCH, _torch_training_step),
        ),
    ),
)
