// SPDX-License-Identifier: GPL-3.0-or-later
// DiffusionNet: features of a surface at its vertices, learned. Source: Sharp, Attaiki, Crane and
// Ovsjanikov 2022, "DiffusionNet: Discretization Agnostic Learning on Surfaces".
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "supple/core/types.h"
#include "supple/geometry/surface_operators.h"
#include "supple/learning/adam.h"
#include "supple/spectral/eigenbasis.h"

namespace supple {

/// Everything that fixes the shapes of the weights. Source: width and blocks are DiffusionNet's;
/// inputs and outputs those of Cao, Roetzer and Bernard 2023, who match shapes by such features.
struct DiffusionSizes {
  int inputs = 128;   ///< see `feature_inputs`
  int outputs = 256;  ///< features a vertex
  int width = 128;    ///< channels between
  int blocks = 4;

  bool operator==(const DiffusionSizes&) const = default;
};

/// What the network needs to know of a surface: built once a mesh. n vertices, area 1.
template <class Scalar>
struct DiffusionContext {
  /// eigenfunctions: at least 1, at most the basis's; fewer are used where the limit would cut
  /// through a multiple eigenvalue. axes: n x 3 first axes of the tangent frames, which the
  /// features do not depend on; by default `tangent_axes`. Errors: `bad_option`; `wrong_shape`
  /// where basis or axes are not the surface's.
  DiffusionContext(const SurfaceOperators& operators, const Eigenbasis& basis, int eigenfunctions);
  DiffusionContext(const SurfaceOperators& operators, const Eigenbasis& basis, int eigenfunctions,
                   const Points& axes);

  using Gradient = Eigen::SparseMatrix<Scalar, Eigen::RowMajor>;
  RowMatrix<Scalar> functions;                      ///< n x k, Phi
  RowMatrix<Scalar> weighted;                       ///< n x k, M Phi
  Eigen::Matrix<Scalar, Eigen::Dynamic, 1> values;  ///< k, lambda
  Gradient gradient;                                ///< 2n x n, `tangent_gradient`
  Gradient gradient_transpose;                      ///< n x 2n
};

/// The weights, all of which act from the right; also the shape of their gradients.
template <class Scalar>
struct DiffusionParameters {
  /// rows x c, and a bias of 1 x c.
  struct Layer {
    RowMatrix<Scalar> weight, bias;
  };
  struct Block {
    RowMatrix<Scalar> times;  ///< 1 x width, >= 0, in units of area
    /// width x width, the parts of A; the diagonal of `imaginary` has no effect.
    RowMatrix<Scalar> real, imaginary;
    std::array<Layer, 3> layers;  ///< 3 width to width, then width to width twice
  };
  Layer first;  ///< inputs to width
  std::vector<Block> blocks;
  Layer last;  ///< width to outputs

  /// Errors: `bad_option` for sizes below 1 (blocks: below 0).
  static DiffusionParameters zeros(const DiffusionSizes& sizes);
  /// Glorot uniform weights, zero biases, times uniform in [0, 0.02]. The authors start at time 0;
  /// on a surface of area 1, with 128 eigenfunctions and wave kernels in, the gradients are then so
  /// large that 9 of 10 gradient features of the last block are at the ends of tanh (so: 1 in
  /// 100).
  static DiffusionParameters random(const DiffusionSizes& sizes, uint64_t seed);
  /// Errors: `model_file` where a tensor is missing, has another shape, is not finite, or a time is
  /// negative; those of `zeros`.
  static DiffusionParameters from_tensors(const DiffusionSizes& sizes,
                                          const std::map<std::string, RowMatrix<float>>& tensors);
  /// By name: first.weight, first.bias, block.0.times, block.0.real, block.0.imaginary,
  /// block.0.layer.0.weight, ..., last.weight, last.bias.
  std::map<std::string, RowMatrix<float>> tensors() const;

  struct Named {
    std::string name;
    RowMatrix<Scalar>* values;  ///< not owned
  };
  struct ConstNamed {
    std::string name;
    const RowMatrix<Scalar>* values;
  };
  /// All of them, in the order of the text above.
  std::vector<Named> named();
  std::vector<ConstNamed> named() const;
};

/// What `diffusion_net_forward` keeps for the backward pass.
template <class Scalar>
struct DiffusionTrace {
  struct Block {
    RowMatrix<Scalar> input;                     // n x width, x
    RowMatrix<Scalar> spectral;                  // k x width, coefficients of d
    RowMatrix<Scalar> diffused;                  // n x width, d
    RowMatrix<Scalar> gradients;                 // 2n x width, g
    RowMatrix<Scalar> mapped;                    // 2n x width, A g
    RowMatrix<Scalar> products;                  // n x width, after tanh
    std::array<RowMatrix<Scalar>, 2> before;     // n x width, before each activation
    std::array<RowMatrix<Scalar>, 2> activated;  // n x width, after it
  };
  RowMatrix<Scalar> input;  // n x inputs
  std::vector<Block> blocks;
  RowMatrix<Scalar> last;  // n x width, the last layer's input
};

/// n x inputs to n x outputs: a linear layer, the blocks, a linear layer. A block takes x to
///   x + MLP[x, d, tanh(Re(conj(g) (A g)))],  d = Phi exp(-lambda t) Phi^T M x,  g = grad d,
/// channel by channel, with t a time for each channel, g the gradient at a vertex as a complex
/// number in its tangent frame, and A a complex matrix between channels. A turn of the frame turns
/// g and A g alike, so the features do not depend on it. The MLP has three layers.
///
/// Unlike the authors': the activation is SiLU instead of ReLU (smooth, so that derivatives can be
/// checked), and there is no dropout. As theirs, diffusion is that of the first k eigenfunctions:
/// time 0 leaves what x has in them, a long time its mean over each component.
///
/// With inputs that do not depend on where a surface lies, neither do the features. A mirrored
/// surface has the features that the conjugate of A gives: the imaginary part tells left from
/// right. Errors: `wrong_shape`.
template <class Scalar>
RowMatrix<Scalar> diffusion_net_forward(const DiffusionSizes& sizes,
                                        const DiffusionParameters<Scalar>& parameters,
                                        const DiffusionContext<Scalar>& context,
                                        const RowMatrix<Scalar>& input,
                                        DiffusionTrace<Scalar>* trace = nullptr);

/// Adds the gradient with respect to every parameter to `gradient` and returns n x inputs, the one
/// with respect to the input; `grad_output` is n x outputs, `trace` that of the forward pass.
/// Same threads: same bytes. Errors: `wrong_shape`.
template <class Scalar>
RowMatrix<Scalar> diffusion_net_backward(const DiffusionSizes& sizes,
                                         const DiffusionParameters<Scalar>& parameters,
                                         const DiffusionContext<Scalar>& context,
                                         const DiffusionTrace<Scalar>& trace,
                                         const RowMatrix<Scalar>& grad_output,
                                         DiffusionParameters<Scalar>& gradient);

/// Adam over every parameter. A time that a step takes below 0 is set to 0.
template <class Scalar>
class DiffusionAdam {
 public:
  explicit DiffusionAdam(const DiffusionSizes& sizes);
  /// Errors: `wrong_shape` where either is of other sizes.
  void step(const DiffusionParameters<Scalar>& gradient, double learning_rate,
            DiffusionParameters<Scalar>& parameters);
  const typename Adam<Scalar>::State& state() const { return adam_.state(); }
  void restore(typename Adam<Scalar>::State state) { adam_.restore(std::move(state)); }

 private:
  Adam<Scalar> adam_;
};

}  // namespace supple
