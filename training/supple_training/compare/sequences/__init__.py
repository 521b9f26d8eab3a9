# SPDX-License-Identifier: GPL-3.0-or-later
"""How near whole sequences come to the truth, and how smooth they are, beside libigl's ARAP.

    python -m supple_training.compare sequence DIR...

Words as in the package `edits`; a case is a sequence (a folder that `supple_training.sequences`
describes), and each contender makes every frame by itself, from the rest shape.
"""
