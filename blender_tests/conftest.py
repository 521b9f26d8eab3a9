# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures: the installed add-on, an empty file for each test, and bodies of known shape."""

import importlib
import sys
from pathlib import Path

import bpy
import pytest

sys.path.insert(0, str(Path(__file__).parent))

import install
import pairs


@pytest.fixture(scope="session")
def package():
    """The name of the installed add-on's package."""
    return install.install()


@pytest.fixture
def addon(package):
    """Return a function that imports a module of the installed add-on: addon("api")."""
    return lambda name: importlib.import_module(f"{package}.{name}")


@pytest.fixture(autouse=True)
def empty_file(package):
    bpy.ops.wm.read_homefile(use_empty=True)


@pytest.fixture
def pair():
    """A body, its copy in another order, and that order."""
    return pairs.bare_pair()
