# SPDX-License-Identifier: GPL-3.0-or-later
"""Command: make pairs and keep them in one file.

python -m supple_training.data --pairs 60 --seed 1 --out pairs.npz
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from supple_training import pairs as pair_store
from supple_training.console import DEFAULT_CACHE, console, pairs_with_progress


def make(
    out: Annotated[Path, typer.Option(help="The .npz file to write: arrays s0, f0, t0, s1, ...")],
    pairs: Annotated[int, typer.Option(min=1, help="How many pairs.")] = 60,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same pairs.")] = 0,
    held_out: Annotated[
        bool, typer.Option("--held-out", help="Bodies and creatures that no training pair has.")
    ] = False,
    vertices: Annotated[
        tuple[int, int], typer.Option(help="The range of vertex counts.", metavar="LOW HIGH")
    ] = (3500, 6500),
    other_bodies: Annotated[
        float, typer.Option(min=0, max=1, help="The share of targets that are another body.")
    ] = 0.2,
    creatures: Annotated[
        float, typer.Option(min=0, max=1, help="The share of pairs that are random creatures.")
    ] = 0.5,
    small: Annotated[
        bool, typer.Option("--small", help="float32, compressed: for a file kept in a repository.")
    ] = False,
    processes: Annotated[int, typer.Option(min=1, help="Processes that make pairs.")] = 2,
    cache: Annotated[Path, typer.Option(help="Where pairs are kept.")] = DEFAULT_CACHE,
) -> None:
    """Sample bodies and creatures and poses of them, triangulate each anew, write them as pairs."""
    try:
        settings = pair_store.PairSettings(
            pairs,
            seed,
            held_out,
            vertices,
            other_body_share=other_bodies,
            creature_share=creatures,
        )
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    made = pairs_with_progress(settings, cache, processes=processes)
    pair_store.save(out, made, settings, small=small)
    counts = [len(source) for source, _, _ in made]
    console.print(f"{out}: {len(made)} pairs of {min(counts)} to {max(counts)} vertices")


if __name__ == "__main__":
    typer.run(make)
