# SPDX-License-Identifier: GPL-3.0-or-later
"""No test touches the user's own cache of prepared meshes."""

import pytest


@pytest.fixture(scope="session", autouse=True)
def cache_of_this_run(tmp_path_factory):
    """Commands that tests start inherit it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SUPPLE_CACHE_DIR", str(tmp_path_factory.mktemp("prepared")))
        patch.delenv("SUPPLE_CACHE_MAX", raising=False)
        patch.delenv("SUPPLE_CACHE", raising=False)
        yield
