// SPDX-License-Identifier: GPL-3.0-or-later
// Handles that pull and are resisted: a quadratic term a vertex in every stage's energy.
#pragma once

#include "energies.h"
#include "supple/geometry/surface_operators.h"

namespace supple {

/// Vertices that are pulled: 1/2 k |x - target|^2 beside the Poisson equation's energy
/// 1/2 sum_f A_f |J - T|^2. s vertices, surface units.
struct SoftHandles {
  Eigen::VectorXi places;    ///< s, in whatever list the vertices were bound by
  Eigen::VectorXi vertices;  ///< s
  Eigen::VectorXd pull;      ///< s, k

  bool operator==(const SoftHandles& other) const {
    return vertices.size() == other.vertices.size() && vertices == other.vertices &&
           pull == other.pull;
  }
  /// laplacian with the pulls on its diagonal.
  SparseMatrix added_to(const SparseMatrix& laplacian) const;
  /// Adds k (target - x) to the pulled rows of a residual, n x 3. targets: s x 3.
  void add_residual(const Points& moved, const Points& targets, Points& residual) const;
};

/// k of a whole handle of this weight, 0 < weight < 1.
double pull_of(double weight);
/// How far a guide of a handle of this weight may stay behind what is asked of it, as the diagonal
/// of the biharmonic interpolation's system; 0 for weight 1. guides: how many the handle has.
double compliance_of(double weight, Eigen::Index guides);

/// Another energy with the pulls: in proportion to its stiffness, so that a handle is followed as
/// far whatever the energy. All are kept, not owned.
class PulledEnergy : public DeformationEnergy {
 public:
  PulledEnergy(const DeformationEnergy& energy, const SoftHandles& soft, const Points& targets)
      : energy_(energy), soft_(soft), targets_(targets) {}
  double evaluate(const Points& moved, Points& gradient) const override;
  double stiffness() const override { return energy_.stiffness(); }

 private:
  const DeformationEnergy& energy_;
  const SoftHandles& soft_;
  const Points& targets_;
};

}  // namespace supple
