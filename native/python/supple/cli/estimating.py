# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `supple estimate`: the paper's second experiment."""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import rich.console
import rich.table
import typer

import supple

from ..files import check_outputs, write_whole
from ..mesh_files import check_ending, read_mesh, write_mesh
from .console import model_file, print_error, watched
from .editing import Mode

# The ways that stand beside each other in every report, and what they mean to Editor.solve.
_ROWS: dict[str, dict[str, object]] = {
    "natural": {"mode": "natural"},
    "no_network": {"mode": "natural", "network": False},
    "stiff": {"mode": "stiff"},
    "arap": {"mode": "arap"},
}


def estimate(
    source: Annotated[Path, typer.Argument(help="Mesh file of the pose before.")],
    target: Annotated[Path, typer.Argument(help="Mesh file of the same vertices after.")],
    out: Annotated[Path, typer.Option(help="Mesh file for the estimated pose.")],
    handles: Annotated[int, typer.Option(min=1, help="Most handles to take from the target.")] = 16,
    report: Annotated[Path | None, typer.Option(help="JSON file for the figures.")] = None,
    mode: Annotated[Mode, typer.Option(help="How the written edit ends.")] = Mode.natural,
    network: Annotated[bool, typer.Option(help="Write what the network gives, or none.")] = True,
    model: Annotated[str, typer.Option(help="Shipped network or .safetensors file.")] = "rotation",
    cache: Annotated[bool, typer.Option(help="Keep prepared meshes on disk, and use them.")] = True,
) -> None:
    """Estimate a motion from a few handles where it is largest, and measure what that misses."""
    try:
        check_outputs((out, report), (source, target, model_file(model)))
        check_ending(out)
        vertices, faces = read_mesh(source)
        truth, _ = read_mesh(target)
        prepared = watched(
            f"{source.name}: preparing",
            lambda p: supple.PreparedMesh(vertices, faces, progress=p, cache=cache),
        )
        patches = supple.propose_motion_handles(prepared, truth, handles)
        editor = supple.Editor(
            prepared,
            [
                supple.Handle(f"handle {i}", patch, positions=truth[patch])
                for i, patch in enumerate(patches)
            ],
            model=model,
        )
        rows = {
            name: _figures(prepared, _solved(editor, name, how), truth)
            for name, how in _ROWS.items()
        }
        written = _solved(editor, mode.value, {"mode": mode.value, "network": network})
        write_mesh(out, written, faces)
        if report is not None:
            content = {
                "source": source.name,
                "target": target.name,
                "handles": len(patches),
                "handle_vertices": sum(map(len, patches)),
                "vertices": len(vertices),
                "mode": mode.value,
                "network": network,
                "rows": rows,
                "model": editor.model.metadata,
                "version": supple.__version__,
            }
            write_whole(report, json.dumps(content, indent=1))
    except (supple.SuppleError, OSError) as error:
        print_error(error)
        raise typer.Exit(1) from error
    rich.console.Console().print(_table(rows))
    typer.echo(
        f"wrote {out}: from {len(patches)} handles, {sum(map(len, patches))} of {len(vertices)} "
        "vertices"
    )


def _solved(editor: supple.Editor, label: str, how: dict[str, object]) -> np.ndarray:
    return watched(f"{label}: solving", lambda p: editor.solve(**how, progress=p)).vertices


def _figures(
    prepared: supple.PreparedMesh, posed: np.ndarray, truth: np.ndarray
) -> dict[str, float | int]:
    arguments = (prepared.vertices, prepared.faces, posed)
    return {
        "pose_error": supple.pose_error(*arguments, truth),
        "symmetric_dirichlet": supple.symmetric_dirichlet(*arguments),
        "flipped_faces": supple.flipped_faces(*arguments),
    }


def _table(rows: dict[str, dict]) -> rich.table.Table:
    table = rich.table.Table("", "pose error", "sym. Dirichlet", "flipped")
    for name, row in rows.items():
        table.add_row(name, *(f"{cell:.4g}" for cell in row.values()))
    return table
