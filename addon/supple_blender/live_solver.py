# SPDX-License-Identifier: GPL-3.0-or-later
"""The native editing solve as the add-on calls it.

No bpy: it runs on any thread. Points are in solve space (see `space`).
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """How to solve. stiffness: 0 natural .. 1 stiff; method: 'supple' or 'arap'."""

    stiffness: float = 0.0
    method: str = "supple"
    network: bool = True
    keep_volume: bool = True

    def arguments(self):
        """Return what `supple.Editor.solve` and `session` take of this."""
        return {
            "stiffness": self.stiffness,
            "method": self.method,
            "network": self.network,
            "keep_volume": self.keep_volume,
        }


def solve(editor, handles, options, progress=None):
    """Return the `supple.EditResult` for new targets: a fixed number of passes, repeatable."""
    return editor.solve(handles, progress=progress, **options.arguments())


def session(editor, options):
    """Return a solver kept warm: aim(handles), advance(milliseconds) -> (n, 3), settled."""
    return editor.session(**options.arguments())
