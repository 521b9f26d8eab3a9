# SPDX-License-Identifier: GPL-3.0-or-later
"""Installing the packaged add-on into the Blender that runs this, as a user would."""

import importlib
import os
import sys
from pathlib import Path

import addon_utils
import bpy

ROOT = Path(__file__).resolve().parent.parent


def archive(kind):
    """Return the newest dist/*-KIND.zip for this Python; SUPPLE_ADDON_ZIP names another."""
    if "SUPPLE_ADDON_ZIP" in os.environ:
        return Path(os.environ["SUPPLE_ADDON_ZIP"]).resolve()
    abi = f"cp{sys.version_info.major}{sys.version_info.minor}"
    found = sorted(
        (ROOT / "dist").glob(f"*{abi}*-{kind}.zip"), key=lambda path: path.stat().st_mtime
    )
    if not found:
        raise FileNotFoundError(
            f"dist/ has no {kind} archive for {abi}. Build it: python scripts/package.py"
        )
    return found[-1]


def install():
    """Install and enable the add-on; return the name of its package."""
    if bpy.app.version < (4, 2, 0):
        bpy.ops.preferences.addon_install(filepath=str(archive("legacy")), overwrite=True)
        name = "supple_blender"
        addon_utils.modules_refresh()
        addon_utils.enable(name, default_set=True, persistent=True)
    else:
        bpy.ops.extensions.package_install_files(
            filepath=str(archive("extension")), repo="user_default", enable_on_install=True
        )
        name = "bl_ext.user_default.supple"
    if not addon_utils.check(name)[1]:
        raise RuntimeError(f"{name} is installed but could not be enabled; see the output above")
    importlib.import_module(name)
    return name
