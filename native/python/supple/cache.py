# SPDX-License-Identifier: GPL-3.0-or-later
"""Prepared meshes kept on disk: a mesh is prepared once, not once a session.

Files are found by their content (geometry and settings), checked when they are read, and removed,
the least recently used first, when they take more than the cap. What a program does not name comes
from the environment:

    SUPPLE_CACHE_DIR    the folder; else the platform's for a user's caches
    SUPPLE_CACHE_MAX    the most it may take, in MiB; else 2048
    SUPPLE_CACHE        0 keeps and uses nothing
"""

import os
import sys
from pathlib import Path
from typing import NamedTuple

from . import _native
from .errors import SuppleError

MEBIBYTE = 1 << 20
# About 50 meshes of 40,000 vertices.
DEFAULT_MAX_MEBIBYTES = 2048


class CacheSize(NamedTuple):
    """How much there is: the number of files and their bytes."""

    files: int
    bytes: int


def folder() -> Path:
    """Where prepared meshes are kept; need not exist yet.

    Raises:
        SuppleError: bad_option where neither the environment nor the system names a folder.
    """
    named = os.environ.get("SUPPLE_CACHE_DIR")
    try:
        return Path(named).expanduser().absolute() if named else _platform_folder()
    except RuntimeError as error:
        raise SuppleError(
            "bad_option",
            f"There is no folder for prepared meshes: {error} Name one in SUPPLE_CACHE_DIR, or "
            "set SUPPLE_CACHE=0.",
        ) from error


def _platform_folder() -> Path:
    """The platform's folder for a user's caches. RuntimeError where a user has no home."""
    if sys.platform == "win32":
        local = os.environ.get("LOCALAPPDATA")
        caches = Path(local) if local else Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        caches = Path.home() / "Library" / "Caches"
    else:
        # The XDG specification: a relative path is to be ignored.
        xdg = Path(os.environ.get("XDG_CACHE_HOME") or ".")
        caches = xdg if xdg.is_absolute() else Path.home() / ".cache"
    return caches / "supple" / "prepared"


def max_bytes() -> int:
    """The most it may take, in bytes.

    Raises:
        SuppleError: bad_option where SUPPLE_CACHE_MAX is no number of MiB.
    """
    text = os.environ.get("SUPPLE_CACHE_MAX") or str(DEFAULT_MAX_MEBIBYTES)
    if not (text.isascii() and text.isdigit() and len(text) < 12):
        raise SuppleError(
            "bad_option",
            f"SUPPLE_CACHE_MAX is '{text}'; give a whole number of MiB, such as "
            f"{DEFAULT_MAX_MEBIBYTES}.",
        )
    return int(text) * MEBIBYTE


def enabled() -> bool:
    """Whether the cache is used where a program does not say: not with SUPPLE_CACHE=0."""
    return os.environ.get("SUPPLE_CACHE") != "0"


def default(max_mebibytes: int | None = None) -> _native.PreparedCache | None:
    """The cache that PreparedMesh uses with cache=True; None where it is not enabled.

    Args:
        max_mebibytes: the most it may take, instead of max_bytes().

    Raises:
        SuppleError: bad_option, as folder and max_bytes.
    """
    if not enabled():
        return None
    cap = max_bytes() if max_mebibytes is None else max_mebibytes * MEBIBYTE
    return _native.PreparedCache(folder(), cap)


def size() -> CacheSize:
    """What is kept now, enabled or not."""
    return CacheSize(*_native.PreparedCache(folder(), 0).size())


def clear() -> CacheSize:
    """Remove all prepared meshes; return what was removed. Other files are left alone."""
    return CacheSize(*_native.PreparedCache(folder(), 0).clear())
