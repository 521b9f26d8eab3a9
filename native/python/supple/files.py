# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing files whole or not at all."""

import contextlib
import os
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

from .errors import SuppleError


def write_whole(path: str | os.PathLike, content: str | bytes) -> None:
    """Write a file, or leave what was there as it was, even where the power fails.

    Folders are made. What is no regular file (a pipe, /dev/stdout) is written to as it is.

    Raises:
        SuppleError: cannot_write, naming the file and why.
    """
    data = content.encode() if isinstance(content, str) else content
    replace_whole(path, lambda partial: partial.write_bytes(data))


def replace_whole(path: str | os.PathLike, write: Callable[[Path], object]) -> None:
    """The same for a file that `write` writes at the path it is called with, of the same ending."""
    check_output(path)
    path = Path(path)
    try:
        if _is_special(path):
            write(path)
            return
        path = Path(os.path.realpath(path))  # a link stays one
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f".{path.stem}.partial{path.suffix}")
        try:
            write(partial)
            with open(partial, "rb+") as file:
                os.fsync(file.fileno())
            if path.exists():
                shutil.copymode(path, partial)
            os.replace(partial, path)
        except BaseException:
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise SuppleError(
            "cannot_write",
            f"{path} cannot be written: {error.strerror or error}. Name another place, or make "
            "room and allow writing there.",
        ) from error


def _is_special(path: Path) -> bool:
    """A pipe, a terminal, a device: what a link under /dev leads to may have no name of its own."""
    return path.exists() and (not path.is_file() or path.parts[:2] == ("/", "dev"))


def check_output(path: str | os.PathLike) -> None:
    """What can be known before long work: that it names a file, in a folder.

    Raises:
        SuppleError: cannot_write.
    """
    path = Path(path)
    if not path.name:
        raise SuppleError("cannot_write", f"'{path}' names no file to write.")
    if path.is_dir():
        raise SuppleError("cannot_write", f"{path} is a folder; name a file in it.")
    if path.exists() and not os.access(path, os.W_OK):
        raise SuppleError(
            "cannot_write", f"{path} may not be written to; allow it or name another."
        )
    for folder in path.parents:
        if folder.exists():
            if not folder.is_dir():
                raise SuppleError(
                    "cannot_write", f"{path} cannot be written: {folder} is a file, not a folder."
                )
            break


def check_outputs(
    outputs: Iterable[str | os.PathLike | None], inputs: Iterable[str | os.PathLike | None] = ()
) -> None:
    """The same for all that a command will write, None left out: each a file of its own, and none
    of them one that it reads.

    Raises:
        SuppleError: cannot_write.
    """
    read = {os.path.realpath(path) for path in inputs if path is not None}
    seen: set[str] = set()
    for path in outputs:
        if path is None:
            continue
        check_output(path)
        real = os.path.realpath(path)
        if real in read:
            raise SuppleError("cannot_write", f"{path} is read by this command; write elsewhere.")
        if real in seen:
            raise SuppleError("cannot_write", f"{path} is named for two outputs.")
        seen.add(real)
