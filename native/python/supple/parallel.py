# SPDX-License-Identifier: GPL-3.0-or-later
"""How many threads a call shares its work among."""

from . import _native
from .errors import SuppleError


def thread_count() -> int:
    """Threads of calls made from this thread. At first OMP_NUM_THREADS, or all processors."""
    return _native.thread_count()


def set_thread_count(count: int) -> None:
    """Set the threads of calls made from this thread, 1 or more; other threads keep theirs.

    Raises:
        SuppleError: bad_option.
    """
    try:
        _native.set_thread_count(count)
    except TypeError as error:
        raise SuppleError(
            "bad_option", f"The number of threads is {count!r}; it must be a whole number."
        ) from error
