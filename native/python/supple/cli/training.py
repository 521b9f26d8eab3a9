# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `supple train unsupervised`."""

import csv
import io
import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

import supple

from ..files import check_outputs, write_whole
from ..matching import TERMS, Epoch
from ..shape_folders import FolderShape, read_shapes
from .console import (
    Latest,
    epoch_text,
    model_file,
    peak_mebibytes,
    print_error,
    progress_bar,
    watched,
)
from .matching import Config


def train_unsupervised(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="Folder of meshes; a subfolder is a group that can be matched."
        ),
    ],
    out: Annotated[Path, typer.Option(help="The .safetensors file to write.")],
    epochs: Annotated[int, typer.Option(min=1, help="Every mesh once each.")] = 20,
    config: Annotated[Config, typer.Option(help="The loss.")] = Config.ljn,
    start: Annotated[
        str, typer.Option(help="Shipped features or .safetensors file to start from, or none.")
    ] = "features",
    guided_epochs: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Epochs at the start that are drawn to rough maps, found by the shapes alone.",
            show_default="5 with --start none, or else 0",
        ),
    ] = None,
    guide_pairs: Annotated[int, typer.Option(min=1, help="Rough maps to look for, a mesh.")] = 3,
    functions: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Eigenfunctions of functional maps and of the signal.",
            show_default="80, or 50 for cdfm",
        ),
    ] = None,
    patience: Annotated[
        int, typer.Option(min=0, help="End after so many epochs without a smaller loss; 0: never.")
    ] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of the weights and every draw.")] = 0,
    checkpoint: Annotated[
        Path | None,
        typer.Option(
            help="Folder to go on from after a stop, and to write to.",
            show_default="FILE.checkpoint",
        ),
    ] = None,
    about: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUE",
            help="Kept in the file: licence=..., training_data=...; as often as you like.",
        ),
    ] = None,
    cache: Annotated[bool, typer.Option(help="Keep prepared meshes on disk, and use them.")] = True,
) -> None:
    """Train features, and a deformation with them, on meshes without any correspondence.

    Beside FILE it writes the history as FILE.metrics.json and the loss curve as FILE.loss.csv.
    Stopped in any way and started again, it goes on after the last epoch that was finished.
    """
    try:
        if out.suffix != ".safetensors":
            raise supple.SuppleError("bad_option", f"{out} must end in .safetensors.")
        if guided_epochs is not None and guided_epochs > epochs:
            raise supple.SuppleError(
                "bad_option",
                f"{guided_epochs} guided epochs of {epochs}: --guided-epochs must be no more than "
                "--epochs.",
            )
        metrics, curve = out.with_suffix(".metrics.json"), out.with_suffix(".loss.csv")
        check_outputs((out, metrics, curve), (model_file(start),))
        kept = checkpoint or out.with_suffix(".checkpoint")
        if kept.exists() and not kept.is_dir():
            raise supple.SuppleError(
                "bad_option", f"{kept} is no folder; name another for --checkpoint."
            )
        metadata = {
            "training": f"unsupervised, {config.value}, {epochs} epochs",
            "seed": str(seed),
            "version": supple.__version__,
            **_entries(about or []),
        }
        model = None if start == "none" else supple.load_match_model(start)
        if model is not None:
            metadata = _continued(model.metadata, metadata)
        shapes = read_shapes(folder, seed=seed, leave_out=kept)
        meshes = _prepared(shapes, cache=cache)
        began = time.perf_counter()
        loss = Latest(epoch_text)
        result = watched(
            "training",
            lambda p: supple.train_unsupervised(
                meshes,
                [shape.group for shape in shapes],
                model=model,
                config=config.value,
                epochs=epochs,
                guided_epochs=guided_epochs,
                guide_pairs=guide_pairs,
                functions=functions,
                patience=patience,
                seed=seed,
                metadata=metadata,
                checkpoint=kept,
                callback=loss,
                progress=p,
            ),
            loss,
        )
        seconds = time.perf_counter() - began
        result.model.save(out)
        content = {
            "shapes": [shape.name for shape in shapes],
            "epochs": [asdict(epoch) for epoch in result.history],
            "guides": result.guides,
            "guides_left_out": result.guides_left_out,
            "seconds_of_this_run": seconds,
            "peak_mebibytes": peak_mebibytes(),
            "metadata": result.model.metadata,
        }
        write_whole(metrics, json.dumps(content, indent=1) + "\n")
        write_whole(curve, _curve(result.history))
    except (supple.SuppleError, OSError) as error:
        print_error(error)
        raise typer.Exit(1) from error
    typer.echo(
        f"wrote {out}, {metrics.name} and {curve.name}: {len(shapes)} meshes, "
        f"{len(result.history)} epochs, loss {result.history[-1].loss['total']:.4g}"
    )


def _continued(before: dict[str, str], metadata: dict[str, str]) -> dict[str, str]:
    """The metadata of a training that started from a model: what that was trained on and how stays
    said, before what came then."""
    both = {
        name: f"{before[name]}; then {metadata[name]}"
        for name in ("training", "training_data")
        if name in before and name in metadata
    }
    return {**metadata, **both}


def _entries(about: list[str]) -> dict[str, str]:
    entries = {}
    for text in about:
        name, separator, value = text.partition("=")
        if not name or not separator:
            raise supple.SuppleError("bad_option", f"--about '{text}' is not KEY=VALUE.")
        entries[name] = value
    return entries


def _prepared(shapes: list[FolderShape], *, cache: bool) -> list[supple.PreparedMesh]:
    meshes = []
    with progress_bar() as bar:
        task = bar.add_task("", total=len(shapes))
        for shape in shapes:
            bar.update(task, description=f"{shape.name}: preparing")
            try:
                meshes.append(supple.PreparedMesh(shape.vertices, shape.faces, cache=cache))
            except supple.SuppleError as error:
                raise supple.SuppleError(error.code, f"{shape.name}: {error}") from error
            bar.advance(task)
    return meshes


def _curve(history: list[Epoch]) -> str:
    """A line an epoch."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["epoch", *TERMS, "guide", "guide_share"])
    for epoch in history:
        losses = [epoch.loss[name] for name in TERMS]
        table.writerow([epoch.epoch, *losses, epoch.guide, epoch.guide_share])
    return text.getvalue()
