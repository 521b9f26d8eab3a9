# SPDX-License-Identifier: GPL-3.0-or-later
"""Every task, by name."""

from __future__ import annotations

from supple_training.compare import editing, kernels, networks
from supple_training.compare.contender import Contender, Task

TASKS: dict[str, Task] = {
    task.name: task for module in (kernels, networks, editing) for task in module.TASKS
}


def find(task: str, contender: str) -> Contender:
    """A contender by its names. Errors: KeyError."""
    for each in TASKS[task].contenders:
        if each.name == contender:
            return each
    raise KeyError(contender)


def chosen(names: list[str]) -> list[Task]:
    """The tasks whose names begin with one of `names`; all where there are none.

    Errors: ValueError naming the first name that fits no task.
    """
    for name in names:
        if not any(task.startswith(name) for task in TASKS):
            raise ValueError(f"there is no task '{name}'; there are: {', '.join(TASKS)}")
    return [
        task
        for name, task in TASKS.items()
        if not names or any(name.startswith(begin) for begin in names)
    ]
