# SPDX-License-Identifier: GPL-3.0-or-later
"""For each sequence a plot of the errors over time and a strip of frames beside the truth."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import PowerNorm, to_rgb
from numpy.typing import NDArray
from supple import geometry

from supple_training.compare.edits.contenders import ARAP, NATURAL
from supple_training.compare.edits.measure import MEASURED
from supple_training.compare.edits.pictures import COLOURS, PLAIN, scale_end
from supple_training.compare.edits.raster import camera, render
from supple_training.compare.sequences.figures import percent_of_size
from supple_training.compare.sequences.measure import Motions
from supple_training.sequences import Sequence

SHOWN = (ARAP, NATURAL)

FRAMES = 4
"""Of a strip, evenly spread."""

PIXELS = 320
"""Width or height of a panel, whichever is longer."""


def plot(name: str, rows: dict[str, dict], path: Path) -> None:
    """Write the errors over time as PNG, a line a contender."""
    figure, (near, smooth) = plt.subplots(2, 1, figsize=(8, 6), sharex=True, layout="constrained")
    for contender, row in rows.items():
        if row["status"] == MEASURED:
            near.plot(row["pose_errors"], label=contender)
            inner = np.arange(1, 1 + len(row["acceleration_errors"]))
            smooth.plot(inner, row["acceleration_errors"], label=contender)
    for axes, what in ((near, "pose error"), (smooth, "acceleration error")):
        axes.set(ylabel=what, ylim=(0, None))
        axes.grid(alpha=0.3)
    near.set_title(name, loc="left", weight="bold")
    near.legend(fontsize=8)
    smooth.set_xlabel("frame")
    _save(figure, path)


def strip(sequence: Sequence, motions: Motions, path: Path) -> None:
    """Write frames as PNG: the truth above, below it results by their distance from it."""
    case, truth = sequence.case, sequence.truth
    shown = [name for name in SHOWN if name in motions]
    chosen = np.linspace(0, len(truth) - 1, FRAMES + 2).round().astype(int)[1:-1]
    clouds = [points[chosen].reshape(-1, 3) for points in (truth, *(motions[n] for n in shown))]
    view = camera(clouds)
    width = round(PIXELS * min(1.0, view.extent[0] / view.extent[1]))
    unit = percent_of_size(case.vertices, case.faces)

    def away(name: str, frame: int) -> NDArray[np.float64]:
        distance = unit * np.linalg.norm(motions[name][frame] - truth[frame], axis=1)
        return distance[case.faces].mean(axis=1)

    values = {(name, frame): away(name, frame) for name in shown for frame in chosen}
    areas = geometry.face_areas(case.vertices, case.faces)
    norm = PowerNorm(0.5, 0.0, scale_end(list(values.values()), areas), clip=True)
    plain = np.tile(to_rgb(PLAIN), (len(case.faces), 1))
    dpi = 100
    height = round(width * view.extent[1] / view.extent[0])
    figure, grid = plt.subplots(
        *(1 + len(shown), FRAMES),
        figsize=((width * FRAMES + 110) / dpi, ((height + 10) * (1 + len(shown)) + 60) / dpi),
        layout="constrained",
        squeeze=False,
    )
    for line, name in zip(grid, ("truth", *shown), strict=True):
        for axes, frame in zip(line, chosen, strict=True):
            points, colours = truth[frame], plain
            if name in motions:
                points = motions[name][frame]
                colours = COLOURS(norm(values[name, frame]))[:, :3]
            axes.imshow(render(points, case.faces, colours, view, width), interpolation="none")
            axes.axis("off")
        line[0].set_title(name, fontsize=10, loc="left")
    for axes, frame in zip(grid[0], chosen, strict=True):
        axes.set_title(f"frame {frame}", fontsize=8, loc="right")
    scale = ScalarMappable(norm, COLOURS)
    colours = figure.colorbar(scale, ax=grid, extend="max", pad=0.01, aspect=28)
    colours.set_label("distance from the truth, % of the root of the area", fontsize=9)
    figure.suptitle(case.name, fontsize=12, x=0.01, ha="left", weight="bold")
    _save(figure, path, dpi)


def _save(figure: plt.Figure, path: Path, dpi: int = 110) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=dpi, facecolor="white")
    plt.close(figure)
