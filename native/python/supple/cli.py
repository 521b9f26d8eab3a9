# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line `supple`."""

import json
import os
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
import rich.console
import rich.progress
import rich.table
import typer

import supple

from .cases import EditCase, read_case, write_mesh

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help="Deform triangle meshes and keep their detail.",
    pretty_exceptions_enable=False,
)
_console = rich.console.Console(stderr=True)
_Result = TypeVar("_Result")

# A solve is measured this often after one that warms up; the middle one is reported.
_MEASURED_SOLVES = 3


class Mode(StrEnum):
    """How an edit ends."""

    natural = "natural"
    stiff = "stiff"
    arap = "arap"


@app.callback(invoke_without_command=True)
def main(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Deform triangle meshes and keep their detail."""
    if version:
        print(f"supple {supple.__version__}")
        raise typer.Exit()


@app.command()
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
    model: Annotated[str, typer.Option(help="Shipped network or .safetensors file.")] = "rotation",
    cache: Annotated[bool, typer.Option(help="Keep prepared meshes on disk, and use them.")] = True,
) -> None:
    """Pose meshes by their handles and measure the result.

    A case that fails is named and the others go on; the exit code is then 1.
    """
    figures: dict[str, dict] = {}
    errors: dict[str, str] = {}
    how = {"mode": mode.value} if stiffness is None else {"stiffness": stiffness}
    try:
        chosen = supple.load_model(model) if network else None
        out.mkdir(parents=True, exist_ok=True)
    except (supple.SuppleError, OSError) as error:
        _console.print(f"[red]error[/red] {error}")
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
            _console.print(f"[red]error[/red] {folder}: {error}")
    if report is not None:
        content = {
            "cases": figures,
            "errors": errors,
            **how,
            "network": network,
            "model": chosen.metadata if chosen else None,
            "version": supple.__version__,
        }
        _write_whole(report, json.dumps(content, indent=1))
    rich.console.Console().print(_table(figures))
    if errors:
        raise typer.Exit(1)


@app.command("cache")
def show_cache(
    clear: Annotated[bool, typer.Option("--clear", help="Remove all of it.")] = False,
) -> None:
    """Show where prepared meshes are kept on disk and what they take, or remove them."""
    try:
        removed = supple.cache.clear() if clear else None
        kept, cap, enabled = supple.cache.size(), supple.cache.max_bytes(), supple.cache.enabled()
    except supple.SuppleError as error:
        _console.print(f"[red]error[/red] {error}")
        raise typer.Exit(1) from error
    lines = {
        "folder": str(supple.cache.folder()),
        "in use": "yes" if enabled else "no (SUPPLE_CACHE=0)",
        "meshes": str(kept.files),
        "size": f"{kept.bytes / supple.cache.MEBIBYTE:.1f} MiB",
        "cap": f"{cap / supple.cache.MEBIBYTE:.1f} MiB",
    }
    if removed is not None:
        lines["removed"] = f"{removed.files} ({removed.bytes / supple.cache.MEBIBYTE:.1f} MiB)"
    # Plain lines: a folder's name must not be broken to the width of a window.
    for name, value in lines.items():
        typer.echo(f"{name:<8} {value}")


def _edit_case(
    case: EditCase, model: supple.Model | None, how: dict[str, object], cache: bool
) -> tuple[np.ndarray, dict[str, object]]:
    def prepare(progress: supple.Progress) -> supple.PreparedMesh:
        return supple.PreparedMesh(case.vertices, case.faces, progress=progress, cache=cache)

    prepared = _watched(f"{case.name}: preparing", prepare)
    start = time.perf_counter()
    editor = supple.Editor(prepared, case.handles, model=model)
    bind_milliseconds = 1e3 * (time.perf_counter() - start)
    result = _watched(f"{case.name}: solving", lambda p: editor.solve(**how, progress=p))
    times = sorted(editor.solve(**how).report["milliseconds"] for _ in range(_MEASURED_SOLVES))
    error = max(
        np.linalg.norm(result.vertices[handle.vertices] - target, axis=1).max()
        for handle, target in zip(case.handles, _targets(case), strict=True)
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


def _watched(label: str, work: Callable[[supple.Progress], _Result]) -> _Result:
    """Runs native work in a thread beside a progress bar; Ctrl+C cancels it."""
    progress = supple.Progress()
    outcome: dict[str, object] = {}

    def run() -> None:
        try:
            outcome["result"] = work(progress)
        except BaseException as error:  # handed to the caller's thread below
            outcome["error"] = error

    thread = threading.Thread(target=run)
    columns = (
        rich.progress.TextColumn("{task.description}"),
        rich.progress.BarColumn(),
        rich.progress.TaskProgressColumn(),
        rich.progress.TimeRemainingColumn(),
    )
    with rich.progress.Progress(*columns, console=_console, transient=True) as bar:
        task = bar.add_task(label, total=1.0)
        thread.start()
        try:
            while thread.is_alive():
                thread.join(0.05)
                bar.update(task, completed=progress.fraction)
        except KeyboardInterrupt:
            progress.cancel()
            thread.join()
            raise
    if "error" in outcome:
        raise outcome["error"]
    return outcome["result"]


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


def _write_whole(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    partial.write_text(text, encoding="utf-8")
    os.replace(partial, path)


if __name__ == "__main__":
    app()
