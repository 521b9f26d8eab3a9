# SPDX-License-Identifier: GPL-3.0-or-later
"""Editing, blending and falloff through the Python package."""

from __future__ import annotations

import heapq

import numpy as np
import pytest
import supple
from supple import Handle


def grid(columns: int = 24, rows: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """A flat sheet of unit cells, and its triangles."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0), indexing="ij")
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    corner = (np.arange(columns)[:, None] * (rows + 1) + np.arange(rows)).reshape(-1)
    a, b, c, d = corner, corner + rows + 1, corner + rows + 2, corner + 1
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def bending(vertices: np.ndarray) -> list[Handle]:
    """One end held, the other lifted and turned."""
    lift = np.eye(4)
    lift[:3, :3] = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
    lift[:3, 3] = [18.0, 0.0, -12.0]
    return [
        Handle("held", np.flatnonzero(vertices[:, 0] < 1.5)),
        Handle("moved", np.flatnonzero(vertices[:, 0] > 22.5), matrix=lift),
    ]


@pytest.fixture(scope="module")
def editor() -> supple.Editor:
    vertices, faces = grid()
    prepared = supple.PreparedMesh(vertices, faces, cache=False)
    return supple.Editor(prepared, bending(vertices))


@pytest.mark.parametrize("mode", ["natural", "stiff", "arap"])
def test_a_mode_is_short_for_a_method_and_a_stiffness(editor, mode):
    method, stiffness = {"natural": ("supple", 0), "stiff": ("supple", 1), "arap": ("arap", 1)}[
        mode
    ]
    short = editor.solve(mode=mode)
    long = editor.solve(method=method, stiffness=stiffness)
    assert np.array_equal(short.vertices, long.vertices)
    assert short.report["network"] is (mode != "arap")


def test_the_slider_trades_distortion(editor):
    vertices, faces = grid()
    distortion = [
        supple.symmetric_dirichlet(vertices, faces, editor.solve(stiffness=s).vertices)
        for s in (0.0, 0.5, 1.0)
    ]
    assert distortion[0] > distortion[1] > distortion[2]


@pytest.mark.parametrize("stiffness", [0.0, 0.4, 1.0])
def test_a_session_ends_where_solve_does(editor, stiffness):
    session = editor.session(stiffness=stiffness)
    session.aim(editor.handles)
    frames = 0
    while not session.settled:
        vertices = session.advance(0.01)
        frames += 1
        assert frames < 500
    assert np.array_equal(vertices, editor.solve(stiffness=stiffness).vertices)
    assert (frames > 1) == (stiffness > 0)
    session.aim(editor.handles)
    assert not session.settled


def test_rebinding_is_binding_anew(editor):
    vertices, _ = grid()
    turned = np.eye(4)
    turned[2, 3] = 3.0
    handles = [*bending(vertices), Handle("middle", [150, 151, 163, 164], matrix=turned)]
    anew = supple.Editor(editor.prepared, handles).solve().vertices
    # Rounds correct in single precision, in another order after a rebind; the box is 19 long.
    assert np.abs(editor.rebind(handles).solve().vertices - anew).max() < 2e-6
    back = editor.rebind(handles).rebind(handles[:2])
    assert np.abs(back.solve().vertices - editor.solve().vertices).max() < 2e-6


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"mode": "soft"}, "'soft' is no mode"),
        ({"mode": "stiff", "stiffness": 1.0}, "not both"),
        ({"method": "laplace"}, "'laplace' is no method"),
        ({"stiffness": 1.5}, "from 0 (natural) to 1 (stiff)"),
        ({"polish": -1}, "polish is -1"),
        ({"loose_pieces": "fly"}, "'follow' or 'stay'"),
    ],
)
def test_bad_options_are_named(editor, options, says):
    with pytest.raises(supple.SuppleError) as raised:
        editor.solve(**options)
    assert raised.value.code == "bad_option"
    assert says in str(raised.value)


def test_a_session_without_targets_says_so(editor):
    with pytest.raises(supple.SuppleError, match="aim first"):
        editor.session().advance()


def test_blend_goes_from_rest_to_pose():
    rng = np.random.default_rng(1)
    rest, posed, weights = rng.random((7, 3)), rng.random((7, 3)), rng.random(7)
    assert np.array_equal(supple.blend(rest, posed, 0.0), rest)
    assert np.array_equal(supple.blend(rest, posed, 1.0), posed)
    expected = rest + 0.3 * weights[:, None] * (posed - rest)
    assert np.abs(supple.blend(rest, posed, 0.3, weights) - expected).max() < 1e-15
    with pytest.raises(supple.SuppleError, match="6 weights"):
        supple.blend(rest, posed, 1.0, weights[:6])
    with pytest.raises(supple.SuppleError, match="strength"):
        supple.blend(rest, posed, np.nan)


def edge_distances(vertices: np.ndarray, faces: np.ndarray, start: int) -> np.ndarray:
    """Dijkstra's distances along edges, here in plain Python."""
    around: dict[int, set[int]] = {}
    for face in faces.tolist():
        for i in face:
            around.setdefault(i, set()).update(face)
    distance = np.full(len(vertices), np.inf)
    distance[start] = 0.0
    heap = [(0.0, start)]
    while heap:
        so_far, i = heapq.heappop(heap)
        if so_far > distance[i]:
            continue
        for j in around[i]:
            length = so_far + float(np.linalg.norm(vertices[j] - vertices[i]))
            if length < distance[j]:
                distance[j] = length
                heapq.heappush(heap, (length, j))
    return distance


def test_falloff_is_smooth_along_edges(editor):
    vertices, faces = grid()
    weights = supple.falloff_weights(editor.prepared, [150], 6.0)
    part = np.clip(1.0 - edge_distances(vertices, faces, 150) / 6.0, 0.0, 1.0)
    assert np.abs(weights - part * part * (3.0 - 2.0 * part)).max() < 1e-12
    assert weights[150] == 1.0
    assert weights[0] == 0.0
    for radius in (0.0, -1.0, np.nan):
        with pytest.raises(supple.SuppleError, match="above 0"):
            supple.falloff_weights(editor.prepared, [150], radius)
    with pytest.raises(supple.SuppleError, match="9999"):
        supple.falloff_weights(editor.prepared, [9999], 1.0)


def test_farthest_points_are_apart():
    vertices, _ = grid()
    chosen = supple.farthest_points(vertices, 6)
    assert len(set(chosen.tolist())) == 6
    apart = np.linalg.norm(vertices[chosen][:, None] - vertices[chosen], axis=2)
    assert apart[~np.eye(6, dtype=bool)].min() > 6.0
    assert len(supple.farthest_points(vertices[:5], 9)) == 5
    with pytest.raises(supple.SuppleError, match="1 or more"):
        supple.farthest_points(vertices, 0)
