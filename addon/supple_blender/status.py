# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel says about the mesh last prepared, by object name. Only for show."""

from dataclasses import dataclass, field

_lines = {}


@dataclass(frozen=True)
class Ready:
    vertices: int
    seconds: float
    notes: list = field(default_factory=list)


def remember(rest, seconds, notes):
    """Keep what preparing RestMesh rest took and found."""
    _lines[rest.name] = Ready(len(rest.positions), seconds, list(notes))


def of(obj):
    """Return Ready for mesh object obj, or None if it was not prepared as it is."""
    ready = _lines.get(obj.name)
    return ready if ready and ready.vertices == len(obj.data.vertices) else None
