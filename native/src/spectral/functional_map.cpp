// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/spectral/functional_map.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "supple/core/error.h"
#include "supple/core/tall.h"
#include "supple/spectral/map_fit.h"

namespace supple {
namespace {

void check_count(const char* whose, const Eigenbasis& basis, Eigen::Index count) {
  if (count < 1 || count > basis.functions.cols()) {
    throw Error(ErrorCode::bad_option, std::to_string(count) + " functions of the " + whose +
                                           " are asked for; there are " +
                                           std::to_string(basis.functions.cols()) +
                                           ", and at least 1 is needed.");
  }
}

void check_basis(const char* whose, const Eigenbasis& basis) {
  if (basis.functions.rows() != basis.mass.size()) {
    throw Error(ErrorCode::wrong_shape, "The functions of the " + std::string(whose) + " have " +
                                            std::to_string(basis.functions.rows()) +
                                            " rows, its masses " +
                                            std::to_string(basis.mass.size()) + ".");
  }
}

void check_map(const Eigenbasis& source, const Eigenbasis& target, const Eigen::VectorXi& map) {
  if (map.size() != source.mass.size()) {
    throw Error(ErrorCode::wrong_shape, "The point map has " + std::to_string(map.size()) +
                                            " entries for " + std::to_string(source.mass.size()) +
                                            " source vertices.");
  }
  for (Eigen::Index i = 0; i < map.size(); ++i) {
    if (map[i] < 0 || map[i] >= target.mass.size()) {
      throw Error(ErrorCode::index_out_of_range,
                  "Entry " + std::to_string(i) + " of the point map is " + std::to_string(map[i]) +
                      "; the target has " + std::to_string(target.mass.size()) + " vertices.");
    }
  }
}

void check_samples(const Eigenbasis& source, const ZoomoutOptions& options) {
  const Eigen::VectorXi& samples = options.samples;
  if (samples.size() > 0 && samples.size() <= options.to) {
    throw Error(ErrorCode::bad_option,
                std::to_string(samples.size()) + " samples do not determine a map of " +
                    std::to_string(options.to) +
                    " functions: more are needed, or none for every vertex.");
  }
  for (const int sample : samples) {
    if (sample < 0 || sample >= source.mass.size()) {
      throw Error(ErrorCode::index_out_of_range,
                  "Sample " + std::to_string(sample) + " is none of the source's " +
                      std::to_string(source.mass.size()) + " vertices.");
    }
  }
}

// The first functions, of a surface of area 1.
RowMatrix<double> unit_functions(const Eigenbasis& basis, Eigen::Index count) {
  return std::sqrt(basis.mass.sum()) * basis.functions.leftCols(count);
}

}  // namespace

RowMatrix<double> functional_map(const Eigenbasis& source, const Eigenbasis& target,
                                 const Eigen::VectorXi& point_map, Eigen::Index source_count,
                                 Eigen::Index target_count) {
  check_basis("source", source);
  check_basis("target", target);
  check_count("source", source, source_count);
  check_count("target", target, target_count);
  check_map(source, target, point_map);
  RowMatrix<double> pulled(point_map.size(), target_count);
  const double scale = std::sqrt(target.mass.sum() / source.mass.sum());
#pragma omp parallel for schedule(static)
  for (Eigen::Index i = 0; i < point_map.size(); ++i) {
    pulled.row(i) = scale * source.mass[i] * target.functions.row(point_map[i]).head(target_count);
  }
  return tall_product<double>({source.functions.leftCols(source_count)}, pulled);
}

Eigen::VectorXi point_map(const Eigenbasis& source, const Eigenbasis& target,
                          const RowMatrix<double>& map, ProgressRange progress) {
  check_basis("source", source);
  check_basis("target", target);
  check_count("source", source, map.rows());
  check_count("target", target, map.cols());
  const double scale = std::sqrt(target.mass.sum() / source.mass.sum());
  return nearest_images(source.functions, target.functions, map, scale, progress);
}

Zoomout zoomout(const Eigenbasis& source, const Eigenbasis& target, const Eigen::VectorXi& initial,
                const ZoomoutOptions& options, ProgressRange progress) {
  if (options.from < 1 || options.to < options.from || options.step < 1) {
    throw Error(ErrorCode::bad_option,
                "A map can't be refined from " + std::to_string(options.from) + " to " +
                    std::to_string(options.to) + " functions by " + std::to_string(options.step) +
                    ": from and step must be 1 or more, and to no less than from.");
  }
  check_count("source", source, options.to);
  check_count("target", target, options.to);
  check_samples(source, options);
  if (options.samples.size() > 0) {
    RowMatrix<double> map = sampled_zoomout(
        sampled_functions(source, options.samples, options.to),
        {unit_functions(target, options.to), {}},
        functional_map(source, target, initial, options.from, options.from), options.to,
        options.step, {}, progress.stage("refining the map on samples", 0.0, 0.8));
    Eigen::VectorXi all =
        point_map(source, target, map, progress.stage("mapping every vertex", 0.8, 1.0));
    return {std::move(all), std::move(map)};
  }
  const int rounds = 1 + (options.to - options.from + options.step - 1) / options.step;
  Zoomout result{initial, {}};
  for (int round = 0; round < rounds; ++round) {
    const int count = std::min(options.from + round * options.step, options.to);
    const ProgressRange part = progress.stage(
        "refining the map with " + std::to_string(count) + " functions",
        static_cast<double>(round) / rounds, static_cast<double>(round + 1) / rounds);
    result.functional_map = functional_map(source, target, result.point_map, count, count);
    result.point_map = point_map(source, target, result.functional_map, part);
  }
  return result;
}

}  // namespace supple
