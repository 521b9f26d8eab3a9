# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of a job file (TOML), checked key by key. Every message names the file and the key."""

import tomllib
from pathlib import Path

import numpy as np

from .errors import UserError


class Table:
    """A TOML table whose keys are taken one by one; what is left over at the end is an error."""

    def __init__(self, data, file, where):
        self.file = file
        self._data, self._where = dict(data), where
        self._known = []

    def error(self, key, message):
        return UserError(f"{self.file}: {self._where}{key}: {message}")

    def take(self, key, kind, default=None, *, required=False):
        """Return the value of `key`, checked to be a `kind`, which is a key of NAMES."""
        self._known.append(key)
        if key not in self._data:
            if required:
                raise self.error(key, "missing; it must be given")
            return default
        value = self._data.pop(key)
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind:
            raise self.error(key, f"must be a {NAMES[kind]}, not {value!r}")
        return value

    def has(self, key):
        return key in self._data

    def table(self, key, *, required=False):
        """Return the table `key` as a Table, or None."""
        data = self.take(key, dict, required=required)
        return None if data is None else Table(data, self.file, f"{self._where}{key}.")

    def choice(self, key, options, default):
        value = self.take(key, str, default)
        if value not in options:
            raise self.error(key, f"must be one of {', '.join(options)}, not '{value}'")
        return value

    def path(self, key, folder, *, required=False, suffix=""):
        """Return a path that ends in suffix, taken from `folder` if it is relative, or None."""
        value = self.take(key, str, required=required)
        if value is None:
            return None
        path = folder / value
        if suffix and path.suffix != suffix:
            raise self.error(key, f"must end in {suffix}, not '{path.name}'")
        return path

    def numbers(self, key, shape):
        """Return an array of finite numbers of this shape, or None."""
        value = self.take(key, list)
        if value is None:
            return None
        text = " x ".join(map(str, shape))
        try:
            array = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise self.error(key, f"must be {text} numbers") from None
        if array.shape != shape or not np.isfinite(array).all():
            raise self.error(key, f"must be {text} finite numbers")
        return array

    def end(self):
        for key in self._data:
            raise self.error(key, f"unknown; the keys here are {', '.join(self._known)}")


NAMES = {
    str: "text",
    bool: "true or false",
    int: "whole number",
    float: "number",
    list: "list",
    dict: "table",
}


def load(path):
    """Return the Table of TOML file `path`, with an absolute `file`. Raises UserError."""
    path = Path(path).absolute()
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path}: can't be read: {error.strerror}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise UserError(f"{path}: not a TOML file: {error}") from error
    return Table(data, path, "")
