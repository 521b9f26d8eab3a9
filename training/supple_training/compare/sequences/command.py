# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `sequence`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import supple
import typer

from supple_training.compare import machine
from supple_training.compare.edits.command import CHECKOUT, folders_of
from supple_training.compare.edits.report import exit_code
from supple_training.compare.sequences import report
from supple_training.compare.sequences.contenders import table
from supple_training.compare.sequences.measure import Settings, measure
from supple_training.compare.sequences.summary import summary
from supple_training.console import console, percent_bar


def sequence(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="DIR...",
            help="Sequences, or folders of them; without any, 'sequences' in the folder "
            "SUPPLE_DATA.",
        ),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(
            help="Folder for sequence.json, sequence.md, and NAME.png and NAME.errors.png each."
        ),
    ] = Path("out/sequence"),
    stiff: Annotated[bool, typer.Option("--stiff", help="Also Supple stiff.")] = False,
    iterations: Annotated[
        int, typer.Option(min=1, help="Of libigl's ARAP, each frame.")
    ] = Settings.iterations,
    model: Annotated[
        str, typer.Option(help="Shipped network or .safetensors file.")
    ] = Settings.model,
    threads: Annotated[
        int | None, typer.Option(min=1, help="That ours run with; else the library's default.")
    ] = None,
    pictures: Annotated[bool, typer.Option(help="Write them.")] = True,
) -> None:
    """Make sequences frame by frame with every contender, and say whether the targets are met.

    Ends with code 1 where a target is missed or a sequence fails.
    """
    found = folders_of(folders, "sequence")
    settings = Settings(iterations, model, threads)
    drawn: list[str] = []
    with percent_bar() as bar:
        shown = bar.add_task("", total=len(found))

        def done(each, rows, motions) -> None:
            if pictures:
                from supple_training.compare.sequences.pictures import plot, strip

                name = each.case.name
                bar.update(shown, description=f"{name}: pictures")
                plot(name, rows, out / f"{name}.errors.png")
                strip(each, motions, out / f"{name}.png")
                drawn.append(name)
            bar.update(shown, advance=1)

        try:
            cases, errors = measure(
                found,
                table(iterations, stiff=stiff),
                settings,
                note=lambda text: bar.update(shown, description=text),
                done=done,
            )
        except supple.SuppleError as error:
            raise typer.BadParameter(str(error), param_hint="--model") from error
        bar.update(shown, description="", completed=len(found))
    made = report.document(cases, errors, summary(cases), settings, commit=machine.commit(CHECKOUT))
    for part in report.tables(made):
        console.print(part, markup=False, highlight=False)
    written = report.write(made, out, drawn)
    console.print("wrote " + ", ".join(map(str, written)) + f"; pictures of {len(drawn)}")
    raise typer.Exit(exit_code(made))
