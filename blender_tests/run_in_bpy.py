# SPDX-License-Identifier: GPL-3.0-or-later
"""Run blender_tests in the Python package `bpy`, against the packaged extension.

    VENV/bin/python blender_tests/run_in_bpy.py [pytest arguments]

VENV holds bpy, pytest and the NumPy that this bpy wants. The extension is installed into a
temporary folder, so that the user's settings and cache are neither read nor changed.
"""

import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def main():
    with tempfile.TemporaryDirectory(prefix="supple-bpy-") as folder:
        os.environ["BLENDER_USER_RESOURCES"] = folder  # read when bpy is imported
        os.environ["SUPPLE_CACHE_DIR"] = f"{folder}/prepared"
        import bpy  # noqa: F401
        import pytest

        return pytest.main(
            [
                *("-p", "no:cacheprovider", "--rootdir", str(ROOT)),
                str(ROOT / "blender_tests"),
                *sys.argv[1:],
            ]
        )


if __name__ == "__main__":
    sys.exit(main())
