// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "supple/core/error.h"
#include "supple/spectral/descriptors.h"
#include "supple/spectral/functional_map.h"
#include "tasks/initial_map/candidates.h"
#include "tasks/refine/pair.h"

namespace supple {
namespace {

using initial_maps::Candidate;
using initial_maps::MeshPair;

constexpr Eigen::Index kFitted = 20;  // functions of the first map
constexpr Eigen::Index kStep = 4;
constexpr int kTimes = 8, kEnergies = 8, kSignatures = 20;
// A pair weighs as much as this many of the thousand samples.
constexpr double kPairWeight = 10.0;
// How much a miss of the pairs counts before they are held, in roots of the area.
constexpr double kMiss = 0.1;

void check(const char* whose, const PreparedMesh& mesh, const Eigen::VectorXi& landmarks) {
  const Eigen::Index n = mesh.mesh.vertices().rows();
  std::set<int> seen;
  for (const int vertex : landmarks) {
    if (vertex < 0 || vertex >= n) {
      throw Error(ErrorCode::index_out_of_range, "A landmark is vertex " + std::to_string(vertex) +
                                                     " of the " + whose + ", which has " +
                                                     std::to_string(n) + " vertices (0-based).");
    }
    if (!seen.insert(vertex).second) {
      throw Error(ErrorCode::bad_option, "Vertex " + std::to_string(vertex) + " of the " +
                                             std::string(whose) +
                                             " is in two landmarks; remove one of them.");
    }
  }
}

// Times from a patch's to the whole surface's, area 1.
Eigen::VectorXd times() {
  return Eigen::VectorXd::LinSpaced(kTimes, std::log(2e-3), std::log(0.2)).array().exp();
}

RowMatrix<double> fitted(const MeshPair& pair, const std::vector<std::pair<int, int>>& landmarks) {
  const Eigenbasis &a = pair.source.basis, &b = pair.target.basis;
  const Eigen::Index k = std::min(kFitted, pair.count);
  MapConstraints constraints;
  const auto add = [&](const RowMatrix<double>& source, const RowMatrix<double>& target,
                       double weight, Eigen::Index every) {
    add_descriptors(pair, k, source, target, weight, constraints);
    add_operators(pair, k, source, target, every, constraints);
  };
  const WaveEnergies many = wave_energies(a, b, kSignatures), few = wave_energies(a, b, kEnergies);
  add(wave_kernel_signature(a, many.energies, many.sigma),
      wave_kernel_signature(b, many.energies, many.sigma), 0.3, kSignatures / 4);
  for (const auto& [from, to] : landmarks) {
    add(heat_kernel(a, from, times()), heat_kernel(b, to, times()), 1.0, kTimes);
    add(wave_kernel(a, from, few.energies, few.sigma), wave_kernel(b, to, few.energies, few.sigma),
        1.0, kEnergies);
  }
  constraints.commuting = 0.1;
  constraints.operator_weight = 0.1;
  return fit_functional_map(a.values.head(k), b.values.head(k), constraints);
}

}  // namespace

InitialMap landmark_map(const PreparedMesh& source, const PreparedMesh& target,
                        const Eigen::VectorXi& source_landmarks,
                        const Eigen::VectorXi& target_landmarks, ProgressRange progress) {
  if (source_landmarks.size() != target_landmarks.size() || source_landmarks.size() == 0) {
    throw Error(ErrorCode::wrong_shape,
                "There are " + std::to_string(source_landmarks.size()) +
                    " landmarks on the source and " + std::to_string(target_landmarks.size()) +
                    " on the target; there must be as many on both, at least one.");
  }
  check("source", source, source_landmarks);
  check("target", target, target_landmarks);
  const Eigen::VectorXi source_anchor = refining::surface_anchor(source.mesh),
                        target_anchor = refining::surface_anchor(target.mesh);
  std::vector<std::pair<int, int>> landmarks;
  for (Eigen::Index i = 0; i < source_landmarks.size(); ++i) {
    landmarks.emplace_back(source_anchor[source_landmarks[i]], target_anchor[target_landmarks[i]]);
  }
  MeshPair pair(source, target, landmarks);
  const auto pairs = static_cast<int>(landmarks.size());
  const int first_source = static_cast<int>(pair.source_samples.size()) - pairs,
            first_target = static_cast<int>(pair.target_samples.size()) - pairs;
  std::vector<std::pair<int, int>> fixed;
  for (int i = 0; i < pairs; ++i) {
    fixed.emplace_back(first_source + i, first_target + i);
  }
  pair.source_functions.weights.tail(pairs) *= kPairWeight;

  progress.stage("fitting a map to the landmarks", 0.0, 0.3);
  std::vector<RowMatrix<double>> starts = {fitted(pair, landmarks)};
  if (pairs >= 3) {
    Points from(pairs, 3), to(pairs, 3);
    for (int i = 0; i < pairs; ++i) {
      from.row(i) = source.operators.vertices.row(landmarks[static_cast<size_t>(i)].first);
      to.row(i) = target.operators.vertices.row(landmarks[static_cast<size_t>(i)].second);
    }
    // The rows of the samples that are nearest once the landmarks lie on one another.
    const Eigen::VectorXi all = nearest_vertices(pair, initial_maps::closest_motion(from, to));
    starts.push_back(
        functional_map(source.basis, target.basis, all, starts[0].rows(), starts[0].cols()));
  }
  Candidate best;
  best.value = -1.0;
  for (size_t i = 0; i < starts.size(); ++i) {
    const auto part = static_cast<double>(starts.size());
    progress.stage("upsampling the map", 0.3 + 0.4 * static_cast<double>(i) / part,
                   0.3 + 0.4 * static_cast<double>(i + 1) / part);
    Candidate now;
    now.map = sampled_zoomout(pair.source_functions, pair.target_functions, starts[i], pair.count,
                              kStep, fixed);
    now.score = pair.score(now.map);
    const Eigen::VectorXi rows =
        sampled_point_map(pair.source_functions, pair.target_functions, now.map);
    double miss = 0.0;
    for (const auto& [from, to] : fixed) {
      miss += (target.operators.vertices.row(pair.target_samples[rows[from]]) -
               target.operators.vertices.row(pair.target_samples[to]))
                  .norm() /
              pairs;
    }
    now.value = now.score.value() * std::exp(-miss / kMiss);
    if (now.value > best.value) {
      best = std::move(now);
    }
  }
  InitialMap result = pair.finished(best.map, progress.stage("finding vertices", 0.7, 1.0));
  for (Eigen::Index i = 0; i < source_landmarks.size(); ++i) {
    result.point_map[source_landmarks[i]] = target_landmarks[i];
  }
  return result;
}

}  // namespace supple
