# SPDX-License-Identifier: GPL-3.0-or-later
"""A strip for each case: the rest shape with its handles, results by distortion, and the truth."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import supple
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, PowerNorm, to_rgb
from numpy.typing import NDArray
from supple import geometry
from supple.cases import EditCase

from supple_training.compare.edits.contenders import ARAP, NATURAL, STIFF
from supple_training.compare.edits.raster import camera, render

matplotlib.use("Agg")
import matplotlib.pyplot as plt

SHOWN = (ARAP, NATURAL, STIFF)

COLOURS = LinearSegmentedColormap.from_list(
    "distortion", ["#e4e7eb", "#fbe08d", "#f39b4a", "#d8412f", "#8c1049", "#35083f"]
)
PLAIN, HELD, MOVED = "#dcdfe4", "#2f6fd0", "#e0701b"

PIXELS = 560
"""Width or height of a panel, whichever is longer."""

BRIGHTEST = 0.98
"""The scale ends at the distortion that this part of the area stays below, in the worst panel."""


def _is_held(case: EditCase, handle: supple.Handle) -> bool:
    """Whether a handle stays where it is."""
    if handle.positions is not None:
        rest = case.vertices[np.asarray(handle.vertices)]
        return bool(np.allclose(handle.positions, rest, atol=1e-9))
    return handle.matrix is None or bool(np.allclose(handle.matrix, np.eye(4)))


def handle_colours(case: EditCase) -> NDArray[np.float64]:
    """(m, 3): faces whose corners all are in handles, by whether these are held or moved."""
    kind = np.zeros(len(case.vertices), int)
    for handle in case.handles:
        kind[np.asarray(handle.vertices)] = 1 if _is_held(case, handle) else 2
    corners = kind[case.faces]
    face = np.where((corners > 0).all(axis=1), corners.max(axis=1), 0)
    return np.array([to_rgb(c) for c in (PLAIN, HELD, MOVED)])[face]


def scale_end(distortions: list[NDArray], areas: NDArray) -> float:
    """Where the colour scale of a case ends: the largest weighted quantile, two digits."""
    ends = []
    for values in distortions:
        order = np.argsort(values)
        share = np.cumsum(areas[order]) / areas.sum()
        ends.append(values[order][min(np.searchsorted(share, BRIGHTEST), len(values) - 1)])
    end = max([1e-6, *ends])
    unit = 10.0 ** (np.floor(np.log10(end)) - 1)
    return float(np.ceil(end / unit) * unit)


def _title(name: str, row: dict) -> str:
    lines = [name, f"distortion {row['symmetric_dirichlet']:.3g}"]
    if row.get("pose_error") is not None:
        lines[-1] += f", pose error {row['pose_error']:.3g}"
    bad = row["flipped_faces"]
    lines.append(f"{bad} face{'s' if bad > 1 else ''} turned" if bad else "")
    return "\n".join(lines)


def strip(case: EditCase, rows: dict[str, dict], poses: dict[str, NDArray], path: Path) -> None:
    """Write the strip of a case as PNG."""
    panels = [(name, poses[name]) for name in SHOWN if name in poses]
    truth = [] if case.truth is None else [case.truth]
    view = camera([case.vertices, *(posed for _, posed in panels), *truth])
    width = round(PIXELS * min(1.0, view.extent[0] / view.extent[1]))
    faces = case.faces
    distortions = [supple.face_distortion(case.vertices, faces, p) for _, p in panels]
    truth_distortion = [supple.face_distortion(case.vertices, faces, p) for p in truth]
    areas = geometry.face_areas(case.vertices, faces)
    norm = PowerNorm(0.5, 0.0, scale_end(distortions, areas), clip=True)

    def coloured(points: NDArray, values: NDArray) -> NDArray:
        return render(points, faces, COLOURS(norm(values))[:, :3], view, width)

    images = [render(case.vertices, faces, handle_colours(case), view, width)]
    titles = [f"rest, {len(case.handles)} handles\n\n"]
    for (name, posed), values in zip(panels, distortions, strict=True):
        images.append(coloured(posed, values))
        titles.append(_title(name, rows[name]))
    for points, values in zip(truth, truth_distortion, strict=True):
        images.append(coloured(points, values))
        own = supple.symmetric_dirichlet(case.vertices, faces, points)
        titles.append(f"truth\ndistortion {own:.3g}\n")

    dpi = 100
    height = images[0].shape[0]
    figure, grid = plt.subplots(
        *(1, len(images)),
        figsize=((max(width, 280) * len(images) + 110) / dpi, (height + 125) / dpi),
        layout="constrained",
        squeeze=False,
    )
    for axes, image, title in zip(grid[0], images, titles, strict=True):
        axes.imshow(image, interpolation="none")
        axes.set_title(title, fontsize=10)
        axes.axis("off")
    colours = figure.colorbar(
        ScalarMappable(norm, COLOURS), ax=list(grid[0]), extend="max", pad=0.01, aspect=28
    )
    colours.set_label("symmetric Dirichlet of a face", fontsize=9)
    ticks = norm.vmax * np.linspace(0, 1, 6) ** 2  # evenly spaced on this scale
    colours.set_ticks(ticks, labels=[f"{tick:.2g}" for tick in ticks], fontsize=8)
    held = {_is_held(case, handle) for handle in case.handles}
    marks = [("held", HELD)] * (True in held) + [("moved", MOVED)] * (False in held)
    for place, (text, colour) in enumerate(marks):
        grid[0, 0].text(
            *(0.02 + 0.2 * place, -0.03, f"■ {text}"),
            transform=grid[0, 0].transAxes,
            color=colour,
            fontsize=9,
            va="top",
        )
    figure.suptitle(case.name, fontsize=12, x=0.01, ha="left", weight="bold")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=dpi, facecolor="white")
    plt.close(figure)
