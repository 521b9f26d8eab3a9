# SPDX-License-Identifier: GPL-3.0-or-later
"""
Native core of Supple; use the package `supple`, which checks and documents.
"""

from __future__ import annotations

import collections.abc
import os
import pathlib
import typing

import numpy
import numpy.typing
import scipy.sparse

__all__: list[str] = [
    "Architecture",
    "DiffusionSizes",
    "EditOptions",
    "EditReport",
    "EditSession",
    "Editor",
    "EmbeddingRecovery",
    "Geodesics",
    "GuideMaps",
    "GuidePair",
    "Handle",
    "HandleTarget",
    "InitialMap",
    "JointEpoch",
    "JointTrainOptions",
    "JointTrainer",
    "KeptFrames",
    "MapScore",
    "MatchDirection",
    "MatchNetworks",
    "MatchOptions",
    "MatchResult",
    "Matcher",
    "Network",
    "Note",
    "PointCacheReader",
    "PointCacheWriter",
    "PreparedMesh",
    "Progress",
    "RefineOptions",
    "RefineReport",
    "RefineResult",
    "Refiner",
    "SequenceEditor",
    "SequenceFrame",
    "SoftMap",
    "SparseCholesky",
    "SurfaceMap",
    "TrainOptions",
    "TrainingPair",
    "TriangleMesh",
    "UnsupervisedLoss",
    "UnsupervisedOptions",
    "automatic_map",
    "blas_name",
    "blend",
    "chamfer",
    "check_surface_map",
    "closest_points",
    "closest_rotations",
    "cotan_laplacian",
    "coverage",
    "deform",
    "eigenbasis",
    "face_areas",
    "face_distortion",
    "face_inversion",
    "falloff_weights",
    "farthest_points",
    "flipped_faces",
    "functional_map",
    "geodesic_errors",
    "gradient",
    "guide_maps",
    "handle_frames",
    "jacobians",
    "landmark_map",
    "load_map",
    "lumped_mass",
    "map_dirichlet",
    "map_score",
    "nearest_corners",
    "nearest_map",
    "nearest_rows",
    "network_forward",
    "network_gradient",
    "part_of_motion",
    "point_map",
    "pose_error",
    "range_share",
    "reversed_map",
    "save_map",
    "set_thread_count",
    "shrink_fit",
    "simd_level",
    "surface_map",
    "symmetric_dirichlet",
    "thread_count",
    "train",
    "train_double",
    "transfer_corners",
    "transfer_field",
    "transfer_groups",
    "transfer_shape_keys",
    "unsupervised_loss",
    "uv_map",
    "vertex_inversion",
    "within_islands",
    "zoomout",
    "zoomout_map",
]

class Progress:
    """
    Progress and cancellation of one long call.

    Pass a new one as `progress=` and watch it from another thread.
    """
    def __init__(self) -> None: ...
    def cancel(self) -> None:
        """
        Ask the call to stop; it raises Cancelled soon after.
        """
    @property
    def cancelled(self) -> bool:
        """
        Whether cancel was called.
        """
    @property
    def fraction(self) -> float:
        """
        Done part of the call, 0 to 1.
        """
    @property
    def seconds_left(self) -> float | None:
        """
        Estimated seconds left; None before 2% is done.
        """
    @property
    def stage(self) -> str:
        """
        What is being done, in words.
        """

class Note:
    @property
    def code(self) -> str: ...
    @property
    def count(self) -> int: ...
    @property
    def message(self) -> str: ...

class TriangleMesh:
    def __init__(
        self,
        vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
        faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    ) -> None: ...
    @property
    def notes(self) -> list[Note]: ...

class SurfaceMap:
    def __init__(
        self,
        face: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        weights: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    ) -> None: ...
    @property
    def face(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def weights(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]: ...

class Inbetween:
    def __init__(
        self,
        prepared: PreparedMesh,
        poses: collections.abc.Sequence[
            typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"]
        ],
        times: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex],
        smooth: bool = True,
        progress: Progress = None,
    ) -> None: ...
    def at(
        self, time: typing.SupportsFloat | typing.SupportsIndex
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]: ...

class Geodesics:
    def __init__(
        self,
        vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
        faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    ) -> None: ...
    def between(
        self,
        sources: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        targets: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, n]"],
        progress: Progress = None,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    def distances(
        self, source: typing.SupportsInt | typing.SupportsIndex
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]: ...

class MapScore:
    @property
    def area(self) -> float: ...
    @property
    def orientation(self) -> float: ...
    @property
    def smoothness(self) -> float: ...
    @property
    def value(self) -> float: ...

class InitialMap:
    @property
    def notes(self) -> list[Note]: ...
    @property
    def point_map(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def score(self) -> MapScore: ...

class SparseCholesky:
    def __init__(
        self,
        matrix: scipy.sparse.csc_matrix,
        backend: str | None = None,
        ordering: str
        | typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"] = "automatic",
    ) -> None: ...
    def solve(
        self, rhs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    @property
    def factor_entries(self) -> int: ...
    @property
    def ordering(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def size(self) -> int: ...

class EmbeddingRecovery:
    def __init__(
        self,
        vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
        faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
        form: str = "product",
        pull: typing.SupportsFloat | typing.SupportsIndex = 4000.0,
        point_weight: typing.SupportsFloat | typing.SupportsIndex = 20000.0,
        jacobian_weight: typing.SupportsFloat | typing.SupportsIndex = 150000.0,
    ) -> None: ...
    def solve(
        self,
        coarse: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
        jacobians: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 9]"],
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]: ...
    @property
    def factor_entries(self) -> int: ...

class Architecture:
    def __init__(
        self,
        configuration: str,
        signal: str,
        eigenfunctions: typing.SupportsInt | typing.SupportsIndex = 128,
        width: typing.SupportsInt | typing.SupportsIndex = 256,
    ) -> None: ...
    @property
    def configuration(self) -> str: ...
    @property
    def eigenfunctions(self) -> int: ...
    @property
    def inputs(self) -> int: ...
    @property
    def outputs(self) -> int: ...
    @property
    def signal(self) -> str: ...
    @property
    def width(self) -> int: ...

class Network:
    @staticmethod
    def untrained(
        architecture: Architecture, seed: typing.SupportsInt | typing.SupportsIndex
    ) -> Network: ...
    def __init__(
        self,
        architecture: Architecture,
        tensors: collections.abc.Mapping[
            str, typing.Annotated[numpy.typing.ArrayLike, numpy.float32, "[m, n]"]
        ],
    ) -> None: ...
    def tensors(
        self,
    ) -> dict[str, typing.Annotated[numpy.typing.NDArray[numpy.float32], "[m, n]"]]: ...
    @property
    def architecture(self) -> Architecture: ...

class TrainOptions:
    architecture: Architecture
    def __init__(self) -> None: ...
    @property
    def epochs(self) -> int: ...
    @epochs.setter
    def epochs(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def fewest_eigenfunctions(self) -> int: ...
    @fewest_eigenfunctions.setter
    def fewest_eigenfunctions(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def first_learning_rate(self) -> float: ...
    @first_learning_rate.setter
    def first_learning_rate(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def last_learning_rate(self) -> float: ...
    @last_learning_rate.setter
    def last_learning_rate(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def loss_weights(self) -> typing.Annotated[list[float], "FixedSize(3)"]: ...
    @loss_weights.setter
    def loss_weights(
        self,
        arg1: typing.Annotated[
            collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"
        ],
    ) -> None: ...
    @property
    def most_eigenfunctions(self) -> int: ...
    @most_eigenfunctions.setter
    def most_eigenfunctions(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def samples(self) -> int: ...
    @samples.setter
    def samples(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def seed(self) -> int: ...
    @seed.setter
    def seed(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...

class TrainingPair:
    def __init__(
        self,
        source: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
        faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
        target: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
        suggestions: collections.abc.Sequence[typing.Any] = ...,
        maps: collections.abc.Sequence[
            typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"]
        ] = ...,
    ) -> None: ...

class SoftMap:
    def __init__(
        self,
        source: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        target: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        temperature: typing.SupportsFloat | typing.SupportsIndex = 0.07,
        progress: Progress = None,
    ) -> None: ...
    def apply(
        self,
        values: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        progress: Progress = None,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    def hard_map(
        self, progress: Progress = None
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...

class UnsupervisedOptions:
    smooth_features: bool
    def __init__(self) -> None: ...
    @property
    def temperature(self) -> float: ...
    @temperature.setter
    def temperature(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def map_weight(self) -> float: ...
    @map_weight.setter
    def map_weight(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def map_exponent(self) -> float: ...
    @map_exponent.setter
    def map_exponent(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def orthogonality(self) -> float: ...
    @orthogonality.setter
    def orthogonality(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def coupling(self) -> float: ...
    @coupling.setter
    def coupling(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def bijectivity(self) -> float: ...
    @bijectivity.setter
    def bijectivity(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def map_penalty(self) -> str: ...
    @map_penalty.setter
    def map_penalty(self, arg1: str) -> None: ...
    @property
    def jacobian_weights(self) -> typing.Annotated[list[float], "FixedSize(3)"]: ...
    @jacobian_weights.setter
    def jacobian_weights(
        self,
        arg1: typing.Annotated[
            collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"
        ],
    ) -> None: ...

class MatchDirection:
    @property
    def map(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    @property
    def soft_map(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    @property
    def pulled(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]: ...
    @property
    def coarse(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]: ...

class UnsupervisedLoss:
    @property
    def match(self) -> typing.Annotated[list[MatchDirection], "FixedSize(2)"]: ...
    @property
    def grad_features(
        self,
    ) -> typing.Annotated[
        list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]], "FixedSize(2)"
    ]: ...
    @property
    def grad_predicted(
        self,
    ) -> typing.Annotated[
        list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 9]"]], "FixedSize(2)"
    ]: ...
    @property
    def orthogonality(self) -> float: ...
    @property
    def coupling(self) -> float: ...
    @property
    def bijectivity(self) -> float: ...
    @property
    def fit(self) -> float: ...
    @property
    def smoothness(self) -> float: ...
    @property
    def determinant(self) -> float: ...
    @property
    def total(self) -> float: ...

class PreparedCache:
    """
    A folder that keeps prepared meshes, for any number of threads and processes.

    supple.cache makes the one that is used where none is named.
    """
    def __init__(
        self,
        folder: os.PathLike | str | bytes,
        max_bytes: typing.SupportsInt | typing.SupportsIndex,
    ) -> None: ...
    def clear(self) -> tuple[int, int]:
        """
        Remove all files; return their number and bytes.
        """
    def size(self) -> tuple[int, int]:
        """
        Number of files and their bytes.
        """
    @property
    def folder(self) -> pathlib.Path:
        """
        Where the files are.
        """
    @property
    def max_bytes(self) -> int:
        """
        The most the files may take together.
        """

class PreparedMesh:
    def __init__(
        self,
        vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
        faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
        eigenfunctions: typing.SupportsInt | typing.SupportsIndex = 128,
        samples: typing.SupportsInt | typing.SupportsIndex = 1024,
        progress: Progress = None,
        cache: PreparedCache = None,
    ) -> None: ...
    @property
    def diagonal(self) -> float: ...
    @property
    def eigenvalues(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]: ...
    @property
    def faces(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 3]"]: ...
    @property
    def from_cache(self) -> bool: ...
    @property
    def notes(self) -> list[Note]: ...
    @property
    def residual(self) -> float: ...
    @property
    def vertices(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]: ...

class Handle:
    def __init__(
        self,
        name: str,
        vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        weight: typing.SupportsFloat | typing.SupportsIndex = 1.0,
    ) -> None: ...

class HandleTarget:
    def __init__(
        self,
        matrix: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[4, 4]"] | None = None,
        positions: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"] | None = None,
    ) -> None: ...

class EditOptions:
    def __init__(
        self,
        method: str = "supple",
        stiffness: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        rounds: typing.SupportsInt | typing.SupportsIndex = -1,
        network_rounds: typing.SupportsInt | typing.SupportsIndex = -1,
        polish: typing.SupportsInt | typing.SupportsIndex = -1,
        passes: typing.SupportsInt | typing.SupportsIndex = -1,
        network: bool = True,
        loose_pieces_follow: bool = True,
        keep_volume: bool = True,
    ) -> None: ...

class EditReport:
    @property
    def network(self) -> bool: ...
    @property
    def volume_kept(self) -> bool: ...
    @property
    def passes(self) -> int: ...
    @property
    def passes_milliseconds(self) -> float: ...
    @property
    def polish(self) -> int: ...
    @property
    def rounds(self) -> int: ...
    @property
    def rounds_milliseconds(self) -> float: ...
    @property
    def suggestion_milliseconds(self) -> float: ...
    @property
    def total_milliseconds(self) -> float: ...

class Editor:
    def __init__(
        self,
        prepared: PreparedMesh,
        handles: collections.abc.Sequence[Handle],
        network: Network,
        progress: Progress = None,
        former: Editor = None,
    ) -> None: ...
    def solve(
        self,
        targets: collections.abc.Sequence[HandleTarget],
        options: EditOptions,
        progress: Progress = None,
        start: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"] | None = None,
    ) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"], EditReport]: ...

class EditSession:
    def __init__(self, editor: Editor, options: EditOptions) -> None: ...
    def advance(
        self, milliseconds: typing.SupportsFloat | typing.SupportsIndex
    ) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"], EditReport]: ...
    def aim(self, targets: collections.abc.Sequence[HandleTarget]) -> None: ...
    @property
    def settled(self) -> bool: ...

class SequenceFrame:
    def __init__(
        self,
        vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
        corrections: collections.abc.Sequence[
            typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[4, 4]"] | None
        ],
        share: typing.SupportsFloat | typing.SupportsIndex,
    ) -> None: ...

class SequenceEditor:
    def __init__(self, editor: Editor, options: EditOptions) -> None: ...
    def solve(
        self,
        frames: collections.abc.Sequence[SequenceFrame],
        progress: Progress = None,
    ) -> list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]]: ...

def blas_name() -> str: ...
def blend(
    rest: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    posed: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    strength: typing.SupportsFloat | typing.SupportsIndex,
    weights: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]: ...
def check_surface_map(
    map: SurfaceMap,
    size: typing.SupportsInt | typing.SupportsIndex,
    target_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
) -> None: ...
def closest_points(
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    points: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    normals: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"] | None,
    cos_limit: typing.SupportsFloat | typing.SupportsIndex,
    reach: typing.SupportsFloat | typing.SupportsIndex,
) -> tuple[
    SurfaceMap,
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"],
    typing.Annotated[numpy.typing.NDArray[numpy.bool], "[m, 1]"],
]: ...
def closest_rotations(
    jacobians: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 9]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 9]"]: ...
def cotan_laplacian(
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
) -> scipy.sparse.csc_matrix: ...
def deform(
    prepared: PreparedMesh,
    target: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    eigenfunctions: typing.SupportsInt | typing.SupportsIndex,
    network: Network,
    progress: Progress = None,
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]: ...
def eigenbasis(
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    count: typing.SupportsInt | typing.SupportsIndex,
    method: str = "automatic",
    progress: Progress = None,
) -> tuple[
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"],
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"],
    float,
]: ...
def face_areas(
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]: ...
def face_distortion(
    rest: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    posed: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]: ...
def falloff_weights(
    prepared: PreparedMesh,
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
    radius: typing.SupportsFloat | typing.SupportsIndex,
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]: ...
def farthest_points(
    points: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    count: typing.SupportsInt | typing.SupportsIndex,
) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
def flipped_faces(
    rest: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    posed: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
) -> int: ...
def functional_map(
    source: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    source_mass: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    target: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    target_mass: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    point_map: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
def gradient(
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
) -> scipy.sparse.csc_matrix: ...
def handle_frames(
    prepared: PreparedMesh,
    handles: collections.abc.Sequence[
        typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"]
    ],
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
) -> list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[4, 4]"]]: ...
def jacobians(
    rest: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    moved: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 9]"]: ...
def load_map(
    path: os.PathLike | str | bytes,
    source_vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    source_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    target_vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    target_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
) -> SurfaceMap: ...
def lumped_mass(
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]: ...
def nearest_corners(
    map: SurfaceMap,
    target_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
def nearest_rows(
    queries: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    points: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    progress: Progress = None,
) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
def network_forward(
    prepared: PreparedMesh,
    network: Network,
    rotations: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 9]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 9]"]: ...
def network_gradient(
    prepared: PreparedMesh,
    network: Network,
    rotations: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 9]"],
    grad: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 9]"],
) -> dict[str, typing.Annotated[numpy.typing.NDArray[numpy.float32], "[m, n]"]]: ...
def part_of_motion(
    matrix: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[4, 4]"],
    centre: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[1, 3]"],
    part: typing.SupportsFloat | typing.SupportsIndex,
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[4, 4]"]: ...
def range_share(
    frame: typing.SupportsFloat | typing.SupportsIndex,
    first: typing.SupportsFloat | typing.SupportsIndex,
    last: typing.SupportsFloat | typing.SupportsIndex,
    ease_in: typing.SupportsFloat | typing.SupportsIndex,
    ease_out: typing.SupportsFloat | typing.SupportsIndex,
) -> float: ...
def point_map(
    source: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    source_mass: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    target: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    target_mass: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    functional_map: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    progress: Progress = None,
) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
def pose_error(
    rest: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    posed: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    truth: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
) -> float: ...
def propose_motion_handles(
    prepared: PreparedMesh,
    moved: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    count: typing.SupportsInt | typing.SupportsIndex,
    radius: typing.SupportsFloat | typing.SupportsIndex | None,
) -> list[typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]]: ...
def reversed_map(
    map: SurfaceMap,
    from_vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    from_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    to_vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    to_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
) -> SurfaceMap: ...
def save_map(
    path: os.PathLike | str | bytes,
    map: SurfaceMap,
    source_vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    source_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    target_vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    target_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
) -> None: ...
def set_thread_count(count: typing.SupportsInt | typing.SupportsIndex) -> None: ...
def shrink_fit(
    source_vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    source_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    target_vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    target_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    map: SurfaceMap,
    rounds: typing.SupportsInt | typing.SupportsIndex = 4,
    project: bool = True,
    progress: Progress = None,
) -> tuple[
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"],
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"],
    int,
    int,
]: ...
def simd_level() -> str: ...
def surface_map(
    point_map: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
    target_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    target_vertices: typing.SupportsInt | typing.SupportsIndex,
) -> SurfaceMap: ...
def symmetric_dirichlet(
    rest: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    posed: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
) -> float: ...
def thread_count() -> int: ...
def train(
    pairs: collections.abc.Sequence[TrainingPair],
    options: TrainOptions,
    max_steps: typing.SupportsInt | typing.SupportsIndex = 0,
    on_step: typing.Any = None,
    progress: Progress = None,
) -> dict: ...
def train_double(
    pairs: collections.abc.Sequence[TrainingPair],
    options: TrainOptions,
    max_steps: typing.SupportsInt | typing.SupportsIndex = 0,
    on_step: typing.Any = None,
    progress: Progress = None,
) -> dict: ...
def transfer_corners(
    map: SurfaceMap,
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    target_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    corners: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    tolerance: typing.SupportsFloat | typing.SupportsIndex,
    extrapolate: bool,
    polygons: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
    otherwise: typing.SupportsFloat | typing.SupportsIndex,
) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], int]: ...
def transfer_field(
    map: SurfaceMap,
    source_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    field: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    otherwise: typing.SupportsFloat | typing.SupportsIndex,
) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], int]: ...
def transfer_groups(
    map: SurfaceMap,
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    target_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    weights: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    smallest: typing.SupportsFloat | typing.SupportsIndex,
    majority: typing.SupportsFloat | typing.SupportsIndex,
) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], bool, int, int]: ...
def transfer_shape_keys(
    source_vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    source_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    keys: collections.abc.Sequence[
        typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"]
    ],
    target_vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    target_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    map: SurfaceMap,
    progress: Progress = None,
) -> tuple[list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]], bool, int]: ...
def within_islands(
    map: SurfaceMap,
    vertices: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    target_faces: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 3]"],
    majority: typing.SupportsFloat | typing.SupportsIndex,
) -> tuple[SurfaceMap, int, int]: ...
def coverage(
    source: TriangleMesh,
    target: TriangleMesh,
    map: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
) -> float: ...
def face_inversion(
    source: TriangleMesh,
    target: TriangleMesh,
    map: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
) -> float: ...
def map_dirichlet(
    source: TriangleMesh,
    target: TriangleMesh,
    map: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
) -> float: ...
def vertex_inversion(
    source: TriangleMesh,
    target: TriangleMesh,
    map: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
) -> float: ...
def chamfer(
    a: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
    b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 3]"],
) -> float: ...
def geodesic_errors(
    geodesics: Geodesics,
    area: typing.SupportsFloat | typing.SupportsIndex,
    truth: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
    images: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, n]"],
    progress: Progress = None,
) -> list[tuple[float, int]]: ...
def automatic_map(
    source: PreparedMesh,
    target: PreparedMesh,
    progress: Progress = None,
) -> InitialMap: ...
def landmark_map(
    source: PreparedMesh,
    target: PreparedMesh,
    source_landmarks: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
    target_landmarks: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
    progress: Progress = None,
) -> InitialMap: ...
def map_score(
    source: PreparedMesh,
    target: PreparedMesh,
    point_map: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
) -> MapScore: ...
def nearest_map(
    source: PreparedMesh,
    target: PreparedMesh,
    aligned: bool = False,
    progress: Progress = None,
) -> InitialMap: ...
def unsupervised_loss(
    first: PreparedMesh,
    second: PreparedMesh,
    features: typing.Annotated[
        collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]],
        "FixedSize(2)",
    ],
    predicted: typing.Annotated[
        collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 9]"]],
        "FixedSize(2)",
    ],
    functions: typing.SupportsInt | typing.SupportsIndex,
    options: UnsupervisedOptions,
    progress: Progress = None,
) -> UnsupervisedLoss: ...
def uv_map(
    source: PreparedMesh,
    target: PreparedMesh,
    source_uvs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    target_uvs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> InitialMap: ...
def zoomout_map(
    source: PreparedMesh,
    target: PreparedMesh,
    point_map: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
    start: typing.SupportsInt | typing.SupportsIndex,
    end: typing.SupportsInt | typing.SupportsIndex,
    step: typing.SupportsInt | typing.SupportsIndex,
    sampled: bool,
    progress: Progress = None,
) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
def zoomout(
    source: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    source_mass: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    target: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    target_mass: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    point_map: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
    start: typing.SupportsInt | typing.SupportsIndex,
    end: typing.SupportsInt | typing.SupportsIndex,
    step: typing.SupportsInt | typing.SupportsIndex,
    progress: Progress = None,
) -> tuple[
    typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"],
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"],
]: ...

__version__: str

class RefineOptions:
    def __init__(
        self,
        method: str = "recovery",
        counts: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex] = ...,
        settling_rounds: typing.SupportsInt | typing.SupportsIndex = 0,
        form: str = "product",
        pull: typing.SupportsFloat | typing.SupportsIndex = 4000.0,
        point_weight: typing.SupportsFloat | typing.SupportsIndex = 20000.0,
        jacobian_weight: typing.SupportsFloat | typing.SupportsIndex = 150000.0,
        facing: typing.SupportsFloat | typing.SupportsIndex = 0.0,
        facing_reach: typing.SupportsFloat | typing.SupportsIndex = ...,
        backward: bool = False,
    ) -> None: ...

class RefineReport:
    @property
    def rounds(self) -> int: ...
    @property
    def eigenfunctions(self) -> int: ...
    @property
    def network(self) -> bool: ...
    @property
    def bounded_faces(self) -> int: ...
    @property
    def signal_milliseconds(self) -> float: ...
    @property
    def network_milliseconds(self) -> float: ...
    @property
    def recovery_milliseconds(self) -> float: ...
    @property
    def nearest_milliseconds(self) -> float: ...
    @property
    def total_milliseconds(self) -> float: ...

class RefineResult:
    @property
    def point_map(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def surface_map(self) -> SurfaceMap: ...
    @property
    def recovered(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 3]"]: ...
    @property
    def confidence(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]: ...
    @property
    def backward_point_map(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def backward_surface_map(self) -> SurfaceMap: ...
    @property
    def report(self) -> RefineReport: ...

class Refiner:
    def __init__(
        self,
        source: PreparedMesh,
        target: PreparedMesh,
        network: Network | None,
        options: RefineOptions,
        progress: Progress | None = None,
    ) -> None: ...
    @typing.overload
    def refine(
        self,
        point_map: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        progress: Progress | None = None,
    ) -> RefineResult: ...
    @typing.overload
    def refine(self, map: SurfaceMap, progress: Progress | None = None) -> RefineResult: ...
    @property
    def notes(self) -> list[Note]: ...

class PointCacheReader:
    def __init__(self, path: os.PathLike | str | bytes) -> None: ...
    @property
    def points(self) -> int: ...
    @property
    def start(self) -> float: ...
    @property
    def rate(self) -> float: ...
    @property
    def frames(self) -> int: ...
    def read(
        self, frame: typing.SupportsInt | typing.SupportsIndex
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float32], "[m, 3]"]: ...

class PointCacheWriter:
    def __init__(
        self,
        path: os.PathLike | str | bytes,
        points: typing.SupportsInt | typing.SupportsIndex,
        start: typing.SupportsFloat | typing.SupportsIndex,
        rate: typing.SupportsFloat | typing.SupportsIndex,
        frame_count: typing.SupportsInt | typing.SupportsIndex,
    ) -> None: ...
    @property
    def frames(self) -> int: ...
    def append(
        self,
        key: str,
        positions: typing.Annotated[numpy.typing.ArrayLike, numpy.float32, "[m, 3]"],
    ) -> None: ...
    def finish(self) -> None: ...
    def close(self) -> None: ...
    def discard(self) -> None: ...

class KeptFrames:
    def __init__(self, paths: collections.abc.Sequence[os.PathLike | str | bytes]) -> None: ...
    def find(
        self, key: str
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float32], "[m, 3]"] | None: ...
    def size(self) -> int: ...

class DiffusionSizes:
    def __init__(
        self,
        inputs: typing.SupportsInt | typing.SupportsIndex = 128,
        outputs: typing.SupportsInt | typing.SupportsIndex = 256,
        width: typing.SupportsInt | typing.SupportsIndex = 128,
        blocks: typing.SupportsInt | typing.SupportsIndex = 4,
    ) -> None: ...
    @property
    def inputs(self) -> int: ...
    @property
    def outputs(self) -> int: ...
    @property
    def width(self) -> int: ...
    @property
    def blocks(self) -> int: ...

class MatchNetworks:
    def __init__(
        self,
        input: str,
        sizes: DiffusionSizes,
        eigenfunctions: typing.SupportsInt | typing.SupportsIndex,
        tensors: collections.abc.Mapping[
            str, typing.Annotated[numpy.typing.ArrayLike, numpy.float32, "[m, n]"]
        ],
        network: Network | None,
    ) -> None: ...
    @staticmethod
    def untrained(
        input: str,
        sizes: DiffusionSizes,
        eigenfunctions: typing.SupportsInt | typing.SupportsIndex,
        seed: typing.SupportsInt | typing.SupportsIndex,
        network: Network | None,
    ) -> MatchNetworks: ...
    @property
    def input(self) -> str: ...
    @property
    def sizes(self) -> DiffusionSizes: ...
    @property
    def eigenfunctions(self) -> int: ...
    @property
    def network(self) -> Network | None: ...
    def tensors(
        self,
    ) -> dict[str, typing.Annotated[numpy.typing.NDArray[numpy.float32], "[m, n]"]]: ...
    def features(
        self, mesh: PreparedMesh
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float32], "[m, n]"]: ...

class GuidePair:
    def __init__(
        self,
        first: typing.SupportsInt | typing.SupportsIndex,
        second: typing.SupportsInt | typing.SupportsIndex,
        there: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        back: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ) -> None: ...

class GuideMaps:
    @property
    def point_maps(
        self,
    ) -> typing.Annotated[
        list[typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]], "FixedSize(2)"
    ]: ...
    @property
    def maps(
        self,
    ) -> typing.Annotated[
        list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]], "FixedSize(2)"
    ]: ...
    @property
    def round_trip(self) -> float: ...

def guide_maps(
    first: PreparedMesh,
    second: PreparedMesh,
    functions: typing.SupportsInt | typing.SupportsIndex,
    progress: Progress | None = None,
    part: collections.abc.Sequence[float] = (0.0, 1.0),
) -> GuideMaps: ...

class JointTrainOptions:
    loss: UnsupervisedOptions
    epochs: int
    first_temperature: float
    guided_epochs: int
    guide_weight: float
    feature_learning_rate: collections.abc.Sequence[float]
    jacobian_learning_rate: collections.abc.Sequence[float]
    largest_gradient: float
    patience: int
    seed: int
    def __init__(self) -> None: ...

class JointEpoch:
    def __init__(
        self,
        epoch: typing.SupportsInt | typing.SupportsIndex,
        pairs: typing.SupportsInt | typing.SupportsIndex,
        guide: typing.SupportsFloat | typing.SupportsIndex,
        guide_share: typing.SupportsFloat | typing.SupportsIndex,
        terms: collections.abc.Sequence[float],
    ) -> None: ...
    @property
    def epoch(self) -> int: ...
    @property
    def pairs(self) -> int: ...
    @property
    def guide(self) -> float: ...
    @property
    def guide_share(self) -> float: ...
    @property
    def terms(self) -> typing.Annotated[list[float], "FixedSize(7)"]: ...

class JointTrainer:
    def __init__(
        self,
        meshes: collections.abc.Sequence[PreparedMesh],
        groups: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex],
        guides: collections.abc.Sequence[GuidePair],
        networks: MatchNetworks,
        options: JointTrainOptions,
        functions: typing.SupportsInt | typing.SupportsIndex,
    ) -> None: ...
    @property
    def finished(self) -> bool: ...
    @property
    def history(self) -> list[JointEpoch]: ...
    def epoch(
        self,
        progress: Progress | None = None,
        part: collections.abc.Sequence[float] = (0.0, 1.0),
    ) -> JointEpoch: ...
    def networks(self) -> MatchNetworks: ...
    def state(
        self,
    ) -> dict[str, typing.Annotated[numpy.typing.NDArray[numpy.float32], "[m, n]"]]: ...
    def restore(
        self,
        state: collections.abc.Mapping[
            str, typing.Annotated[numpy.typing.ArrayLike, numpy.float32, "[m, n]"]
        ],
        history: collections.abc.Sequence[JointEpoch],
    ) -> None: ...

class MatchOptions:
    training: JointTrainOptions
    functions: int
    most_pairs: float
    automatic: bool
    refine: RefineOptions
    def __init__(self) -> None: ...

class MatchResult:
    @property
    def initial(self) -> InitialMap: ...
    @property
    def automatic(self) -> bool: ...
    @property
    def refined(self) -> RefineResult: ...

class Matcher:
    def __init__(
        self,
        source: PreparedMesh,
        target: PreparedMesh,
        networks: MatchNetworks,
        options: MatchOptions,
        progress: Progress | None = None,
    ) -> None: ...
    @property
    def history(self) -> list[JointEpoch]: ...
    @property
    def notes(self) -> list[Note]: ...
    def networks(self) -> MatchNetworks: ...
    def features_map(self, progress: Progress | None = None) -> InitialMap: ...
    def adapt(
        self,
        watch: collections.abc.Callable[[JointEpoch], None] | None = None,
        progress: Progress | None = None,
    ) -> None: ...
    def run(
        self,
        watch: collections.abc.Callable[[JointEpoch], None] | None = None,
        progress: Progress | None = None,
    ) -> MatchResult: ...
