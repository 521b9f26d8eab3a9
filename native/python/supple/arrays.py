# SPDX-License-Identifier: GPL-3.0-or-later
"""Checked conversion of what callers pass to the arrays the native module takes."""

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from .errors import SuppleError


def array(value: ArrayLike, name: str) -> NDArray:
    """Real numbers in any shape. Errors: wrong_shape."""
    try:
        result = np.asarray(value)
    except ValueError as error:
        raise SuppleError("wrong_shape", f"{name} is not a regular array: {error}.") from error
    if result.dtype.kind not in "fiub":
        raise SuppleError("wrong_shape", f"{name} holds {result.dtype} values, not numbers.")
    return result


def number(value: object, name: str) -> float:
    """One real number. Errors: wrong_shape."""
    found = array(value, name)
    if found.ndim != 0:
        raise SuppleError("wrong_shape", f"{name} has shape {found.shape}; it must be one number.")
    return float(found)


def whole(value: object, name: str) -> int:
    """One whole number. Errors: wrong_shape."""
    if not number(value, name).is_integer() or isinstance(value, bool):
        raise SuppleError("wrong_shape", f"{name} is {value}; it must be a whole number.")
    return int(value)


def points(value: ArrayLike, name: str = "vertices", dtype: DTypeLike = np.float64) -> NDArray:
    """(n, 3), float64 where not told, C order. Errors: wrong_shape."""
    found = array(value, name)
    if found.ndim != 2 or found.shape[1] != 3:
        raise SuppleError("wrong_shape", f"{name} has shape {found.shape}; it must be (n, 3).")
    return np.ascontiguousarray(found, dtype=dtype)


def rows(value: ArrayLike, name: str) -> NDArray[np.float64]:
    """(n, k) float64, C order. Errors: wrong_shape."""
    found = array(value, name)
    if found.ndim != 2:
        raise SuppleError("wrong_shape", f"{name} has shape {found.shape}; it must be (n, k).")
    return np.ascontiguousarray(found, dtype=np.float64)


def numbers(value: ArrayLike, name: str) -> NDArray[np.float64]:
    """(n,) float64. Errors: wrong_shape."""
    found = array(value, name)
    if found.ndim != 1:
        raise SuppleError("wrong_shape", f"{name} has shape {found.shape}; it must be a list.")
    return np.ascontiguousarray(found, dtype=np.float64)


def matrices(value: ArrayLike, name: str) -> NDArray[np.float64]:
    """(m, 9) float64 of (m, 3, 3) matrices. Errors: wrong_shape."""
    found = array(value, name)
    if found.ndim != 3 or found.shape[1:] != (3, 3):
        raise SuppleError("wrong_shape", f"{name} has shape {found.shape}; it must be (m, 3, 3).")
    return np.ascontiguousarray(found.reshape(-1, 9), dtype=np.float64)


def triangles(value: ArrayLike, name: str = "faces") -> NDArray[np.int32]:
    """(m, 3) int32, C order. Errors: wrong_shape, also for indices that are not whole numbers."""
    found = array(value, name)
    if found.size == 0:
        return np.zeros((0, 3), dtype=np.int32)
    if found.ndim != 2 or found.shape[1] != 3:
        raise SuppleError(
            "wrong_shape",
            f"{name} has shape {found.shape}; it must be (m, 3): triangles. "
            "Triangulate larger polygons first.",
        )
    return _whole(found, name)


def indices(value: ArrayLike, name: str) -> NDArray[np.int32]:
    """(k,) int32. Errors: wrong_shape."""
    found = array(value, name)
    if found.size == 0:
        return np.zeros(0, dtype=np.int32)
    if found.ndim != 1:
        raise SuppleError("wrong_shape", f"{name} has shape {found.shape}; it must be a list.")
    return _whole(found, name)


def matrix4(value: ArrayLike, name: str) -> NDArray[np.float64]:
    """(4, 4) float64, column-vector convention. Errors: wrong_shape."""
    found = array(value, name)
    if found.shape != (4, 4):
        raise SuppleError("wrong_shape", f"{name} has shape {found.shape}; it must be (4, 4).")
    return np.ascontiguousarray(found, dtype=np.float64)


def _whole(found: NDArray, name: str) -> NDArray[np.int32]:
    limits = np.iinfo(np.int32)
    if found.dtype.kind == "b" or (
        found.dtype.kind == "f" and not np.array_equal(found, np.round(found))
    ):
        raise SuppleError("wrong_shape", f"{name} holds values that are not whole numbers.")
    if found.max() > limits.max or found.min() < limits.min:
        raise SuppleError("index_out_of_range", f"{name} holds indices beyond 2**31.")
    return np.ascontiguousarray(found, dtype=np.int32)
