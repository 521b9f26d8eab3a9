// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <string>

#include "supple/core/error.h"
#include "supple/spectral/descriptors.h"
#include "supple/spectral/functional_map.h"
#include "tasks/initial_map/candidates.h"

namespace supple {
namespace {

using initial_maps::Candidate;
using initial_maps::MeshPair;

constexpr Eigen::Index kFitted = 20;  // functions of the first maps
constexpr Eigen::Index kFirstStep = 1, kStep = 4;
constexpr Eigen::Index kFirstSamples = 600;
constexpr Eigen::Index kLeast = 8;
constexpr int kSignatures = 40;
constexpr int kSigns = 5;          // functions whose signs are tried, beside the constant
constexpr size_t kAlignments = 4;  // of the 24
constexpr size_t kKept = 6;        // candidates that are upsampled to the end
// Maps that differ by less than this part of themselves are one candidate.
constexpr double kSame = 0.3;
// Two candidates are as good: scores within this part. Elsewhere: this far apart, in roots of the
// area, on average.
constexpr double kAsGood = 0.05, kElsewhere = 0.1;

std::vector<RowMatrix<double>> from_signatures(const MeshPair& pair, Eigen::Index k) {
  const Eigenbasis &a = pair.source.basis, &b = pair.target.basis;
  const WaveEnergies waves = wave_energies(a, b, kSignatures);
  const RowMatrix<double> source = wave_kernel_signature(a, waves.energies, waves.sigma);
  const RowMatrix<double> target = wave_kernel_signature(b, waves.energies, waves.sigma);
  MapConstraints constraints;
  add_descriptors(pair, k, source, target, 1.0, constraints);
  constraints.commuting = 0.1;
  std::vector<RowMatrix<double>> maps;
  const Eigen::VectorXd source_values = a.values.head(k), target_values = b.values.head(k);
  maps.push_back(fit_functional_map(source_values, target_values, constraints));
  add_operators(pair, k, source, target, kSignatures / 8, constraints);
  for (const double weight : {0.1, 1.0}) {
    constraints.operator_weight = weight;
    maps.push_back(fit_functional_map(source_values, target_values, constraints));
  }
  return maps;
}

std::vector<RowMatrix<double>> from_signs() {
  std::vector<RowMatrix<double>> maps;
  for (int signs = 0; signs < 1 << kSigns; ++signs) {
    RowMatrix<double> map = RowMatrix<double>::Identity(kSigns + 1, kSigns + 1);
    for (int i = 0; i < kSigns; ++i) {
      map(i + 1, i + 1) = (signs >> i & 1) != 0 ? -1.0 : 1.0;
    }
    maps.push_back(std::move(map));
  }
  return maps;
}

std::vector<RowMatrix<double>> from_alignments(const MeshPair& pair, Eigen::Index k) {
  std::vector<initial_maps::Alignment> found = initial_maps::alignments(pair);
  found.resize(std::min(found.size(), kAlignments));
  found.push_back({Matrix3::Identity(), Eigen::RowVector3d::Zero(), 0.0});  // as they stand
  std::vector<RowMatrix<double>> maps;
  for (const auto& alignment : found) {
    maps.push_back(functional_map(pair.source.basis, pair.target.basis,
                                  nearest_vertices(pair, alignment), k, k));
  }
  return maps;
}

// Upsamples each to `to` functions; best first.
std::vector<Candidate> upsampled(const MeshPair& pair, const std::vector<RowMatrix<double>>& maps,
                                 Eigen::Index to, Eigen::Index step, ProgressRange progress) {
  std::vector<Candidate> result;
  for (size_t i = 0; i < maps.size(); ++i) {
    progress.report(static_cast<double>(i) / static_cast<double>(maps.size()));
    Candidate now;
    now.map = sampled_zoomout(pair.source_functions, pair.target_functions, maps[i], to, step);
    now.score = pair.score(now.map);
    now.value = now.score.value();
    result.push_back(std::move(now));
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const Candidate& a, const Candidate& b) { return a.value > b.value; });
  return result;
}

// Mean distance of the samples' images.
double apart(const MeshPair& pair, const RowMatrix<double>& a, const RowMatrix<double>& b) {
  const auto images = [&](const RowMatrix<double>& map) {
    const Eigen::VectorXi rows =
        sampled_point_map(pair.source_functions, pair.target_functions, map);
    return Points(
        pair.target.operators.vertices(Eigen::VectorXi(pair.target_samples(rows)), Eigen::all));
  };
  return (images(a) - images(b)).rowwise().norm().mean();
}

}  // namespace

InitialMap automatic_map(const PreparedMesh& source, const PreparedMesh& target,
                         ProgressRange progress) {
  const MeshPair pair(source, target), few(source, target, {}, kFirstSamples);
  if (pair.count < kLeast) {
    throw Error(ErrorCode::bad_option, "An automatic map needs " + std::to_string(kLeast) +
                                           " eigenfunctions of both meshes; there are " +
                                           std::to_string(pair.count) +
                                           ". Use a finer mesh, or start from landmarks.");
  }
  const Eigen::Index k = std::min(kFitted, pair.count);
  const ProgressRange first = progress.stage("looking for candidates", 0.0, 0.5);
  std::vector<RowMatrix<double>> maps = from_signs();
  for (auto* const more : {&from_alignments, &from_signatures}) {
    for (RowMatrix<double>& map : more(pair, k)) {
      maps.push_back(std::move(map));
    }
  }
  std::vector<Candidate> found = upsampled(few, maps, k, kFirstStep, first);
  maps.clear();
  for (Candidate& candidate : found) {
    const bool known = std::any_of(maps.begin(), maps.end(), [&](const RowMatrix<double>& map) {
      return (map - candidate.map).norm() < kSame * map.norm();
    });
    if (!known && maps.size() < kKept) {
      maps.push_back(std::move(candidate.map));
    }
  }
  found = upsampled(pair, maps, pair.count, kStep, progress.stage("upsampling the best", 0.5, 0.8));
  InitialMap result = pair.finished(found[0].map, progress.stage("finding vertices", 0.8, 1.0));
  for (size_t i = 1; i < found.size(); ++i) {
    if (found[i].value > found[0].value * (1.0 - kAsGood) &&
        apart(pair, found[0].map, found[i].map) > kElsewhere) {
      result.notes.push_back(
          {"uncertain", 1,
           "Another map, which leads elsewhere, fits as well: the shapes may be symmetric. Check "
           "the result, or start from landmarks."});
      break;
    }
  }
  return result;
}

}  // namespace supple
