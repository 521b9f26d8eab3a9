# SPDX-License-Identifier: GPL-3.0-or-later
"""No test touches the user's own cache of prepared meshes; and shapes that several files use."""

from dataclasses import dataclass

import numpy as np
import pytest


@pytest.fixture(scope="session", autouse=True)
def cache_of_this_run(tmp_path_factory):
    """Commands that tests start inherit it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SUPPLE_CACHE_DIR", str(tmp_path_factory.mktemp("prepared")))
        patch.delenv("SUPPLE_CACHE_MAX", raising=False)
        patch.delenv("SUPPLE_CACHE", raising=False)
        yield


@dataclass(frozen=True)
class Blob:
    """A closed surface around the origin, unlike its mirror image.

    vertices (n, 3), faces (m, 3); directions (n, 3): equal ones correspond between blobs.
    """

    vertices: np.ndarray
    faces: np.ndarray
    directions: np.ndarray

    def nearest(self, other: "Blob") -> np.ndarray:
        """(n,) the other's vertex nearest to where each of these belongs."""
        return np.argmax(self.directions @ other.directions.T, axis=1)


BUMPS = np.array([[1, 0.2, 0.1], [-0.3, 1, 0.4], [0.1, -0.5, 1], [-0.8, -0.6, 0.2], [0.3, 0.4, -1]])
HEIGHTS = [0.9, 0.5, 0.35, 0.6, 0.25]


def bumpy_blob(size: int, seed: int, bend: float = 0.0) -> Blob:
    """Of `size` vertices; seeds differ in triangulation and order, bends in pose."""
    hull = pytest.importorskip("scipy.spatial").ConvexHull
    random = np.random.default_rng(seed)
    step = np.arange(size) + 0.5
    height, angle = 1 - 2 * step / size, np.pi * (1 + np.sqrt(5)) * step
    radius = np.sqrt(1 - height**2)
    even = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    directions = random.permutation(even @ turn)
    faces = hull(directions).simplices
    a, b, c = (directions[faces[:, i]] for i in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    centres = BUMPS / np.linalg.norm(BUMPS, axis=1, keepdims=True)
    raised = np.exp(6 * (directions @ centres.T - 1)) @ HEIGHTS
    vertices = directions * (1 + raised)[:, None]
    vertices[:, 2] += bend * vertices[:, 0] ** 2
    return Blob(vertices, faces.astype(np.int32), directions)


@pytest.fixture(scope="session")
def blob():
    return bumpy_blob
