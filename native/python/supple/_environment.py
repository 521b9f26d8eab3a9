# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the native module in the environment that the libraries under it need.

They read it when they load. Afterwards it is as it was: a program started from here, or a library
loaded later, is not to calculate otherwise because of us.
"""

import os
import re
from pathlib import Path


def _kernels() -> str | None:
    """OpenBLAS's name for the kernels this processor runs best, or None to leave it to OpenBLAS."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return None
    found = re.search(r"^flags\s*:(.*)$", text, re.MULTILINE)
    flags = set(found[1].split()) if found else set()
    if {"avx512f", "avx512bw", "avx512dq", "avx512vl", "avx512cd"} <= flags:
        return "SkylakeX"
    if {"avx2", "fma"} <= flags:
        return "Haswell"
    return None


def _load() -> None:
    wanted = {
        # OpenMP's threads spin between loops unless told to sleep, and beside a busy Blender that
        # costs far more than waking them (measured 17 times on 2 cores). A moment of it, some
        # microseconds, is worth it: the loops of a frame follow each other closely (passes of an
        # edit on an idle machine are twice as fast, beside one busy core half as slow again).
        "OMP_WAIT_POLICY": "passive",
        "GOMP_SPINCOUNT": "1000",
        # OpenBLAS knows processors by their model number and takes kernels of 2004 for one newer
        # than itself (measured 3 to 6 times slower). What a processor can do is in its flags.
        "OPENBLAS_CORETYPE": _kernels(),
    }
    ours = {name: value for name, value in wanted.items() if value and name not in os.environ}
    os.environ.update(ours)
    try:
        from . import _native  # noqa: F401
    finally:
        for name in ours:
            del os.environ[name]


_load()
