# SPDX-License-Identifier: GPL-3.0-or-later
"""The one exception that reaches people."""


class UserError(Exception):
    """Something the user can put right. The message names the object, the number and the fix."""


class CancelledError(Exception):
    """The user pressed Esc; nothing was written."""


def count(number, one, many):
    """Return the number with its noun: '1 vertex', '2,000 vertices'."""
    return f"{number:,} {one if number == 1 else many}"


def some(names, limit=3):
    """Return `names` as text, quoted, cut after `limit`."""
    names = list(names)
    text = ", ".join(f"'{name}'" for name in names[:limit])
    more = len(names) - limit
    return f"{text} and {more} more" if more > 0 else text
