# SPDX-License-Identifier: GPL-3.0-or-later
"""The linear algebra: eigenfunctions, factors, solves, recovery of a shape from its Jacobians."""

from __future__ import annotations

import numpy as np
from supple import SuppleError, geometry

from supple_training.compare.contender import (
    Contender,
    NotAvailable,
    Ready,
    Task,
    accepts,
    attribute,
)
from supple_training.compare.shapes import Case, bent

EIGENFUNCTIONS = 128
COLUMNS = 3
SHIFT = -0.01
"""Of the shift-invert in SciPy; the surface has area 1, so the first value that is not 0 is about
10."""

EIGSH_TOLERANCE = 1e-8
"""ARPACK's own. From 1e-3 to 1e-9 it ended in the same sweep at 1k and 10k vertices, with residuals
below 1e-10: no looser one would make it faster."""


def operators(case: Case):
    """W (n, n) sparse and M's diagonal (n,)."""
    return (
        geometry.cotan_laplacian(case.vertices, case.faces).tocsc(),
        geometry.lumped_mass(case.vertices, case.faces),
    )


# --- eigenfunctions -------------------------------------------------------------------------------


def residual(laplacian, mass, values, functions) -> float:
    """The largest |M^-1/2 (W phi - lambda M phi)| / max(lambda, 1), as supple.geometry reports."""
    away = laplacian @ functions - (mass[:, None] * functions) * values
    norms = np.linalg.norm(away / np.sqrt(mass)[:, None], axis=0)
    return float((norms / np.maximum(values, 1.0)).max())


def _eigen_facts(case: Case):
    def facts(result) -> dict:
        functions, values = result[:2]
        return {"residual": residual(*operators(case), np.asarray(values), np.asarray(functions))}

    return facts


def _eigenbasis(case: Case, _: int) -> Ready:
    run = attribute("supple.geometry.eigenbasis")
    return Ready(lambda: run(case.vertices, case.faces, EIGENFUNCTIONS), _eigen_facts(case))


def _lanczos(case: Case, _: int) -> Ready:
    run = attribute("supple.geometry.eigenbasis")
    accepts(run, "method", "supple.geometry.eigenbasis")
    return Ready(
        lambda: run(case.vertices, case.faces, EIGENFUNCTIONS, method="lanczos"),
        _eigen_facts(case),
    )


def _eigsh(factored: bool):
    def setup(case: Case, _: int) -> Ready:
        import scipy.sparse as sparse
        from scipy.sparse.linalg import LinearOperator, eigsh

        if factored:
            import cholespy  # noqa: F401 - missing is found out before the clock runs

        count = min(EIGENFUNCTIONS, len(case.vertices) - 2)

        def call():
            laplacian, mass = operators(case)  # ours builds them too
            weights = sparse.diags(mass).tocsc()
            inverse = None
            if factored:
                solve = _cholespy_factor(laplacian - SHIFT * weights)
                inverse = LinearOperator(laplacian.shape, matvec=solve, dtype=np.float64)
            values, functions = eigsh(
                laplacian,
                k=count,
                M=weights,
                sigma=SHIFT,
                OPinv=inverse,
                tol=EIGSH_TOLERANCE,
            )
            return functions, values

        return Ready(call, _eigen_facts(case))

    return setup


# --- factor and solve -----------------------------------------------------------------------------


def _system(case: Case):
    """W + M, positive definite, (n, n) CSC."""
    import scipy.sparse as sparse

    laplacian, mass = operators(case)
    return (laplacian + sparse.diags(mass)).tocsc()


def _right_side(rows: int) -> np.ndarray:
    return np.random.default_rng(5).normal(size=(rows, COLUMNS))


def _solve_facts(matrix, rhs):
    def facts(result) -> dict:
        away = np.linalg.norm(matrix @ np.asarray(result) - rhs) / np.linalg.norm(rhs)
        return {"residual": float(away)}

    return facts


def _cholespy_factor(matrix):
    """A function that solves with the factored matrix: (n,) or (n, c) to the same shape."""
    import cholespy

    coo = matrix.tocoo()
    solver = cholespy.CholeskySolverD(
        matrix.shape[0],
        coo.row.astype(np.int32),
        coo.col.astype(np.int32),
        coo.data.astype(np.float64),
        cholespy.MatrixType.COO,
    )

    def solve(rhs: np.ndarray) -> np.ndarray:
        rhs = np.ascontiguousarray(rhs, dtype=np.float64)
        result = np.zeros_like(rhs)
        solver.solve(rhs, result)
        return result

    return solve


def _native_factor(ordering: str | None):
    def factor(matrix):
        cholesky = attribute("supple.geometry.SparseCholesky")
        if ordering is None:
            return cholesky(matrix).solve
        try:
            return cholesky(matrix, ordering=ordering).solve
        except (TypeError, SuppleError) as error:
            raise NotAvailable("supple.geometry.SparseCholesky(ordering=)") from error

    return factor


def _factoring(factor):
    def setup(case: Case, _: int) -> Ready:
        _probe(factor)
        matrix = _system(case)
        rhs = _right_side(matrix.shape[0])
        return Ready(lambda: factor(matrix), lambda solve: _solve_facts(matrix, rhs)(solve(rhs)))

    return setup


def _solving(factor):
    def setup(case: Case, _: int) -> Ready:
        _probe(factor)
        matrix = _system(case)
        rhs = _right_side(matrix.shape[0])
        solve = factor(matrix)
        return Ready(lambda: solve(rhs), _solve_facts(matrix, rhs))

    return setup


def _probe(factor) -> None:
    """Find out with a small matrix whether it can be had."""
    import scipy.sparse as sparse

    factor(sparse.identity(4, format="csc"))


# --- recovery -------------------------------------------------------------------------------------


def _recovery(form: str, solve: bool):
    def setup(case: Case, _: int) -> Ready:
        recovery = attribute("supple.geometry.EmbeddingRecovery")

        def factor():
            try:
                return recovery(case.vertices, case.faces, form=form)
            except TypeError as error:
                raise NotAvailable("supple.geometry.EmbeddingRecovery(form=)") from error

        moved = bent(case.vertices)
        jacobians = geometry.jacobians(case.vertices, case.faces, moved)

        def error(result) -> dict:
            away = np.asarray(result) - moved
            away -= away.mean(axis=0)
            return {"error": float(np.abs(away).max())}

        if not solve:
            return Ready(factor, lambda made: error(made.solve(moved, jacobians)))
        made = factor()
        return Ready(lambda: made.solve(moved, jacobians), error)

    return setup


TASKS = (
    Task(
        "eigenbasis",
        f"{EIGENFUNCTIONS} eigenfunctions",
        (
            Contender("supple", _eigenbasis, ours=True),
            Contender("SciPy eigsh", _eigsh(factored=False)),
            Contender("SciPy eigsh, CHOLMOD inside", _eigsh(factored=True)),
            Contender("Spectra", _lanczos),
        ),
    ),
    Task(
        "factor",
        "Cholesky factor of W + M",
        (
            Contender("supple", _factoring(_native_factor(None)), ours=True),
            Contender("CHOLMOD (cholespy)", _factoring(_cholespy_factor)),
            Contender("CHOLMOD supernodal, METIS", _factoring(_native_factor("metis"))),
        ),
    ),
    Task(
        "solve",
        f"solve with that factor, {COLUMNS} columns",
        (
            Contender("supple", _solving(_native_factor(None)), ours=True),
            Contender("CHOLMOD (cholespy)", _solving(_cholespy_factor)),
            Contender("CHOLMOD supernodal, METIS", _solving(_native_factor("metis"))),
        ),
    ),
    Task(
        "recovery_factor",
        "recovery of an embedding: factor",
        (
            Contender("supple, product", _recovery("product", solve=False), ours=True),
            Contender("literal (CHOLMOD)", _recovery("literal", solve=False)),
        ),
    ),
    Task(
        "recovery_solve",
        "recovery of an embedding: solve",
        (
            Contender("supple, product", _recovery("product", solve=True), ours=True),
            Contender("literal (CHOLMOD)", _recovery("literal", solve=True)),
        ),
    ),
)
