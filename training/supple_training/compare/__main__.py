# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands: measure, and compare two measurements. See the package's text for how."""

from __future__ import annotations

import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from supple_training.compare import against as builds
from supple_training.compare import difference, machine, report, shapes, tasks
from supple_training.compare.edits.command import edit
from supple_training.compare.maps.command import refine
from supple_training.compare.runner import TRAINING, Build, Comparison, Mesh, Settings
from supple_training.compare.sequences.command import sequence
from supple_training.console import console, percent_bar

CHECKOUT = TRAINING.parent

BODY_SIZE = 10_000

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


def _whole_numbers(text: str, option: str, smallest: int) -> tuple[int, ...]:
    try:
        values = tuple(dict.fromkeys(int(part) for part in text.split(",")))
    except ValueError:
        values = ()
    if not values or min(values) < smallest:
        raise typer.BadParameter(
            f"'{text}' is no list of whole numbers of {smallest} or more, as 1000,10000",
            param_hint=option,
        )
    return values


def _measured(settings: Settings, chosen: list, made: tuple[Build, ...]) -> list[dict]:
    """The rows, under a progress bar."""
    with percent_bar() as bar:
        shown = bar.add_task("", total=len(chosen) * len(settings.meshes))

        def note(text: str) -> None:
            bar.update(shown, description=text, advance=0 if text else 1)

        return Comparison(settings, made).run(chosen, note)


def _show_difference(base: dict, new: dict, floor: float) -> int:
    """Print it; returns the exit code."""
    found = difference.changes(base, new, floor)
    console.print(difference.table(found))
    compared = [change for change in found if change.ratio is not None]
    for change in found:
        if change.ratio is None:
            task, contender, size, threads = change.key
            console.print(
                f"  {task}, {contender}, {size} vertices, threads {threads}: {change.verdict}",
                markup=False,
                highlight=False,
            )
    for warning in difference.warnings(base, new):
        console.print(f"[yellow]{warning}[/]")
    slower = [change for change in found if change.verdict == "slower"]
    faster = [change for change in found if change.verdict == "faster"]
    console.print(
        f"{len(compared)} compared: {len(slower)} slower beyond noise, {len(faster)} faster"
    )
    return 1 if slower else 0


def _meshes(sizes: tuple[int, ...], body: bool, scratch: Path) -> tuple[Mesh, ...]:
    """The toruses, and the body, which is made here and kept in the folder `scratch`."""
    meshes = [Mesh("torus", size) for size in sizes]
    if body:
        meshes.append(Mesh("body", BODY_SIZE, scratch / "body.npz"))
        with console.status("making the body"):
            shapes.save(shapes.body(BODY_SIZE), scratch / "body.npz")
    return tuple(meshes)


def _speed_against(
    settings: Settings, chosen: list, reference: str, out: Path, noise: float
) -> int:
    """Measure this checkout and a commit in turns, write and print both; returns the exit code."""
    commits = {"base": machine.commit(CHECKOUT, reference), "new": machine.commit(CHECKOUT)}
    if commits["base"] is None:
        raise typer.BadParameter(f"git knows no commit '{reference}'", param_hint="--against")
    try:
        with builds.both(CHECKOUT, commits["base"], console.print) as (base_site, new_site):
            pair = (Build("base", base_site), Build("new", new_site))
            rows = _measured(settings, chosen, pair)
    except builds.BuildError as error:
        console.print(str(error), style="red", markup=False)
        return 2
    documents = []
    for name, commit in commits.items():
        mine = [row for row in rows if row["build"] == name]
        documents.append(report.document(mine, settings, commit=commit))
        report.write(documents[-1], out / name)
    code = _show_difference(*documents, noise)
    console.print(f"wrote {out / 'base'} and {out / 'new'}")
    return code


@app.command()
def speed(
    sizes: Annotated[
        str, typer.Option(help="Numbers of vertices, with commas.")
    ] = "1000,10000,40000,160000",
    body: Annotated[
        bool, typer.Option("--body", help=f"Also a human body of {BODY_SIZE} vertices.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(
            help=f"Only tasks that begin so, with commas or again: {', '.join(tasks.TASKS)}."
        ),
    ] = None,
    runs: Annotated[int, typer.Option(min=1, help="Of each measurement.")] = 7,
    threads: Annotated[
        str, typer.Option(help="That ours run with: a number, or 'both' for 1 and 2.")
    ] = "2",
    out: Annotated[
        Path, typer.Option(help="Folder for speed.json, speed.md and speed.png.")
    ] = Path("out/speed"),
    peers: Annotated[
        bool | None,
        typer.Option(
            help="Measure what else does the same; without --against, that is the default."
        ),
    ] = None,
    limit: Annotated[
        float,
        typer.Option(min=0.1, help="Seconds a call may take; what needs more is skipped later."),
    ] = 120.0,
    against: Annotated[
        str | None,
        typer.Option(help="A commit: build it and this checkout, let both take turns, print both."),
    ] = None,
    noise: Annotated[
        float, typer.Option(min=0.0, help="With --against: smaller changes are never called one.")
    ] = difference.FLOOR,
) -> None:
    """Measure every kernel and task beside its peers; with --against, beside another commit.

    Ends with code 1 where --against finds something that got slower beyond noise.
    """
    counts = _whole_numbers(sizes, "--sizes", 100)
    try:
        names = [name for text in only or [] for name in text.split(",")]
        chosen = tasks.chosen(names)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--only") from error
    with TemporaryDirectory(prefix="supple-compare-") as scratch:
        settings = Settings(
            meshes=_meshes(counts, body, Path(scratch)),
            threads=_whole_numbers("1,2" if threads == "both" else threads, "--threads", 1),
            runs=runs,
            limit=limit,
            peers=against is None if peers is None else peers,
        )
        if max(settings.threads) > len(os.sched_getaffinity(0)):
            console.print("[yellow]more threads than this process has cores[/]")
        if against is not None:
            raise typer.Exit(_speed_against(settings, chosen, against, out, noise))
        rows = _measured(settings, chosen, (Build("this"),))
    made = report.document(rows, settings, commit=machine.commit(CHECKOUT))
    for part in report.tables(rows):
        console.print(part, markup=False, highlight=False)
    console.print("wrote " + ", ".join(map(str, report.write(made, out))))


@app.command()
def diff(
    base: Annotated[Path, typer.Argument(help="speed.json of before.", dir_okay=False)],
    new: Annotated[Path, typer.Argument(help="speed.json of after.", dir_okay=False)],
    noise: Annotated[
        float, typer.Option(min=0.0, help="Smaller changes are never called one.")
    ] = difference.FLOOR,
) -> None:
    """Compare two files that `speed` wrote; code 1 where something got slower beyond noise."""
    documents = []
    for name, path in (("BASE", base), ("NEW", new)):
        try:
            documents.append(report.load(path))
        except (OSError, ValueError) as error:
            raise typer.BadParameter(str(error), param_hint=name) from error
    raise typer.Exit(_show_difference(*documents, noise))


app.command()(edit)
app.command()(refine)
app.command()(sequence)

if __name__ == "__main__":
    app()
