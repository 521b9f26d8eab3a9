# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `edit`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import supple
import typer

from supple_training.compare import machine
from supple_training.compare.contender import Contender
from supple_training.compare.edits import report
from supple_training.compare.edits.contenders import ARAP, table
from supple_training.compare.edits.measure import Settings, case_folders, measure
from supple_training.compare.edits.summary import summary
from supple_training.console import console, percent_bar

CHECKOUT = Path(__file__).parents[4]


def folders_of(given: list[Path] | None, kind: str) -> list[Path]:
    """Folders of cases of this kind, "edit" or "sequence", by default those in SUPPLE_DATA."""
    if not given:
        data = os.environ.get("SUPPLE_DATA")
        if not data:
            raise typer.BadParameter(
                f"name folders of {kind} cases, or set SUPPLE_DATA to a folder that has '{kind}s' "
                "in it",
                param_hint="DIR",
            )
        given = [Path(data) / f"{kind}s"]
    try:
        return case_folders(given, kind)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="DIR") from error


def _chosen(contenders: tuple[Contender, ...], only: list[str] | None) -> list[Contender]:
    """The reference, and those whose names begin so; all without `only`."""
    wanted = [name for text in only or [] for name in text.split(",")]
    for name in wanted:
        if not any(each.name.startswith(name) for each in contenders):
            names = ", ".join(each.name for each in contenders)
            raise typer.BadParameter(
                f"there is no '{name}'; there are: {names}", param_hint="--only"
            )
    return [
        each
        for each in contenders
        if not wanted or each.name == ARAP or each.name.startswith(tuple(wanted))
    ]


def edit(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="DIR...",
            help="Edit cases, or folders of them; without any, 'edits' in the folder SUPPLE_DATA.",
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option(help="Folder for edit.json, edit.md and a NAME.png each case.")
    ] = Path("out/edit"),
    only: Annotated[
        list[str] | None,
        typer.Option(help="Only contenders that begin so, with commas or again; ARAP always."),
    ] = None,
    runs: Annotated[int, typer.Option(min=1, help="Of each frame, in turns.")] = 7,
    iterations: Annotated[int, typer.Option(min=1, help="Of libigl's ARAP.")] = 1000,
    model: Annotated[str, typer.Option(help="Shipped network or .safetensors file.")] = "rotation",
    threads: Annotated[
        int | None, typer.Option(min=1, help="That ours run with; else the library's default.")
    ] = None,
    pictures: Annotated[bool, typer.Option(help="Write them.")] = True,
) -> None:
    """Make edits with every contender, judge them, and say whether the targets are met.

    Ends with code 1 where a target is missed or a case fails.
    """
    chosen = _chosen(table(iterations), only)
    found = folders_of(folders, "edit")
    settings = Settings(runs, iterations, model, threads)
    drawn: list[str] = []
    with percent_bar() as bar:
        shown = bar.add_task("", total=len(found))

        def done(case, rows, poses) -> None:
            if pictures:
                from supple_training.compare.edits.pictures import strip

                bar.update(shown, description=f"{case.name}: picture")
                strip(case, rows, poses, out / f"{case.name}.png")
                drawn.append(case.name)
            bar.update(shown, advance=1)

        try:
            cases, errors = measure(
                found,
                chosen,
                settings,
                note=lambda text: bar.update(shown, description=text),
                done=done,
            )
        except supple.SuppleError as error:
            raise typer.BadParameter(str(error), param_hint="--model") from error
        bar.update(shown, description="", completed=len(found))
    ours = [contender.name for contender in chosen if contender.ours]
    made = report.document(
        cases, errors, summary(cases, ours), settings, commit=machine.commit(CHECKOUT)
    )
    for part in report.tables(made):
        console.print(part, markup=False, highlight=False)
    written = report.write(made, out, drawn)
    console.print("wrote " + ", ".join(map(str, written)) + f"; {len(drawn)} pictures")
    raise typer.Exit(report.exit_code(made))
