# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `refine`."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated

import supple
import typer
from rich.progress import (
    BarColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
from supple import evaluation
from supple.match_sets import read_match_set

from supple_training.compare import machine
from supple_training.compare.maps.peers import peers
from supple_training.console import console

CHECKOUT = Path(__file__).parents[4]
PYFM = "pyfm_zoomout"


def speed_ratios(rows: dict[str, dict]) -> dict[str, float]:
    """How many times faster than pyFM's ZoomOut each row of ours is, by means over pairs."""
    if PYFM not in rows:
        return {}
    slow = rows[PYFM][evaluation.SECONDS]
    return {
        name: slow / rows[name][evaluation.SECONDS]
        for name in ("zoomout", "no_network", "ljn")
        if rows.get(name, {}).get(evaluation.SECONDS)
    }


def refine(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="SET_DIR",
            help="Folder with shapes/NAME.off, corres/NAME.vts, init/A__B.map and pairs.txt.",
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for refine.json and refine.md.")] = Path(
        "out/refine"
    ),
    model: Annotated[str, typer.Option(help="Shipped network or .safetensors file.")] = "spectral",
    runs: Annotated[int, typer.Option(min=1, help="Of each refinement; the least counts.")] = 1,
    pairs: Annotated[int | None, typer.Option(min=1, help="Only the first so many.")] = None,
    threads: Annotated[
        int | None, typer.Option(min=1, help="That all run with; else the library's default.")
    ] = None,
) -> None:
    """Refine the maps of a set by every way there is, measure them, and compare their speed."""
    if threads is not None:
        supple.set_thread_count(threads)
    others, missing = peers(supple.thread_count())
    try:
        chosen = [*evaluation.methods(supple.load_model(model)), *others]
        match_set = read_match_set(folder)
    except supple.SuppleError as error:
        raise typer.BadParameter(str(error)) from error
    if pairs is not None:
        del match_set.pairs[pairs:]
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TaskProgressColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as bar:
        shown = bar.add_task("", total=1.0)
        made = evaluation.Evaluation(
            match_set,
            chosen,
            runs=runs,
            note=lambda text, done: bar.update(shown, description=text, completed=done),
        ).run()
        bar.update(shown, description="", completed=1.0)
    made |= {
        "speed_over_pyfm_zoomout": speed_ratios(made["rows"]),
        "missing": missing,
        "model": model,
        "runs": runs,
        "threads": supple.thread_count(),
        "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "commit": machine.commit(CHECKOUT),
        "machine": machine.facts(),
        "versions": machine.versions() | {"supple": supple.__version__},
    }
    text = markdown(made)
    out.mkdir(parents=True, exist_ok=True)
    (out / "refine.json").write_text(json.dumps(made, indent=1) + "\n")
    (out / "refine.md").write_text(text)
    console.print(text, markup=False, highlight=False)
    console.print(f"wrote {out / 'refine.json'}, {out / 'refine.md'}")


def markdown(made: dict) -> str:
    """The evaluation's table, the ratios of times, and what is missing."""
    host = made["machine"]
    lines = [evaluation.markdown(made)]
    if made["speed_over_pyfm_zoomout"]:
        lines.append("Times as fast as pyFM's ZoomOut, warm, in the same run:")
        lines += [
            f"- {name}: {ratio:.1f}" for name, ratio in made["speed_over_pyfm_zoomout"].items()
        ]
        lines.append("")
    lines += [f"- missing: {text}" for text in made["missing"]]
    lines.append(
        f"\n{host['cpu']}, {host['cores']} cores, {made['threads']} threads, load "
        f"{host['load']:.1f} at the end; {made['date']}, commit {made['commit'] or 'unknown'}."
    )
    return "\n".join(lines) + "\n"
