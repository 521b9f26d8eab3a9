// SPDX-License-Identifier: GPL-3.0-or-later
// Shared by the binding files: the only folder that knows pybind11. Arrays only; no algorithms.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "supple/core/progress.h"

namespace supple::bindings {

namespace py = pybind11;

/// Long calls run without the GIL.
using NoGil = py::call_guard<py::gil_scoped_release>;

inline ProgressRange range(Progress* progress) { return ProgressRange(progress); }

void bind_core(py::module_& module);
void bind_geometry(py::module_& module);
void bind_spectral(py::module_& module);
void bind_learning(py::module_& module);
void bind_features(py::module_& module);
void bind_cache(py::module_& module);
void bind_tasks(py::module_& module);
void bind_map_metrics(py::module_& module);
void bind_initial_maps(py::module_& module);
void bind_inbetween(py::module_& module);
void bind_refine(py::module_& module);
void bind_transfer(py::module_& module);
void bind_sequence(py::module_& module);
void bind_point_cache(py::module_& module);
void bind_unsupervised(py::module_& module);
void bind_matching(py::module_& module);

}  // namespace supple::bindings
