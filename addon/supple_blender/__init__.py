# SPDX-License-Identifier: GPL-3.0-or-later
"""Supple for Blender: pose meshes by their vertex groups, match them, carry what they have across.

`supple_blender.api` (in an extension: `bl_ext.user_default.supple.api`) is the Python interface;
the operators `bpy.ops.supple.*` and the sidebar tab "Supple" are thin layers over it.
"""

bl_info = {
    "name": "Supple",
    "author": "The Supple developers",
    "version": (0, 0, 0),
    "blender": (3, 4, 0),
    "location": "View3D > Sidebar > Supple",
    "description": "Pose meshes by vertex groups, keep their detail, match and transfer",
    "category": "Mesh",
}

# Kept apart from bl_info, which Blender replaces when the add-on is an extension.
VERSION = bl_info["version"]

from . import (  # noqa: E402
    compat,
    handle_operators,
    landmark_click,
    landmark_operators,
    live_operators,
    match_operators,
    match_panel,
    match_properties,
    match_view_operators,
    panel,
    pose_operators,
    preferences,
    properties,
    sequence_operators,
    sequence_panel,
    sequence_preview,
    sequence_properties,
    transfer_operators,
)

_MODULES = (
    *(preferences, properties, pose_operators, handle_operators, live_operators, panel),
    *(match_properties, match_operators, match_view_operators, landmark_operators),
    *(sequence_properties, sequence_preview, sequence_operators, sequence_panel),
    *(landmark_click, transfer_operators, match_panel),
)
_cli_commands = []


def _run_command(arguments):
    """`blender --command supple JOB.toml [--out DIR]`."""
    from . import job

    return job.main(arguments)


def register():
    for module in _MODULES:
        module.register()
    _cli_commands.extend(compat.register_cli_command("supple", _run_command))


def unregister():
    while _cli_commands:
        compat.unregister_cli_command(_cli_commands.pop())
    for module in reversed(_MODULES):
        module.unregister()
