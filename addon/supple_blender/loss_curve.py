# SPDX-License-Identifier: GPL-3.0-or-later
"""A loss as text: figures, and a curve of the characters that Blender's fonts have."""

BARS = "▁▂▃▄▅▆▇█"
WIDTH = 20


def curve(losses, width=WIDTH):
    """Return a bar a loss, from the least to the largest of them; of many, evenly chosen ones."""
    last = len(losses) - 1
    if last >= width:
        losses = [losses[round(index * last / (width - 1))] for index in range(width)]
    least, largest = min(losses), max(losses)
    span = (largest - least) or 1.0
    return "".join(BARS[round((len(BARS) - 1) * (loss - least) / span)] for loss in losses)


def figures(losses):
    """Return the first and the last loss, such as 'Loss 287 to 192'."""
    ends = [f"{loss:.4g}" for loss in (losses[0], losses[-1])]
    return f"Loss {' to '.join(ends[: len(losses)])}"
