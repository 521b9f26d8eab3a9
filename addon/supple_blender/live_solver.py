# SPDX-License-Identifier: GPL-3.0-or-later
"""The native editing solve as the add-on calls it; what the package has not yet is emulated here.

No bpy: it runs on any thread. Points are in solve space (see `space`).
"""

from dataclasses import dataclass

import numpy as np

from . import native


@dataclass(frozen=True)
class Options:
    """How to solve. stiffness: 0 natural .. 1 stiff; method: 'supple' or 'arap'."""

    stiffness: float = 0.0
    method: str = "supple"
    network: bool = True

    def arguments(self):
        """Return what `supple.Editor.solve` and `session` take of this."""
        return {
            "stiffness": self.stiffness,
            "method": self.method,
            "network": self.network,
        }


def solve(editor, handles, options, progress=None):
    """Return the `supple.EditResult` for new targets: a fixed number of passes, repeatable."""
    return editor.solve(handles, progress=progress, **options.arguments())


def session(editor, options):
    """Return a solver kept warm: aim(handles), advance(milliseconds) -> (n, 3), settled."""
    return editor.session(**options.arguments())


def blend(rest, posed, strength, weights):
    """Return positions between rest and posed (n, 3): as far as strength and weights (n,) say.

    EMULATED, along straight lines, until the package has it.
    """
    supple = native.supple()
    if hasattr(supple, "blend"):
        return supple.blend(rest, posed, strength, weights)
    amount = strength if weights is None else strength * weights[:, None]
    return rest + amount * (posed - rest)


def falloff_weights(prepared, vertices, radius):
    """Return (n,) in [0, 1]: 1 at `vertices`, falling off to 0 at `radius` from them.

    EMULATED, through the body instead of along the surface, until the package has it.
    """
    supple = native.supple()
    if hasattr(supple, "falloff_weights"):
        return supple.falloff_weights(prepared, vertices, radius)
    nearest = np.full(len(prepared.vertices), np.inf)
    for point in prepared.vertices[vertices]:
        np.minimum(nearest, ((prepared.vertices - point) ** 2).sum(axis=1), out=nearest)
    part = np.clip(1.0 - np.sqrt(nearest) / radius, 0.0, 1.0)
    return part * part * (3.0 - 2.0 * part)


def farthest_points(points, count):
    """Return `count` indices spread over points (n, 3), each farthest from those before it.

    EMULATED: supple::farthest_point_samples is not exposed to Python.
    """
    distance = ((points - points.mean(axis=0)) ** 2).sum(axis=1)
    chosen = []
    for _ in range(min(count, len(points))):
        chosen.append(int(distance.argmax()))
        from_it = ((points - points[chosen[-1]]) ** 2).sum(axis=1)
        distance = from_it if len(chosen) == 1 else np.minimum(distance, from_it)
    return chosen
