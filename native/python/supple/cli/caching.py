# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `supple cache`."""

from typing import Annotated

import typer

import supple

from .console import print_error


def show_cache(
    clear: Annotated[bool, typer.Option("--clear", help="Remove all of it.")] = False,
) -> None:
    """Show where prepared meshes are kept on disk and what they take, or remove them."""
    try:
        removed = supple.cache.clear() if clear else None
        kept, cap, enabled = supple.cache.size(), supple.cache.max_bytes(), supple.cache.enabled()
    except supple.SuppleError as error:
        print_error(error)
        raise typer.Exit(1) from error
    lines = {
        "folder": str(supple.cache.folder()),
        "in use": "yes" if enabled else "no (SUPPLE_CACHE=0)",
        "meshes": str(kept.files),
        "size": f"{kept.bytes / supple.cache.MEBIBYTE:.1f} MiB",
        "cap": f"{cap / supple.cache.MEBIBYTE:.1f} MiB",
    }
    if removed is not None:
        lines["removed"] = f"{removed.files} ({removed.bytes / supple.cache.MEBIBYTE:.1f} MiB)"
    # Plain lines: a folder's name must not be broken to the width of a window.
    for name, value in lines.items():
        typer.echo(f"{name:<8} {value}")
