# SPDX-License-Identifier: GPL-3.0-or-later
"""What a refused operator must leave behind: one message. Apart, as a window has no pytest."""

import pairs
import pytest


def refuse(operator, match):
    """Assert that the operator reports an error that matches, and that the file stays as it was."""
    before = pairs.everything()
    with pytest.raises(RuntimeError, match=match) as caught:
        operator()
    assert "Traceback" not in str(caught.value)
    assert pairs.everything() == before
