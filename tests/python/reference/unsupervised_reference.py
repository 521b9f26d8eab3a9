# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's unsupervised loss in PyTorch, in double precision and with dense matrices.

Written from the paper (Eqns 12 to 14) and from the decisions stated in the headers soft_map.h,
feature_map.h, jacobian_loss.h and unsupervised_loss.h, not from the C++ sources. Its derivatives
are autograd's.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch_reference import Surface


@dataclass
class Options:
    """The paper's, by default; map_weight and map_exponent those of ULRSSM."""

    temperature: float = 0.07
    map_weight: float = 100.0
    map_exponent: float = 0.5
    orthogonality: float = 1.0
    coupling: float = 1.0
    bijectivity: float = 0.0
    jacobian_weights: tuple[float, float, float] = (1.0, 20.0, 10.0)


def soft_map(source: Tensor, target: Tensor, temperature: float) -> Tensor:
    """(n1, n2): softmax of the cosines of features."""
    cosines = torch.nn.functional.normalize(source) @ torch.nn.functional.normalize(target).T
    return torch.softmax(cosines / temperature, dim=1)


def resolvent_mask(source: Tensor, target: Tensor, exponent: float) -> Tensor:
    """(k_s, k_t): squared distances of the resolvents, real and imaginary part."""
    largest = torch.maximum(source.max(), target.max())
    a = ((source / largest) ** exponent)[:, None]
    b = ((target / largest) ** exponent)[None, :]
    real = a / (a**2 + 1) - b / (b**2 + 1)
    imaginary = 1 / (a**2 + 1) - 1 / (b**2 + 1)
    return real**2 + imaginary**2


def feature_map(source: Tensor, target: Tensor, penalties: Tensor) -> Tensor:
    """(k_s, k_t) from (k_s, c) and (k_t, c) coefficients: one linear system a row."""
    systems = target @ target.T + torch.diag_embed(penalties)
    return torch.linalg.solve(systems, source @ target.T)


def adjacency(faces: Tensor) -> Tensor:
    """(m, m): the mean over the faces with two common corners."""
    corners = torch.nn.functional.one_hot(faces).sum(dim=1).double()
    neighbours = (corners @ corners.T == 2).double()
    return neighbours / neighbours.sum(dim=1, keepdim=True)


def jacobian_terms(surface: Surface, rough: Tensor, predicted: Tensor) -> list[Tensor]:
    """Fit, smoothness and determinant of (m, 3, 3) Jacobians, faces by area."""
    mean = (adjacency(surface.faces) @ predicted.reshape(-1, 9)).reshape(-1, 3, 3)
    return [
        (surface.areas * ((rough - predicted) ** 2).sum(dim=(1, 2))).sum(),
        (surface.areas * ((predicted - mean) ** 2).sum(dim=(1, 2))).sum(),
        (surface.areas * (torch.linalg.det(predicted) - 1) ** 2).sum(),
    ]


def loss(
    surfaces: tuple[Surface, Surface],
    features: list[Tensor],
    predicted: list[Tensor],
    count: int,
    options: Options,
) -> dict[str, Tensor]:
    """Every term before weighting, both directions together, and the total."""
    functions = [surface.eigenfunctions[:, :count] for surface in surfaces]
    inverses = [phi.T * surface.mass for phi, surface in zip(functions, surfaces, strict=True)]
    coefficients = [inverse @ f for inverse, f in zip(inverses, features, strict=True)]
    maps, terms = [], {"orthogonality": 0, "coupling": 0, "bijectivity": 0}
    jacobians = [0, 0, 0]
    eye = torch.eye(count, dtype=torch.float64)
    for source, target in ((0, 1), (1, 0)):
        mask = resolvent_mask(
            surfaces[source].eigenvalues[:count].clamp(min=0),
            surfaces[target].eigenvalues[:count].clamp(min=0),
            options.map_exponent,
        )
        solved = feature_map(coefficients[source], coefficients[target], options.map_weight * mask)
        soft = soft_map(features[source], features[target], options.temperature)
        of_soft = inverses[source] @ soft @ functions[target]
        maps.append(solved)
        terms["orthogonality"] += ((solved.T @ solved - eye) ** 2).sum()
        terms["coupling"] += ((solved - of_soft) ** 2).sum()
        rough = surfaces[source].jacobians(soft @ surfaces[target].vertices)
        here = jacobian_terms(surfaces[source], rough, predicted[source])
        jacobians = [sum(pair) for pair in zip(jacobians, here, strict=True)]
    for there, back in (maps, maps[::-1]):
        terms["bijectivity"] += ((there @ back - eye) ** 2).sum()
    total = sum(getattr(options, name) * value for name, value in terms.items())
    total += sum(w * value for w, value in zip(options.jacobian_weights, jacobians, strict=True))
    names = ("fit", "smoothness", "determinant")
    return terms | dict(zip(names, jacobians, strict=True)) | {"total": total}
