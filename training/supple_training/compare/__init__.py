# SPDX-License-Identifier: GPL-3.0-or-later
"""How long Supple's kernels and tasks take, and how good its edits are, beside what else does it.

    python -m supple_training.compare speed --sizes 1000,10000 --out speed
    python -m supple_training.compare speed --against main
    python -m supple_training.compare diff old/speed.json new/speed.json
    python -m supple_training.compare edit DIR...
    python -m supple_training.compare sequence DIR...
    python -m supple_training.compare refine SET_DIR

Words: a task is one thing to be done (`tasks.py` lists them); a contender is one way to do it, ours
or a peer's; a measurement is one contender at one size with one number of threads. Each measurement
has a process of its own (`worker.py`), so that its threads, its memory and its crashes are its own;
`runner.py` lets the processes take turns. The comparison of edits is the
package `edits`, that of whole sequences the package `sequences`, that of refined maps the package
`maps`.
"""
