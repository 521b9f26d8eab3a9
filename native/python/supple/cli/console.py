# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands share: the terminal and progress."""

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import rich.console
import rich.markup
import rich.progress

import supple

from ..matching import Epoch

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


class Latest:
    """A callback for training; as text, what `describe` says of what it was called with last."""

    def __init__(self, describe: Callable[[object], str]) -> None:
        self._describe = describe
        self._text = ""

    def __call__(self, what: object) -> None:
        self._text = self._describe(what)

    def __str__(self) -> str:
        return self._text


def epoch_text(epoch: Epoch) -> str:
    text = f"epoch {epoch.epoch + 1}, loss {epoch.loss['total']:.4g}"
    if epoch.guide_share > 0:
        text += f", to the guides {epoch.guide:.4g}"
    return text


def watched(label: str, work: Callable[[supple.Progress], _Result], note: object = "") -> _Result:
    """Runs native work in a thread beside a progress bar; Ctrl+C cancels it.

    note: what is said beside the label, as str(note) has it at the time.
    """
    progress = supple.Progress()
    outcome: dict[str, object] = {}
    ended = threading.Event()  # a join that Ctrl+C interrupts takes the thread for ended

    def run() -> None:
        try:
            outcome["result"] = work(progress)
        except BaseException as error:  # handed to the caller's thread below
            outcome["error"] = error
        finally:
            ended.set()

    thread = threading.Thread(target=run)
    with progress_bar() as bar:
        task = bar.add_task(label, total=1.0)
        try:
            thread.start()
            while not ended.wait(0.05):
                text = f"{label} {note}".rstrip()
                bar.update(task, description=text, completed=progress.fraction)
        except KeyboardInterrupt:
            progress.cancel()
            ended.wait()
            raise
    if "error" in outcome:
        raise outcome["error"]
    return outcome["result"]


def model_file(name: str) -> Path | None:
    """The file of a model, None for a shipped one by its name."""
    shipped = (*supple.shipped_models(), *supple.shipped_match_models())
    return None if name in shipped else Path(name)


def print_error(error: object) -> None:
    """Not as markup: paths may have brackets."""
    console.print(f"[red]error[/red] {rich.markup.escape(str(error))}", highlight=False)


def peak_mebibytes() -> float | None:
    """The most memory that this process has taken, or None where the system won't say."""
    try:
        import resource
    except ImportError:
        return None
    unit = 1024**2 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
