# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `supple edit`."""

import json
import time
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import rich.console
import rich.table
import typer

import supple

from ..cases import EditCase, read_case
from ..files import check_outputs, write_whole
from ..mesh_files import write_mesh
from .console import print_error, watched

# A solve is measured this often after one that warms up; the middle one is reported.
_MEASURED_SOLVES = 3


class Mode(StrEnum):
    """How an edit ends."""

    natural = "natural"
    stiff = "stiff"
    arap = "arap"


def edit(
    cases: Annotated[
        list[Path], typer.Argument(help="Folders with mesh.obj, case.json and maybe truth.obj.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the posed meshes, NAME.obj each.")],
    report: Annotated[Path | None, typer.Option(help="JSON file for the figures.")] = None,
    mode: Annotated[Mode, typer.Option(help="How an edit ends.")] = Mode.natural,
    stiffness: Annotated[
        float | None,
        typer.Option(min=0.0, max=1.0, help="Between natural (0) and stiff (1), in mode's place."),
    ] = None,
    network: Annotated[bool, typer.Option(help="Use the network, or the identity.")] = True,
    keep_volume: Annotated[
        bool, typer.Option(help="Give closed bodies back most of the volume that bending takes.")
    ] = True,
    model: Annotated[str, typer.Option(help="Shipped network or .safetensors file.")] = "rotation",
    cache: Annotated[bool, typer.Option(help="Keep prepared meshes on disk, and use them.")] = True,
) -> None:
    """Pose meshes by their handles and measure the result.

    A case that fails is named and the others go on; the exit code is then 1.
    """
    figures: dict[str, dict] = {}
    errors: dict[str, str] = {}
    how: dict[str, object] = {"mode": mode.value} if stiffness is None else {"stiffness": stiffness}
    how["keep_volume"] = keep_volume
    try:
        read = [file for folder in cases for file in Path(folder).glob("*")]
        written = {out / f"{Path(folder).resolve().name}.obj" for folder in cases}
        check_outputs([report, *written], read)
        chosen = supple.load_model(model) if network else None
        out.mkdir(parents=True, exist_ok=True)
    except (supple.SuppleError, OSError) as error:
        print_error(error)
        raise typer.Exit(1) from error
    for folder in cases:
        try:
            case = read_case(folder)
            if case.name in figures:
                raise supple.SuppleError(
                    "bad_case", f"Two cases are called '{case.name}'; rename one folder."
                )
            vertices, figures[case.name] = _edit_case(case, chosen, how, cache)
            write_mesh(out / f"{case.name}.obj", vertices, case.faces)
        except (supple.SuppleError, OSError) as error:
            errors[str(folder)] = str(error)
            print_error(f"{folder}: {error}")
    if report is not None:
        content = {
            "cases": figures,
            "errors": errors,
            **how,
            "network": network,
            "model": chosen.metadata if chosen else None,
            "version": supple.__version__,
        }
        try:
            write_whole(report, json.dumps(content, indent=1))
        except supple.SuppleError as error:
            errors["report"] = str(error)
            print_error(error)
    rich.console.Console().print(_table(figures))
    if errors:
        raise typer.Exit(1)


def _edit_case(
    case: EditCase, model: supple.Model | None, how: dict[str, object], cache: bool
) -> tuple[np.ndarray, dict[str, object]]:
    def prepare(progress: supple.Progress) -> supple.PreparedMesh:
        return supple.PreparedMesh(case.vertices, case.faces, progress=progress, cache=cache)

    prepared = watched(f"{case.name}: preparing", prepare)
    start = time.perf_counter()
    editor = supple.Editor(prepared, case.handles, model=model)
    bind_milliseconds = 1e3 * (time.perf_counter() - start)
    result = watched(f"{case.name}: solving", lambda p: editor.solve(**how, progress=p))
    times = sorted(editor.solve(**how).report["milliseconds"] for _ in range(_MEASURED_SOLVES))
    error = max(
        (
            np.linalg.norm(result.vertices[handle.vertices] - target, axis=1).max()
            for handle, target in zip(case.handles, _targets(case), strict=True)
            if handle.weight == 1
        ),
        default=0.0,
    )
    pose_error = None
    if case.truth is not None:
        pose_error = supple.pose_error(case.vertices, case.faces, result.vertices, case.truth)
    arguments = (case.vertices, case.faces, result.vertices)
    return result.vertices, {
        "symmetric_dirichlet": supple.symmetric_dirichlet(*arguments),
        "flipped_faces": supple.flipped_faces(*arguments),
        "handle_error": error / prepared.diagonal,
        "pose_error": pose_error,
        "prepare_seconds": prepared.seconds,
        "bind_milliseconds": bind_milliseconds,
        "from_cache": prepared.from_cache,
        "frame_milliseconds": times[_MEASURED_SOLVES // 2],
        "vertices": prepared.vertex_count,
        "stages": result.report,
        "notes": [asdict(note) for note in result.notes],
    }


def _targets(case: EditCase) -> list[np.ndarray]:
    """Where each handle's vertices were asked to be, computed here and not by the solver."""
    targets = []
    for handle in case.handles:
        rest = case.vertices[np.asarray(handle.vertices)]
        if handle.matrix is not None:
            matrix = np.asarray(handle.matrix, dtype=np.float64)
            rest = rest @ matrix[:3, :3].T + matrix[:3, 3]
        elif handle.positions is not None:
            rest = np.asarray(handle.positions, dtype=np.float64)
        targets.append(rest)
    return targets


def _table(figures: dict[str, dict]) -> rich.table.Table:
    columns = {
        "symmetric_dirichlet": "sym. Dirichlet",
        "flipped_faces": "flipped",
        "handle_error": "handle error",
        "pose_error": "pose error",
        "prepare_seconds": "prepare s",
        "frame_milliseconds": "frame ms",
    }
    table = rich.table.Table("case", "vertices", *columns.values())
    for name, row in figures.items():
        cells = [row[column] for column in columns]
        text = ["-" if cell is None else f"{cell:.4g}" for cell in cells]
        table.add_row(name, str(row["vertices"]), *text)
    return table
