# SPDX-License-Identifier: GPL-3.0-or-later
"""Factors, recovery and maps beside SciPy's."""

import threading

import numpy as np
import pytest
import supple
from supple import SuppleError, geometry, spectral
from supple_training.compare import shapes

sparse = pytest.importorskip("scipy.sparse")
linalg = pytest.importorskip("scipy.sparse.linalg")

COUNT = 40


@pytest.fixture(scope="module")
def case():
    return shapes.bumpy_torus(500)


@pytest.fixture(scope="module")
def system(case):
    laplacian = geometry.cotan_laplacian(case.vertices, case.faces)
    mass = geometry.lumped_mass(case.vertices, case.faces)
    return (laplacian + sparse.diags(mass)).tocsc()


def code_of(call) -> str:
    with pytest.raises(SuppleError) as caught:
        call()
    return caught.value.code


# --- factors --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("backend", "ordering"),
    [(None, None), ("cholmod", "amd"), ("cholmod", "metis"), ("eigen", None)],
)
def test_factor_solves_as_scipy_does(system, backend, ordering):
    rhs = np.random.default_rng(1).normal(size=(system.shape[0], 3))
    factor = geometry.SparseCholesky(system, backend=backend, ordering=ordering)
    expected = linalg.spsolve(system, rhs)
    assert np.allclose(factor.solve(rhs), expected, rtol=1e-9, atol=1e-12)
    assert np.allclose(factor.solve(rhs[:, 0]), expected[:, 0], rtol=1e-9, atol=1e-12)
    assert sorted(factor.ordering) == list(range(system.shape[0]))
    again = geometry.SparseCholesky(system, backend=backend, ordering=factor.ordering)
    assert again.factor_entries == factor.factor_entries > system.nnz / 2


def test_any_format_of_scipy_does(system):
    rhs = np.ones(system.shape[0])
    expected = geometry.SparseCholesky(system).solve(rhs)
    mixed = system.tocoo()
    order = np.random.default_rng(2).permutation(mixed.nnz)
    twice = np.concatenate([order, order])  # each entry in two halves
    halves = (mixed.data[twice] / 2, (mixed.row[twice], mixed.col[twice]))
    for matrix in (system.tocsr(), sparse.coo_matrix(halves, system.shape), system.toarray()):
        assert np.allclose(geometry.SparseCholesky(matrix).solve(rhs), expected, rtol=1e-10)


def test_matrices_that_cannot_be_factored_are_refused(system):
    factor = geometry.SparseCholesky
    assert code_of(lambda: factor(-system)) == "not_positive_definite"
    assert code_of(lambda: factor(sparse.triu(system))) == "not_positive_definite"
    assert code_of(lambda: factor(system[:, :-1])) == "wrong_shape"
    assert code_of(lambda: factor(system, ordering="best")) == "bad_option"
    assert code_of(lambda: factor(system, ordering=[0, 0])) == "bad_option"
    assert code_of(lambda: factor(system, backend="lapack")) == "bad_option"
    assert code_of(lambda: factor(system, backend="eigen", ordering="metis")) == "bad_option"
    assert code_of(lambda: factor(system).solve(np.ones(3))) == "wrong_shape"


# --- eigenfunctions -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "size", "tolerance"),
    [
        ("block_krylov", 1000, 1e-8),
        ("lanczos", 1000, 1e-8),
        ("dense", 500, 1e-8),
        ("multiresolution", 5000, 1e-2),  # or "block_krylov", which it takes on small meshes
    ],
)
def test_every_method_finds_the_same(method, size, tolerance):
    case = shapes.bumpy_torus(size)
    _, expected, _ = geometry.eigenbasis(case.vertices, case.faces, 16)
    functions, values, residual = geometry.eigenbasis(case.vertices, case.faces, 16, method=method)
    assert functions.shape == (len(case.vertices), 16)
    assert residual < tolerance
    assert np.allclose(values, expected, rtol=tolerance, atol=1e-8)


def test_a_method_that_does_not_exist_is_refused(case):
    call = geometry.eigenbasis
    assert code_of(lambda: call(case.vertices, case.faces, 9, method="spectra")) == "bad_option"


# --- recovery -------------------------------------------------------------------------------------


def recovery_inputs(case):
    moved = shapes.bent(case.vertices)
    noise = np.random.default_rng(3)
    coarse = moved + 0.02 * noise.normal(size=moved.shape)
    jacobians = geometry.jacobians(case.vertices, case.faces, moved)
    return moved, coarse, jacobians + 0.1 * noise.normal(size=jacobians.shape)


def operators(case):
    laplacian = geometry.cotan_laplacian(case.vertices, case.faces)
    mass = geometry.lumped_mass(case.vertices, case.faces)
    areas = np.repeat(geometry.face_areas(case.vertices, case.faces), 3)
    divergence = geometry.gradient(case.vertices, case.faces).T @ sparse.diags(areas)
    return laplacian, sparse.diags(mass / mass.sum()).tocsc(), divergence


def test_product_gives_back_a_known_map(case):
    moved, _, _ = recovery_inputs(case)
    jacobians = geometry.jacobians(case.vertices, case.faces, moved)
    recovery = geometry.EmbeddingRecovery(case.vertices, case.faces)
    assert np.abs(recovery.solve(moved, jacobians) - moved).max() < 1e-10


def test_both_forms_solve_their_equation(case):
    _, coarse, jacobians = recovery_inputs(case)
    laplacian, mass, divergence = operators(case)
    d = divergence @ jacobians.reshape(-1, 3)
    s, a4, a5 = 4000.0, 2e4, 1.5e5
    inverse = sparse.diags(1 / mass.diagonal())
    product = (laplacian + s * mass) @ inverse @ (laplacian + s * mass)
    expected = linalg.spsolve(
        product.tocsc(), s * s * (mass @ coarse) + 2 * s * d + laplacian @ (inverse @ d)
    )
    got = geometry.EmbeddingRecovery(case.vertices, case.faces).solve(coarse, jacobians)
    assert np.allclose(got, expected, atol=1e-9)
    wide = laplacian + a4 * mass + a5 * laplacian @ mass @ laplacian
    expected = linalg.spsolve(wide.tocsc(), a4 * (mass @ coarse) + a5 * laplacian @ (mass @ d))
    literal = geometry.EmbeddingRecovery(case.vertices, case.faces, form="literal")
    assert np.allclose(literal.solve(coarse, jacobians), expected, atol=1e-9)
    assert literal.factor_entries > 0


def test_recovery_refuses_what_does_not_fit(case):
    made = geometry.EmbeddingRecovery(case.vertices, case.faces)
    moved, _, jacobians = recovery_inputs(case)
    assert code_of(lambda: made.solve(moved[:-1], jacobians)) == "wrong_shape"
    assert code_of(lambda: made.solve(moved, jacobians[:-1])) == "wrong_shape"
    assert code_of(lambda: made.solve(moved, jacobians.reshape(-1, 9))) == "wrong_shape"
    recovery = geometry.EmbeddingRecovery
    assert code_of(lambda: recovery(case.vertices, case.faces, "wide")) == "bad_option"
    assert code_of(lambda: recovery(case.vertices, case.faces, pull=0)) == "bad_option"


# --- maps -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pair(case):
    """The surface, a copy with other vertex numbers and three times as large, and the map."""
    place = np.random.default_rng(4).permutation(len(case.vertices))
    vertices = np.empty_like(case.vertices)
    vertices[place] = 3 * case.vertices[:, [1, 2, 0]]
    faces = place[case.faces]
    source = spectral.basis(case.vertices, case.faces, COUNT)
    return source, spectral.basis(vertices, faces, COUNT), place


def test_functional_map_is_the_projection_of_what_is_pulled_back(pair):
    source, target, place = pair
    expected = 3 * source.functions.T @ (source.mass[:, None] * target.functions[place])
    got = spectral.functional_map(source, target, place)
    assert np.allclose(got, expected, atol=1e-12)
    assert np.allclose(got.T @ got, np.eye(COUNT), atol=1e-6)


def test_point_map_is_the_nearest_row(pair):
    from scipy.spatial import cKDTree

    source, target, place = pair
    rough = spectral.functional_map(source, target, place) + 0.05 * np.random.default_rng(6).normal(
        size=(COUNT, COUNT)
    )
    area = np.sqrt(target.mass.sum()), np.sqrt(source.mass.sum())
    _, expected = cKDTree(area[0] * target.functions @ rough.T).query(area[1] * source.functions)
    assert (spectral.point_map(source, target, rough) == expected).all()


def test_zoomout_recovers_a_copy(pair):
    source, target, place = pair
    start = place.copy()
    wrong = np.random.default_rng(5).permutation(len(place))[: int(0.3 * len(place))]
    start[wrong] = start[wrong[::-1]]
    found, functional = spectral.zoomout(source, target, start, start=10, end=COUNT)
    assert (found == place).all()
    assert functional.shape == (COUNT, COUNT)


def test_zoomout_reports_is_cancelled_and_refuses(pair):
    source, target, place = pair
    progress = supple.Progress()
    spectral.zoomout(source, target, place, start=10, end=20, progress=progress)
    assert progress.fraction == 1.0
    progress = supple.Progress()
    progress.cancel()
    with pytest.raises(supple.Cancelled):
        spectral.zoomout(source, target, place, end=COUNT, progress=progress)
    assert code_of(lambda: spectral.zoomout(source, target, place)) == "bad_option"  # 120 of 40
    assert code_of(lambda: spectral.zoomout(source, target, place[:-1], end=30)) == "wrong_shape"
    far = place + len(place)
    assert code_of(lambda: spectral.functional_map(source, target, far)) == "index_out_of_range"


# --- the machine ----------------------------------------------------------------------------------


def test_threads_are_those_of_the_calling_thread():
    before = supple.thread_count()
    try:
        supple.set_thread_count(1)
        assert supple.thread_count() == 1
        seen = []
        other = threading.Thread(target=lambda: seen.append(supple.thread_count()))
        other.start()
        other.join()
        assert seen[0] >= 1
    finally:
        supple.set_thread_count(before)
    assert supple.thread_count() == before
    for count in (0, -1, 1.5, "two"):
        assert code_of(lambda count=count: supple.set_thread_count(count)) == "bad_option"


def test_the_kernels_have_names():
    assert supple.simd_level() in {"plain", "avx2", "avx512"}
    assert "OpenBLAS" in supple.blas_name()
