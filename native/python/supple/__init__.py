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
from .mesh import Mesh, Note, PreparedMesh
from .metrics import face_distortion, flipped_faces, pose_error, symmetric_dirichlet
from .model import Model, load_model, shipped_models
from .parallel import set_thread_count, thread_count

__all__ = [
    "Cancelled",
    "EditResult",
    "EditSession",
    "Editor",
    "Geodesics",
    "Handle",
    "Mesh",
    "Model",
    "Note",
    "PreparedCache",
    "PreparedMesh",
    "Progress",
    "SuppleError",
    "TrainResult",
    "__version__",
    "blas_name",
    "blend",
    "cache",
    "chamfer",
    "coverage",
    "deform",
    "edit",
    "face_distortion",
    "face_inversion",
    "falloff_weights",
    "farthest_points",
    "flipped_faces",
    "geodesic_errors",
    "load_model",
    "map_dirichlet",
    "pose_error",
    "set_thread_count",
    "shipped_models",
    "simd_level",
    "symmetric_dirichlet",
    "thread_count",
    "train",
    "vertex_inversion",
]
