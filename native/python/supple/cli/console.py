# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands share: the terminal, progress, and writing files."""

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import rich.console
import rich.progress

import supple

console = rich.console.Console(stderr=True)
_Result = TypeVar("_Result")
_COLUMNS = (
    rich.progress.TextColumn("{task.description}"),
    rich.progress.BarColumn(),
    rich.progress.TaskProgressColumn(),
    rich.progress.TimeRemainingColumn(),
)


def progress_bar() -> rich.progress.Progress:
    """One that goes away when it is done."""
    return rich.progress.Progress(*_COLUMNS, console=console, transient=True)


def watched(label: str, work: Callable[[supple.Progress], _Result]) -> _Result:
    """Runs native work in a thread beside a progress bar; Ctrl+C cancels it."""
    progress = supple.Progress()
    outcome: dict[str, object] = {}

    def run() -> None:
        try:
            outcome["result"] = work(progress)
        except BaseException as error:  # handed to the caller's thread below
            outcome["error"] = error

    thread = threading.Thread(target=run)
    with progress_bar() as bar:
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


def write_whole(path: Path, text: str) -> None:
    """Writes a file, or leaves what was there as it was."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    partial.write_text(text, encoding="utf-8")
    os.replace(partial, path)
