# SPDX-License-Identifier: GPL-3.0-or-later
"""Run blender_tests in a Blender with a window system's binary, against the packaged add-on.

    blender -b --python-exit-code 1 -P blender_tests/run_in_blender.py -- [pytest arguments]

Blender starts again with user folders of its own, so that the user's settings and cache are neither
read nor changed. pytest is taken from SUPPLE_PYTEST_PATH, a site-packages folder for Blender's
Python, or from .venv; it comes last on the path, so that NumPy stays Blender's.
"""

import os
import shutil
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER_VARIABLE = "SUPPLE_TEST_FOLDER"


def start_again():
    """Replace this process by a Blender with empty user folders."""
    folder = tempfile.mkdtemp(prefix="supple-blender-")
    user = {
        "BLENDER_USER_RESOURCES": folder,  # 4.2 and later
        "BLENDER_USER_CONFIG": f"{folder}/config",
        "BLENDER_USER_SCRIPTS": f"{folder}/scripts",
        "BLENDER_USER_DATAFILES": f"{folder}/datafiles",
        "SUPPLE_CACHE_DIR": f"{folder}/prepared",
    }
    import bpy

    environment = {**os.environ, **user, FOLDER_VARIABLE: folder}
    os.execve(bpy.app.binary_path, [bpy.app.binary_path, *sys.argv[1:]], environment)


def add_pytest():
    python = f"python{sys.version_info.major}.{sys.version_info.minor}"
    default = ROOT / ".venv" / "lib" / python / "site-packages"
    sys.path.append(os.environ.get("SUPPLE_PYTEST_PATH", str(default)))


def main():
    if FOLDER_VARIABLE not in os.environ:
        start_again()
    add_pytest()
    import pytest

    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    try:
        code = pytest.main(
            [
                "-p",
                "no:cacheprovider",
                "--rootdir",
                str(ROOT),
                str(ROOT / "blender_tests"),
                *arguments,
            ]
        )
    finally:
        shutil.rmtree(os.environ[FOLDER_VARIABLE], ignore_errors=True)
    sys.stdout.flush()
    if code:
        sys.exit(int(code))


main()
