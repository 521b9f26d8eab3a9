# SPDX-License-Identifier: GPL-3.0-or-later
"""A comparison of sequences as JSON, as tables and as Markdown."""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from pathlib import Path

import supple
from rich.table import Table

from supple_training.compare import machine
from supple_training.compare.edits.contenders import ARAP
from supple_training.compare.edits.measure import MEASURED
from supple_training.compare.edits.report import (
    VERDICT_HEAD,
    markdown_table,
    network_text,
    number,
    titled_table,
    verdict_cells,
)
from supple_training.compare.report import absence, seconds_text
from supple_training.compare.sequences.measure import Settings

SCHEMA = "supple-sequence-1"

HEAD = (
    "contender",
    "pose error",
    "over ARAP's",
    "acceleration error",
    "over ARAP's",
    "handle error",
    "frame",
)
SUMMARY_HEAD = (
    "contender",
    "sequences",
    "pose error",
    "over ARAP's",
    "acceleration error",
    "over ARAP's",
    "frame",
)


def document(
    cases: dict[str, dict],
    errors: dict[str, str],
    summary: dict,
    settings: Settings,
    *,
    commit: str | None,
) -> dict:
    """Everything that is written; "measured" has the sequences as `measure` gives them."""
    return {
        "schema": SCHEMA,
        "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "commit": commit,
        "machine": machine.facts(),
        "versions": machine.versions() | {"supple": supple.__version__},
        "settings": asdict(settings),
        "measured": cases,
        "errors": errors,
        "summary": summary,
    }


def _over(row: dict, reference: dict, figure: str) -> str:
    """A figure over ARAP's; a dash without ARAP's."""
    return number(row[figure] / reference[figure] if reference.get(figure) else None)


def case_cells(rows: dict[str, dict]) -> list[list[str]]:
    """The table of a sequence: a line for each contender that made it."""
    reference = rows.get(ARAP, {})
    return [
        [
            name,
            number(row["pose_error"]),
            _over(row, reference, "pose_error"),
            number(row["acceleration_error"]),
            _over(row, reference, "acceleration_error"),
            number(row["handle_error"], ".0e"),
            seconds_text(row["frame_milliseconds"] / 1e3),
        ]
        for name, row in rows.items()
        if row["status"] == MEASURED
    ]


def summary_cells(name: str, row: dict) -> list[str]:
    """A contender over all sequences."""
    return [
        name,
        str(row["cases"]),
        number(row["pose_error"]),
        number(row["pose_error_ratio"]),
        number(row["acceleration_error"]),
        number(row["acceleration_error_ratio"]),
        seconds_text(row["frame_milliseconds"] / 1e3),
    ]


def _title(name: str, case: dict) -> str:
    return (
        f"{name}: {case['vertices']:,} vertices, {case['frames']} frames, {case['handles']} "
        f"handles, acceleration {number(case['acceleration'])}"
    )


def _absences(made: dict) -> list[str]:
    """What could not be measured or read."""
    texts = [
        f"{name}: {absence({'contender': contender, **row})}"
        for name, case in made["measured"].items()
        for contender, row in case["rows"].items()
        if row["status"] != MEASURED
    ]
    return texts + [f"{name}: {message}" for name, message in made["errors"].items()]


def tables(made: dict) -> list[Table | str]:
    """For the terminal: a table a sequence, then all together, then the targets."""
    summary = made["summary"]
    together = [summary_cells(*item) for item in summary["contenders"].items()]
    judged = [verdict_cells(verdict) for verdict in summary["verdicts"]]
    parts = [
        (_title(name, case), HEAD, case_cells(case["rows"]), 1)
        for name, case in made["measured"].items()
    ]
    parts += [("all sequences", SUMMARY_HEAD, together, 1), ("targets", VERDICT_HEAD, judged, 2)]
    shown: list[Table | str] = []
    for title, head, lines, left in parts:
        table = titled_table(title, head, left)
        for line in lines:
            table.add_row(*line)
        shown.append(table)
    return [*shown, *(f"  {text}" for text in _absences(made)), network_text(summary["network"])]


def markdown(made: dict, pictures: list[str]) -> str:
    """The whole comparison; `pictures` names the sequences that have a plot and a picture."""
    host, settings, summary = made["machine"], made["settings"], made["summary"]
    packages = ", ".join(f"{n} {v}" for n, v in made["versions"].items() if v)
    lines = [
        "# Sequences",
        "",
        f"{host['cpu']}, {host['cores']} cores; {made['date']}, commit "
        f"{made['commit'] or 'unknown'}, load {host['load']:.1f} at the end. Python "
        f"{host['python']}, {packages}.",
        "",
        "Every frame is made by itself from the rest shape, the handles where the truth has them. "
        f"{ARAP}: {settings['iterations']} iterations (spokes and rims). Pose error: mean over "
        "frames. Acceleration error: mean over inner frames and vertices of how far the second "
        "difference is from the truth's. Both x100 of the root of the rest area. Frame: median.",
        "",
        *markdown_table(
            SUMMARY_HEAD, [summary_cells(*item) for item in summary["contenders"].items()]
        ),
        "",
        *markdown_table(VERDICT_HEAD, [verdict_cells(v) for v in summary["verdicts"]], left=2),
        "",
        network_text(summary["network"]),
    ]
    if missing := _absences(made):
        lines += ["", *(f"- {text}" for text in missing)]
    for name, case in made["measured"].items():
        lines += ["", f"## {_title(name, case)}", ""]
        lines += markdown_table(HEAD, case_cells(case["rows"]))
        if name in pictures:
            lines += ["", f"![{name}, errors]({name}.errors.png)", "", f"![{name}]({name}.png)"]
    return "\n".join(lines) + "\n"


def write(made: dict, folder: Path, pictures: list[str]) -> list[Path]:
    """sequence.json and sequence.md in `folder`, which is made; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / "sequence.json", folder / "sequence.md"]
    paths[0].write_text(json.dumps(made, indent=1) + "\n")
    paths[1].write_text(markdown(made, pictures))
    return paths
