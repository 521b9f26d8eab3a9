# SPDX-License-Identifier: GPL-3.0-or-later
"""Random articulated creatures that are made here, from no one else's data.

A creature is a random skeleton (`families`), a smooth skin with small bumps and folds around it
(`skin`), and weights by which the skin follows the joints' turns (`poses`). Lengths are metres; the
skin's area is about a human body's. Everything random takes a `numpy.random.Generator`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from supple_training.bodies import HELD_OUT_GRID, self_intersection
from supple_training.creatures.families import FAMILIES
from supple_training.creatures.poses import (
    follow,
    joint_motions,
    sample_gait,
    sample_lean,
    sample_turns,
    stand,
)
from supple_training.creatures.proportions import grown
from supple_training.creatures.skeleton import FloatArray, Skeleton
from supple_training.creatures.skin import IntArray, skin, spread
from supple_training.remesh import (
    euler_characteristic,
    is_closed_manifold,
    remesh,
    unit_normals,
)

_ATTEMPTS = 20
CREATURES = 5
"""How many creatures are tried before it is given up: one bad draw must not end a long run."""

WALKERS = ("quadruped", "biped", "sprawler", "bird", "insect")
"""The families that go on legs."""

_T = TypeVar("_T")


@dataclass(frozen=True)
class Creature:
    """A skeleton in its skin, at rest."""

    skeleton: Skeleton
    vertices: FloatArray
    """(n, 3) in metres."""
    faces: IntArray
    """(m, 3): one closed manifold surface, counterclockwise from outside."""
    weights: FloatArray
    """(n, joints): how far each vertex follows each joint; rows sum to 1."""

    def other_proportions(self, rng: np.random.Generator) -> Creature:
        """The same creature with longer and shorter, thicker and thinner parts."""
        skeleton, vertices = grown(self.skeleton, self.vertices, self.weights, rng)
        return Creature(skeleton, vertices, self.faces, self.weights)

    def posed(self, turns: FloatArray) -> FloatArray:
        """The skin (n, 3) after turns (joints, 3) in degrees about the joints' own axes."""
        return follow(self.vertices, self.weights, *joint_motions(self.skeleton, turns))


def is_held_out(traits: FloatArray) -> bool:
    """Whether a creature of traits (limb length, thickness) in [0, 1] is kept from training.

    One cell in four of a grid, as for bodies, in every family.
    """
    cell = np.minimum((np.asarray(traits) * HELD_OUT_GRID).astype(int), HELD_OUT_GRID - 1)
    return bool(cell.sum() % 4 == 3)


def sample_traits(rng: np.random.Generator, *, held_out: bool = False) -> FloatArray:
    """(2,) random traits in [0, 1]: limb length and thickness."""
    while True:
        traits = rng.random(2)
        if is_held_out(traits) == held_out:
            return traits


def volume(vertices: FloatArray, faces: IntArray) -> float:
    """The volume inside a closed surface, in cubic metres."""
    corner = vertices[faces]
    return float(np.einsum("md,md->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6)


def sample_creature(
    rng: np.random.Generator,
    *,
    held_out: bool = False,
    vertices: tuple[int, int] = (3500, 6500),
    family: str | None = None,
    suits: Callable[[Skeleton], bool] = lambda _: True,
) -> Creature:
    """A random creature in a triangulation of its own, of a random family unless one is named.

    Skeletons are drawn again until one `suits`.

    Raises RuntimeError when none of several skins is a single closed surface that can be
    triangulated with so few vertices.
    """
    makers = [maker for maker in FAMILIES if family in (None, maker.__name__)]
    share = np.array([FAMILIES[maker] for maker in makers])
    maker = makers[int(rng.choice(len(makers), p=share / share.sum()))]
    for _ in range(_ATTEMPTS):
        skeleton = maker(*sample_traits(rng, held_out=held_out), rng)
        while not suits(skeleton):
            skeleton = maker(*sample_traits(rng, held_out=held_out), rng)
        made = skin(skeleton, rng)
        if made is None:
            continue
        rest, faces, weights, thickness = made
        if not is_closed_manifold(faces) or euler_characteristic(faces) != 2:
            continue
        # Triangulated at rest, where the limbs are well apart.
        try:
            surface = remesh(rest, faces, rng, vertex_count=vertices, attempts=6)
        except RuntimeError:  # too thin for so few vertices
            continue
        rest = surface.carry(rest)
        weights = spread(
            rest, surface.faces, surface.carry(weights), surface.carry(thickness[:, None])[:, 0]
        )
        return Creature(skeleton, rest, surface.faces, weights)
    raise RuntimeError(
        f"none of {_ATTEMPTS} skins of a {maker.__name__} was one closed surface that could be "
        f"triangulated with {vertices[0]} to {vertices[1]} vertices"
    )


def collapsed_share(rest: FloatArray, posed: FloatArray, faces: IntArray) -> float:
    """The share of faces, from 0 to 1, that a pose makes less than a tenth as large."""
    _, before = unit_normals(rest, faces)
    _, after = unit_normals(posed, faces)
    return float(np.mean(after < 0.1 * before))


def _plausible(creature: Creature, posed: FloatArray, allowed: float) -> bool:
    """Whether a pose keeps volume and faces and cuts into itself by no more than `allowed`."""
    rest, faces = creature.vertices, creature.faces
    return bool(
        abs(volume(posed, faces) / volume(rest, faces) - 1) < 0.12
        and collapsed_share(rest, posed, faces) < 0.002
        and self_intersection(posed, faces) <= allowed
    )


def sample_pose(
    creature: Creature, rng: np.random.Generator, *, intersection_limit: float = 0.015
) -> FloatArray:
    """The creature in a random plausible pose: (n, 3) in metres.

    Drawn again, a little nearer to rest each time, while more than `intersection_limit` of the
    surface cuts into the creature, beyond what already does at rest, or volume or faces collapse.

    Raises RuntimeError when no pose is free enough of that.
    """
    rest = creature.vertices
    allowed = self_intersection(rest, creature.faces) + intersection_limit
    for attempt in range(_ATTEMPTS):
        turns = sample_turns(creature.skeleton, rng) * (1 - 0.6 * attempt / _ATTEMPTS)
        posed = creature.posed(turns)
        if _plausible(creature, posed, allowed):
            return stand(posed, rest, sample_lean(rng))
    raise RuntimeError(
        f"no pose out of {_ATTEMPTS} kept self intersection below {allowed:.3f}; "
        "widen intersection_limit or narrow the joint ranges"
    )


def walk_cycle(
    creature: Creature,
    rng: np.random.Generator,
    frames: int,
    *,
    intersection_limit: float = 0.015,
) -> FloatArray:
    """The creature in each frame of a whole stride of a random gait: (frames, n, 3) in metres.

    All frames are as plausible as those of `sample_pose`.

    Raises RuntimeError when no gait is.
    """
    rest = creature.vertices
    allowed = self_intersection(rest, creature.faces) + intersection_limit
    for attempt in range(_ATTEMPTS):
        gait = sample_gait(creature.skeleton, rng, frames) * (1 - 0.6 * attempt / _ATTEMPTS)
        posed = [creature.posed(turns) for turns in gait]
        if all(_plausible(creature, each, allowed) for each in posed):
            lean = sample_lean(rng)
            return np.stack([stand(each, rest, lean) for each in posed])
    raise RuntimeError(
        f"no gait out of {_ATTEMPTS} kept self intersection below {allowed:.3f} in all frames; "
        "widen intersection_limit or narrow the joint ranges"
    )


def retried(make: Callable[[], _T]) -> _T:
    """What `make` returns, called again where it raises RuntimeError, which is raised at last."""
    for _ in range(CREATURES - 1):
        try:
            return make()
        except RuntimeError:
            continue
    return make()


def make_creature_pair(
    rng: np.random.Generator,
    *,
    held_out: bool = False,
    at_rest: bool = False,
    other_proportions: bool = False,
    vertices: tuple[int, int] = (3500, 6500),
    family: str | None = None,
) -> tuple[FloatArray, NDArray[np.int32], FloatArray]:
    """A pair of a new creature: source (n, 3), faces (m, 3), target (n, 3).

    The source is at rest or posed, triangulated in its own way; the target is another pose, of
    other proportions where they are asked for.

    Raises RuntimeError when no good creature, triangulation or pose is found.
    """

    def make() -> tuple[FloatArray, NDArray[np.int32], FloatArray]:
        creature = sample_creature(rng, held_out=held_out, vertices=vertices, family=family)
        source = creature.vertices if at_rest else sample_pose(creature, rng)
        target = sample_pose(
            creature.other_proportions(rng) if other_proportions else creature, rng
        )
        return source, creature.faces.astype(np.int32), target

    return retried(make)
