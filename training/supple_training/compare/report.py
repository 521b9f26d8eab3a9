# SPDX-License-Identifier: GPL-3.0-or-later
"""A comparison as JSON, as tables and as a plot."""

from __future__ import annotations

import json
import time
from pathlib import Path

import matplotlib
from rich.table import Table

from supple_training.compare import machine
from supple_training.compare.runner import Settings

matplotlib.use("Agg")
import matplotlib.pyplot as plt

SCHEMA = "supple-speed-1"


def document(rows: list[dict], settings: Settings, *, commit: str | None) -> dict:
    """Everything that is written: the rows, and what they were made on, with and how."""
    return {
        "schema": SCHEMA,
        "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "commit": commit,
        "machine": machine.facts(),
        "versions": machine.versions(),
        "settings": {
            "meshes": [[mesh.name, mesh.size] for mesh in settings.meshes],
            "threads": list(settings.threads),
            "runs": settings.runs,
            "limit_seconds": settings.limit,
            "peers": settings.peers,
        },
        "rows": rows,
    }


def load(path: Path) -> dict:
    """A document. Errors: ValueError where the file holds none; OSError."""
    try:
        read = json.loads(path.read_text())
    except ValueError as error:
        raise ValueError(f"{path} is not JSON ({error})") from error
    if not isinstance(read, dict) or read.get("schema") != SCHEMA:
        raise ValueError(f"{path} is no comparison of speed ({SCHEMA}); make one with `speed`")
    return read


def seconds_text(seconds: float) -> str:
    """With three digits and a fitting unit."""
    for unit, factor in (("s", 1.0), ("ms", 1e3)):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.3g} {unit}" if seconds < 1000 else f"{seconds:.0f} s"
    return f"{seconds * 1e6:.3g} µs"


def bytes_text(count: float) -> str:
    """In MB or GB."""
    return f"{count / 1e9:.2f} GB" if count >= 1e9 else f"{count / 1e6:.1f} MB"


def fact_text(facts: dict) -> str:
    """Figures of a result, in a line."""
    return ", ".join(
        f"{name} {value:.3g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in facts.items()
    )


def remark(row: dict) -> str:
    """How good its result is, and what else is to be said of a measurement."""
    parts = [row.get("message", ""), fact_text(row.get("facts", {}))]
    for threads, seconds in sorted(row.get("seconds_with_threads", {}).items()):
        if int(threads) != row["threads"]:
            parts.append(f"{seconds_text(seconds)} with threads: {threads}")
    return "; ".join(filter(None, parts))


def absence(row: dict) -> str:
    """Why there are no figures."""
    message = f": {row['message']}" if row.get("message") else ""
    return f"{row['contender']}: {row['status']}{message}"


def cells(row: dict) -> list[str]:
    """A measured row: who, threads, time, quartiles, times ours, peak memory."""
    seconds = row["seconds"]
    return [
        row["contender"],
        str(row["threads"]),
        seconds_text(seconds["median"]),
        f"{seconds_text(seconds['low'])} to {seconds_text(seconds['high'])} ({seconds['runs']})",
        f"{row['times_ours']:.2f}" if "times_ours" in row else "",
        bytes_text(row["peak_bytes"]),
    ]


HEAD = ("", "threads", "median", "quartiles (runs)", "times ours", "peak memory")


def _groups(rows: list[dict], *names: str) -> list[list[dict]]:
    """Rows that share these values, together, in the order they came."""
    groups: dict[tuple, list[dict]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return list(groups.values())


def tables(rows: list[dict]) -> list[Table | str]:
    """For the terminal: a table a task, and below it what could not be measured."""
    shown: list[Table | str] = []
    for group in _groups(rows, "task"):
        table = Table(title=f"{group[0]['task']}: {group[0]['title']}", title_justify="left")
        table.add_column("vertices", justify="right")
        for name in HEAD:
            table.add_column(name, justify="left" if not name else "right")
        for size in _groups(group, "mesh", "size"):
            for row in size:
                if "seconds" in row:
                    table.add_row(size_text(row), *cells(row))
            table.add_section()
        if table.row_count:
            shown.append(table)
        else:
            shown.append(table.title)
        absences = dict.fromkeys(
            f"  {size_text(row)}: {absence(row)}" for row in group if "seconds" not in row
        )
        shown += absences
    return shown


def size_text(row: dict) -> str:
    """The number of vertices, and the mesh where it is not the torus."""
    return f"{row['size']:,}" + ("" if row["mesh"] == "torus" else f" ({row['mesh']})")


def markdown(made: dict) -> str:
    """The whole comparison as Markdown."""
    host, settings = made["machine"], made["settings"]
    packages = ", ".join(f"{n} {v}" for n, v in made["versions"].items() if v)
    lines = [
        "# Speed",
        "",
        f"{host['cpu']}, {host['cores']} cores, {bytes_text(host['memory_bytes'])}; "
        f"{made['date']}, commit {made['commit'] or 'unknown'}, load {host['load']:.1f} at the "
        f"end. Python {host['python']}, {packages}.",
        "",
        f"Up to {settings['runs']} runs that take turns, after a warm-up; limit "
        f"{settings['limit_seconds']:g} s a call. Peak memory is what the first call in a process "
        "of its own needs beyond what was there before it. Peers run with the faster of 1 and 2 "
        "threads.",
    ]
    for group in _groups(made["rows"], "task"):
        lines += ["", f"## {group[0]['task']}: {group[0]['title']}"]
        for size in _groups(group, "mesh", "size"):
            lines += ["", f"{size_text(size[0])} vertices", ""]
            measured = [row for row in size if "seconds" in row]
            if measured:
                lines += [
                    "| " + " | ".join((*HEAD, "")) + " |",
                    "|---|---:|---:|---|---:|---:|---|",
                ]
                lines += ["| " + " | ".join((*cells(r), remark(r))) + " |" for r in measured]
                lines.append("")
            lines += [f"- {absence(row)}" for row in size if "seconds" not in row]
    gains = thread_gains(made["rows"])
    if gains:
        lines += ["", "## Threads", "", "How many times as fast ours is with 2 threads as with 1."]
        lines += ["", "| task | | vertices | times as fast |", "|---|---|---:|---:|"]
        lines += [f"| {t} | {c} | {size} | {gain:.2f} |" for t, c, size, gain in gains]
    text = "\n".join(lines).rstrip("\n")
    while "\n\n\n" in text:
        text = text.replace("\n\n\n", "\n\n")
    return text + "\n"


def thread_gains(rows: list[dict]) -> list[tuple[str, str, str, float]]:
    """Task, contender, size as text, and time with 1 thread over time with 2; where both are."""
    medians = {
        (row["task"], row["contender"], size_text(row), row["threads"]): row["seconds"]["median"]
        for row in rows
        if row["ours"] and "seconds" in row
    }
    return [
        (task, contender, size, seconds / medians[task, contender, size, 2])
        for (task, contender, size, threads), seconds in medians.items()
        if threads == 1 and (task, contender, size, 2) in medians
    ]


def plot(made: dict, path: Path) -> None:
    """Cost against size as PNG: a row a task, time at the left, peak memory at the right."""
    rows = [row for row in made["rows"] if "seconds" in row and row["mesh"] == "torus"]
    tasks = list(dict.fromkeys(row["task"] for row in rows))
    if not tasks:
        tasks = ["nothing was measured"]
    figure, grid = plt.subplots(
        len(tasks), 2, figsize=(11, 2.9 * len(tasks)), layout="constrained", squeeze=False
    )
    for task, (left, right) in zip(tasks, grid, strict=True):
        mine = [row for row in rows if row["task"] == task]
        lines = list(dict.fromkeys((r["contender"], r["ours"] and r["threads"]) for r in mine))
        for contender, threads in lines:
            points = sorted(
                (r["vertices"], r["seconds"], r["peak_bytes"])
                for r in mine
                if r["contender"] == contender and (not threads or r["threads"] == threads)
            )
            label = contender
            if threads:
                label += f", {threads} thread" + ("s" if threads > 1 else "")
            style = {
                "marker": "o",
                "ms": 3,
                "lw": 2 if threads else 1,
                "ls": "-" if threads else "--",
            }
            sizes = [p[0] for p in points]
            (line,) = left.plot(sizes, [p[1]["median"] for p in points], label=label, **style)
            left.fill_between(
                sizes,
                [p[1]["low"] for p in points],
                [p[1]["high"] for p in points],
                color=line.get_color(),
                alpha=0.2,
                lw=0,
            )
            right.plot(sizes, [max(p[2], 1e5) / 1e6 for p in points], label=label, **style)
        left.set(title=task, ylabel="seconds")
        right.set(title=f"{task}: peak memory", ylabel="MB")
        for axes in (left, right):
            axes.set(xlabel="vertices", xscale="log", yscale="log")
            axes.grid(alpha=0.3)
        if lines:
            left.legend(fontsize=7, loc="upper left")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def write(made: dict, folder: Path) -> list[Path]:
    """speed.json, speed.md and speed.png in `folder`, which is made; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"speed.{kind}" for kind in ("json", "md", "png")]
    paths[0].write_text(json.dumps(made, indent=1) + "\n")
    paths[1].write_text(markdown(made))
    plot(made, paths[2])
    return paths
