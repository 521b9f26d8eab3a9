# SPDX-License-Identifier: GPL-3.0-or-later
"""Refinement of maps beside pyFM's and other classical ways, on a set with known answers."""
