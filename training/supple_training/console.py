# SPDX-License-Identifier: GPL-3.0-or-later
"""The look that the commands of this package share."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from supple_training import pairs as pair_store

console = Console()

DEFAULT_CACHE = Path.home() / ".cache" / "supple" / "pairs"


def progress_bar() -> Progress:
    """A bar with a count, the time so far and the time left, and a free `note` at the end."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
        console=console,
    )


def percent_bar() -> Progress:
    """A narrow bar with the part that is done, a count, the time so far and what is being done."""
    return Progress(
        TextColumn("{task.percentage:>3.0f}%"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
        console=console,
    )


def pairs_with_progress(
    settings: pair_store.PairSettings, cache: Path, *, processes: int
) -> list[pair_store.Pair]:
    """`pairs.cached` under a progress bar."""
    what = "held-out pairs" if settings.held_out else "training pairs"
    with progress_bar() as bar:
        task = bar.add_task(f"making {what}", total=settings.pairs, note="")
        pairs = pair_store.cached(
            settings,
            cache,
            processes=processes,
            report=lambda done, _: bar.update(task, completed=done),
        )
        bar.update(task, completed=settings.pairs)
    return pairs
