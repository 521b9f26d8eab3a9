# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands `supple evaluate refine` and `supple evaluate match`."""

import json
import math
from pathlib import Path
from typing import Annotated

import rich.console
import rich.table
import typer

import supple

from .. import evaluation
from ..files import check_outputs, write_whole
from ..match_sets import MatchSet, read_match_set
from ..matching import EPOCHS
from .console import print_error, progress_bar


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
        _check_report(report, folder)
        chosen = evaluation.methods(supple.load_model(model))
        match_set = _first_pairs(read_match_set(folder), pairs)
        result = _evaluated(match_set, chosen, runs=runs, cache=cache)
        result |= {"model": model, "runs": runs, "version": supple.__version__}
        _write(result, report)
    except (supple.SuppleError, OSError) as error:
        print_error(error)
        raise typer.Exit(1) from error
    rich.console.Console().print(_table(result))


def evaluate_match(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="SET_DIR",
            help="Folder with shapes/NAME.off, corres/NAME.vts, maybe corres/NAME.mirror.vts, and "
            "pairs.txt.",
        ),
    ],
    report: Annotated[
        Path | None, typer.Option(help="JSON file for the figures; the table goes beside it, .md.")
    ] = None,
    model: Annotated[str, typer.Option(help="Shipped features or .safetensors file.")] = "features",
    configs: Annotated[
        str, typer.Option(help="Ways, with commas: ljn, no_network, without_ljn, ulrssm, cdfm.")
    ] = "without_ljn,no_network,ljn",
    epochs: Annotated[int, typer.Option(min=0, help="Of adaptation to each pair.")] = EPOCHS,
    pairs: Annotated[int | None, typer.Option(min=1, help="Only the first so many pairs.")] = None,
    cache: Annotated[bool, typer.Option(help="Keep prepared meshes on disk, and use them.")] = True,
) -> None:
    """Match the pairs of a set from their shapes alone, in several ways, and measure the maps.

    Seconds are of all but the preparation of meshes: adaptation to the pair is counted.
    """
    try:
        _check_report(report, folder)
        networks = supple.load_match_model(model)
        names = list(dict.fromkeys(name.strip() for name in configs.split(",")))
        chosen = evaluation.match_methods(networks, names, epochs=epochs)
        match_set = _first_pairs(read_match_set(folder, refine=False), pairs)
        result = _evaluated(match_set, chosen, cache=cache)
        result |= {"model": networks.metadata, "epochs": epochs, "version": supple.__version__}
        _write(result, report)
    except (supple.SuppleError, OSError) as error:
        print_error(error)
        raise typer.Exit(1) from error
    rich.console.Console().print(_table(result))


def _first_pairs(match_set: MatchSet, count: int | None) -> MatchSet:
    if count is not None:
        del match_set.pairs[count:]
    return match_set


def _evaluated(match_set: MatchSet, chosen: list[evaluation.Method], **options: object) -> dict:
    """Measured under a progress bar."""
    with progress_bar() as bar:
        task = bar.add_task("", total=1.0)
        return evaluation.Evaluation(
            match_set,
            chosen,
            note=lambda text, done: bar.update(task, description=text, completed=done),
            **options,
        ).run()


def _check_report(report: Path | None, folder: Path) -> None:
    if report is not None:
        check_outputs((report, report.with_suffix(".md")), folder.rglob("*"))


def _write(result: dict, report: Path | None) -> None:
    if report is not None:
        write_whole(report, json.dumps(_finite(result), indent=1, allow_nan=False))
        write_whole(report.with_suffix(".md"), evaluation.markdown(result))


def _finite(value: object) -> object:
    """JSON has no NaN: what could not be measured is null."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _table(result: dict) -> rich.table.Table:
    title = f"{result['set']}: {result['pairs']} pairs"
    if evaluation.INITIAL in result["rows"]:
        title += ", change from the initial map"
    first, *columns = evaluation.head(result)
    table = rich.table.Table(first, title=title)
    for column in columns:
        table.add_column(column, justify="right")
    for name, row in result["rows"].items():
        table.add_row(name, *evaluation.cells(row))
    return table
