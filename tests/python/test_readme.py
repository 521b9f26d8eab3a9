# SPDX-License-Identifier: GPL-3.0-or-later
"""The README's example runs as it stands there."""

import re
from pathlib import Path

import meshio
import numpy as np

README = Path(__file__).resolve().parents[2] / "README.md"


def write_tube(path, rings=12, around=12):
    """A closed tube of rings * around vertices along z, 3 long and 1 wide."""
    z, angle = np.meshgrid(
        np.linspace(0, 3, rings), np.linspace(0, 2 * np.pi, around, endpoint=False), indexing="ij"
    )
    points = np.stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), z], axis=-1).reshape(-1, 3)
    index = np.arange(rings * around).reshape(rings, around)
    low, high = index[:-1].ravel(), index[1:].ravel()
    low_next, high_next = (np.roll(part, -1, axis=1).ravel() for part in (index[:-1], index[1:]))
    sides = np.concatenate(
        [np.stack([low, low_next, high_next], 1), np.stack([low, high_next, high], 1)]
    )
    meshio.write_points_cells(path, points, [("triangle", sides)])


def test_python_example(tmp_path, monkeypatch, capsys):
    write_tube(tmp_path / "body.obj")
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    names = {}
    exec(compile(example, "README.md", "exec"), names)
    rest, posed = names["mesh"].points, names["result"].vertices
    assert posed.shape == rest.shape
    np.testing.assert_allclose(posed[[0, 1, 2]], rest[[0, 1, 2]], atol=1e-6)
    np.testing.assert_allclose(posed[[120, 121]], rest[[120, 121]] + [0, 0, 0.3], atol=1e-6)
    assert "(144, 3)" in capsys.readouterr().out
