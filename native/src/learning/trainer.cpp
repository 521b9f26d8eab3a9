// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/trainer.h"

#include <algorithm>
#include <numeric>
#include <string>

#include "draws.h"
#include "supple/core/error.h"

namespace supple {
namespace {

void check(const TrainOptions& options, size_t pairs) {
  if (pairs == 0) {
    throw Error(ErrorCode::bad_option, "Training needs at least one pair.");
  }
  if (options.epochs < 1 || options.samples < 0 || options.architecture.eigenfunctions < 1 ||
      options.architecture.width < 1 || options.fewest_eigenfunctions < 1 ||
      options.most_eigenfunctions < options.fewest_eigenfunctions) {
    throw Error(ErrorCode::bad_option,
                "Training needs epochs, width and eigenfunctions of at least 1, samples >= 0 and a "
                "range of signal eigenfunctions that starts at 1 or more.");
  }
  if (options.architecture.configuration == Configuration::paper && options.samples != 0) {
    throw Error(ErrorCode::bad_option,
                "The 'paper' configuration is evaluated at every vertex: set samples to 0.");
  }
}

TriangleMesh checked(const Points& vertices, const Faces& faces, int pair, const char* side) {
  try {
    return TriangleMesh(vertices, faces);
  } catch (const Error& error) {
    throw Error(error.code(), "Pair " + std::to_string(pair) + ", " + side + ": " + error.what());
  }
}

}  // namespace

template <class Scalar>
struct Trainer<Scalar>::Example {
  Example(const TrainingPair& pair, int index, const TrainOptions& options,
          const ProgressRange& progress)
      : mesh(checked(pair.source, pair.faces, index, "source")), operators(mesh) {
    if (pair.target.rows() != pair.source.rows()) {
      throw Error(ErrorCode::wrong_shape,
                  "Pair " + std::to_string(index) + " has " + std::to_string(pair.source.rows()) +
                      " source vertices and " + std::to_string(pair.target.rows()) +
                      " target vertices; they must be the same vertices.");
    }
    const TriangleMesh moved = checked(pair.target, pair.faces, index, "target");
    if (!moved.same_surface_vertices(mesh)) {
      throw Error(ErrorCode::wrong_shape,
                  "Pair " + std::to_string(index) + " has vertices attached on one side only.");
    }
    // The spectral signal is taken between sides of area 1, as `deform` does; an edit keeps its
    // size.
    target = options.architecture.signal == SignalKind::spectral
                 ? moved.surface_vertices()
                 : mesh.to_surface(moved.from_surface(moved.surface_vertices()));
    poisson = std::make_unique<FreePoisson>(operators.laplacian, operators.mass,
                                            operators.component, operators.component_count);
    // One more than is used: where to cut is read from the gap above.
    basis = eigenbasis(operators.laplacian, operators.mass,
                       {.count = options.architecture.eigenfunctions + 1}, progress);
    if (options.architecture.signal == SignalKind::spectral) {
      const SurfaceOperators other(moved);
      target_basis = eigenbasis(other.laplacian, other.mass,
                                {.count = options.most_eigenfunctions + 1}, progress);
    }
    if (options.architecture.signal == SignalKind::spectral) {
      for (const Eigen::VectorXi& map : pair.maps) {
        add(map, index);
      }
    }
    context = std::make_unique<NetworkContext<Scalar>>(
        operators, basis, options.architecture.eigenfunctions, options.samples);
    if (options.architecture.signal == SignalKind::rotation) {
      for (const Suggestion& suggestion : pair.suggestions) {
        add(suggestion, index);
      }
    }
  }

  void add(const Suggestion& suggestion, int index) {
    const auto fail = [&](ErrorCode code, const std::string& what) {
      throw Error(code, "A suggestion of pair " + std::to_string(index) + " " + what);
    };
    const Eigen::Index n = mesh.vertices().rows();
    if (suggestion.vertices.rows() != n) {
      fail(ErrorCode::wrong_shape, "has " + std::to_string(suggestion.vertices.rows()) +
                                       " vertices, the source " + std::to_string(n) +
                                       "; they must be the same vertices.");
    }
    if (!suggestion.vertices.allFinite()) {
      fail(ErrorCode::not_finite, "has a coordinate that is not a finite number.");
    }
    Points moved(operators.vertices.rows(), 3);
    for (Eigen::Index i = 0; i < moved.rows(); ++i) {
      moved.row(i) = suggestion.vertices.row(mesh.mesh_vertex()[i]);
    }
    std::vector<int> held;
    std::vector<bool> held_component(static_cast<size_t>(operators.component_count), false);
    for (const int vertex : suggestion.held) {
      if (vertex < 0 || vertex >= n) {
        fail(ErrorCode::index_out_of_range, "holds vertex " + std::to_string(vertex) +
                                                "; the source has " + std::to_string(n) + ".");
      }
      if (const int surface = mesh.surface_vertex()[vertex]; surface >= 0) {
        held.push_back(surface);
        held_component[static_cast<size_t>(operators.component[surface])] = true;
      }
    }
    if (std::find(held_component.begin(), held_component.end(), false) != held_component.end()) {
      fail(ErrorCode::no_handles, "holds no vertex of one of its pieces. Hold one of each.");
    }
    const auto count = static_cast<Eigen::Index>(held.size());
    suggestions.push_back(
        {mesh.to_surface(moved),
         HeldSystem(operators.laplacian, Eigen::Map<Eigen::VectorXi>(held.data(), count))});
  }

  void add(const Eigen::VectorXi& map, int index) {
    const Eigen::Index n = mesh.vertices().rows();
    if (map.size() != n) {
      throw Error(ErrorCode::wrong_shape, "A map of pair " + std::to_string(index) + " has " +
                                              std::to_string(map.size()) + " entries for " +
                                              std::to_string(n) + " source vertices.");
    }
    Eigen::VectorXi on_surface(operators.vertices.rows());
    for (Eigen::Index i = 0; i < on_surface.size(); ++i) {
      const int vertex = map[mesh.mesh_vertex()[i]];
      if (vertex < 0 || vertex >= n || mesh.surface_vertex()[vertex] < 0) {
        throw Error(ErrorCode::index_out_of_range,
                    "A map of pair " + std::to_string(index) + " leads to vertex " +
                        std::to_string(vertex) + ", which is no vertex of the target's surface.");
      }
      on_surface[i] = mesh.surface_vertex()[vertex];
    }
    maps.push_back(std::move(on_surface));
  }

  /// The number of suggestions or maps, whichever the signal has.
  size_t variants() const { return std::max(suggestions.size(), maps.size()); }

  /// The target in `count` eigenfunctions, pulled back along the true map or one of the rough ones.
  Points coarse_target(Eigen::Index count, int map) const {
    if (map < 0) {
      return spectral_target(basis, target_basis, target, count);
    }
    const Points smooth = target_basis.project(target, count);
    const Points pulled = smooth(maps[static_cast<size_t>(map)], Eigen::all);
    return basis.project(pulled, count);
  }

  /// What there is of `wanted` eigenfunctions of the spectral signal; 0 for rotations.
  int signal_count(int wanted) const {
    return target_basis.size() == 0 ? 0
                                    : static_cast<int>(stable_count(basis, target_basis, wanted));
  }

  struct Edit {
    Points moved;  // surface units
    HeldSystem poisson;
  };

  TriangleMesh mesh;
  SurfaceOperators operators;
  Points target;  // surface units: the source's, or its own for the spectral signal
  Eigenbasis basis, target_basis;
  std::unique_ptr<FreePoisson> poisson;
  std::unique_ptr<NetworkContext<Scalar>> context;
  std::vector<Edit> suggestions;
  std::vector<Eigen::VectorXi> maps;  // of surface vertices
};

template <class Scalar>
Trainer<Scalar>::Trainer(const std::vector<TrainingPair>& pairs, const TrainOptions& options,
                         ProgressRange progress)
    : options_(options),
      network_(options.architecture, options.seed),
      adam_(options.architecture.sizes()),
      generator_(options.seed) {
  check(options, pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    progress.report(static_cast<double>(i) / static_cast<double>(pairs.size()));
    examples_.push_back(
        std::make_unique<Example>(pairs[i], static_cast<int>(i), options, ProgressRange{}));
  }
  order_.resize(pairs.size());
  std::iota(order_.begin(), order_.end(), 0);
  if (options.architecture.configuration == Configuration::equivariant) {
    normalise_inputs();
  }
  progress.report(1.0);
}

template <class Scalar>
Trainer<Scalar>::~Trainer() = default;

template <class Scalar>
int Trainer<Scalar>::total_steps() const {
  return options_.epochs * static_cast<int>(examples_.size());
}

template <class Scalar>
Signal Trainer<Scalar>::signal_of(const Example& example, int eigenfunctions,
                                  int suggestion) const {
  if (options_.architecture.signal == SignalKind::rotation) {
    return rotation_signal(example.operators.jacobians_of(
        suggestion < 0 ? example.target
                       : example.suggestions[static_cast<size_t>(suggestion)].moved));
  }
  const Points coarse = example.coarse_target(eigenfunctions, suggestion);
  return spectral_signal(example.operators, example.basis, coarse, eigenfunctions);
}

template <class Scalar>
void Trainer<Scalar>::normalise_inputs() {
  using Row = typename LocalJacobianNetwork<Scalar>::Row;
  const int inputs = options_.architecture.sizes().inputs;
  Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(inputs);
  Eigen::RowVectorXd squares = Eigen::RowVectorXd::Zero(inputs);
  double count = 0.0;
  for (const auto& example : examples_) {
    const int middle = (options_.fewest_eigenfunctions + options_.most_eigenfunctions) / 2;
    const Signal signal =
        signal_of(*example, example->signal_count(middle), example->variants() == 0 ? -1 : 0);
    const RowMatrix<double> raw =
        network_.raw_inputs(*example->context, signal).template cast<double>();
    sum += raw.colwise().sum();
    squares += raw.colwise().squaredNorm();
    count += static_cast<double>(raw.rows());
  }
  const Eigen::RowVectorXd mean = sum / count;
  const Eigen::RowVectorXd variance = (squares / count - mean.cwiseProduct(mean)).cwiseMax(0.0);
  // An input that hardly varies in training must not be blown up elsewhere.
  constexpr double kFloor = 1e-3;
  const Row scale = (variance.cwiseSqrt().array() + kFloor).inverse().template cast<Scalar>();
  network_.set_normalisation(mean.template cast<Scalar>(), scale);
}

template <class Scalar>
TrainStep Trainer<Scalar>::step() {
  const int count = static_cast<int>(examples_.size());
  if (next_ % count == 0) {
    shuffle(generator_, order_);
  }
  TrainStep result;
  result.step = next_;
  result.pair = order_[next_ % count];
  result.learning_rate = decayed_learning_rate(options_.first_learning_rate,
                                               options_.last_learning_rate, next_, total_steps());
  const Example& example = *examples_[result.pair];
  if (options_.architecture.signal == SignalKind::spectral) {
    const int range = options_.most_eigenfunctions - options_.fewest_eigenfunctions + 1;
    result.eigenfunctions =
        example.signal_count(options_.fewest_eigenfunctions + draw(generator_, range));
  }
  if (example.variants() > 0) {
    result.suggestion = draw(generator_, static_cast<int>(example.variants()));
  }

  const Signal signal = signal_of(example, result.eigenfunctions, result.suggestion);
  typename LocalJacobianNetwork<Scalar>::Trace trace;
  const MatrixField predicted = network_.forward(*example.context, signal, &trace);
  MatrixField grad;
  if (example.suggestions.empty()) {
    result.loss = supervised_loss(example.operators, *example.poisson, options_.weights,
                                  example.target, predicted, &grad);
  } else {
    const auto& edit = example.suggestions[static_cast<size_t>(result.suggestion)];
    result.loss = supervised_loss(example.operators, edit.poisson, options_.weights, example.target,
                                  predicted, &grad);
  }
  auto gradient = LayerParameters<Scalar>::zeros(options_.architecture.sizes());
  network_.backward(*example.context, signal, trace, grad, gradient);
  adam_.step(gradient, result.learning_rate, network_.parameters());
  ++next_;
  return result;
}

template class Trainer<float>;
template class Trainer<double>;

}  // namespace supple
