# SPDX-License-Identifier: GPL-3.0-or-later
"""The native editing solve as the add-on calls it; what the package has not yet is emulated here.

No bpy: it runs on any thread. Points are in solve space (see `space`).
"""

import inspect
from dataclasses import dataclass

import numpy as np

from . import native

# EMULATED until the native package has it: what a full solve and a frame of `advance` take.
FULL_PASSES = 40
FIRST_PASSES = 2


@dataclass(frozen=True)
class Options:
    """How to solve. stiffness: 0 natural .. 1 stiff; method: 'supple' or 'arap'."""

    stiffness: float = 0.0
    method: str = "supple"
    network: bool = True


def _has_stiffness(editor):
    return "stiffness" in inspect.signature(type(editor).solve).parameters


def solve(editor, handles, options, progress=None):
    """Return the `supple.EditResult` for new targets: a fixed number of passes, repeatable."""
    if _has_stiffness(editor):
        return editor.solve(
            handles,
            stiffness=options.stiffness,
            method=options.method,
            network=options.network,
            progress=progress,
        )
    return _emulated_solve(editor, handles, options, _all_passes(options), progress)


def session(editor, options):
    """Return a solver kept warm: aim(handles), advance(milliseconds) -> (n, 3), settled."""
    if hasattr(editor, "session"):
        return editor.session(
            stiffness=options.stiffness, method=options.method, network=options.network
        )
    return _EmulatedSession(editor, options)


def blend(rest, posed, strength, weights):
    """Return positions between rest and posed (n, 3): as far as strength and weights (n,) say."""
    supple = native.supple()
    if hasattr(supple, "blend"):
        return supple.blend(rest, posed, strength, weights)
    amount = strength if weights is None else strength * weights[:, None]
    return rest + amount * (posed - rest)


def falloff_weights(prepared, vertices, radius):
    """Return (n,) in [0, 1]: 1 at `vertices`, falling off to 0 at `radius` from them."""
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


def _all_passes(options):
    return FULL_PASSES if options.method == "arap" else round(options.stiffness * FULL_PASSES)


def _emulated_solve(editor, handles, options, passes, progress=None):
    network = options.network and options.method != "arap"
    if not passes:
        return editor.solve(handles, mode="natural", network=network, progress=progress)
    return editor.solve(handles, mode="stiff", passes=passes, network=network, progress=progress)


class _EmulatedSession:
    """EMULATED: every `advance` solves from the start, with twice the passes of the one before."""

    def __init__(self, editor, options):
        self._editor, self._options = editor, options
        self._handles, self._passes, self._vertices = None, 0, None
        self.settled = False

    def aim(self, handles):
        self._handles, self._passes, self.settled = handles, FIRST_PASSES, False

    def advance(self, milliseconds):
        if self.settled:
            return self._vertices
        passes = min(self._passes, _all_passes(self._options))
        result = _emulated_solve(self._editor, self._handles, self._options, passes)
        self._vertices = np.asarray(result.vertices)
        self._passes *= 2
        self.settled = passes == _all_passes(self._options)
        return self._vertices
