# SPDX-License-Identifier: GPL-3.0-or-later
"""What the figures of all sequences come to, and whether the targets are met.

Ratios are those of means over sequences that both sides made; every sequence has equal weight.
"""

from __future__ import annotations

import numpy as np

from supple_training.compare.edits.contenders import ARAP, NATURAL
from supple_training.compare.edits.summary import (
    POSE,
    POSE_AIM,
    both,
    network_gain,
    ratio_of_means,
    values,
    verdict,
)

FIGURES = ("pose_error", "acceleration_error", "frame_milliseconds")


def contender_summary(cases: dict[str, dict], contender: str) -> dict:
    """The means of a contender's figures, and "FIGURE_ratio": those over ARAP's; None: unknown."""
    own = {figure: list(values(cases, contender, figure).values()) for figure in FIGURES}
    row: dict = {"cases": len(own[FIGURES[0]])}
    for figure, found in own.items():
        row[figure] = float(np.mean(found)) if found else None
        pairs = both(cases, figure, contender, ARAP)
        row[f"{figure}_ratio"] = ratio_of_means(list(pairs.values()))
    return row


def verdicts(rows: dict[str, dict], network: dict | None) -> list[dict]:
    """Each target beside what was reached: {"what", "target", "value", "verdict"}."""
    natural, gained = rows.get(NATURAL, {}), network or {}
    return [
        verdict(
            "natural: pose error over ARAP's",
            f"<= {POSE}, aim {POSE_AIM}",
            natural.get("pose_error_ratio"),
            lambda value: value <= POSE,
            lambda value: value <= POSE_AIM,
        ),
        verdict(
            "natural: acceleration error over ARAP's",
            "< 1",
            natural.get("acceleration_error_ratio"),
            lambda value: value < 1,
        ),
        verdict(
            "network: nearer to the truth than without",
            "> 0",
            gained.get("gain"),
            lambda value: value > 0,
        ),
    ]


def summary(cases: dict[str, dict]) -> dict:
    """{"contenders": {name: ...}, "network": ..., "verdicts": [...]}; the nearest first."""
    names = dict.fromkeys(name for case in cases.values() for name in case["rows"])
    rows = {name: contender_summary(cases, name) for name in names}
    rows = {name: row for name, row in rows.items() if row["cases"]}
    network = network_gain(cases)
    return {
        "contenders": {
            name: rows[name] for name in sorted(rows, key=lambda n: rows[n]["pose_error"])
        },
        "network": network,
        "verdicts": verdicts(rows, network),
    }
