# SPDX-License-Identifier: GPL-3.0-or-later
"""A comparison of edits as JSON, as tables and as Markdown."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import supple
from rich.table import Table

from supple_training.compare import machine
from supple_training.compare.edits.contenders import ARAP, NATURAL
from supple_training.compare.edits.measure import MEASURED, NEAR, Settings
from supple_training.compare.edits.summary import MISSED
from supple_training.compare.report import absence, seconds_text

SCHEMA = "supple-edit-1"

CASE_HEAD = (
    "contender",
    "distortion",
    "over ARAP's",
    "pose error",
    "flipped",
    "turned, degenerate",
    "handle error",
    "volume",
    "prepare",
    "bind",
    "frame",
    "ARAP's energy",
)
SUMMARY_HEAD = (
    "contender",
    "cases",
    "distortion over ARAP's",
    "worst case",
    "pose error",
    "over ARAP's",
    "by handles",
    "flipped",
    "handle error",
    "frame, ARAP iterations",
    "reach ARAP's energy",
)
VERDICT_HEAD = ("target", "", "reached", "verdict")


def document(
    cases: dict[str, dict],
    errors: dict[str, str],
    summary: dict,
    settings: Settings,
    *,
    commit: str | None,
) -> dict:
    """Everything that is written.

    "contenders" has for each one {"cases": {NAME: figures}}, the layout of the command line's
    reports; "cases" itself is that of natural, so that a reader of such a report can read this one.
    """
    names = dict.fromkeys(name for case in cases.values() for name in case["rows"])
    by_contender = {
        name: {
            "cases": {
                case: each["rows"][name]
                for case, each in cases.items()
                if each["rows"][name]["status"] == MEASURED
            }
        }
        for name in names
    }
    return {
        "schema": SCHEMA,
        "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "commit": commit,
        "machine": machine.facts(),
        "versions": machine.versions() | {"supple": supple.__version__},
        "settings": asdict(settings),
        "cases": by_contender.get(NATURAL, {"cases": {}})["cases"],
        "cases_contender": NATURAL,
        "contenders": by_contender,
        "measured": cases,
        "errors": errors,
        "summary": summary,
    }


def number(value: float | None, form: str = ".3g") -> str:
    """A figure as text; a dash where there is none."""
    return "-" if value is None else format(value, form)


def _reached(row: dict) -> str:
    """How soon ARAP's converged energy is reached, or how far away one solve ends."""
    if row["converged_seconds"] is None:
        return "not reached"
    return seconds_text(row["converged_seconds"])


def case_cells(row: dict, reference: dict) -> list[str]:
    """A contender's figures on a case; `reference` is ARAP's row or {}."""
    ratio = None
    if reference.get("symmetric_dirichlet"):
        ratio = row["symmetric_dirichlet"] / reference["symmetric_dirichlet"]
    return [
        number(row["symmetric_dirichlet"]),
        number(ratio),
        number(row["pose_error"]),
        str(row["flipped_faces"]),
        f"{row['new_turned_over_faces']}, {row['new_degenerate_faces']}",
        number(row["handle_error"], ".0e"),
        number(row["volume_ratio"], ".3f"),
        seconds_text(row["prepare_seconds"]) if row["prepare_seconds"] else "-",
        seconds_text(row["bind_milliseconds"] / 1e3),
        seconds_text(row["frame_milliseconds"] / 1e3),
        _reached(row),
    ]


def summary_cells(name: str, row: dict) -> list[str]:
    """A contender over all cases."""
    worst = "-"
    if row["worst_distortion_case"]:
        worst = f"{row['worst_distortion_ratio']:.3g} {row['worst_distortion_case']}"
    by_handles = [
        f"{count}: {number(ratio)}" for count, ratio in row["pose_error_ratio_by_handles"].items()
    ]
    return [
        name,
        str(row["cases"]),
        number(row["distortion_ratio"]),
        worst,
        number(row["mean_pose_error"]),
        number(row["pose_error_ratio"]),
        ", ".join(by_handles) or "-",
        str(row["flipped_faces"]),
        number(row["handle_error"], ".0e"),
        number(row["frame_over_arap_iteration"]),
        f"{row['converged']} of {row['cases']}",
    ]


def verdict_cells(verdict: dict) -> list[str]:
    """A target, and what was reached."""
    value = verdict["value"]
    share = verdict["what"].startswith("network") and value is not None
    return [
        verdict["what"],
        verdict["target"],
        f"{value:.1%}" if share else number(value),
        verdict["verdict"],
    ]


def network_text(network: dict | None) -> str:
    """What the network is worth, in a sentence."""
    if network is None:
        return "The network is not judged: no case has a truth and both results."
    interval = "no interval from a single case"
    if network["low"] is not None:
        interval = (
            f"95% interval {network['low']:.1%} to {network['high']:.1%} from "
            f"{network['resamples']:,} resamples of {network['cases']} cases"
        )
    return (
        f"With the network natural is {network['gain']:.1%} nearer to the truth (ratio of means; "
        f"{interval}; mean of the cases' gains {network['mean_case_gain']:.1%})."
    )


def _rows(cases: dict[str, dict]) -> Iterator[tuple[str, dict, list[list[str]], list[str]]]:
    """Each case with its table's rows and its absences."""
    for name, case in cases.items():
        reference = case["rows"].get(ARAP, {})
        cells, missing = [], []
        for contender, row in case["rows"].items():
            if row["status"] == MEASURED:
                cells.append([contender, *case_cells(row, reference)])
            else:
                missing.append(absence({"contender": contender, **row}))
        yield name, case, cells, missing


def _case_text(name: str, case: dict) -> str:
    truth = "" if case["truth"] else ", no truth"
    return f"{name}: {case['vertices']:,} vertices, {case['handles']} handles{truth}"


def titled_table(title: str, head: tuple[str, ...], left: int = 1) -> Table:
    """For the terminal, without rows; the first `left` columns are text."""
    table = Table(title=title, title_justify="left")
    for place, column in enumerate(head):
        table.add_column(column, justify="left" if place < left else "right", overflow="fold")
    return table


def tables(made: dict) -> list[Table | str]:
    """For the terminal: a table a case, then all cases together, then the targets."""
    shown: list[Table | str] = []
    absences: dict[str, None] = {}
    for name, case, cells, missing in _rows(made["measured"]):
        table = titled_table(_case_text(name, case), CASE_HEAD)
        for row in cells:
            table.add_row(*row)
        shown.append(table)
        absences |= dict.fromkeys(f"  {text}" for text in missing)
    summary = made["summary"]
    table = titled_table("all cases, least distortion first", SUMMARY_HEAD)
    for name, row in summary["contenders"].items():
        table.add_row(*summary_cells(name, row))
    shown += [table, *absences]
    shown += [f"  {name}: {message}" for name, message in made["errors"].items()]
    targets = titled_table("targets", VERDICT_HEAD, left=2)
    for verdict in summary["verdicts"]:
        targets.add_row(*verdict_cells(verdict))
    return [*shown, targets, network_text(summary["network"])]


def markdown_table(head: tuple[str, ...], rows: list[list[str]], left: int = 1) -> list[str]:
    """Its lines; the first `left` columns are text."""
    rule = "".join("---|" if i < left else "---:|" for i in range(len(head)))
    return ["| " + " | ".join(head) + " |", "|" + rule] + [
        "| " + " | ".join(row) + " |" for row in rows
    ]


def markdown(made: dict, pictures: list[str]) -> str:
    """The whole comparison; `pictures` names the cases that have a picture."""
    host, settings, summary = made["machine"], made["settings"], made["summary"]
    packages = ", ".join(f"{n} {v}" for n, v in made["versions"].items() if v)
    absences: dict[str, None] = {}
    sections: list[str] = []
    for name, case, cells, missing in _rows(made["measured"]):
        sections += ["", f"## {_case_text(name, case)}", ""]
        sections += markdown_table(CASE_HEAD, cells)
        absences |= dict.fromkeys(f"- {text}" for text in missing)
        if name in pictures:
            sections += ["", f"![{name}]({name}.png)"]
    lines = [
        "# Edits",
        "",
        f"{host['cpu']}, {host['cores']} cores; {made['date']}, commit "
        f"{made['commit'] or 'unknown'}, load {host['load']:.1f} at the end. Python "
        f"{host['python']}, {packages}.",
        "",
        f"{ARAP}: {settings['iterations']} iterations (spokes and rims) from the rest shape with "
        "the handles displaced; its frame is one iteration, all others' one warm solve, the median "
        f"of {settings['runs']} in turns. ARAP's energy: how long until the contender's energy is "
        f"no more than ARAP's last (edit.json also has when it is within {NEAR - 1:.0%} of it).",
        "",
        *markdown_table(
            SUMMARY_HEAD,
            [summary_cells(name, row) for name, row in summary["contenders"].items()],
        ),
        "",
        *markdown_table(VERDICT_HEAD, [verdict_cells(v) for v in summary["verdicts"]], left=2),
        "",
        network_text(summary["network"]),
    ]
    if absences:
        lines += ["", *absences]
    lines += [f"- {name}: {message}" for name, message in made["errors"].items()]
    return "\n".join(lines + sections) + "\n"


def write(made: dict, folder: Path, pictures: list[str]) -> list[Path]:
    """edit.json and edit.md in `folder`, which is made; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / "edit.json", folder / "edit.md"]
    paths[0].write_text(json.dumps(made, indent=1) + "\n")
    paths[1].write_text(markdown(made, pictures))
    return paths


def exit_code(made: dict) -> int:
    """1 where a target was missed or a case failed, else 0; what was not judged is no failure."""
    words = {verdict["verdict"] for verdict in made["summary"]["verdicts"]}
    failed = any(
        row["status"] == "failed"
        for case in made["measured"].values()
        for row in case["rows"].values()
    )
    return int(MISSED in words or failed or bool(made["errors"]))
