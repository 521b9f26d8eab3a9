// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"

PYBIND11_MODULE(_native, module) {
  module.doc() = "Native core of Supple; use the package `supple`, which checks and documents.";
  module.attr("__version__") = SUPPLE_VERSION;
  supple::bindings::bind_core(module);
  supple::bindings::bind_geometry(module);
  supple::bindings::bind_spectral(module);
  supple::bindings::bind_learning(module);
  supple::bindings::bind_features(module);
  supple::bindings::bind_cache(module);
  supple::bindings::bind_tasks(module);
  supple::bindings::bind_inbetween(module);
  supple::bindings::bind_map_metrics(module);
  supple::bindings::bind_initial_maps(module);
  supple::bindings::bind_refine(module);
  supple::bindings::bind_transfer(module);
  supple::bindings::bind_sequence(module);
  supple::bindings::bind_point_cache(module);
  supple::bindings::bind_unsupervised(module);
  supple::bindings::bind_matching(module);
}
