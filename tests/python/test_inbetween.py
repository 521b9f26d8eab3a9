# SPDX-License-Identifier: GPL-3.0-or-later
"""In-betweening through the Python package, on the sample human."""

import json
from pathlib import Path

import numpy as np
import pytest
import supple
from supple import Handle, SuppleError
from supple.mesh_files import read_mesh

HUMAN = Path(__file__).resolve().parents[2] / "samples" / "human"
SHOULDER = np.array([-0.17, 1.5, 0.0])
ANGLE = np.radians(100)


def turned(angle: float) -> np.ndarray:
    """The right arm up, about the shoulder."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    matrix[:3, 3] = SHOULDER - matrix[:3, :3] @ SHOULDER
    return matrix


@pytest.fixture(scope="module")
def human():
    vertices, faces = read_mesh(HUMAN / "human.obj")
    groups = json.loads((HUMAN / "human_groups.json").read_text())
    prepared = supple.PreparedMesh(vertices, faces)
    handles = [
        Handle(name, group, matrix=turned(ANGLE) if name == "hand.R" else None)
        for name, group in groups.items()
    ]
    posed = supple.Editor(prepared, handles).solve().vertices
    return prepared, posed, groups


def volume(points: np.ndarray, faces: np.ndarray) -> float:
    return np.linalg.det(points[faces]).sum() / 6


def test_an_arm_turns_on_an_arc(human):
    prepared, posed, groups = human
    rest, hand = prepared.vertices, groups["hand.R"]
    between = supple.Inbetween(prepared, [rest, posed], [0, 10])
    middle, blended = between.at(5), (rest + posed) / 2

    def reach(points):
        return np.linalg.norm(points[hand].mean(axis=0) - SHOULDER)

    assert reach(posed) == pytest.approx(reach(rest), rel=1e-6)
    assert reach(middle) == pytest.approx(reach(rest), rel=0.01)
    assert reach(blended) < 0.7 * reach(rest)
    half = rest[hand] @ turned(ANGLE / 2)[:3, :3].T + turned(ANGLE / 2)[:3, 3]
    arm = np.linalg.norm(rest[hand].mean(axis=0) - SHOULDER)
    assert np.linalg.norm(middle[hand] - half, axis=1).max() < 0.03 * arm
    # The arm is a small part of the body, so what a blend takes from it is some 2%.
    mean = (volume(rest, prepared.faces) + volume(posed, prepared.faces)) / 2
    assert volume(middle, prepared.faces) == pytest.approx(mean, rel=0.003)
    assert volume(blended, prepared.faces) < 0.985 * mean
    for still in ("foot.L", "foot.R", "hand.L"):
        np.testing.assert_allclose(middle[groups[still]], rest[groups[still]], atol=1e-3)


def test_keys_are_exact_and_ends_are_held(human):
    prepared, posed, _ = human
    rest = prepared.vertices
    between = supple.Inbetween(prepared, [rest, posed, rest], [1, 2, 4])
    assert np.array_equal(between.at(2), posed)
    assert np.array_equal(between.at(0), rest)
    assert np.array_equal(between.at(9), rest)
    sharp = supple.Inbetween(prepared, [rest, posed, rest], [1, 2, 4], smooth=False)
    assert np.abs(sharp.at(1.5) - between.at(1.5)).max() > 1e-3


def test_errors_have_codes(human):
    prepared, posed, _ = human
    with pytest.raises(SuppleError) as error:
        supple.Inbetween(prepared, [posed, posed], [1, 0])
    assert error.value.code == "bad_option"
    with pytest.raises(SuppleError, match=r"poses\[1\]") as error:
        supple.Inbetween(prepared, [posed, posed[:, :2]], [0, 1])
    assert error.value.code == "wrong_shape"
    progress = supple.Progress()
    progress.cancel()
    with pytest.raises(supple.Cancelled):
        supple.Inbetween(prepared, [posed, posed], [0, 1], progress=progress)
