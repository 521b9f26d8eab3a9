# SPDX-License-Identifier: GPL-3.0-or-later
"""DiffusionNet in PyTorch, in double precision and with dense matrices.

Written from Sharp, Attaiki, Crane and Ovsjanikov 2022 and from what is stated in
native/include/supple/learning/diffusion_net.h and geometry/tangent_gradient.h, not from the C++
sources. Tangent vectors are kept in space here, with rotations about the normal in place of complex
numbers, so that there are no frames to agree on. Good for a few hundred vertices.
"""

from __future__ import annotations

import numpy as np
import torch
import torch_reference as reference
from torch import Tensor


class Surface:
    """A connected triangle mesh of area 1 and the operators of the network."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, count: int):
        base = reference.Surface(vertices, faces)
        n, m = len(base.vertices), len(base.faces)
        self.mass = base.mass
        self.values = base.eigenvalues[:count].clamp(min=0)
        self.functions = base.eigenfunctions[:, :count]

        # The gradient on faces, (m, 3, n), from its integral; then its area-weighted mean.
        on_faces = (base.divergence / base.areas.repeat_interleave(3)).T.reshape(m, 3, n)
        weights = torch.zeros(n, m, dtype=torch.float64)
        for i in range(3):
            weights[base.faces[:, i], torch.arange(m)] = base.areas
        normals = weights @ base.frames[:, 2]
        self.normals = normals / normals.norm(dim=1, keepdim=True)
        mean = torch.einsum("vm,mdn->vdn", weights / weights.sum(dim=1, keepdim=True), on_faces)
        along = torch.einsum("vd,vdn->vn", self.normals, mean)
        self.gradient = mean - self.normals[:, :, None] * along[:, None, :]  # (n, 3, n)


def features(surface: Surface, tensors: dict[str, Tensor], inputs: Tensor) -> Tensor:
    """(n, outputs) from (n, inputs)."""
    x = inputs @ tensors["first.weight"] + tensors["first.bias"]
    blocks = sum(name.endswith(".times") for name in tensors)
    for b in range(blocks):
        block = {
            name.removeprefix(f"block.{b}."): tensor
            for name, tensor in tensors.items()
            if name.startswith(f"block.{b}.")
        }
        decay = torch.exp(-surface.values[:, None] * block["times"])
        diffused = surface.functions @ (decay * (surface.functions.T @ (surface.mass[:, None] * x)))
        gradients = torch.einsum("vdn,nc->vdc", surface.gradient, diffused)
        # Times i is a quarter turn about the normal.
        quarter = torch.linalg.cross(
            surface.normals[:, :, None].expand_as(gradients), gradients, dim=1
        )
        mapped = gradients @ block["real"] + quarter @ block["imaginary"]
        products = torch.tanh((gradients * mapped).sum(dim=1))

        hidden = torch.cat([x, diffused, products], dim=1)
        for layer in range(3):
            if layer > 0:
                hidden = torch.nn.functional.silu(hidden)
            hidden = hidden @ block[f"layer.{layer}.weight"] + block[f"layer.{layer}.bias"]
        x = x + hidden
    return x @ tensors["last.weight"] + tensors["last.bias"]


def trainable(tensors: dict[str, np.ndarray]) -> dict[str, Tensor]:
    """Double copies that take gradients."""
    return {
        name: torch.tensor(np.array(value), dtype=torch.float64, requires_grad=True)
        for name, value in tensors.items()
    }
