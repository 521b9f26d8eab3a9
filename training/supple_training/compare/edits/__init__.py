# SPDX-License-Identifier: GPL-3.0-or-later
"""How good edits are and how long they take, beside what else makes them.

    python -m supple_training.compare edit DIR...

Words: a case is one edit to make (a folder that `supple.cases` reads); a contender is one way to
make it, ours or a peer's (`contenders.py` lists them); a row is one contender's figures on one
case. All contenders get the same handles and are judged by the same functions (`figures.py`).
"""
