// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/sequence.h"

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>

#include "supple/core/error.h"
#include "supple/core/parallel.h"
#include "supple/geometry/jacobians.h"
#include "supple/geometry/rotations.h"

namespace supple {
namespace {

Eigen::RowVector3d centre_of(const Points& points, const Eigen::VectorXi& vertices) {
  Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
  for (const int vertex : vertices) {
    sum += points.row(vertex);
  }
  return sum / static_cast<double>(vertices.size());
}

// Of rows: v -> (v - from) linear + to.
Eigen::Matrix4d about(const Eigen::RowVector3d& from, const Matrix3& linear,
                      const Eigen::RowVector3d& to) {
  Eigen::Matrix4d result = Eigen::Matrix4d::Identity();
  result.topLeftCorner<3, 3>() = linear.transpose();
  result.topRightCorner<3, 1>() = (to - from * linear).transpose();
  return result;
}

double eased(double t) {
  const double s = std::clamp(t, 0.0, 1.0);
  return s * s * s * (10.0 + s * (6.0 * s - 15.0));
}

bool asks(const SequenceFrame& frame) {
  return frame.share != 0.0 &&
         std::any_of(frame.corrections.begin(), frame.corrections.end(), [](const auto& matrix) {
           return matrix && *matrix != Eigen::Matrix4d::Identity();
         });
}

}  // namespace

Eigen::Matrix4d handle_frame(const PreparedMesh& prepared, const Eigen::VectorXi& vertices,
                             const StartPose& pose) {
  const TriangleMesh& mesh = prepared.mesh;
  const SurfaceOperators& operators = prepared.operators;
  if (vertices.size() == 0) {
    throw Error(ErrorCode::empty_handle, "A handle without vertices has no frame.");
  }
  Matrix3 sum = Matrix3::Zero();
  for (const int vertex : vertices) {
    if (vertex < 0 || vertex >= mesh.vertices().rows()) {
      throw Error(ErrorCode::index_out_of_range,
                  "Vertex " + std::to_string(vertex) + " of a handle is not in a mesh of " +
                      std::to_string(mesh.vertices().rows()) + " vertices.");
    }
    const int v = mesh.surface_vertex()[vertex];
    if (v >= 0) {
      for (int i = operators.corners.first[v]; i < operators.corners.first[v + 1]; ++i) {
        const int f = operators.corners.corner[i] / 3;
        sum += operators.face_areas[f] * matrix_at(pose.jacobians, f);
      }
    }
  }
  const Matrix3 turn = sum.isZero(0.0) ? Matrix3(Matrix3::Identity()) : closest_rotation(sum);
  return about(centre_of(mesh.vertices(), vertices), turn, centre_of(pose.mesh_vertices, vertices));
}

Eigen::Matrix4d part_of_motion(const Eigen::Matrix4d& matrix, const Eigen::RowVector3d& centre,
                               double part) {
  if (!matrix.allFinite() || !centre.allFinite() || !std::isfinite(part)) {
    throw Error(ErrorCode::not_finite, "A correction has a number that is not finite.");
  }
  const Matrix3 linear = matrix.topLeftCorner<3, 3>().transpose();
  const double size = linear.norm();
  if (!(std::abs(linear.determinant()) > 1e-12 * size * size * size)) {
    throw Error(ErrorCode::singular_matrix,
                "A correction has a matrix without an inverse (a scale of 0?). Give every axis a "
                "scale other than 0.");
  }
  if (part == 1.0) {
    return matrix;
  }
  const PolarDecomposition polar = polar_decomposition(linear);
  const Matrix3 stretch = Matrix3::Identity() + part * (polar.stretch - Matrix3::Identity());
  const Matrix3 turn = rotation_matrix(part * rotation_vector(polar.rotation));
  const Eigen::RowVector3d to =
      centre * linear + Eigen::RowVector3d(matrix.topRightCorner<3, 1>().transpose());
  return about(centre, stretch * turn, centre + part * (to - centre));
}

double range_share(double frame, double first, double last, double ease_in, double ease_out) {
  if (!(last >= first)) {
    throw Error(ErrorCode::bad_option, "The range ends at frame " + std::to_string(last) +
                                           ", before its start at " + std::to_string(first) + ".");
  }
  if (!(ease_in >= 0.0 && ease_out >= 0.0 && std::isfinite(ease_in + ease_out))) {
    throw Error(ErrorCode::bad_option, "A range eases in and out over 0 frames or more.");
  }
  if (!(frame >= first && frame <= last)) {
    return 0.0;
  }
  const double in = ease_in > 0.0 ? eased((frame - first) / ease_in) : 1.0;
  const double out = ease_out > 0.0 ? eased((last - frame) / ease_out) : 1.0;
  return in * out;
}

SequenceEditor::SequenceEditor(std::shared_ptr<const Editor> editor, const EditOptions& options)
    : editor_(std::move(editor)), options_(options) {
  EditSession(editor_, options_);  // for its checks
}

Points SequenceEditor::solve(const SequenceFrame& frame) const {
  const std::vector<Handle>& handles = editor_->handles();
  if (frame.corrections.size() != handles.size()) {
    throw Error(ErrorCode::wrong_shape,
                "There are " + std::to_string(handles.size()) + " handles but " +
                    std::to_string(frame.corrections.size()) + " corrections.");
  }
  const SingleThread one;
  const PreparedMesh& prepared = editor_->prepared();
  auto start = std::make_shared<const StartPose>(prepared, frame.vertices);
  if (!asks(frame)) {
    return frame.vertices;
  }
  std::vector<HandleTarget> targets(handles.size());
  for (size_t h = 0; h < handles.size(); ++h) {
    if (frame.corrections[h]) {
      const Eigen::VectorXi& vertices = handles[h].vertices;
      const Eigen::Matrix4d at = handle_frame(prepared, vertices, *start);
      const Eigen::Matrix4d correction = part_of_motion(
          *frame.corrections[h], centre_of(prepared.mesh.vertices(), vertices), frame.share);
      targets[h].matrix = at * correction * at.inverse();
    }
  }
  return editor_->solve(targets, options_, {}, std::move(start)).vertices;
}

std::vector<Points> SequenceEditor::solve(const std::vector<SequenceFrame>& frames,
                                          ProgressRange progress) const {
  std::vector<Points> results(frames.size());
  std::atomic<int> done = 0;
  run_at_once(frames.size(), [&](size_t i) {
    progress.report(static_cast<double>(done) / static_cast<double>(frames.size()));
    results[i] = solve(frames[i]);
    ++done;
  });
  progress.report(1.0);
  return results;
}

}  // namespace supple
