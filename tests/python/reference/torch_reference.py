# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's network and training step in PyTorch, in double precision and with dense matrices.

Written from the paper and from the decisions stated in native/include/supple/learning/*.h, not from
the C++ sources, so that the same mistake is unlikely in both. Good for a few hundred vertices.

Sizes: n vertices, m faces, k eigenfunctions. Points are rows. A field of 3x3 matrices is (m, 3, 3).
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

LOSS_WEIGHTS = (1.0, 10.0, 2.0)  # alpha_1, alpha_2, alpha_3


def frames(vertices: Tensor, faces: Tensor) -> Tensor:
    """(m, 3, 3): rows first edge, second edge, unit normal."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    normal = torch.linalg.cross(b - a, c - a)
    return torch.stack([b - a, c - a, normal / normal.norm(dim=1, keepdim=True)], dim=1)


def voronoi_mass(vertices: Tensor, faces: Tensor) -> Tensor:
    """(n,): mixed Voronoi areas, Meyer et al. 2003, section 3.3, one triangle corner at a time."""
    mass = np.zeros(len(vertices))
    points = vertices.numpy()
    for face in faces.numpy():
        corners = points[face]
        area = np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) / 2
        angles = []
        for i in range(3):
            u, v = corners[(i + 1) % 3] - corners[i], corners[(i + 2) % 3] - corners[i]
            angles.append(np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v)))
        for i in range(3):
            if max(angles) > np.pi / 2:
                share = area / 2 if angles[i] > np.pi / 2 else area / 4
            else:
                j, k = (i + 1) % 3, (i + 2) % 3
                to_j = np.sum((corners[j] - corners[i]) ** 2) / np.tan(angles[k])
                to_k = np.sum((corners[k] - corners[i]) ** 2) / np.tan(angles[j])
                share = (to_j + to_k) / 8
            mass[face[i]] += share
    return torch.from_numpy(mass)


class Surface:
    """Operators of one connected triangle mesh, scaled to area 1."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray):
        points = torch.from_numpy(np.asarray(vertices, dtype=np.float64))
        self.faces = torch.from_numpy(np.asarray(faces, dtype=np.int64))
        edge_frames = frames(points, self.faces)
        double_area = torch.linalg.cross(edge_frames[:, 0], edge_frames[:, 1]).norm(dim=1)
        self.scale = torch.sqrt(double_area.sum() / 2)
        self.vertices = points / self.scale
        self.frames = frames(self.vertices, self.faces)
        self.inverse_frames = torch.linalg.inv(self.frames)
        self.areas = double_area / 2 / self.scale**2
        self.mass = voronoi_mass(self.vertices, self.faces)
        n, m = len(points), len(self.faces)

        # The gradient of the hat function at corner i is normal x opposite edge / (2 area).
        gradient = torch.zeros(m, 3, n, dtype=torch.float64)
        for i in range(3):
            after, before = self.faces[:, (i + 1) % 3], self.faces[:, (i + 2) % 3]
            opposite = self.vertices[before] - self.vertices[after]
            turned = torch.linalg.cross(self.frames[:, 2], opposite) / (2 * self.areas[:, None])
            gradient[torch.arange(m), :, self.faces[:, i]] += turned
        gradient = gradient.reshape(3 * m, n)
        self.divergence = gradient.T * self.areas.repeat_interleave(3)
        self.laplacian = self.divergence @ gradient

        # Poisson with the mass-weighted centroid at 0, as one dense matrix.
        self.centring = torch.eye(n, dtype=torch.float64) - self.mass / self.mass.sum()
        self.poisson = self.centring @ torch.linalg.pinv(self.laplacian) @ self.divergence

        root = self.mass.sqrt()
        values, vectors = torch.linalg.eigh(self.laplacian / root[:, None] / root)
        self.eigenvalues = values
        self.eigenfunctions = vectors / root[:, None]

        count = torch.zeros(n, dtype=torch.float64)
        count.index_add_(0, self.faces.ravel(), torch.ones(3 * m, dtype=torch.float64))
        self.averaging = torch.zeros(n, m, dtype=torch.float64)
        for i in range(3):
            self.averaging[self.faces[:, i], torch.arange(m)] += 1 / count[self.faces[:, i]]

    def jacobians(self, moved: Tensor) -> Tensor:
        """(m, 3, 3): E1^-1 E2 to (n, 3) moved vertices."""
        return self.inverse_frames @ frames(moved, self.faces)

    def project(self, field: Tensor, count: int) -> Tensor:
        """Phi Phi^T M times an (n, c) field, with the first `count` eigenfunctions."""
        phi = self.eigenfunctions[:, :count]
        return phi @ (phi.T @ (self.mass[:, None] * field))


class Pair:
    """A source, its target, and the coarse signal between them.

    For kind "rotation" the target is in the source's units; for "spectral" both have area 1.
    suggestions: (vertices (n, 3), held (k,)) each, what edits of the pair start from.
    """

    def __init__(
        self,
        source: np.ndarray,
        faces: np.ndarray,
        target: np.ndarray,
        suggestions: list = (),
        *,
        kind: str,
    ):
        self.kind = kind
        self.source = Surface(source, faces)
        self.other = Surface(target, faces)
        if kind == "spectral":
            self.target = self.other.vertices
        else:
            self.target = torch.from_numpy(np.asarray(target, np.float64)) / self.source.scale
        self.suggestions = [
            (torch.from_numpy(vertices) / self.source.scale, torch.from_numpy(held).long())
            for vertices, held in suggestions
        ]

    def signal(self, eigenfunctions: int, suggestion: int) -> Tensor:
        """(m, 3, 3): closest rotations, or Jacobians to the spectrally projected target."""
        if self.kind == "spectral":
            coarse = self.other.project(self.target, eigenfunctions)
            coarse = self.source.project(coarse, eigenfunctions)
            return self.source.jacobians(coarse)
        moved = self.target if suggestion < 0 else self.suggestions[suggestion][0]
        left, _, right = torch.linalg.svd(self.source.jacobians(moved))
        sign = torch.det(left @ right)
        middle = torch.diag_embed(torch.stack([torch.ones_like(sign)] * 2 + [sign], dim=1))
        return left @ middle @ right

    def recover(self, predicted: Tensor, suggestion: int) -> tuple[Tensor, Tensor]:
        """(n, 3) the embedding of (m, 3, 3) Jacobians, and the target as it is compared with it."""
        surface = self.source
        if suggestion < 0:
            return surface.poisson @ predicted.reshape(-1, 3), surface.centring @ self.target
        held = self.suggestions[suggestion][1]
        free = torch.ones(len(self.target), dtype=torch.bool)
        free[held] = False
        known = surface.laplacian[free][:, held] @ self.target[held]
        divergence = (surface.divergence @ predicted.reshape(-1, 3))[free]
        embedding = self.target.clone()
        embedding[free] = torch.linalg.solve(surface.laplacian[free][:, free], divergence - known)
        return embedding, self.target


class Network(torch.nn.Module):
    """Four layers of `width`, each projected, then two that are not; SiLU between the maps."""

    def __init__(self, tensors: dict[str, np.ndarray]):
        super().__init__()
        count = sum(name.endswith(".weight") for name in tensors)

        def parameters(kind: str) -> torch.nn.ParameterList:
            return torch.nn.ParameterList(
                torch.nn.Parameter(torch.tensor(tensors[f"layer.{i}.{kind}"], dtype=torch.float64))
                for i in range(count)
            )

        self.weights, self.biases = parameters("weight"), parameters("bias")

    def forward(self, surface: Surface, signal: Tensor, eigenfunctions: int) -> Tensor:
        """(m, 3, 3) Jacobians from an (m, 3, 3) signal."""
        x = surface.averaging @ signal.reshape(-1, 9)
        last = len(self.weights) - 1
        for i, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = x @ weight + bias
            if i < last:
                x = torch.nn.functional.silu(x)
            if i < last - 1:
                x = surface.project(x, eigenfunctions)
        return x[surface.faces].mean(dim=1).reshape(-1, 3, 3)


def losses(pair: Pair, predicted: Tensor, suggestion: int) -> tuple[Tensor, Tensor, Tensor]:
    """The Jacobian, position and integrated-Jacobian terms, before weighting."""
    surface = pair.source
    truth = surface.jacobians(pair.target)
    embedding, target = pair.recover(predicted, suggestion)
    away = embedding - target
    integrated = surface.jacobians(embedding) - truth
    return (
        (surface.areas * ((predicted - truth) ** 2).sum(dim=(1, 2))).sum(),
        (surface.mass * (away**2).sum(dim=1)).sum(),
        (surface.areas * (integrated**2).sum(dim=(1, 2))).sum(),
    )


def train(
    pairs: list[Pair],
    network: Network,
    schedule: list[dict],
    *,
    eigenfunctions: int,
    first: float,
    last: float,
    total: int,
) -> list[tuple[float, float, float, float]]:
    """One Adam step for each row of `schedule`: its pair, suggestion and number of eigenfunctions.

    The learning rate falls from `first` to `last` by the same factor over `total` steps.
    Returns the weighted loss and its three terms before each step.
    """
    adam = torch.optim.Adam(network.parameters(), lr=first)
    trace = []
    for number, row in enumerate(schedule):
        pair = pairs[row["pair"]]
        for group in adam.param_groups:
            group["lr"] = first * (last / first) ** (number / (total - 1))
        adam.zero_grad()
        signal = pair.signal(row["eigenfunctions"], row["suggestion"])
        terms = losses(pair, network(pair.source, signal, eigenfunctions), row["suggestion"])
        loss = sum(weight * term for weight, term in zip(LOSS_WEIGHTS, terms, strict=True))
        loss.backward()
        adam.step()
        trace.append((loss.item(), *(term.item() for term in terms)))
    return trace
