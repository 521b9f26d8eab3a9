// SPDX-License-Identifier: GPL-3.0-or-later
// What an edit can be relaxed towards. moved: n x 3 in surface units.
#pragma once

#include "supple/geometry/surface_operators.h"
#include "volume.h"

namespace supple {

/// A function of the moved vertices with a gradient.
class DeformationEnergy {
 public:
  virtual ~DeformationEnergy() = default;
  /// Its value; gradient: n x 3.
  virtual double evaluate(const Points& moved, Points& gradient) const = 0;
  /// How much larger its second derivative is than the Laplacian's, near rest.
  virtual double stiffness() const = 0;
};

/// As rigid as possible, spokes and rims: each vertex turns with the faces around it,
///   sum_f A_f / 3 sum_{i in f} |T_f - P_f R_i|^2,
/// T the tangential Jacobian, P the projection to the rest face, R_i the closest rotation of
/// sum_{f at i} A_f T_f. Equal to the edge form with cotangent weights up to a factor.
/// Source: Sorkine and Alexa 2007; spokes and rims: Chao, Pinkall, Sanan and Schroeder 2010.
class ArapEnergy : public DeformationEnergy {
 public:
  explicit ArapEnergy(const SurfaceOperators& operators) : operators_(operators) {}
  double evaluate(const Points& moved, Points& gradient) const override;
  double stiffness() const override { return 2.0; }

 private:
  const SurfaceOperators& operators_;
};

/// Symmetric Dirichlet (Smith and Schaefer 2015) plus ARAP's resistance to bending: without it a
/// surface loses strain by crumpling. Faces of less than a tenth of their area, where the first
/// would go to infinity, get its tangent. Closed components also resist a change of volume: a
/// membrane has the least strain where it gives way to a bend and buckles.
class StiffEnergy : public DeformationEnergy {
 public:
  /// volume: not owned; nullptr where none is kept. kept: a component, its volume before the edit;
  /// 0 where it is not kept.
  explicit StiffEnergy(const SurfaceOperators& operators, const EnclosedVolume* volume = nullptr,
                       Eigen::VectorXd kept = {});
  double evaluate(const Points& moved, Points& gradient) const override;
  double stiffness() const override { return 8.0 + 2.0 * kBending; }
  /// Raises the weight of bending around every face that has turned over. Returns how many have.
  int stiffen_folds(const Points& moved);

 private:
  static constexpr double kBending = 0.25;
  Eigen::VectorXi turned_over(const Points& points) const;

  double add_volume(const Points& moved, Points& gradient) const;

  const SurfaceOperators& operators_;
  const EnclosedVolume* volume_;
  Eigen::VectorXd kept_;
  Eigen::VectorXd bending_;       // a face
  Eigen::VectorXi over_at_rest_;  // a face: 1 where it already is
};

}  // namespace supple
