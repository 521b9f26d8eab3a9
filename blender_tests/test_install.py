# SPDX-License-Identifier: GPL-3.0-or-later
"""The packaged add-on, as installed: complete, self-contained, and readable when it can't work."""

import platform
import sys
from pathlib import Path

import addon_utils
import bodies
import bpy
import pytest


def test_native_part_comes_from_the_archive(addon):
    supple = addon("native").supple()
    installed = Path(addon("native").__file__).parent
    beside = installed / "vendor"
    if bpy.app.version >= (4, 2, 0):
        beside = installed.parents[1] / ".local"
    assert Path(supple.__file__).is_relative_to(beside)


def test_version_is_that_of_the_native_part(addon, package):
    version = sys.modules[package].VERSION
    assert version > (0, 0, 0)
    assert ".".join(map(str, version)) == addon("native").supple().__version__


def test_disable_and_enable_again(package):
    addon_utils.disable(package)
    assert not hasattr(bpy.types.Object, "supple")
    addon_utils.enable(package)
    bodies.add_bar()
    assert bpy.ops.supple.handles_from_groups() == {"FINISHED"}


@pytest.fixture
def broken_native(addon, monkeypatch):
    """The add-on in a Blender where the native part can't be imported."""
    native = addon("native")
    monkeypatch.setattr(native, "_module", None)
    monkeypatch.setattr(native, "_problem", "")
    monkeypatch.setitem(sys.modules, "supple", None)  # importing it now raises ImportError
    return native


def test_failed_native_import_still_registers(package, broken_native):
    addon_utils.disable(package)
    addon_utils.enable(package)
    assert addon_utils.check(package)[1]
    python = f"Python {sys.version_info.major}.{sys.version_info.minor}"
    message = broken_native.problem()
    for part in (platform.system(), platform.machine(), python, "Install the Supple zip"):
        assert part in message
    assert "\n" not in message


def test_failed_native_import_is_one_readable_report(broken_native):
    bodies.add_bar()
    with pytest.raises(RuntimeError, match="native part does not load here"):
        bpy.ops.supple.prepare()


def test_another_version_of_the_native_part_is_refused(addon, monkeypatch):
    native = addon("native")
    monkeypatch.setattr(native.supple(), "__version__", "9.9.9")
    monkeypatch.setattr(native, "_module", None)
    monkeypatch.setattr(native, "_problem", "")
    assert "9.9.9" in native.problem()
    assert "restart Blender" in native.problem()
