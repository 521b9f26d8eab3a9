# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line `supple`."""

from typing import Annotated

import typer

import supple

from .caching import show_cache
from .editing import edit
from .estimating import estimate
from .evaluating import evaluate_match, evaluate_refine
from .matching import match
from .refining import refine
from .training import train_unsupervised

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help="Deform and match triangle meshes and keep their detail.",
    pretty_exceptions_enable=False,
)
evaluate = typer.Typer(no_args_is_help=True, help="Measure on data with known answers.")
train = typer.Typer(no_args_is_help=True, help="Train networks on your own shapes.")
app.add_typer(evaluate, name="evaluate")
app.add_typer(train, name="train")
app.command()(edit)
app.command()(estimate)
app.command()(match)
app.command()(refine)
app.command("cache")(show_cache)
evaluate.command("match")(evaluate_match)
evaluate.command("refine")(evaluate_refine)
train.command("unsupervised")(train_unsupervised)


@app.callback(invoke_without_command=True)
def main(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Deform and match triangle meshes and keep their detail."""
    if version:
        print(f"supple {supple.__version__}")
        raise typer.Exit()


@train.callback()
def _train() -> None:
    """Train networks on your own shapes."""


@evaluate.callback()
def _evaluate() -> None:
    """Measure on data with known answers."""
