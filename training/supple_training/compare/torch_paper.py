# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's network and its supervised training step in PyTorch on the CPU.

Every vertex, as in the paper, in single precision, with sparse operators: what one would write
today without this library. tests/python/reference has the same in double precision with dense
matrices; a test holds the two together. What a step can reuse (the signal, the operators, the
factor of the Poisson equation) is made once, outside of it.

Sizes: n vertices, m faces, k eigenfunctions. A field of 3x3 matrices is (m, 3, 3).
"""

from __future__ import annotations

import warnings

import numpy as np
import torch
from supple import geometry
from torch import Tensor

from supple_training.compare.shapes import Case

LOSS_WEIGHTS = (1.0, 10.0, 2.0)
EIGENFUNCTIONS = 128


def _sparse(matrix) -> Tensor:
    coo = matrix.tocoo()
    indices = torch.from_numpy(np.stack([coo.row, coo.col]).astype(np.int64))
    values = torch.from_numpy(coo.data.astype(np.float32))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "in beta state", on every use
        return torch.sparse_coo_tensor(indices, values, coo.shape).coalesce().to_sparse_csr()


def frames(vertices: Tensor, faces: Tensor) -> Tensor:
    """(m, 3, 3): rows first edge, second edge, unit normal."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    normal = torch.linalg.cross(b - a, c - a)
    return torch.stack([b - a, c - a, normal / normal.norm(dim=1, keepdim=True)], dim=1)


class Surface:
    """A mesh of area 1 with the operators that the network needs."""

    def __init__(self, case: Case, eigenfunctions: int = EIGENFUNCTIONS):
        from scipy.sparse import csr_matrix

        self.case = case
        mass = geometry.lumped_mass(case.vertices, case.faces)
        functions, _, _ = geometry.eigenbasis(case.vertices, case.faces, eigenfunctions)
        self.functions = torch.from_numpy(functions.astype(np.float32))
        weighted = np.ascontiguousarray((functions * mass[:, None]).T, dtype=np.float32)
        self.weighted = torch.from_numpy(weighted)
        self.mass = torch.from_numpy(mass.astype(np.float32))
        self.vertices = torch.from_numpy(case.vertices.astype(np.float32))
        self.faces = torch.from_numpy(case.faces.astype(np.int64))
        areas = geometry.face_areas(case.vertices, case.faces)
        self.areas = torch.from_numpy(areas.astype(np.float32))
        self.inverse_frames = torch.linalg.inv(
            frames(torch.from_numpy(case.vertices), self.faces)
        ).float()

        n, m = len(case.vertices), len(case.faces)
        corners, owners = case.faces.ravel(), np.repeat(np.arange(m), 3)
        share = 1.0 / np.bincount(corners, minlength=n)[corners]
        self.averaging = _sparse(csr_matrix((share, (corners, owners)), (n, m)))
        spread = csr_matrix((np.full(3 * m, 1 / 3), (owners, corners)), (m, n))
        self.to_faces = _sparse(spread)

    def jacobians(self, moved: Tensor) -> Tensor:
        """(m, 3, 3): E1^-1 E2 to (n, 3) moved vertices."""
        return self.inverse_frames @ frames(moved, self.faces)


class Poisson:
    """The embedding of (m, 3, 3) Jacobians, mass-weighted centroid at 0, through CHOLMOD."""

    def __init__(self, surface: Surface):
        from scipy.sparse import diags

        from supple_training.compare.kernels import _cholespy_factor

        case = surface.case
        laplacian = geometry.cotan_laplacian(case.vertices, case.faces).tocsr()
        gradient = geometry.gradient(case.vertices, case.faces)
        areas = geometry.face_areas(case.vertices, case.faces)
        self.divergence = _sparse((gradient.T @ diags(np.repeat(areas, 3))).tocsr())
        self.mass = geometry.lumped_mass(case.vertices, case.faces)
        self.mass = self.mass / self.mass.sum()
        # W has the constants in its kernel: the first vertex is held, and the result centred.
        self.solve_held = _cholespy_factor(laplacian[1:, 1:].tocsc())

    def inverse(self, rhs: np.ndarray) -> np.ndarray:
        """The pseudo-inverse of W for right sides (n, 3) that sum to 0, up to a constant."""
        result = np.zeros(rhs.shape)
        result[1:] = self.solve_held(rhs[1:])
        return result

    def __call__(self, predicted: Tensor) -> Tensor:
        rhs = self.divergence @ predicted.reshape(-1, 3)
        return _PoissonSolve.apply(rhs, self)


class _PoissonSolve(torch.autograd.Function):
    """C W^+ b, with C the centring x - 1 mu^T x; its transpose in the backward pass."""

    @staticmethod
    def forward(context, rhs: Tensor, poisson: Poisson) -> Tensor:
        context.poisson = poisson
        result = poisson.inverse(rhs.detach().double().numpy())
        result -= poisson.mass @ result
        return torch.from_numpy(result).to(rhs.dtype)

    @staticmethod
    def backward(context, grad: Tensor):
        poisson = context.poisson
        grad_np = grad.double().numpy()
        centred = grad_np - poisson.mass[:, None] * grad_np.sum(axis=0)
        return torch.from_numpy(poisson.inverse(centred)).to(grad.dtype), None


class Network(torch.nn.Module):
    """Four layers of `width`, each projected, then two that are not; SiLU between the maps."""

    def __init__(self, tensors: dict[str, np.ndarray]):
        super().__init__()
        count = sum(name.endswith(".weight") for name in tensors)

        def parameters(kind: str) -> torch.nn.ParameterList:
            return torch.nn.ParameterList(
                torch.nn.Parameter(torch.tensor(np.array(tensors[f"layer.{i}.{kind}"])))
                for i in range(count)
            )

        self.weights, self.biases = parameters("weight"), parameters("bias")

    def forward(self, surface: Surface, signal: Tensor) -> Tensor:
        """(m, 3, 3) Jacobians from an (m, 3, 3) signal."""
        x = surface.averaging @ signal.reshape(-1, 9)
        last = len(self.weights) - 1
        for i, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = torch.addmm(bias, x, weight)
            if i < last:
                x = torch.nn.functional.silu(x)
            if i < last - 1:
                x = surface.functions @ (surface.weighted @ x)
        return (surface.to_faces @ x).reshape(-1, 3, 3)


class TrainingStep:
    """One step of supervised training on one pair with Adam; calling it does the step."""

    def __init__(self, surface: Surface, network: Network, signal: Tensor, target: np.ndarray):
        self.surface, self.network, self.signal = surface, network, signal
        self.poisson = Poisson(surface)
        weight = self.poisson.mass @ target
        self.target = torch.from_numpy((target - weight).astype(np.float32))
        self.truth = surface.jacobians(self.target)
        self.adam = torch.optim.Adam(network.parameters(), lr=1e-3)

    def loss(self) -> Tensor:
        """The three terms of the paper, weighted."""
        surface = self.surface
        predicted = self.network(surface, self.signal)
        embedding = self.poisson(predicted)
        integrated = surface.jacobians(embedding) - self.truth
        terms = (
            (surface.areas * ((predicted - self.truth) ** 2).sum(dim=(1, 2))).sum(),
            (surface.mass * ((embedding - self.target) ** 2).sum(dim=1)).sum(),
            (surface.areas * (integrated**2).sum(dim=(1, 2))).sum(),
        )
        return sum(weight * term for weight, term in zip(LOSS_WEIGHTS, terms, strict=True))

    def __call__(self) -> float:
        self.adam.zero_grad()
        loss = self.loss()
        loss.backward()
        self.adam.step()
        return loss.item()
