# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets what the libraries under the native module read from the environment when they load.

On import, because it has to come before the native module's.
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


def _prepare() -> None:
    # OpenMP's threads spin between loops unless told to sleep, and beside a busy Blender that costs
    # far more than waking them (measured 17 times on 2 cores).
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    # OpenBLAS knows processors by their model number and takes kernels of 2004 for one newer than
    # itself (measured 3 to 6 times slower). What a processor can do is in its flags.
    if "OPENBLAS_CORETYPE" not in os.environ and (kernels := _kernels()):
        os.environ["OPENBLAS_CORETYPE"] = kernels


_prepare()
