# SPDX-License-Identifier: GPL-3.0-or-later
"""The families of creatures and how often each is drawn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from supple_training.creatures.crawlers import fish, insect, octopus, snake, sprawler
from supple_training.creatures.skeleton import Skeleton
from supple_training.creatures.things import hand, plant, vessel
from supple_training.creatures.walkers import biped, bird, quadruped

Maker = Callable[[float, float, np.random.Generator], Skeleton]
"""Makes a skeleton from two traits in [0, 1], limb length and thickness, and random numbers."""

FAMILIES: dict[Maker, float] = {
    quadruped: 0.5,
    bird: 0.1,
    biped: 0.08,
    sprawler: 0.09,
    snake: 0.03,
    fish: 0.03,
    hand: 0.04,
    octopus: 0.04,
    insect: 0.04,
    plant: 0.03,
    vessel: 0.02,
}
"""How often each family is drawn."""
