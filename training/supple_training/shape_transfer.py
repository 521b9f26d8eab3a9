# SPDX-License-Identifier: GPL-3.0-or-later
"""Shape keys carried from a coarse body to a fine one, against the true ones.

    python -m supple_training.shape_transfer [--vertices 3000] [--seed 0] [--pictures DIR]

A body is triangulated again with few vertices, so its keys are known on both meshes: another
figure, poses. Printed for each key, beside what copying offsets does: RMS error, in thousandths of
the root of the area, and roughness, the RMS error of the deformation's Jacobians, in which
stair-steps are large however low they are. With --pictures, DIR/KEY.png shows the target with the
true key and with each method's, smoothly shaded, so that steps show as facets.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import scipy.spatial
import supple
import supple.geometry

from . import bodies, remesh

FloatArray = bodies.FloatArray
IntArray = bodies.IntArray

PIXELS = 900
"""Height of a picture."""


def keys_of(phenotype: FloatArray, seed: int) -> dict[str, FloatArray]:
    """True shapes of one body by name: stronger and heavier, and two random poses."""
    heavier = phenotype.copy()
    for name in ("muscle", "weight"):
        heavier[bodies.PHENOTYPES.index(name)] += 0.3
    poses = [np.random.default_rng([seed, pose]) for pose in range(2)]
    shapes = {"heavier": bodies.vertices(np.clip(heavier, 0.0, 1.0))}
    for number, rng in enumerate(poses):
        shapes[f"pose {number}"] = bodies.sample_pose(phenotype, rng)
    return shapes


class Judge:
    """Errors of moved vertices on a rest mesh."""

    def __init__(self, rest: FloatArray, faces: IntArray) -> None:
        self._rest, self._faces = rest, faces
        self._areas = supple.geometry.face_areas(rest, faces)

    def rms(self, moved: FloatArray, truth: FloatArray) -> float:
        """By area, in thousandths of the area's root."""
        return 10.0 * supple.pose_error(self._rest, self._faces, moved, truth)

    def roughness(self, moved: FloatArray, truth: FloatArray) -> float:
        """RMS difference of the Jacobians by area."""
        difference = supple.geometry.jacobians(
            self._rest, self._faces, moved
        ) - supple.geometry.jacobians(self._rest, self._faces, truth)
        squared = np.sum(difference**2, axis=(1, 2))
        return float(np.sqrt(self._areas @ squared / self._areas.sum()))


def draw(faces: IntArray, shown: dict[str, FloatArray], path: Path) -> None:
    """Write the shapes side by side as PNG, from the front, all at one scale."""
    import matplotlib.image

    from .compare.edits import raster

    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # Z up, as Y up
    shown = {name: points @ upright for name, points in shown.items()}
    view = raster.camera(list(shown.values()), elevation=5.0, turn=20.0)
    width = round(PIXELS * view.extent[0] / view.extent[1])
    grey = np.full((len(faces), 3), 0.86)
    images = [raster.render(points, faces, grey, view, width) for points in shown.values()]
    path.parent.mkdir(parents=True, exist_ok=True)
    matplotlib.image.imsave(path, np.clip(np.concatenate(images, axis=1), 0.0, 1.0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vertices", type=int, default=3000, help="of the coarse body")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pictures", type=Path, help="folder for a picture of each key")
    options = parser.parse_args()

    rng = np.random.default_rng(options.seed)
    phenotype = bodies.sample_phenotype(rng, held_out=True)
    rest, faces = bodies.vertices(phenotype), bodies.triangles()
    coarse = remesh.remesh(rest, faces, rng, vertex_count=options.vertices)
    source = supple.Mesh(coarse.carry(rest), coarse.faces)
    target = supple.Mesh(rest, faces)

    normals = np.zeros_like(rest)
    unit, areas = remesh.unit_normals(rest, faces)
    np.add.at(normals, faces.ravel(), np.repeat(unit * areas[:, None], 3, axis=0))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    surface_map = supple.closest_points(source, rest, normals, cos_limit=0.3, reach=0.05).map
    nearest = scipy.spatial.cKDTree(source.vertices).query(rest)[1]

    shapes = keys_of(phenotype, options.seed)
    judge = Judge(rest, faces)
    print(f"{len(source.vertices)} to {len(rest)} vertices        rms  roughness")
    for name, truth in shapes.items():
        key = coarse.carry(truth)
        offsets = key - source.vertices
        blended = supple.transfer_field(surface_map, source, offsets).values
        rows = {
            "nearest vertex's offset": rest + offsets[nearest],
            "blended offsets": rest + blended,
            "transfer_shape_keys": supple.transfer_shape_keys(
                source, [key], target, surface_map
            ).shapes[0],
        }
        for method, moved in rows.items():
            rms, roughness = judge.rms(moved, truth), judge.roughness(moved, truth)
            print(f"{name:8} {method:24} {rms:7.3f} {roughness:8.3f}")
        if options.pictures:
            path = options.pictures / f"{name.replace(' ', '_')}.png"
            draw(faces, {"truth": truth, **rows}, path)
            print(f"wrote {path}: {', '.join(['truth', *rows])}")


if __name__ == "__main__":
    main()
