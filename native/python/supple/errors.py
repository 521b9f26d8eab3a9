# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of the package. Each message names what is wrong, where, and the fix."""


class SuppleError(ValueError):
    """Bad input or a failed computation.

    Attributes:
        code: what went wrong, for programs: "empty_mesh", "wrong_shape", "index_out_of_range",
            "not_finite", "empty_handle", "overlapping_handles", "no_handles", "singular_matrix",
            "stale_mesh", "model_file", "array_file", "bad_option", "not_positive_definite",
            "no_convergence", "cancelled"; of files "bad_case", "bad_set", "cannot_write".
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


class Cancelled(SuppleError):  # noqa: N818 - a wish granted, not an error
    """A long call stopped because its Progress was asked to cancel; nothing was changed."""


def from_native(code: str, message: str) -> SuppleError:
    """The exception for a native error."""
    return Cancelled(code, message) if code == "cancelled" else SuppleError(code, message)
