# SPDX-License-Identifier: GPL-3.0-or-later
"""What a task and its contenders are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from supple_training.compare.shapes import Case


class NotAvailable(Exception):  # noqa: N818 - an answer, not an error
    """This build has no such function; the message names it."""


@dataclass
class Ready:
    """Work that was set up, to be called any number of times.

    Attributes:
        call: does it once, all of it, and returns what it made. Only this is timed.
        facts: from what `call` returned to figures that say how good it is, by name.
        before: run before each call, untimed.
        close: run at the end.
    """

    call: Callable[[], object]
    facts: Callable[[object], dict[str, float | int | str]] = field(default=lambda _: {})
    before: Callable[[], None] = field(default=lambda: None)
    close: Callable[[], None] = field(default=lambda: None)


@dataclass(frozen=True)
class Contender:
    """One way to do a task.

    Attributes:
        setup: runs in a process of its own, with `threads` threads; raises NotAvailable or
            ImportError where it cannot be had.
        threaded: False where it never uses more than one thread, so that more are not tried.
    """

    name: str
    setup: Callable[[Case, int], Ready]
    ours: bool = False
    threaded: bool = True


@dataclass(frozen=True)
class Task:
    """One thing to be done. The first of ours is what all others are compared with."""

    name: str
    title: str
    contenders: tuple[Contender, ...]


def attribute(path: str) -> object:
    """A function of the package by its dotted path, as "supple.geometry.eigenbasis".

    Raises:
        NotAvailable: where this build has none.
    """
    import importlib

    module, _, name = path.rpartition(".")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise NotAvailable(path) from error


def accepts(function: Callable, option: str, path: str) -> None:
    """Raise NotAvailable unless `function` has the option."""
    import inspect

    if option not in inspect.signature(function).parameters:
        raise NotAvailable(f"{path}({option}=)")
