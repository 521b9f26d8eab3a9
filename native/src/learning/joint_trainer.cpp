// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/learning/joint_trainer.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "draws.h"
#include "supple/core/error.h"
#include "tensors.h"

namespace supple {
namespace {

using Tensors = std::map<std::string, RowMatrix<float>>;
using AdamState = Adam<float>::State;

constexpr const char* kFeatures = "features.";
constexpr const char* kJacobians = "jacobians.";

void check(const JointTrainOptions& options) {
  const auto rates = {options.feature_learning_rate, options.jacobian_learning_rate};
  const bool rates_fit = std::all_of(rates.begin(), rates.end(), [](const auto& rate) {
    return rate[0] > 0.0 && rate[1] > 0.0 && std::isfinite(rate[0]) && std::isfinite(rate[1]);
  });
  if (options.epochs < 1 || options.guided_epochs < 0 || options.guide_weight < 0.0 ||
      options.largest_gradient < 0.0 || options.patience < 0 || options.first_temperature < 0.0 ||
      !rates_fit) {
    throw Error(ErrorCode::bad_option,
                "Training needs 1 epoch or more, learning rates above 0, and guided epochs, guide "
                "weight, first temperature, largest gradient and patience of 0 or more.");
  }
}

void add_state(const std::string& prefix, const AdamState& state, Tensors& tensors) {
  for (size_t t = 0; t < state.mean.size(); ++t) {
    tensors[prefix + "adam.mean." + std::to_string(t)] = state.mean[t];
    tensors[prefix + "adam.square." + std::to_string(t)] = state.square[t];
  }
  tensors[prefix + "adam.steps"] =
      RowMatrix<float>::Constant(1, 1, static_cast<float>(state.steps));
}

// Of tensors of the sizes of `like`.
AdamState read_state(const std::string& prefix, const Tensors& tensors, AdamState like) {
  for (size_t t = 0; t < like.mean.size(); ++t) {
    const Eigen::Index count = like.mean[t].cols();
    like.mean[t] = read_tensor<float>(tensors, prefix + "adam.mean." + std::to_string(t), 1, count);
    like.square[t] =
        read_tensor<float>(tensors, prefix + "adam.square." + std::to_string(t), 1, count);
  }
  like.steps = static_cast<int>(read_tensor<float>(tensors, prefix + "adam.steps", 1, 1)(0, 0));
  return like;
}

// The tensors whose names begin with the prefix, without it.
Tensors part(const Tensors& tensors, const std::string& prefix) {
  Tensors result;
  for (const auto& [name, values] : tensors) {
    if (name.rfind(prefix, 0) == 0) {
      result[name.substr(prefix.size())] = values;
    }
  }
  return result;
}

// What to multiply a gradient by so that it is no longer than `largest` (0: any length).
double shortening(double squared_length, double largest) {
  const double length = std::sqrt(squared_length);
  return largest > 0.0 && length > largest ? largest / length : 1.0;
}

double squared_length(const DiffusionParameters<float>& gradient) {
  double sum = 0.0;
  for (const auto& tensor : gradient.named()) {
    sum += tensor.values->cast<double>().squaredNorm();
  }
  return sum;
}

double squared_length(const LayerParameters<float>& gradient) {
  double sum = 0.0;
  for (size_t l = 0; l < gradient.weights.size(); ++l) {
    sum += gradient.weights[l].cast<double>().squaredNorm() +
           gradient.biases[l].cast<double>().squaredNorm();
  }
  return sum;
}

void add(UnsupervisedLossValues& sum, const UnsupervisedLossValues& one, double share) {
  sum.orthogonality += share * one.orthogonality;
  sum.coupling += share * one.coupling;
  sum.bijectivity += share * one.bijectivity;
  sum.fit += share * one.fit;
  sum.smoothness += share * one.smoothness;
  sum.determinant += share * one.determinant;
  sum.total += share * one.total;
}

}  // namespace

JointTrainer::JointTrainer(std::vector<std::shared_ptr<const Surface>> surfaces,
                           std::vector<int> groups, std::vector<GuidePair> guides,
                           Networks networks, JointTrainOptions options)
    : surfaces_(std::move(surfaces)),
      guides_(std::move(guides)),
      networks_(std::move(networks)),
      options_(options),
      feature_adam_(networks_.features.architecture.sizes) {
  check(options_);
  if (groups.size() != surfaces_.size()) {
    throw Error(ErrorCode::wrong_shape, std::to_string(groups.size()) + " groups were given for " +
                                            std::to_string(surfaces_.size()) + " surfaces.");
  }
  const int count = static_cast<int>(surfaces_.size());
  partners_.resize(surfaces_.size());
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < count; ++j) {
      if (i != j && groups[static_cast<size_t>(i)] == groups[static_cast<size_t>(j)]) {
        partners_[static_cast<size_t>(i)].push_back(j);
      }
    }
    if (partners_[static_cast<size_t>(i)].empty()) {
      throw Error(ErrorCode::bad_option, "Surface " + std::to_string(i) +
                                             " is alone in its group; training needs at least two "
                                             "that can be matched.");
    }
  }
  if (count == 0) {
    throw Error(ErrorCode::bad_option, "Training needs at least two surfaces; there are none.");
  }
  for (const GuidePair& guide : guides_) {
    if (guide.first < 0 || guide.second < 0 || guide.first >= count || guide.second >= count) {
      throw Error(ErrorCode::index_out_of_range,
                  "A guide is of surfaces " + std::to_string(guide.first) + " and " +
                      std::to_string(guide.second) + "; there are " + std::to_string(count) + ".");
    }
    const auto& partners = partners_[static_cast<size_t>(guide.first)];
    if (std::find(partners.begin(), partners.end(), guide.second) == partners.end()) {
      throw Error(ErrorCode::bad_option, "A guide is of surfaces " + std::to_string(guide.first) +
                                             " and " + std::to_string(guide.second) +
                                             ", which are not two of one group.");
    }
  }
  if (networks_.jacobians.has_value()) {
    if (networks_.jacobians->architecture().signal != SignalKind::spectral) {
      throw Error(ErrorCode::bad_option,
                  "Matching needs a local Jacobian network of the signal 'spectral'.");
    }
    jacobian_adam_.emplace(networks_.jacobians->architecture().sizes());
  }
}

double JointTrainer::guide_share(int epoch) const {
  if (guides_.empty() || epoch >= options_.guided_epochs) {
    return 0.0;
  }
  return 1.0 - static_cast<double>(epoch) / options_.guided_epochs;
}

UnsupervisedOptions JointTrainer::loss_of(int epoch) const {
  UnsupervisedOptions loss = options_.loss;
  const double share = 1.0 - guide_share(epoch);
  for (double* weight :
       {&loss.orthogonality, &loss.coupling, &loss.bijectivity, &loss.jacobians.fit,
        &loss.jacobians.smoothness, &loss.jacobians.determinant}) {
    *weight *= share;
  }
  if (options_.first_temperature > 0.0 && options_.epochs > 1) {
    const double done = static_cast<double>(epoch) / (options_.epochs - 1);
    loss.temperature =
        1.0 / ((1.0 - done) / options_.first_temperature + done / options_.loss.temperature);
  }
  return loss;
}

bool JointTrainer::finished() const {
  const int done = static_cast<int>(history_.size());
  if (done >= options_.epochs) {
    return true;
  }
  const int guided = guides_.empty() ? 0 : options_.guided_epochs;
  if (options_.patience == 0 || done <= guided) {
    return false;
  }
  const auto first = history_.begin() + guided;
  const auto best = std::min_element(first, history_.end(), [](const auto& a, const auto& b) {
    return a.loss.terms.total < b.loss.terms.total;
  });
  return history_.end() - best > options_.patience;
}

std::vector<JointTrainer::Step> JointTrainer::steps_of(int epoch) const {
  // Of this epoch's own: two seeds and epochs never share a sequence in practice.
  std::seed_seq sequence{static_cast<uint32_t>(options_.seed),
                         static_cast<uint32_t>(options_.seed >> 32), static_cast<uint32_t>(epoch)};
  std::mt19937_64 generator(sequence);
  const int count = static_cast<int>(surfaces_.size());
  std::vector<Step> steps;
  if (guide_share(epoch) > 0.0) {
    std::vector<int> order(guides_.size());
    for (size_t i = 0; i < order.size(); ++i) {
      order[i] = static_cast<int>(i);
    }
    for (int i = 0; i < count; ++i) {
      if (i % static_cast<int>(order.size()) == 0) {
        shuffle(generator, order);
      }
      const GuidePair& guide =
          guides_[static_cast<size_t>(order[static_cast<size_t>(i) % order.size()])];
      steps.push_back({guide.first, guide.second, &guide});
    }
    return steps;
  }
  for (int i = 0; i < count; ++i) {
    const auto& partners = partners_[static_cast<size_t>(i)];
    const int other = draw(generator, static_cast<int>(partners.size()));
    steps.push_back({i, partners[static_cast<size_t>(other)], nullptr});
  }
  shuffle(generator, steps);
  return steps;
}

void JointTrainer::update(const JointGradient<float>& gradient, const UnsupervisedOptions& loss,
                          int step) {
  const int total = options_.epochs * pairs_per_epoch();
  const auto rate = [&](const std::array<double, 2>& ends) {
    return decayed_learning_rate(ends[0], ends[1], step, total);
  };
  DiffusionParameters<float> of_features = gradient.features;
  const double features = shortening(squared_length(gradient.features), options_.largest_gradient);
  for (const auto& tensor : of_features.named()) {
    *tensor.values *= static_cast<float>(features);
  }
  feature_adam_.step(of_features, rate(options_.feature_learning_rate),
                     networks_.features.parameters);
  if (!jacobian_adam_.has_value() || !loss.jacobians.any()) {
    return;
  }
  LayerParameters<float> of_jacobians = gradient.jacobians;
  const double jacobians =
      shortening(squared_length(gradient.jacobians), options_.largest_gradient);
  for (size_t l = 0; l < of_jacobians.weights.size(); ++l) {
    of_jacobians.weights[l] *= static_cast<float>(jacobians);
    of_jacobians.biases[l] *= static_cast<float>(jacobians);
  }
  jacobian_adam_->step(of_jacobians, rate(options_.jacobian_learning_rate),
                       networks_.jacobians->parameters());
}

const JointEpoch& JointTrainer::epoch(ProgressRange progress, const Watch& watch) {
  if (finished()) {
    throw Error(ErrorCode::bad_option,
                "Training is finished after " + std::to_string(history_.size()) + " epochs.");
  }
  const Tensors before = state();
  JointEpoch result;
  result.epoch = static_cast<int>(history_.size());
  result.guide_share = guide_share(result.epoch);
  const UnsupervisedOptions now = loss_of(result.epoch);
  const std::vector<Step> steps = steps_of(result.epoch);
  result.pairs = static_cast<int>(steps.size());
  const double share = 1.0 / static_cast<double>(steps.size());
  try {
    for (size_t s = 0; s < steps.size(); ++s) {
      const Step& step = steps[s];
      Guide guide;
      if (step.guide != nullptr) {
        guide = {result.guide_share * options_.guide_weight, step.guide->maps};
      }
      JointGradient<float> gradient;
      const JointLossValues loss =
          joint_loss(networks_,
                     {surfaces_[static_cast<size_t>(step.first)].get(),
                      surfaces_[static_cast<size_t>(step.second)].get()},
                     now, guide, &gradient,
                     progress.stage("training", share * static_cast<double>(s),
                                    share * static_cast<double>(s + 1)));
      if (!std::isfinite(loss.total())) {
        throw Error(ErrorCode::not_finite, "The loss of epoch " + std::to_string(result.epoch) +
                                               " between surfaces " + std::to_string(step.first) +
                                               " and " + std::to_string(step.second) +
                                               " is not a number. Use a smaller learning rate.");
      }
      update(gradient, now, result.epoch * pairs_per_epoch() + static_cast<int>(s));
      add(result.loss.terms, loss.terms, share);
      result.loss.guide += share * loss.guide;
      if (watch) {
        watch(loss);
      }
    }
  } catch (...) {
    restore(before, history_);
    throw;
  }
  history_.push_back(result);
  return history_.back();
}

Tensors JointTrainer::state() const {
  Tensors result;
  for (const auto& [name, values] : networks_.features.parameters.tensors()) {
    result[kFeatures + name] = values;
  }
  add_state(kFeatures, feature_adam_.state(), result);
  if (jacobian_adam_.has_value()) {
    for (const auto& [name, values] : networks_.jacobians->tensors()) {
      result[kJacobians + name] = values;
    }
    add_state(kJacobians, jacobian_adam_->state(), result);
  }
  return result;
}

void JointTrainer::restore(const Tensors& state, std::vector<JointEpoch> history) {
  if (history.size() > static_cast<size_t>(options_.epochs)) {
    throw Error(ErrorCode::model_file,
                "The training to go on with has " + std::to_string(history.size()) +
                    " epochs, more than the " + std::to_string(options_.epochs) + " asked for.");
  }
  auto features = DiffusionParameters<float>::from_tensors(networks_.features.architecture.sizes,
                                                           part(state, kFeatures));
  AdamState feature_state = read_state(kFeatures, state, feature_adam_.state());
  if (jacobian_adam_.has_value()) {
    LocalJacobianNetwork<float> jacobians(networks_.jacobians->architecture(),
                                          part(state, kJacobians));
    jacobian_adam_->restore(read_state(kJacobians, state, jacobian_adam_->state()));
    networks_.jacobians = std::move(jacobians);
  }
  networks_.features.parameters = std::move(features);
  feature_adam_.restore(std::move(feature_state));
  history_ = std::move(history);
}

}  // namespace supple
