# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user waits for: preparing a mesh, binding handles, edits; and refining a map."""

from __future__ import annotations

import numpy as np
import supple
from supple import geometry

from supple_training.compare.contender import Contender, Ready, Task, attribute
from supple_training.compare.shapes import LIFT, Case, bent, two_ends

MANY_ITERATIONS = 1000

REFINE_FROM, REFINE_TO, REFINE_STEP = 20, 100, 5
"""Eigenfunctions of a map before and after it is refined, and how many more each time."""

# --- prepare, bind, edit --------------------------------------------------------------------------


def _handles(case: Case) -> list[supple.Handle]:
    held, lifted = two_ends(case.vertices)
    move = np.eye(4)
    move[2, 3] = LIFT
    return [supple.Handle("held", held), supple.Handle("lifted", lifted, matrix=move)]


def _prepare(case: Case, _: int) -> Ready:
    return Ready(
        lambda: supple.PreparedMesh(case.vertices, case.faces),
        lambda prepared: {"residual": prepared.residual},
    )


def _bind(case: Case, _: int) -> Ready:
    prepared, model = supple.PreparedMesh(case.vertices, case.faces), supple.load_model("rotation")
    handles = _handles(case)
    return Ready(lambda: supple.Editor(prepared, handles, model=model))


def _distortion(case: Case, posed: np.ndarray) -> dict:
    return {"distortion": supple.symmetric_dirichlet(case.vertices, case.faces, posed)}


def _edit(mode: str):
    def setup(case: Case, _: int) -> Ready:
        prepared = supple.PreparedMesh(case.vertices, case.faces)
        editor = supple.Editor(prepared, _handles(case))

        def facts(result: supple.EditResult) -> dict:
            report = result.report
            return {
                "rounds": report["rounds"],
                "passes": report["passes"],
                **_distortion(case, result.vertices),
            }

        return Ready(lambda: editor.solve(mode=mode), facts)

    return setup


def _arap_inputs(case: Case):
    held, lifted = two_ends(case.vertices)
    vertices = np.ascontiguousarray(case.vertices)
    targets = np.concatenate([vertices[held], vertices[lifted] + [0.0, 0.0, LIFT]])
    return vertices, case.faces.astype(np.int64), np.concatenate([held, lifted]), targets


def _arap_factor(case: Case, _: int) -> Ready:
    import igl

    vertices, faces, held, _targets = _arap_inputs(case)

    def call():
        data = igl.ARAPData()
        igl.arap_precomputation(vertices, faces, 3, held, data)
        return data

    return Ready(call)


def _arap(iterations: int | None):
    def setup(case: Case, _: int) -> Ready:
        import igl

        vertices, faces, held, targets = _arap_inputs(case)
        data = igl.ARAPData()
        if iterations is not None:
            data.max_iter = iterations
        igl.arap_precomputation(vertices, faces, 3, held, data)

        def facts(posed: np.ndarray) -> dict:
            return {"iterations": int(data.max_iter), **_distortion(case, posed)}

        return Ready(lambda: igl.arap_solve(targets, data, vertices), facts)

    return setup


# --- refine ---------------------------------------------------------------------------------------


def _map_inputs(case: Case):
    """Two shapes, their eigenfunctions and masses, and a coarse functional map between them: that
    of every vertex to itself, which ours is given as it is."""
    other = bent(case.vertices)
    bases, masses = [], []
    for vertices in (case.vertices, other):
        functions, _, _ = geometry.eigenbasis(vertices, case.faces, REFINE_TO)
        bases.append(functions)
        masses.append(geometry.lumped_mass(vertices, case.faces))
    start = bases[1][:, :REFINE_FROM].T @ (masses[1][:, None] * bases[0][:, :REFINE_FROM])
    return bases, masses, np.ascontiguousarray(start)


def _map_facts(count: int):
    """How many vertices are matched to themselves: the shapes are one surface, moved."""

    def facts(result) -> dict:
        matched = np.asarray(result[1]).ravel()
        return {"matched to themselves": float((matched == np.arange(count)).mean())}

    return facts


def _zoomout(case: Case, _: int) -> Ready:
    zoomout = attribute("supple.spectral.zoomout")
    bases, masses, _ = _map_inputs(case)
    target, source = zip(bases, masses, strict=True)
    same = np.arange(len(case.vertices))

    def call():
        refined = zoomout(source, target, same, start=REFINE_FROM, end=REFINE_TO, step=REFINE_STEP)
        return refined[::-1]  # the functional map first, as pyFM has it

    return Ready(call, _map_facts(len(case.vertices)))


def _pyfm(case: Case, threads: int) -> Ready:
    import scipy.sparse as sparse
    from pyFM.refine import zoomout_refine

    bases, masses, start = _map_inputs(case)
    area = sparse.diags(masses[1])
    rounds = (REFINE_TO - REFINE_FROM) // REFINE_STEP

    def call():
        return zoomout_refine(
            start,
            bases[0],
            bases[1],
            nit=rounds,
            step=REFINE_STEP,
            A2=area,
            return_p2p=True,
            n_jobs=threads,
        )

    return Ready(call, _map_facts(len(case.vertices)))


ARAP = "libigl ARAP"
ARAP_MANY = f"libigl ARAP, {MANY_ITERATIONS} iterations"

TASKS = (
    Task("prepare", "prepare a mesh", (Contender("supple", _prepare, ours=True),)),
    Task(
        "bind",
        "bind handles",
        (Contender("supple", _bind, ours=True), Contender(ARAP, _arap_factor)),
    ),
    Task(
        "edit_natural",
        "warm edit, natural",
        (Contender("supple", _edit("natural"), ours=True), Contender(ARAP, _arap(None))),
    ),
    Task(
        "edit_stiff",
        "warm edit, stiff",
        (
            Contender("supple", _edit("stiff"), ours=True),
            Contender(ARAP, _arap(None)),
            Contender(ARAP_MANY, _arap(MANY_ITERATIONS)),
        ),
    ),
    Task(
        "refine",
        f"refine a map, {REFINE_FROM} to {REFINE_TO} eigenfunctions",
        (Contender("supple", _zoomout, ours=True), Contender("pyFM ZoomOut", _pyfm)),
    ),
)
