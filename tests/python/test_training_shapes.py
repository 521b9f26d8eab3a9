# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes without labels: no order is left in them; and matching sets, whose truth agrees."""

from __future__ import annotations

import json

import numpy as np
import pytest

pytest.importorskip("anny", reason="anny is not installed; pip install ./training")
pytest.importorskip("igl", reason="libigl is not installed; pip install ./training")

from scipy.stats import spearmanr
from supple import Mesh
from supple.map_metrics import flipped
from supple.match_sets import read_match_set
from supple.mesh_files import read_mesh
from supple_training import bodies, creatures, match_cases, shapes
from supple_training.compare.shapes import bumpy_torus
from supple_training.creatures.families import FAMILIES
from supple_training.creatures.kinds import KINDS, TURNS
from supple_training.maps import vertex_normals
from supple_training.relabel import cleaned, placed, remeshed, shuffled
from supple_training.remesh import (
    component_count,
    euler_characteristic,
    is_closed_manifold,
    remesh,
    unit_normals,
)
from typer.testing import CliRunner

SETTINGS = shapes.ShapeSettings(seed=3)
POINTS = 300
SIZE = 2500


@pytest.fixture(scope="module")
def body():
    return shapes.body(SETTINGS, 0)[1]


@pytest.fixture(scope="module")
def siblings():
    return [shapes.creature(SETTINGS, index)[1] for index in range(SETTINGS.siblings)]


@pytest.fixture(scope="module")
def torus():
    made = bumpy_torus(3000)
    return made.vertices, made.faces.astype(np.int64)


@pytest.fixture(scope="module")
def pair():
    return match_cases.bodies_pair(5, 0, SIZE, POINTS)


def volume(vertices, faces):
    return creatures.volume(vertices, faces)


def nearest_original(surface):
    """(n,) the original vertex with the largest weight."""
    return surface.corners[np.arange(len(surface.corners)), surface.weights.argmax(axis=1)]


def correlations(surface, rest):
    """Rank correlations of the order of vertices, faces and corners with the original surface."""
    original, place = nearest_original(surface), surface.carry(rest)
    middle = place[surface.faces].mean(axis=1)
    found = [spearmanr(np.arange(len(original)), original)[0]]
    found += [spearmanr(np.arange(len(place)), place[:, d])[0] for d in range(3)]
    found += [spearmanr(np.arange(len(middle)), middle[:, d])[0] for d in range(3)]
    found.append(spearmanr(np.arange(len(middle)), original[surface.faces].min(axis=1))[0])
    # A corner of each face is its lowest original vertex: each as often as the others.
    lowest = original[surface.faces].argmin(axis=1)
    found += list(np.bincount(lowest, minlength=3) / len(lowest) - 1 / 3)
    return np.abs(found)


def test_shuffling_is_a_relabelling_of_the_same_surface(torus):
    vertices, faces = torus
    surface = remesh(vertices, faces, np.random.default_rng(1), vertex_count=800)
    other = shuffled(surface, np.random.default_rng(2))
    before, after = surface.carry(vertices), other.carry(vertices)
    assert not np.array_equal(before, after)
    assert np.array_equal(np.unique(before, axis=0), np.unique(after, axis=0))
    areas = [np.sort(unit_normals(p, s.faces)[1]) for p, s in ((before, surface), (after, other))]
    assert np.allclose(*areas, rtol=1e-12, atol=0)
    assert volume(after, other.faces) == pytest.approx(volume(before, surface.faces))

    def corners(points, triangles):
        """Each face as its three points in order from the least: the same however it is named."""
        ranks = np.unique(points, axis=0, return_inverse=True)[1].ravel()[triangles]
        turned = (ranks.argmin(axis=1)[:, None] + np.arange(3)) % 3
        return np.unique(np.take_along_axis(ranks, turned, axis=1), axis=0)

    assert np.array_equal(corners(before, surface.faces), corners(after, other.faces))


def test_placing_is_a_similarity_that_keeps_the_sides(torus):
    vertices, faces = torus
    moved, turn, scale = placed(vertices, faces, np.random.default_rng(4))
    expected = scale * turn.apply(vertices - vertices[0])
    assert np.allclose(moved - moved[0], expected, atol=1e-9 * scale)
    assert volume(moved, faces) == pytest.approx(scale**3 * volume(vertices, faces))
    turns = [placed(vertices, faces, np.random.default_rng(i))[1].as_matrix() for i in range(200)]
    # Of uniform rotations, the mean is 0 and each entry has variance 1/3.
    assert np.abs(np.mean(turns, axis=0)).max() < 0.2
    assert np.abs(np.var(turns, axis=0) - 1 / 3).max() < 0.12


def test_shapes_carry_no_order(body, siblings):
    rest = bodies.vertices(bodies.sample_phenotype(np.random.default_rng(0)))
    kept = remesh(rest, bodies.triangles(), np.random.default_rng(0), vertex_count=2000)
    assert correlations(kept, rest).max() > 0.5  # the figure sees an order where there is one
    assert correlations(body.surface, rest).max() < 4.5 / np.sqrt(len(body.vertices))
    for index, shape in enumerate(siblings):
        fine = shapes.fine_creature(SETTINGS.seed, SETTINGS.held_out, 0, 0)
        bound = 4.5 / np.sqrt(len(shape.vertices))
        assert correlations(shape.surface, fine.vertices).max() < bound, index


def test_no_two_shapes_share_a_triangulation(siblings):
    edges = []
    for shape in siblings:
        original = nearest_original(shape.surface)[shape.faces]
        named = np.sort(original[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges.append({tuple(edge) for edge in named.tolist()})
    for i, one in enumerate(edges):
        for other in edges[i + 1 :]:
            assert len(one & other) < 0.3 * min(len(one), len(other))


def test_shapes_are_whole_and_as_large_as_asked(body, siblings):
    for shape in (body, *siblings):
        assert SETTINGS.vertices[0] <= len(shape.vertices) <= SETTINGS.vertices[1]
        assert is_closed_manifold(shape.faces)
        assert euler_characteristic(shape.faces) == 2
        assert volume(shape.vertices, shape.faces) > 0
        assert shape.faces.dtype == np.int32


def test_a_number_is_always_the_same_shape(body):
    again = shapes.body(SETTINGS, 0)[1]
    assert np.array_equal(again.vertices, body.vertices)
    assert np.array_equal(again.faces, body.faces)


def test_creatures_of_a_kind_have_the_same_parts():
    makers = {maker.__name__: maker for maker in FAMILIES}
    assert set(TURNS) == set(KINDS)
    rng = np.random.default_rng(0)
    for name, kind in KINDS.items():
        suiting = [
            skeleton
            for skeleton in (makers[kind.family](*rng.random(2), rng) for _ in range(60))
            if kind.suits(skeleton)
        ]
        assert len(suiting) >= 3, name
        assert len({sum(c.joints > 0 for c in skeleton.chains) for skeleton in suiting}) == 1
        for skeleton in suiting if kind.symmetric else []:
            joints = np.concatenate([chain.points for chain in skeleton.chains])
            apart = np.linalg.norm(joints[:, None] * [-1, 1, 1] - joints[None], axis=2)
            assert apart.min(axis=1).max() < 1e-9, name


def test_the_command_writes_a_folder_for_each_kind(tmp_path, siblings, monkeypatch):
    monkeypatch.setitem(shapes._MAKERS, "bodies", lambda *_: ("bodies", siblings[0]))
    options = ["--count", "2", "--seed", str(SETTINGS.seed)]
    done = CliRunner().invoke(shapes.app, [str(tmp_path), *options])
    assert done.exit_code == 0, done.output
    found = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.ply"))
    assert found == [f"{kind}/000{i}.ply" for kind in ("bodies", TURNS[0]) for i in range(2)]
    vertices, faces = read_mesh(tmp_path / TURNS[0] / "0001.ply")
    assert np.array_equal(vertices, siblings[1].vertices)
    assert np.array_equal(faces, siblings[1].faces)
    assert json.loads((tmp_path / "about.json").read_text())["licence"] == "CC0-1.0"


def test_creatures_apart_have_folders_of_their_own(tmp_path, siblings):
    options = ["--kind", "creatures", "--count", "2", "--seed", str(SETTINGS.seed)]
    options += ["--siblings", "2", "--apart"]
    done = CliRunner().invoke(shapes.app, [str(tmp_path), *options])
    assert done.exit_code == 0, done.output
    found = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.ply"))
    assert found == [f"{TURNS[0]}_0000/000{i}.ply" for i in range(2)]
    assert np.array_equal(read_mesh(tmp_path / found[1])[0], siblings[1].vertices)


def test_one_shape_of_a_creature_is_not_set_apart(tmp_path):
    done = CliRunner().invoke(shapes.app, [str(tmp_path / "out"), "--siblings", "1", "--apart"])
    assert done.exit_code == 2
    assert "two shapes of a creature" in done.output
    assert not (tmp_path / "out").exists()


# --- poses of a file ------------------------------------------------------------------------------


def test_each_pose_of_a_file_gets_its_own_triangulation(tmp_path, torus):
    vertices, faces = torus
    bent = vertices * [1.0, 1.0, 1.4]
    np.savez(tmp_path / "poses.npz", vertices=[vertices, bent, vertices], faces=faces)
    options = ["--from", str(tmp_path / "poses.npz"), "--vertices", "700", "900", "--count", "2"]
    done = CliRunner().invoke(shapes.app, [str(tmp_path / "out"), *options])
    assert done.exit_code == 0, done.output
    written = [read_mesh(path) for path in sorted((tmp_path / "out").glob("*.ply"))]
    assert len(written) == 2
    for (points, triangles), original in zip(written, (vertices, bent), strict=True):
        assert 700 <= len(points) <= 900
        assert euler_characteristic(triangles) == 0
        # The same shape at another size: the volume over the area to the power of 3/2 stays.
        rates = [
            volume(p, f) / unit_normals(p, f)[1].sum() ** 1.5
            for p, f in ((points, triangles), (original, faces))
        ]
        assert rates[0] == pytest.approx(rates[1], rel=0.03)
    assert {tuple(np.sort(face)) for face in written[0][1].tolist()} != {
        tuple(np.sort(face)) for face in written[1][1].tolist()
    }


@pytest.mark.parametrize(
    ("arrays", "part"),
    [
        ({"vertices": np.zeros((1, 4, 3))}, "no array 'faces'"),
        ({"vertices": np.zeros((4, 3)), "faces": np.zeros((2, 3))}, "(poses, n, 3)"),
        ({"vertices": np.zeros((1, 4, 3)), "faces": [[0, 1, 4]]}, "0 to 3"),
        ({"vertices": np.full((1, 4, 3), np.nan), "faces": [[0, 1, 2]]}, "pose 0"),
        (
            {"vertices": np.zeros((1, 5, 3)), "faces": [[0, 1, 2], [1, 0, 3], [0, 1, 4]]},
            "from vertex 0 to 1",
        ),
    ],
)
def test_bad_files_of_poses_say_what_is_wrong(tmp_path, arrays, part):
    np.savez(tmp_path / "poses.npz", **arrays)
    with pytest.raises(ValueError, match=r"poses\.npz") as caught:
        shapes.read_poses(tmp_path / "poses.npz")
    assert part in str(caught.value)
    done = CliRunner().invoke(
        shapes.app, [str(tmp_path / "out"), "--from", str(tmp_path / "poses.npz")]
    )
    assert done.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_what_is_no_file_of_poses_is_named(tmp_path):
    np.save(tmp_path / "poses.npy", np.zeros((1, 4, 3)))
    with pytest.raises(ValueError, match=r"poses\.npy is no \.npz file"):
        shapes.read_poses(tmp_path / "poses.npy")


def test_cleaning_splits_vertices_where_fans_meet():
    solid = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    two = np.concatenate([solid, np.where(solid == 0, 0, solid + 4)])
    twice = np.concatenate([two, two[:1], [[4, 4, 2]]])  # a double face and a collapsed one
    faces, originals = cleaned(twice)
    assert is_closed_manifold(faces)
    assert component_count(faces) == 2
    assert np.array_equal(np.sort(originals), [0, 0, 1, 2, 3, 5, 6, 7])
    assert np.array_equal(originals[faces], two)


def test_a_surface_with_a_hole_keeps_it(torus):
    vertices, faces = torus
    away = np.linalg.norm(vertices[faces].mean(axis=1) - vertices[faces[0, 0]], axis=1)
    faces, originals = cleaned(faces[away > 0.08])
    shape = remeshed(vertices[originals], faces, np.random.default_rng(2), (900, 1000))
    assert euler_characteristic(shape.faces) == euler_characteristic(faces) == -1
    assert not is_closed_manifold(shape.faces)


# --- matching sets --------------------------------------------------------------------------------


def longest_edges(vertices, faces):
    """(n,) the longest edge at each vertex."""
    longest = np.zeros(len(vertices))
    for i in range(3):
        a, b = faces[:, i], faces[:, (i + 1) % 3]
        length = np.linalg.norm(vertices[a] - vertices[b], axis=1)
        np.maximum.at(longest, a, length)
        np.maximum.at(longest, b, length)
    return longest


@pytest.fixture(scope="module")
def middle():
    """A body on which the points of two others are compared."""
    return bodies.vertices(np.full(len(bodies.PHENOTYPES), 0.4))


def test_the_truth_of_both_shapes_agrees(pair, middle):
    a, b = pair
    assert len(a.template) == len(b.template) == POINTS
    places = [made.shape.surface.carry(middle)[made.template] for made in pair]
    edges = [
        longest_edges(made.shape.surface.carry(middle), made.shape.faces)[made.template]
        for made in pair
    ]
    apart = np.linalg.norm(places[0] - places[1], axis=1)
    assert np.all(apart < np.sum(edges, axis=0))
    assert np.mean(apart) < np.mean(edges)
    normals = [
        vertex_normals(made.shape.surface.carry(middle), made.shape.faces)[made.template]
        for made in pair
    ]
    assert np.mean(np.sum(normals[0] * normals[1], axis=1) > 0) > 0.98


def test_mirrored_twice_is_where_it_was(pair, middle):
    for made in pair:
        place = made.shape.surface.carry(middle)
        edge = longest_edges(place, made.shape.faces)
        back = place[made.mirror] * [-1, 1, 1]
        apart = np.linalg.norm(back - place[made.template], axis=1)
        assert np.all(apart < edge[made.mirror] + edge[made.template])
        aside = np.abs(place[made.template, 0]) > 2 * edge[made.template]
        assert aside.mean() > 0.5
        assert np.all(place[made.template][aside, 0] * place[made.mirror][aside, 0] < 0)


def test_mirrored_maps_are_flipped_and_true_ones_are_not(pair):
    _, b = pair
    chosen = slice(0, 40)
    mesh = Mesh(b.shape.vertices, b.shape.faces)
    rough = np.random.default_rng(0).permutation(40) < 10
    mixed = np.where(rough, b.mirror[chosen], b.template[chosen])
    images = np.stack([b.template[chosen], b.mirror[chosen], mixed], axis=1)
    assert flipped(mesh, b.template[chosen], b.mirror[chosen], images) == [False, True, False]


def test_a_set_is_written_and_read(tmp_path, pair, monkeypatch):
    monkeypatch.setattr(match_cases, "bodies_pair", lambda *_: pair)
    done = CliRunner().invoke(match_cases.app, [str(tmp_path), "--pairs", "1"])
    assert done.exit_code == 0, done.output
    found = read_match_set(tmp_path, refine=False)
    assert found.pairs == [("body_000_a", "body_000_b")]
    assert found.initial == {found.pairs[0]: None}
    for name, made in zip(found.pairs[0], pair, strict=True):
        shape = found.shapes[name]
        assert np.allclose(shape.vertices, made.shape.vertices, rtol=1e-12)
        assert np.array_equal(shape.faces, made.shape.faces)
        assert np.array_equal(shape.template, made.template)
        assert np.array_equal(shape.mirror, made.mirror)


def test_a_creature_in_two_proportions_has_one_truth():
    seed, points = SETTINGS.seed, 200
    a, b = match_cases.creatures_pair(seed, 0, SIZE, points)
    rest = shapes.fine_creature(seed, True, 0, 0).vertices
    places = [made.shape.surface.carry(rest)[made.template] for made in (a, b)]
    edges = [
        longest_edges(made.shape.surface.carry(rest), made.shape.faces)[made.template]
        for made in (a, b)
    ]
    apart = np.linalg.norm(places[0] - places[1], axis=1)
    assert np.all(apart < np.sum(edges, axis=0))
    back = a.shape.surface.carry(rest)[a.mirror] * [-1, 1, 1]
    # Left and right differ by small bumps.
    assert np.mean(np.linalg.norm(back - places[0], axis=1)) < 2 * np.mean(edges[0])
