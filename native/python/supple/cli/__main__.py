# SPDX-License-Identifier: GPL-3.0-or-later
"""`python -m supple.cli`."""

from supple.cli import app

app()
