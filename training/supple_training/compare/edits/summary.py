# SPDX-License-Identifier: GPL-3.0-or-later
"""What the figures of all cases come to, and whether the targets are met.

A ratio of pose errors is the ratio of their means; distortion is compared by the geometric mean of
each case's ratio. Only cases that both sides made count.
"""

from __future__ import annotations

import numpy as np

from supple_training.compare.edits.contenders import ARAP, NATURAL, NO_NETWORK, STIFF
from supple_training.compare.edits.measure import MEASURED

RESAMPLES, SEED = 10_000, 1
"""Of the bootstrap over cases."""

RIGID = 1e-9
"""Distortion below this is rounding and counts as this, so that two rigid results compare as 1."""

STIFF_MEAN, STIFF_WORST = 0.4, 1.0
POSE, POSE_AIM = 0.92, 0.8
GAIN, GAIN_AIM = 0.05, 0.10
HANDLE_ERROR = 1e-6

MET, AIM_MET, MISSED, UNJUDGED = "met", "aim met", "missed", "not judged"


def values(cases: dict[str, dict], contender: str, figure: str) -> dict[str, float]:
    """The figure of each case in which this contender has it."""
    found = {}
    for name, case in cases.items():
        row = case["rows"].get(contender, {})
        if row.get("status") == MEASURED and row.get(figure) is not None:
            found[name] = row[figure]
    return found


def both(cases: dict, figure: str, one: str, other: str) -> dict[str, tuple[float, float]]:
    """The figure of both, for the cases in which both have it."""
    first, second = values(cases, one, figure), values(cases, other, figure)
    return {name: (value, second[name]) for name, value in first.items() if name in second}


def ratio_of_means(pairs: list[tuple[float, float]]) -> float | None:
    """Of the first numbers to the second; None without pairs."""
    if not pairs:
        return None
    above, below = np.mean(pairs, axis=0)
    return float(above / below) if below > 0 else None


def contender_summary(cases: dict[str, dict], contender: str) -> dict:
    """One contender over all cases; None where there is nothing to say."""
    measured = values(cases, contender, "symmetric_dirichlet")
    distortion = both(cases, "symmetric_dirichlet", contender, ARAP)
    ratios = {name: max(a, RIGID) / max(b, RIGID) for name, (a, b) in distortion.items()}
    worst = max(ratios, key=ratios.get) if ratios else None
    errors = both(cases, "pose_error", contender, ARAP)
    counts = sorted({cases[name]["handles"] for name in errors})
    frames = both(cases, "frame_milliseconds", contender, ARAP)
    handle = values(cases, contender, "handle_error")
    own = list(values(cases, contender, "pose_error").values())
    return {
        "cases": len(measured),
        "distortion_ratio": float(np.exp(np.mean(np.log(list(ratios.values())))))
        if ratios
        else None,
        "worst_distortion_ratio": ratios[worst] if worst else None,
        "worst_distortion_case": worst,
        "mean_pose_error": float(np.mean(own)) if own else None,
        "pose_error_ratio": ratio_of_means(list(errors.values())),
        "pose_error_ratio_by_handles": {
            str(count): ratio_of_means(
                [pair for name, pair in errors.items() if cases[name]["handles"] == count]
            )
            for count in counts
        },
        "flipped_faces": int(sum(values(cases, contender, "flipped_faces").values())),
        "new_turned_over_faces": int(
            sum(values(cases, contender, "new_turned_over_faces").values())
        ),
        "new_degenerate_faces": int(sum(values(cases, contender, "new_degenerate_faces").values())),
        "handle_error": max(handle.values()) if handle else None,
        "frame_over_arap_iteration": float(np.median([a / b for a, b in frames.values()]))
        if frames
        else None,
        "converged": len(values(cases, contender, "converged_seconds")),
    }


def network_gain(cases: dict[str, dict]) -> dict | None:
    """How much nearer to the truth `natural` comes with the network than without; None if unknown.

    gain: 1 - the ratio of mean pose errors; low, high: its 95% interval over resampled cases, None
    for a single case; mean_case_gain: the mean of the cases' own gains.
    """
    pairs = np.array(list(both(cases, "pose_error", NATURAL, NO_NETWORK).values()))
    if not len(pairs) or not (pairs[:, 1] > 0).all():
        return None
    rng = np.random.default_rng(SEED)
    drawn = pairs[rng.integers(len(pairs), size=(RESAMPLES, len(pairs)))].mean(axis=1)
    low, high = np.percentile(1 - drawn[:, 0] / drawn[:, 1], [2.5, 97.5]).tolist()
    return {
        "gain": 1 - ratio_of_means(list(map(tuple, pairs))),
        "low": low if len(pairs) > 1 else None,
        "high": high if len(pairs) > 1 else None,
        "mean_case_gain": float(np.mean(1 - pairs[:, 0] / pairs[:, 1])),
        "cases": len(pairs),
        "resamples": RESAMPLES,
        "seed": SEED,
    }


def verdict(what: str, target: str, value: float | None, met, aim=None) -> dict:
    """A target and what `met` and `aim` say of the value, None where it is not known."""
    if value is None:
        word = UNJUDGED
    elif not met(value):
        word = MISSED
    else:
        word = AIM_MET if aim is not None and aim(value) else MET
    return {"what": what, "target": target, "value": value, "verdict": word}


def verdicts(rows: dict[str, dict], network: dict | None, ours: list[str]) -> list[dict]:
    """Each target beside what was reached: {"what", "target", "value", "verdict"}."""
    nothing: dict = {}
    stiff, natural = rows.get(STIFF, nothing), rows.get(NATURAL, nothing)
    turned = None
    if stiff.get("cases"):
        turned = stiff["new_turned_over_faces"] + stiff["new_degenerate_faces"]
    held = [rows[name]["handle_error"] for name in ours if rows.get(name, nothing).get("cases")]
    network = network or nothing
    return [
        verdict(
            "stiff: distortion over ARAP's, geometric mean",
            f"<= {STIFF_MEAN}",
            stiff.get("distortion_ratio"),
            lambda value: value <= STIFF_MEAN,
        ),
        verdict(
            "stiff: distortion over ARAP's, worst case",
            f"<= {STIFF_WORST}",
            stiff.get("worst_distortion_ratio"),
            lambda value: value <= STIFF_WORST,
        ),
        verdict(
            "stiff: newly turned over or degenerate faces", "0", turned, lambda value: value == 0
        ),
        verdict(
            "natural: pose error over ARAP's",
            f"<= {POSE}, aim {POSE_AIM}",
            natural.get("pose_error_ratio"),
            lambda value: value <= POSE,
            lambda value: value <= POSE_AIM,
        ),
        verdict(
            "network: nearer to the truth than without",
            f">= {GAIN:.0%}, aim {GAIN_AIM:.0%}",
            network.get("gain"),
            lambda value: value >= GAIN,
            lambda value: value >= GAIN_AIM,
        ),
        verdict(
            "network: lower end of the gain's 95% interval",
            "> 0",
            network.get("low"),
            lambda value: value > 0,
        ),
        verdict(
            "ours: largest handle error, of the diagonal",
            f"<= {HANDLE_ERROR:g}",
            max(held) if held else None,
            lambda value: value <= HANDLE_ERROR,
        ),
    ]


def summary(cases: dict[str, dict], ours: list[str]) -> dict:
    """{"contenders": {name: ...}, "network": ..., "verdicts": [...]}; least distortion first."""
    names = dict.fromkeys(name for case in cases.values() for name in case["rows"])
    rows = {name: contender_summary(cases, name) for name in names}
    rows = {name: row for name, row in rows.items() if row["cases"]}

    def rank(name: str) -> float:
        ratio = rows[name]["distortion_ratio"]
        return np.inf if ratio is None else ratio

    network = network_gain(cases)
    return {
        "contenders": {name: rows[name] for name in sorted(rows, key=rank)},
        "network": network,
        "verdicts": verdicts(rows, network, ours),
    }
