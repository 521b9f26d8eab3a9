# SPDX-License-Identifier: GPL-3.0-or-later
"""What the figures were made on and with."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("numpy", "scipy", "torch", "libigl", "cholespy", "pyfmaps", "scikit-learn")


def facts() -> dict:
    """Processor, its instruction sets, cores, memory, system."""
    cpu: dict[str, str] = {}
    path = Path("/proc/cpuinfo")
    if path.exists():
        for line in path.read_text().split("\n\n")[0].splitlines():
            name, _, value = line.partition(":")
            cpu[name.strip()] = value.strip()
    return {
        "cpu": cpu.get("model name", platform.processor() or "unknown"),
        "flags": sorted(cpu.get("flags", "").split()),
        "cores": len(os.sched_getaffinity(0)),
        "memory_bytes": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "load": os.getloadavg()[0],
        "system": platform.platform(),
        "python": platform.python_version(),
    }


def versions() -> dict[str, str | None]:
    """Of everything that is measured beside ours; None where it is not installed."""
    result: dict[str, str | None] = {}
    for package in PACKAGES:
        try:
            result[package] = version(package)
        except PackageNotFoundError:
            result[package] = None
    return result


def commit(folder: Path, reference: str = "HEAD") -> str | None:
    """The full name of a commit; "+changes" follows where HEAD's files were changed since."""

    def git(*arguments: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments], capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    try:
        name = git("rev-parse", "--verify", f"{reference}^{{commit}}")
        changed = reference == "HEAD" and git("status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.CalledProcessError):
        return None
    return name + ("+changes" if changed else "")
