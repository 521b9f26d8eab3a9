// SPDX-License-Identifier: GPL-3.0-or-later
// Local Jacobian Network: a coarse signal in, a Jacobian per face out. Source: the paper,
// section 4.1.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"
#include "supple/learning/signal.h"
#include "supple/learning/spectral_mlp.h"
#include "supple/spectral/eigenbasis.h"
#include "supple/spectral/sampling.h"

namespace supple {

/// How the layers are joined to the signal. Silent points of the paper are decided at
/// `spectral_mlp_forward` (activation and its order) and `LayerParameters::random` (initial
/// values).
enum class Configuration {
  /// The paper, literally: the nine numbers of the signal, averaged to vertices, in; nine numbers a
  /// vertex out, averaged to faces. Sees world coordinates, so turning a mesh changes its answer.
  paper,
  /// The same layers between invariants and equivariant matrices ("scalars are universal", Villar
  /// et al.
  /// 2021). Let X_i be the signal's fields, L the last of them, Y_is the field i in the first 8,
  /// 16, 32,
  /// 64, 128 eigenfunctions, n the rest normal.
  /// In: for these matrices averaged to vertices, all products <A, B>, all (n A).(n B), det A, and
  /// how far
  /// the point lies from the surface in 8..128 eigenfunctions, along n and in all; shifted and
  /// scaled by
  /// the training set's mean and deviation.
  /// Out: coefficients c_b, projected to the eigenfunctions, of matrices at each face,
  ///   J = L + sum_b c_b (B_b - L), with B_b from X_i, Y_is and Y_s Y_s^T L of the last field, and
  ///   P (X_i - L), P (Y_is - L), P = n^T n.
  /// What is smooth is combined at vertices, and its average taken to faces.
  /// All invariants stay and every B_b turns with J, so the answer turns with the meshes exactly;
  /// and where the signal is one rotation, every B_b - L is 0 and J is that rotation.
  equivariant,
};
const char* to_string(Configuration configuration);
/// Errors: `bad_option` for any other name.
Configuration configuration(const std::string& name);

/// Everything that fixes the shapes of a network's weights.
struct Architecture {
  Configuration configuration = Configuration::equivariant;
  SignalKind signal = SignalKind::rotation;
  int eigenfunctions = 128;  ///< of every spectral projection inside the network
  int width = 256;

  LayerSizes sizes() const;
  bool operator==(const Architecture&) const = default;
};

/// What a network sees of where a surface lies: at rest, or in a pose that edits start from.
template <class Scalar>
struct SurfaceLook {
  const Points* face_normals = nullptr;    ///< m x 3; not owned
  const Points* vertex_normals = nullptr;  ///< n x 3; not owned
  RowMatrix<Scalar> shape;                 ///< p x 2 scales: distance to the smoothed surface
};

/// What a network needs to know of a rest mesh besides its operators: built once a mesh.
template <class Scalar>
struct NetworkContext {
  NetworkContext() = default;  ///< of no mesh
  /// samples: number of points the layers are evaluated at; 0 for every vertex (the paper).
  /// eigenfunctions: at most the basis's; fewer are used where the mesh has fewer, or where the
  /// limit would cut through a multiple eigenvalue.
  NetworkContext(const SurfaceOperators& operators, const Eigenbasis& basis, int eigenfunctions,
                 Eigen::Index samples);
  /// The same from its `samples` and `domain.projector`, which take longest to find.
  NetworkContext(const SurfaceOperators& operators, const Eigenbasis& basis, int eigenfunctions,
                 Eigen::VectorXi samples, RowMatrix<Scalar> projector);

  const SurfaceOperators* operators = nullptr;  ///< not owned; must outlive this
  Eigen::VectorXi samples;                      ///< p vertex indices
  SpectralDomain<Scalar> domain;                ///< the eigenfunctions at the samples
  RowMatrix<Scalar> functions;                  ///< n x k at every vertex
  std::vector<Eigen::Index> scales;  ///< ascending counts of eigenfunctions, the last is k
  SurfaceLook<Scalar> rest;

  /// The look of the surface with its vertices moved (n x 3, surface units); the normals are kept,
  /// not owned.
  SurfaceLook<Scalar> look(const Points& moved, const Points& face_normals,
                           const Points& vertex_normals) const;

 private:
  void complete(const Eigenbasis& basis);  // all that follows from samples and domain
};

/// A network and its weights. Scalar is float in use, double where derivatives are checked.
template <class Scalar>
class LocalJacobianNetwork {
 public:
  using Row = Eigen::Matrix<Scalar, 1, Eigen::Dynamic>;

  /// New weights. The last layer of `equivariant` starts at 1% of the usual size, so that an
  /// untrained network hardly changes its signal.
  LocalJacobianNetwork(const Architecture& architecture, uint64_t seed);
  /// Errors: `model_file` where a tensor is missing, has another shape, or is not finite.
  LocalJacobianNetwork(const Architecture& architecture,
                       const std::map<std::string, RowMatrix<float>>& tensors);

  const Architecture& architecture() const { return architecture_; }
  LayerParameters<Scalar>& parameters() { return parameters_; }
  const LayerParameters<Scalar>& parameters() const { return parameters_; }
  /// Names and values of every tensor: layer.0.weight, layer.0.bias (1 x c), ..., input.mean,
  /// input.scale.
  std::map<std::string, RowMatrix<float>> tensors() const;
  /// input.mean and input.scale (1 x inputs): layers see (x - mean) * scale.
  void set_normalisation(const Row& mean, const Row& scale);

  /// What `forward` keeps for `backward`; all but the layers' own is of `equivariant` alone.
  struct Trace {
    SpectralMlpTrace<Scalar> mlp;
    Matrix3 reference;               ///< mean of the signal's last field by area
    RowMatrix<Scalar> coefficients;  ///< k x 16 a field: the signal in the eigenfunctions
    RowMatrix<Scalar> outputs;       ///< k x outputs: the layers' answer in the eigenfunctions
  };
  /// m x 9 Jacobians of a signal. look: nullptr for that at rest; else that of the pose which the
  /// signal starts from.
  MatrixField forward(const NetworkContext<Scalar>& context, const Signal& signal,
                      Trace* trace = nullptr, const SurfaceLook<Scalar>* look = nullptr) const;
  /// Adds to `gradient` from the m x 9 gradient with respect to `forward`. trace: that of `forward`
  /// for the same context and signal, with the look at rest.
  /// signal_gradient: where not nullptr, set to the gradient with respect to the signal's fields,
  /// m x 9 each; `spectral_signal_backward` takes it on to the coarse target.
  void backward(const NetworkContext<Scalar>& context, const Signal& signal, const Trace& trace,
                const MatrixField& grad, LayerParameters<Scalar>& gradient,
                Signal* signal_gradient = nullptr) const;
  /// p x inputs, before normalisation. For the training set's mean and deviation.
  RowMatrix<Scalar> raw_inputs(const NetworkContext<Scalar>& context, const Signal& signal) const;

 private:
  Architecture architecture_;
  LayerParameters<Scalar> parameters_;
  Row mean_, scale_;
};

}  // namespace supple
