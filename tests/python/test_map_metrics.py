# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of maps beside a second implementation, written from their definitions in NumPy."""

import numpy as np
import pytest
import supple
from supple import SuppleError, geometry
from supple_training.compare import shapes

SOURCE = shapes.bumpy_torus(500)
TARGET = shapes.bumpy_torus(400)


@pytest.fixture(scope="module")
def pair():
    """Two meshes, and a rough map: the nearest vertex, a tenth of them somewhere else."""
    source = supple.Mesh(SOURCE.vertices, SOURCE.faces)
    target = supple.Mesh(3.0 * TARGET.vertices + 1.0, TARGET.faces)
    apart = SOURCE.vertices[:, None] - TARGET.vertices[None]
    rough = np.linalg.norm(apart, axis=2).argmin(1)
    random = np.random.default_rng(0)
    wrong = random.random(len(rough)) < 0.1
    rough[wrong] = random.integers(0, len(TARGET.vertices), wrong.sum())
    return source, target, rough


def area_normals(vertices, faces):
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a) / 2


def vertex_normals(vertices, faces):
    sums = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(sums, faces[:, corner], area_normals(vertices, faces))
    return sums / np.linalg.norm(sums, axis=1, keepdims=True).clip(1e-300)


def test_inversions(pair):
    source, target, point_map = pair
    images = target.vertices[point_map]
    own = vertex_normals(target.vertices, target.faces)
    towards = own[point_map][source.faces].sum(1)
    faces = (area_normals(images, source.faces) * towards).sum(1) < 0
    assert supple.face_inversion(*pair) == pytest.approx(100 * faces.mean())
    assert 0 < faces.mean() < 1
    agreement = np.zeros(len(own))
    mapped = vertex_normals(images, source.faces)
    np.add.at(agreement, point_map, (mapped * own[point_map]).sum(1))
    assert supple.vertex_inversion(*pair) == pytest.approx(100 * (agreement < 0).mean())


def test_dirichlet_energy_is_the_sum_of_its_faces(pair):
    source, target, point_map = pair
    area = np.linalg.norm(area_normals(target.vertices, target.faces), axis=1).sum()
    images = target.vertices[point_map] / np.sqrt(area)
    energy = 0.0
    for a, b, c in source.faces:
        edges = source.vertices[[b, c]] - source.vertices[a]
        gram = edges @ edges.T
        moved = images[[b, c]] - images[a]
        energy += (
            np.sqrt(np.linalg.det(gram)) / 2 * np.trace(np.linalg.solve(gram, moved @ moved.T))
        )
    assert supple.map_dirichlet(*pair) == pytest.approx(energy)


def test_coverage_is_the_mass_that_is_hit(pair):
    _, target, point_map = pair
    mass = geometry.lumped_mass(target.vertices, target.faces)
    share = mass[np.unique(point_map)].sum() / mass.sum()
    assert supple.coverage(*pair) == pytest.approx(100 * share)


def test_chamfer(pair):
    source, target, _ = pair
    apart = np.linalg.norm(source.vertices[:, None] - target.vertices[None], axis=2)
    expected = apart.min(1).mean() + apart.min(0).mean()
    assert supple.chamfer(source.vertices, target.vertices) == pytest.approx(expected)


def test_geodesics_beside_pygeodesic(pair):
    exact = pytest.importorskip("pygeodesic.geodesic")
    mesh = pair[1]
    other = exact.PyGeodesicAlgorithmExact(mesh.vertices, mesh.faces)
    ours = supple.Geodesics(mesh.vertices, mesh.faces)
    for source in (0, 17, 200):
        expected, _ = other.geodesicDistances(np.array([source]), None)
        assert ours.distances(source) == pytest.approx(expected, rel=1e-8, abs=1e-9)


def test_geodesic_errors_share_the_work_of_several_maps(pair):
    _, target, _ = pair
    geodesics = supple.Geodesics(target.vertices, target.faces)
    truth = np.array([3, 50, 3])
    images = np.array([[3, 4], [60, 50], [200, 3]])
    lengths = geodesics.between(truth, images)
    assert lengths[0, 0] == lengths[1, 1] == lengths[2, 1] == 0
    assert lengths[2, 0] == pytest.approx(geodesics.distances(3)[200])
    area = geometry.face_areas(target.vertices, target.faces).sum()
    for column, error in enumerate(supple.geodesic_errors(target, truth, images)):
        assert error.unreachable == 0
        assert error.mean == pytest.approx(100 * lengths[:, column].mean() / np.sqrt(area))


def test_bad_maps_are_named(pair):
    source, target, point_map = pair
    with pytest.raises(SuppleError) as short:
        supple.coverage(source, target, point_map[:-1])
    assert short.value.code == "wrong_shape"
    beyond = point_map.copy()
    beyond[7] = len(target.vertices)
    with pytest.raises(SuppleError) as outside:
        supple.face_inversion(source, target, beyond)
    assert outside.value.code == "index_out_of_range"
    assert "Entry 7" in str(outside.value)
