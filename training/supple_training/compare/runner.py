# SPDX-License-Identifier: GPL-3.0-or-later
"""Lets the contenders of a task take turns, and keeps what they needed.

For each task and size every contender gets a process (`worker.py`), which sets up and makes a first
call: the warm-up, whose peak memory is the one reported. Then all of them run once, and once again,
ABCABC..., so that whatever else the machine does meets them alike.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import select
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from supple_training.compare.contender import Contender, Task

TRAINING = Path(__file__).resolve().parents[2]

SLOW = 10.0
"""Seconds of a call above which there are fewer runs."""

SHORT = 0.02
"""Seconds that a run lasts at least: shorter calls are made several times."""

TRIES = 3
"""Calls, unless they are long, by which a peer's number of threads is chosen."""

SETUP_SHARE = 10
"""Setting up may take this many times the limit of a call."""

PEER_THREADS = (1, 2)
"""What a peer's best is chosen from."""

SPINS = "300000"
"""libgomp's own default. Ours sleep instead (OMP_WAIT_POLICY); peers are to be as they are."""


@dataclass(frozen=True)
class Settings:
    """What one comparison is made with."""

    meshes: tuple[Mesh, ...]
    threads: tuple[int, ...]
    runs: int = 7
    limit: float = 120.0
    peers: bool = True


@dataclass(frozen=True)
class Mesh:
    """What is measured on: the torus of a size, or a mesh in a file of `shapes.save`."""

    name: str
    size: int
    file: Path | None = None


@dataclass(frozen=True)
class Build:
    """A supple to measure: its name, and the folder that holds it (None: the one installed)."""

    name: str
    site: Path | None = None


class OverLimit(Exception):  # noqa: N818 - an answer, not an error
    """A call took longer than it may."""


class Failed(Exception):  # noqa: N818
    """The contender's process ended without an answer; the message says how."""


class Worker:
    """A contender's process. Use as a context manager."""

    def __init__(self, request: dict, build: Build, *, ours: bool) -> None:
        threads = str(request["threads"])
        paths = [str(build.site)] if build.site else []
        paths += [str(TRAINING), *filter(None, [os.environ.get("PYTHONPATH")])]
        env = {
            **os.environ,
            "SUPPLE_CACHE": "0",  # what is prepared is computed, not found on disk
            "PYTHONPATH": os.pathsep.join(paths),
            **dict.fromkeys(
                ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), threads
            ),
        }
        env.pop("OMP_WAIT_POLICY", None)
        env.pop("GOMP_SPINCOUNT", None)
        if not ours:
            env["GOMP_SPINCOUNT"] = SPINS
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed in `close`
        self._process = subprocess.Popen(
            [sys.executable, "-m", "supple_training.compare.worker", json.dumps(request)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=env,
            bufsize=0,
        )

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def answer(self, limit: float) -> dict:
        """The next answer. Errors: OverLimit, Failed; the process is gone then."""
        if not select.select([self._process.stdout], [], [], limit)[0]:
            self._process.kill()
            self.close()
            raise OverLimit(f"more than {limit:g} s")
        line = b""
        while not line.endswith(b"\n"):
            part = self._process.stdout.read(65536)
            if not part:
                raise Failed(self._last_words())
            line += part
        return json.loads(line)

    def ask(self, command: str, limit: float) -> dict:
        """Its answer to a command; errors as `answer`."""
        with contextlib.suppress(BrokenPipeError):  # `answer` finds out how it ended
            self._process.stdin.write(command.encode() + b"\n")
        return self.answer(limit)

    def _last_words(self) -> str:
        code = self._process.wait()
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        self.close()
        if code < 0:
            return f"ended by signal {-code}" + (" (out of memory?)" if code == -9 else "")
        return lines[-1] if lines else f"ended with code {code}"

    def close(self) -> None:
        """End the process, by force where it does not end itself."""
        try:
            with contextlib.suppress(OSError, ValueError):  # it ended, or this was closed before
                self._process.stdin.write(b"quit\n")
            self._process.wait(2)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._errors):
            stream.close()


@dataclass
class Entry:
    """One measurement while it is made, and the row it becomes."""

    contender: Contender
    build: Build
    mesh: Mesh
    row: dict
    worker: Worker | None = None
    runs: int = 0
    repeats: int = 1
    seconds: list[float] = field(default_factory=list)

    def end(self, status: str, message: str) -> None:
        """Nothing more will come of it; runs that were made are kept."""
        if self.worker is not None:
            self.worker.close()
            self.worker = None
        if not self.seconds:
            self.row.update(status=status, message=message)
        else:
            self.row["message"] = message


class Comparison:
    """Runs tasks and collects rows."""

    def __init__(self, settings: Settings, builds: Iterable[Build] = (Build("this"),)) -> None:
        self.settings = settings
        self.builds = tuple(builds)
        self.rows: list[dict] = []
        self._given_up: dict[tuple, str] = {}

    def run(self, tasks: list[Task], report: Callable[[str], None] = lambda _: None) -> list[dict]:
        """All tasks on all meshes, ascending; `report` is told what is done, "" after each."""
        for task in tasks:
            for mesh in sorted(self.settings.meshes, key=lambda mesh: mesh.size):
                self._measure(task, mesh, report)
                report("")
        return self.rows

    def _entries(self, task: Task, mesh: Mesh) -> list[list[Entry]]:
        """What is to be measured; of each inner list (a peer's numbers of threads) the fastest."""
        result = []
        for contender in task.contenders:
            if not contender.ours and not self.settings.peers:
                continue
            cores = len(os.sched_getaffinity(0))
            builds = self.builds if contender.ours else self.builds[-1:]
            for build in builds:
                if contender.ours:
                    choices = [[threads] for threads in self.settings.threads]
                else:
                    choices = [[t for t in PEER_THREADS if t <= cores]]
                    if not contender.threaded:
                        choices = [[1]]
                for group in choices:
                    result.append(
                        [self._entry(task, contender, build, mesh, threads) for threads in group]
                    )
        return result

    def _entry(self, task: Task, contender: Contender, build: Build, mesh: Mesh, threads: int):
        row = {
            "task": task.name,
            "title": task.title,
            "contender": contender.name,
            "ours": contender.ours,
            "build": build.name,
            "mesh": mesh.name,
            "size": mesh.size,
            "threads": threads,
            "status": "measured",
        }
        return Entry(contender, build, mesh, row)

    def _measure(self, task: Task, mesh: Mesh, report: Callable[[str], None]) -> None:
        groups = self._entries(task, mesh)
        where = f"{task.name}, {mesh.name} of {mesh.size}"
        live: list[Entry] = []
        try:
            for group in groups:
                for entry in group:
                    report(f"{where}: {entry.contender.name}, setting up")
                    self._start(entry)
                live.append(_fastest(group))
            for turn in range(self.settings.runs):
                for entry in live:
                    if entry.worker is not None and turn < entry.runs:
                        report(f"{where}: {entry.contender.name}, run {turn + 1}")
                        self._turn(entry)
            for entry in live:
                self._finish(entry)
        finally:
            for group in groups:
                for entry in group:
                    if entry.worker is not None:
                        entry.worker.close()
        rows = [entry.row for entry in live]
        _add_ratios(rows)
        self.rows += rows

    def _key(self, entry: Entry) -> tuple:
        row = entry.row
        return row["task"], row["contender"], row["build"], row["threads"]

    def _give_up(self, entry: Entry, status: str, message: str) -> None:
        entry.end(status, message)
        self._given_up[self._key(entry)] = f"{status} at {entry.row['size']} vertices: {message}"

    def _start(self, entry: Entry) -> None:
        """Set up, the first call, and how many runs there will be."""
        if reason := self._given_up.get(self._key(entry)):
            entry.end("skipped", reason)
            return
        names = ("task", "contender", "size", "threads")
        request = {name: entry.row[name] for name in names}
        request["file"] = str(entry.mesh.file) if entry.mesh.file else None
        limit = self.settings.limit
        entry.worker = Worker(request, entry.build, ours=entry.contender.ours)
        try:
            answer = entry.worker.answer(SETUP_SHARE * limit)
            if "ready" not in answer:
                entry.end(answer["status"], answer["message"])
                return
            entry.row.update(vertices=answer["vertices"], faces=answer["faces"])
            warm = entry.worker.ask("warm", limit)
            seconds = warm["seconds"]
            if seconds < 1.0:
                tries = (entry.worker.ask("run 1", limit) for _ in range(TRIES))
                seconds = min(each["seconds"] for each in tries)
        except OverLimit as error:
            self._give_up(entry, "over the limit", str(error))
            return
        except Failed as error:
            entry.end("failed", str(error))
            return
        entry.row["peak_bytes"] = warm["peak_bytes"]
        entry.row["first_seconds"] = warm["seconds"]
        entry.row["seconds_with_threads"] = {str(entry.row["threads"]): seconds}
        entry.runs = self.settings.runs
        if seconds > SLOW:
            entry.runs = max(1, int(self.settings.runs * SLOW / seconds))
        entry.repeats = min(1000, max(1, math.ceil(SHORT / max(seconds, 1e-9))))

    def _turn(self, entry: Entry) -> None:
        try:
            answer = entry.worker.ask(f"run {entry.repeats}", self.settings.limit)
        except OverLimit as error:
            self._give_up(entry, "over the limit", str(error))
        except Failed as error:
            entry.end("failed", str(error))
        else:
            entry.seconds.append(answer["seconds"])

    def _finish(self, entry: Entry) -> None:
        if entry.seconds:
            entry.row["seconds"] = summary(entry.seconds)
        if entry.worker is None:
            return
        try:
            facts = entry.worker.ask("facts", SETUP_SHARE * self.settings.limit)
            entry.row["facts"] = facts["facts"]
        except (OverLimit, Failed) as error:
            entry.row["message"] = f"its result could not be judged: {error}"
        else:
            entry.worker.close()
        entry.worker = None


def _fastest(group: list[Entry]) -> Entry:
    """Of a peer with several numbers of threads, the fastest; the others end."""
    ready = [entry for entry in group if entry.worker is not None]
    if not ready:
        return group[0]

    def calibrated(entry: Entry) -> float:
        return next(iter(entry.row["seconds_with_threads"].values()))

    best = min(ready, key=calibrated)
    for entry in ready:
        best.row["seconds_with_threads"].update(entry.row["seconds_with_threads"])
        if entry is not best:
            entry.worker.close()
            entry.worker = None
    return best


def summary(seconds: list[float]) -> dict:
    """Median, quartiles and all of the runs."""
    low, middle, high = np.quantile(seconds, (0.25, 0.5, 0.75))
    return {
        "median": float(middle),
        "low": float(low),
        "high": float(high),
        "runs": len(seconds),
        "all": seconds,
    }


def _add_ratios(rows: list[dict]) -> None:
    """How many times as long as the first of ours (with most threads) each row took."""
    for build in dict.fromkeys(row["build"] for row in rows):
        ours = [r for r in rows if r["ours"] and r["build"] == build]
        if not ours:
            continue
        first = [r for r in ours if r["contender"] == ours[0]["contender"] and "seconds" in r]
        if not first:
            continue
        unit = max(first, key=lambda r: r["threads"])["seconds"]["median"]
        for row in rows:
            if row["build"] == build and "seconds" in row:
                row["times_ours"] = row["seconds"]["median"] / unit
