# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `supple evaluate refine`."""

import json
from pathlib import Path
from typing import Annotated

import rich.console
import rich.table
import typer

import supple

from .. import evaluation
from ..match_sets import read_match_set
from .console import console, progress_bar, write_whole


def evaluate_refine(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="SET_DIR",
            help="Folder with shapes/NAME.off, corres/NAME.vts, init/A__B.map and pairs.txt.",
        ),
    ],
    report: Annotated[
        Path | None, typer.Option(help="JSON file for the figures; the table goes beside it, .md.")
    ] = None,
    model: Annotated[str, typer.Option(help="Shipped network or .safetensors file.")] = "spectral",
    runs: Annotated[
        int, typer.Option(min=1, help="Times each refinement is measured; the least counts.")
    ] = 1,
    pairs: Annotated[int | None, typer.Option(min=1, help="Only the first so many pairs.")] = None,
    cache: Annotated[bool, typer.Option(help="Keep prepared meshes on disk, and use them.")] = True,
) -> None:
    """Refine the maps of a set with and without the network and with ZoomOut, and measure them.

    Seconds are of a warm refinement: meshes prepared, factors ready.
    """
    try:
        chosen = evaluation.methods(supple.load_model(model))
        match_set = read_match_set(folder)
        if pairs is not None:
            del match_set.pairs[pairs:]
        with progress_bar() as bar:
            task = bar.add_task("", total=1.0)
            result = evaluation.Evaluation(
                match_set,
                chosen,
                runs=runs,
                cache=cache,
                note=lambda text, done: bar.update(task, description=text, completed=done),
            ).run()
        result |= {"model": model, "runs": runs, "version": supple.__version__}
        if report is not None:
            write_whole(report, json.dumps(result, indent=1))
            write_whole(report.with_suffix(".md"), evaluation.markdown(result))
    except (supple.SuppleError, OSError) as error:
        console.print(f"[red]error[/red] {error}", highlight=False)
        raise typer.Exit(1) from error
    rich.console.Console().print(_table(result))


def _table(result: dict) -> rich.table.Table:
    title = f"{result['set']}: {result['pairs']} pairs, change from the initial map"
    table = rich.table.Table("map", title=title)
    for column in (*evaluation.COLUMNS, "per pair"):
        table.add_column(column, justify="right")
    for name, row in result["rows"].items():
        table.add_row(name, *evaluation.cells(row))
    return table
