# SPDX-License-Identifier: GPL-3.0-or-later
"""Supple: detail-preserving deformation of triangle meshes with Local Jacobian Networks.

Arrays in, arrays out: vertices are (n, 3) in the caller's units, faces (m, 3) 0-based triangles,
matrices (4, 4) for column vectors. Every error is a SuppleError with a code and a readable message.
Source: "Deformation Recovery: Localized Learning for Detail-Preserving Deformations", SIGGRAPH Asia
2024.
"""

from . import _environment as _environment  # first: it acts before the native module loads
from . import cache
from ._native import PreparedCache, Progress, __version__, blas_name, simd_level
from .blending import blend, falloff_weights, farthest_points
from .deforming import deform
from .editing import Editor, EditResult, EditSession, Handle, edit
from .errors import Cancelled, SuppleError
from .inbetween import Inbetween
from .initial_maps import (
    InitialMap,
    MapScore,
    automatic_map,
    landmark_map,
    map_score,
    nearest_map,
    uv_map,
    zoomout_map,
)
from .learning import TrainResult, train
from .map_metrics import (
    Geodesics,
    chamfer,
    coverage,
    face_inversion,
    geodesic_errors,
    map_dirichlet,
    vertex_inversion,
)
from .match_model import (
    MatchModel,
    load_match_model,
    shipped_match_models,
    untrained_match_model,
)
from .matching import Matcher, MatchResult, match
from .mesh import Mesh, Note, PreparedMesh
from .metrics import face_distortion, flipped_faces, pose_error, symmetric_dirichlet
from .model import Model, load_model, shipped_models
from .motion_handles import propose_motion_handles
from .parallel import set_thread_count, thread_count
from .point_cache import KeptFrames, PointCacheReader, PointCacheWriter
from .refining import Refiner, RefineResult, refine
from .sequence import SequenceEditor, SequenceFrame, handle_frames, part_of_motion, range_share
from .transfer import (
    SurfaceMap,
    closest_points,
    load_map,
    reversed_map,
    save_map,
    shrink_fit,
    transfer_corners,
    transfer_field,
    transfer_groups,
    transfer_shape_keys,
    transfer_uvs,
    within_islands,
)
from .unsupervised import UnsupervisedResult, train_unsupervised

__all__ = [
    "Cancelled",
    "EditResult",
    "EditSession",
    "Editor",
    "Geodesics",
    "Handle",
    "Inbetween",
    "InitialMap",
    "KeptFrames",
    "MapScore",
    "MatchModel",
    "MatchResult",
    "Matcher",
    "Mesh",
    "Model",
    "Note",
    "PointCacheReader",
    "PointCacheWriter",
    "PreparedCache",
    "PreparedMesh",
    "Progress",
    "RefineResult",
    "Refiner",
    "SequenceEditor",
    "SequenceFrame",
    "SuppleError",
    "SurfaceMap",
    "TrainResult",
    "UnsupervisedResult",
    "__version__",
    "automatic_map",
    "blas_name",
    "blend",
    "cache",
    "chamfer",
    "closest_points",
    "coverage",
    "deform",
    "edit",
    "face_distortion",
    "face_inversion",
    "falloff_weights",
    "farthest_points",
    "flipped_faces",
    "geodesic_errors",
    "handle_frames",
    "landmark_map",
    "load_map",
    "load_match_model",
    "load_model",
    "map_dirichlet",
    "map_score",
    "match",
    "nearest_map",
    "part_of_motion",
    "pose_error",
    "propose_motion_handles",
    "range_share",
    "refine",
    "reversed_map",
    "save_map",
    "set_thread_count",
    "shipped_match_models",
    "shipped_models",
    "shrink_fit",
    "simd_level",
    "symmetric_dirichlet",
    "thread_count",
    "train",
    "train_unsupervised",
    "transfer_corners",
    "transfer_field",
    "transfer_groups",
    "transfer_shape_keys",
    "transfer_uvs",
    "untrained_match_model",
    "uv_map",
    "vertex_inversion",
    "within_islands",
    "zoomout_map",
]
