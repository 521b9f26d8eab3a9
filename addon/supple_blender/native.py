# SPDX-License-Identifier: GPL-3.0-or-later
"""The native package `supple`: where it comes from, and what to say when it is not there.

An extension brings it as a wheel, which Blender puts on the path. The legacy zip carries it
unpacked in the folder `vendor`. A failed import is kept as a message, so that the add-on still
registers.
"""

import importlib
import platform
import sys
from pathlib import Path

from .errors import UserError

_VENDOR = Path(__file__).parent / "vendor"
_module = None
_problem = ""


def _python():
    return f"{sys.version_info.major}.{sys.version_info.minor}"


def _explain(error):
    return (
        f"Supple's native part does not load here ({platform.system()} {platform.machine()}, "
        f"Python {_python()}): {error}. Install the Supple zip made for this system and "
        f"Python {_python()}, then restart Blender."
    )


def _check_version(module):
    from . import VERSION

    packaged = ".".join(str(number) for number in VERSION)
    if VERSION != (0, 0, 0) and module.__version__ != packaged:
        raise ImportError(
            f"version {module.__version__} is loaded from {Path(module.__file__).parent} "
            f"but the add-on is {packaged}"
        )


def _load():
    global _module, _problem
    if _VENDOR.is_dir() and str(_VENDOR) not in sys.path:
        sys.path.insert(0, str(_VENDOR))
    try:
        module = importlib.import_module("supple")
        _check_version(module)
    except (ImportError, OSError) as error:
        _problem = _explain(error)
        return
    _module, _problem = module, ""


def problem():
    """Return why the native part does not load, in one sentence with the fix, or ''."""
    if _module is None and not _problem:
        _load()
    return _problem


def supple():
    """Return the module `supple`. Raises UserError if it can't be loaded."""
    if problem():
        raise UserError(_problem)
    return _module
