# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds of a checkout and of another commit of it, each installed in a folder of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class BuildError(Exception):
    """A build that failed; the message ends with its last lines."""


def _run(what: str, *command: object, folder: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        # Older commits' scripts/package.py does not name the right Spectra itself.
        env={"spectra_ROOT": "/usr", **os.environ, "PATH": path, "PYTHONPATH": ""},
    )
    if done.returncode:
        lines = "\n".join(done.stdout.splitlines()[-15:])
        raise BuildError(f"{what} failed (code {done.returncode}):\n{lines}")


def install(checkout: Path, site: Path) -> None:
    """The wheel of `checkout`, built as it is for a release, unpacked into `site`."""
    _run("building the wheel", sys.executable, "scripts/package.py", "wheel", folder=checkout)
    tag = f"cp{sys.version_info.major}{sys.version_info.minor}"
    wheels = sorted((checkout / "dist").glob(f"supple-*-{tag}-*.whl"))
    if len(wheels) != 1:
        raise BuildError(f"{checkout / 'dist'} has {len(wheels)} wheels for {tag}, not one")
    pip = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-input", "--quiet"]
    _run("unpacking the wheel", *pip, "--target", site, wheels[0], folder=checkout)


@contextmanager
def both(checkout: Path, reference: str, report=lambda _: None) -> Iterator[tuple[Path, Path]]:
    """The folders of two installed builds: of `reference`, and of `checkout` as it lies there.

    Only the package is taken from the two; both are measured by the commands of this one.

    Errors: BuildError.
    """
    with tempfile.TemporaryDirectory(prefix="supple-compare-") as made:
        folder = Path(made)
        tree = folder / "tree"
        report(f"building {reference}")
        git = ["git", "-C", checkout, "worktree"]
        _run("git worktree add", *git, "add", "--detach", tree, reference, folder=checkout)
        try:
            install(tree, folder / "base")
            report("building this checkout")
            install(checkout, folder / "new")
            yield folder / "base", folder / "new"
        finally:
            _run("git worktree remove", *git, "remove", "--force", tree, folder=checkout)
