# SPDX-License-Identifier: GPL-3.0-or-later
"""From two rest shapes to a map between them. No bpy: it runs on any thread.

What is carried goes from the source to the target, so a map has a point on the source's surface for
each vertex of the target: in the native package's words the panel's target is a map's source.
"""

import re
from dataclasses import dataclass, field

import numpy as np

from . import match_features, native, prepared, space
from .errors import UserError
from .mesh_data import RestMesh
from .pose import guarded


@dataclass(frozen=True)
class MatchInput:
    """Everything a match needs.

    start: one of STARTS. worlds: matrices (4, 4) of source and target. landmarks: (p, 2), a
    source and a target vertex each. uvs: (m, 3, 2) of source and target. file: a map's. current: a
    `supple.SurfaceMap`. epochs, model: how long which features adapt. What the start does not need
    may be None.
    """

    source: RestMesh
    target: RestMesh
    start: str
    refine: bool
    worlds: tuple = ()
    landmarks: np.ndarray | None = None
    uvs: tuple = ()
    file: str = ""
    current: object = None
    epochs: int = match_features.EPOCHS
    model: str = match_features.MODEL

    @property
    def name(self):
        return self.target.name


@dataclass(frozen=True)
class Match:
    """surface_map: a `supple.SurfaceMap`, target to source. confidence: (n,) of its points, 0 to 1.
    notes: what people should know.
    """

    surface_map: object
    confidence: np.ndarray
    notes: list = field(default_factory=list)


def in_panel_words(text, file=""):
    """Return a native message with source and target as in the panel; `file` in it stays."""
    other = {"source": "target", "target": "source"}
    parts = text.split(file) if file else [text]
    turned = [re.sub(r"\b(source|target)\b", lambda found: other[found[0]], p) for p in parts]
    return file.join(turned)


def arrays(rest):
    """Return a RestMesh as the native package takes one: local vertices and triangles."""
    return rest.positions, rest.triangles


def solve_arrays(rest):
    """As `arrays`, congruent to what is seen."""
    return space.to_solve_points(rest.stretch, rest.positions), rest.triangles


def _automatic(inputs, source, target, progress):
    return native.supple().automatic_map(target, source, progress=progress)


def _landmarks(inputs, source, target, progress):
    pairs = inputs.landmarks[:, ::-1]
    return native.supple().landmark_map(target, source, pairs, progress=progress)


def _aligned(inputs, source, target, progress):
    return native.supple().nearest_map(target, source, progress=progress)


def _nearest(inputs, source, target, progress):
    """As both lie in the world, where prepared meshes are not."""
    points = [
        space.to_world_points(world, rest.positions)
        for world, rest in zip(inputs.worlds, (inputs.source, inputs.target), strict=True)
    ]
    return native.supple().closest_points((points[0], inputs.source.triangles), points[1]).map


def _uvs(inputs, source, target, progress):
    source_uvs, target_uvs = inputs.uvs
    return native.supple().uv_map(target, source, target_uvs, source_uvs)


def _file(inputs, source, target, progress):
    return native.supple().load_map(inputs.file, arrays(inputs.target), arrays(inputs.source))


def _current(inputs, source, target, progress):
    return inputs.current


FIRST_MAPS = {
    "AUTOMATIC": _automatic,
    "LANDMARKS": _landmarks,
    "NEAREST": _nearest,
    "ALIGNED": _aligned,
    "UVS": _uvs,
    "FILE": _file,
    "CURRENT": _current,
}
FEATURES = "FEATURES"
STARTS = (*FIRST_MAPS, FEATURES)

WITHOUT_FEATURES = "A map found without the features bore refining better, and was taken."


def _texts(result):
    return [in_panel_words(note.message) for note in result.notes]


def _as_map(initial, source):
    """Return a `supple.InitialMap` as a map, how plausible it is (n,), and notes as text."""
    found = native.supple().SurfaceMap.from_point_map(initial.point_map, source)
    return found, np.where(found.face < 0, 0.0, initial.score.value), _texts(initial)


def _first(inputs, source, target, progress):
    """As _as_map, of the start."""
    supple = native.supple()
    found = FIRST_MAPS[inputs.start](inputs, source, target, progress)
    if not isinstance(found, supple.SurfaceMap):
        return _as_map(found, source)
    corners = np.maximum(found.nearest_corners(source), 0)
    score = supple.map_score(target, source, corners)
    return found, np.where(found.face < 0, 0.0, score.value), []


def _from_start(inputs, source, target, stages):
    """As _as_map, refined if the MatchInput says so."""
    found, confidence, notes = _first(inputs, source, target, stages.begin("Matching", 0.25))
    if not inputs.refine:
        return found, confidence, notes
    progress = stages.begin("Refining", 0.15)
    refiner = native.supple().Refiner(target, source, progress=progress)
    refined = refiner.refine(found, progress=progress)
    return refined.surface_map, refined.confidence, [*notes, *_texts(refined)]


def _from_features(inputs, model, source, target, stages):
    """As _from_start; what adapted also refines."""
    result = match_features.match(model, inputs.epochs, source, target, stages)
    found, confidence, notes = _as_map(result.initial, source)
    if result.automatic:
        notes = [WITHOUT_FEATURES, *notes]
    if not inputs.refine:
        return found, confidence, notes
    refined = result.refined
    return refined.surface_map, refined.confidence, [*notes, *_texts(refined)]


def _solve(inputs, stages):
    supple = native.supple()
    is_learned = inputs.start == FEATURES
    model = match_features.load(inputs.model) if is_learned else None
    share = 0.05 if is_learned else 0.3  # features take long to adapt
    source, target = (
        guarded(rest.name, lambda rest=rest: prepared.mesh(rest, stages, share))
        for rest in (inputs.source, inputs.target)
    )
    try:
        if is_learned:
            found, confidence, notes = _from_features(inputs, model, source, target, stages)
        else:
            found, confidence, notes = _from_start(inputs, source, target, stages)
    except supple.Cancelled:
        raise
    except supple.SuppleError as error:
        raise UserError(f"{inputs.name}: {in_panel_words(str(error), inputs.file)}") from error
    return Match(found, confidence, notes)


def solve(inputs, stages):
    """Return the Match. Raises UserError, or CancelledError after `stages.cancel()`."""
    return guarded(inputs.name, lambda: _solve(inputs, stages))
