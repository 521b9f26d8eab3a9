# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of creatures: those of one kind have the same parts, so a map between any two makes sense.

Families whose parts differ in number are split or cut down to one number. Left out are snakes,
octopuses, plants and bottles, which are about round, so that more than one map is right, and fish,
whose tail fins stand upright or lie level.
"""

from __future__ import annotations

from dataclasses import dataclass

from supple_training.creatures.skeleton import Skeleton


@dataclass(frozen=True)
class Kind:
    """Creatures of one family with the same number of long parts."""

    family: str
    limbs: int
    """Legs, arms and wings; the fingers of a hand."""
    tails: int
    """Tails, trunks and feelers."""
    symmetric: bool = True
    """Whether the left side is the right one's mirror image in x at rest, but for small bumps."""

    def suits(self, skeleton: Skeleton) -> bool:
        """Whether a skeleton of the family is of this kind."""
        kinds = [chain.kind for chain in skeleton.chains]
        return kinds.count("limb") == self.limbs and kinds.count("tail") == self.tails


KINDS = {
    "quadruped": Kind("quadruped", 4, 1),
    "biped": Kind("biped", 4, 1),
    "bird": Kind("bird", 4, 1),
    "sprawler": Kind("sprawler", 4, 1),
    "insect": Kind("insect", 6, 2),
    "spider": Kind("insect", 8, 0),
    "hand": Kind("hand", 5, 0, symmetric=False),
}
"""By name. Elephants, which have a trunk, are no quadrupeds here."""

TURNS = (
    "quadruped",
    "biped",
    "bird",
    "quadruped",
    "sprawler",
    "insect",
    "quadruped",
    "hand",
    "spider",
)
"""The order in which kinds are made: quadrupeds, which differ most, are a third."""
