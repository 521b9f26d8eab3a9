# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `supple match`."""

import json
import time
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

import supple

from ..files import check_outputs, write_whole
from ..matching import CONFIGURATIONS, EPOCHS
from ..mesh_files import check_ending, write_mesh
from .console import Latest, epoch_text, model_file, peak_mebibytes, print_error, watched
from .maps import prepared, print_notes, write_map, written

Config = StrEnum("Config", {name: name for name in CONFIGURATIONS})


def match(
    source: Annotated[Path, typer.Argument(help="Mesh file that is mapped.")],
    target: Annotated[Path, typer.Argument(help="Mesh file it is mapped to.")],
    out: Annotated[Path, typer.Option(help="For the map: a target vertex a line, from 1.")],
    model: Annotated[str, typer.Option(help="Shipped features or .safetensors file.")] = "features",
    config: Annotated[Config, typer.Option(help="The loss that features adapt by.")] = Config.ljn,
    epochs: Annotated[
        int, typer.Option(min=0, help="Of adaptation; 0 for the features as they are.")
    ] = EPOCHS,
    automatic: Annotated[
        bool, typer.Option(help="Also look for a map without features, and take the better one.")
    ] = True,
    seed: Annotated[int, typer.Option(min=0, help="Of the order of steps.")] = 0,
    deformed: Annotated[
        Path | None, typer.Option(help="Mesh file for the source laid onto the target.")
    ] = None,
    save_model: Annotated[
        Path | None, typer.Option(help=".safetensors file for the adapted networks.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="JSON file for the loss curve, score, time and memory.")
    ] = None,
    cache: Annotated[bool, typer.Option(help="Keep prepared meshes on disk, and use them.")] = True,
) -> None:
    """Map one mesh to another from their shapes alone, with features that adapt to the pair."""
    try:
        check_outputs((out, deformed, save_model, report), (source, target, model_file(model)))
        if deformed is not None:
            check_ending(deformed)
        networks = supple.load_match_model(model)
        meshes = prepared((source, target), cache=cache)
        began = time.perf_counter()
        matcher = watched(
            "factoring",
            lambda p: supple.Matcher(
                *meshes,
                model=networks,
                config=config.value,
                epochs=epochs,
                automatic=automatic,
                seed=seed,
                progress=p,
            ),
        )
        loss = Latest(epoch_text)
        result = watched("matching", lambda p: matcher.run(callback=loss, progress=p), loss)
        seconds = time.perf_counter() - began
        print_notes([*result.notes, *result.initial.notes])
        score = supple.map_score(*meshes, result.point_map)
        write_map(out, result.point_map)
        if deformed is not None:
            write_mesh(deformed, result.refined.recovered, meshes[0].faces)
        if save_model is not None:
            matcher.model.save(save_model)
        if report is not None:
            content = {
                "source": source.name,
                "target": target.name,
                "config": config.value,
                "epochs": [asdict(epoch) for epoch in result.history],
                "automatic": result.automatic,
                "score": asdict(score),
                "initial_score": asdict(result.score),
                "seconds": seconds,
                "prepare_seconds": sum(mesh.seconds for mesh in meshes),
                "peak_mebibytes": peak_mebibytes(),
                "model": networks.metadata,
                "version": supple.__version__,
            }
            write_whole(report, json.dumps(content, indent=1))
    except (supple.SuppleError, OSError) as error:
        print_error(error)
        raise typer.Exit(1) from error
    typer.echo(written(out, result.point_map, score))
