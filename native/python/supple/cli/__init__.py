# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line `supple`."""

from typing import Annotated

import typer

import supple

from .caching import show_cache
from .editing import edit
from .estimating import estimate
from .evaluating import evaluate_refine
from .refining import refine

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help="Deform and match triangle meshes and keep their detail.",
    pretty_exceptions_enable=False,
)
evaluate = typer.Typer(no_args_is_help=True, help="Measure on data with known answers.")
app.add_typer(evaluate, name="evaluate")
app.command()(edit)
app.command()(estimate)
app.command()(refine)
app.command("cache")(show_cache)
evaluate.command("refine")(evaluate_refine)


@app.callback(invoke_without_command=True)
def main(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Deform and match triangle meshes and keep their detail."""
    if version:
        print(f"supple {supple.__version__}")
        raise typer.Exit()


@evaluate.callback()
def _evaluate() -> None:
    """Measure on data with known answers."""
