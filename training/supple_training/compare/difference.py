# SPDX-License-Identifier: GPL-3.0-or-later
"""Two comparisons, one beside the other: what got slower beyond noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rich.table import Table

from supple_training.compare.report import bytes_text, seconds_text, size_text

FLOOR = 0.05
"""A change below this share is never called one, however near the quartiles are."""

Key = tuple[str, str, str, int]


@dataclass(frozen=True)
class Change:
    """One of our measurements, before and after.

    Attributes:
        ratio: new median over base median.
        low, high: the noise band: new lower over base upper quartile, and the other way round.
        verdict: "slower", "faster", "same", or why there is no ratio.
        peaks: bytes before and after.
    """

    key: Key
    verdict: str
    ratio: float | None = None
    low: float | None = None
    high: float | None = None
    medians: tuple[float, float] | None = None
    peaks: tuple[int, int] | None = None


def _by_key(document: dict, *, ours: bool) -> dict[Key, dict]:
    """Rows by task, contender, size and threads (0 for peers, which choose their own)."""
    return {
        (
            row["task"],
            row["contender"],
            size_text(row),
            row["threads"] if ours else 0,
        ): row
        for row in document["rows"]
        if row["ours"] == ours
    }


def _change(key: Key, base: dict | None, new: dict | None, floor: float) -> Change:
    before, after = (row.get("seconds") if row else None for row in (base, new))
    if before is None or after is None:
        if before is None and after is None:
            return Change(key, "in neither")
        gone = new if after is None else base
        reason = "not measured" if gone is None else gone["status"]
        return Change(key, f"{'new' if after is None else 'base'}: {reason}")
    low, high = after["low"] / before["high"], after["high"] / before["low"]
    verdict = "same"
    if low > 1 + floor:
        verdict = "slower"
    elif high < 1 / (1 + floor):
        verdict = "faster"
    return Change(
        key,
        verdict,
        after["median"] / before["median"],
        low,
        high,
        (before["median"], after["median"]),
        (base["peak_bytes"], new["peak_bytes"]),
    )


def changes(base: dict, new: dict, floor: float = FLOOR) -> list[Change]:
    """Of all our measurements that are in either, in the order of the new one."""
    before, after = _by_key(base, ours=True), _by_key(new, ours=True)
    keys = list(after) + [key for key in before if key not in after]
    found = [_change(key, before.get(key), after.get(key), floor) for key in keys]
    return [change for change in found if change.verdict != "in neither"]


def peer_ratio(base: dict, new: dict) -> float | None:
    """The median of what peers took, new over base: 1 where the machine was as fast both times."""
    before, after = _by_key(base, ours=False), _by_key(new, ours=False)
    ratios = [
        after[key]["seconds"]["median"] / before[key]["seconds"]["median"]
        for key in after.keys() & before.keys()
        if "seconds" in after[key] and "seconds" in before[key]
    ]
    return float(np.median(ratios)) if ratios else None


def warnings(base: dict, new: dict) -> list[str]:
    """Why the two may not be comparable."""
    found = []
    for name in ("cpu", "cores"):
        if base["machine"][name] != new["machine"][name]:
            found.append(
                f"another machine: {name} {base['machine'][name]}, then {new['machine'][name]}"
            )
    ratio = peer_ratio(base, new)
    if ratio is not None and not 0.9 < ratio < 1.1:
        found.append(f"the peers took {ratio:.2f} times as long: the machine was not as fast")
    return found


def table(found: list[Change]) -> Table:
    """For people: what both have."""
    result = Table(title="New against base (below 1: new is faster)")
    for name in ("task", "", "vertices", "threads", "base", "new", "ratio", "noise", "peak memory"):
        result.add_column(name, justify="left" if name in ("task", "") else "right")
    result.add_column("")
    colours = {"slower": "red", "faster": "green"}
    for change in (each for each in found if each.ratio is not None):
        task, contender, size, threads = change.key
        row = [task, contender, size, str(threads)]
        row += [seconds_text(seconds) for seconds in change.medians]
        row += [f"{change.ratio:.2f}", f"{change.low:.2f} to {change.high:.2f}"]
        row.append(" -> ".join(bytes_text(peak) for peak in change.peaks))
        colour = colours.get(change.verdict)
        row.append(f"[{colour}]{change.verdict}[/]" if colour else change.verdict)
        result.add_row(*row)
    return result
