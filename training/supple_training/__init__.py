# SPDX-License-Identifier: GPL-3.0-or-later
"""Training data, training and evaluation for Supple.

`bodies` samples people and poses from anny, `remesh` gives each its own triangulation, `pairs` puts
both together; `data`, `train` and `sample_human` are commands (`python -m supple_training.train`).
"""
