# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps between surfaces and what they carry, through the Python package."""

from __future__ import annotations

import numpy as np
import pytest
import supple
from supple import SuppleError, SurfaceMap


def torus(around: int, tube: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, triangles, and UVs by corner, cut along both circles."""
    i, j = np.meshgrid(np.arange(around + 1), np.arange(tube + 1), indexing="ij")
    index = (i % around) * tube + j % tube
    uv = np.stack([i / around, j / tube], axis=-1)
    a, b = 2 * np.pi * uv[:-1, :-1].reshape(-1, 2).T
    ring = 1 + 0.4 * np.cos(b)
    vertices = np.stack([ring * np.cos(a), ring * np.sin(a), 0.4 * np.sin(b)], axis=1)

    def split(grid: np.ndarray) -> np.ndarray:
        p, q, r, s = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
        pairs = [np.stack([p, q, r], axis=2), np.stack([p, r, s], axis=2)]
        return np.concatenate([pair.reshape(-1, 3, *grid.shape[2:]) for pair in pairs])

    return vertices, split(index).astype(np.int32), split(uv)


@pytest.fixture(scope="module")
def pair():
    source, target = torus(60, 30), torus(41, 23)
    surface_map = supple.closest_points(source[:2], target[0]).map
    return source, target, surface_map


def test_closest_points_are_on_the_surface_and_know_their_side(pair):
    (vertices, faces, _), (points, _, _), surface_map = pair
    found = supple.closest_points((vertices, faces), points)
    placed = np.einsum("nk,nkd->nd", found.map.weights, vertices[faces[found.map.face]])
    np.testing.assert_allclose(np.linalg.norm(placed - points, axis=1), found.distance, atol=1e-9)
    assert found.agrees is None and len(found.map) == len(points)
    outwards = placed / np.linalg.norm(placed, axis=1)[:, None]
    agreeing = supple.closest_points((vertices, faces), points, outwards, reach=0.01).agrees
    assert agreeing.dtype == bool and agreeing.any() and not agreeing.all()
    assert np.array_equal(surface_map.face, found.map.face)


def test_a_point_map_comes_back(pair):
    (vertices, faces, _), _, _ = pair
    wanted = np.array([5, -1, 100])
    surface_map = SurfaceMap.from_point_map(wanted, (vertices, faces))
    assert surface_map.nearest_corners((vertices, faces)).tolist() == wanted.tolist()


def test_reversed_map_goes_back(pair):
    source, target, surface_map = pair
    back = supple.reversed_map(surface_map, target[:2], source[:2])
    placed = supple.transfer_field(back, target[:2], target[0]).values
    assert np.abs(placed - source[0]).max() < 0.05


def test_fields_keep_their_dimensions(pair):
    source, target, surface_map = pair
    single, unmapped = supple.transfer_field(surface_map, source[:2], source[0][:, 2])
    assert single.shape == (len(target[0]),) and unmapped == 0
    assert np.abs(single - target[0][:, 2]).max() < 0.02
    face = surface_map.face.copy()
    face[3] = -1
    values, unmapped = supple.transfer_field(
        SurfaceMap(face, surface_map.weights), source[:2], source[0], otherwise=np.inf
    )
    assert unmapped == 1 and np.isinf(values[3]).all()


def test_groups_are_normalised(pair):
    source, target, surface_map = pair
    share = 0.5 + 0.5 * source[0][:, :1] / 1.4
    result = supple.transfer_groups(
        surface_map, source[:2], target[:2], np.hstack([share, 1 - share])
    )
    assert result.normalised and result.moved == 0 and result.unmapped == 0
    np.testing.assert_allclose(result.weights.sum(axis=1), 1.0, atol=1e-12)


def test_uvs_do_not_span_their_seams(pair):
    source, target, surface_map = pair
    uvs, unmapped = supple.transfer_uvs(surface_map, source[:2], target[:2], source[2])
    assert unmapped == 0 and uvs.shape == target[2].shape
    assert np.ptp(uvs, axis=1).max() < 0.06
    difference = uvs - target[2]
    whole = np.round(difference[:, :1])  # a face over the seam may be on either side of it
    assert np.abs(difference - whole).max() < 0.01


def test_colours_by_corner_stay_in_range(pair):
    source, target, surface_map = pair
    colours = np.repeat((source[2][..., :1] > 0.5).all(axis=1)[:, None], 3, axis=1).astype(float)
    result = supple.transfer_corners(surface_map, source[:2], target[:2], colours).values
    assert set(np.unique(np.round(result, 9))) == {0.0, 1.0}
    assert np.ptp(result, axis=1).max() < 1e-9


def test_shape_keys(pair):
    source, target, surface_map = pair

    def bent(vertices: np.ndarray) -> np.ndarray:
        return vertices + np.array([0, 0, 0.3]) * np.sin(2 * vertices[:, :1])

    result = supple.transfer_shape_keys(
        source[:2], [source[0], bent(source[0])], supple.Mesh(*target[:2]), surface_map
    )
    assert result.coincide and result.unmapped == 0
    assert np.array_equal(result.shapes[0], target[0])
    assert np.abs(result.shapes[1] - bent(target[0])).max() < 0.01


def test_shrink_fit(pair):
    source, target, surface_map = pair
    lumpy = source[0] * (1 + 0.1 * np.sin(5 * source[0][:, :1]))
    fit = supple.shrink_fit(target[:2], (lumpy, source[1]), surface_map)
    assert fit.flipped == 0 and fit.unmapped == 0
    assert fit.distance.max() < 1e-9 and fit.vertices.shape == target[0].shape


def test_map_files(pair, tmp_path):
    source, target, surface_map = pair
    path = tmp_path / "pair.map"
    supple.save_map(path, surface_map, target[:2], source[:2])
    back = supple.load_map(path, target[:2], source[:2])
    assert np.array_equal(back.face, surface_map.face)
    assert np.array_equal(back.weights, surface_map.weights)
    with pytest.raises(SuppleError, match="source: its vertices have moved") as caught:
        supple.load_map(path, (target[0] + 1e-9, target[1]), source[:2])
    assert caught.value.code == "stale_mesh"
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(SuppleError) as caught:
        supple.load_map(path, target[:2], source[:2])
    assert caught.value.code == "array_file"


def test_bad_input_is_named(pair):
    source, target, surface_map = pair
    with pytest.raises(SuppleError, match="2 faces and 1 rows"):
        SurfaceMap([0, 1], [[1, 0, 0]])
    with pytest.raises(SuppleError, match=r"\(m, 3, c\)"):
        supple.transfer_uvs(surface_map, source[:2], target[:2], source[2][:, 0])
    with pytest.raises(SuppleError, match=r"keys\[1\]"):
        supple.transfer_shape_keys(
            source[:2], [source[0], source[0][:, :2]], target[:2], surface_map
        )
    with pytest.raises(SuppleError, match="the mesh it maps to has"):
        supple.transfer_field(surface_map, target[:2], source[0])
    progress = supple.Progress()
    progress.cancel()
    with pytest.raises(supple.Cancelled):
        supple.shrink_fit(target[:2], source[:2], surface_map, progress=progress)
