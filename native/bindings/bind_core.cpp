// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/core/dense.h"
#include "supple/core/error.h"
#include "supple/core/parallel.h"
#include "supple/core/simd.h"

namespace supple::bindings {

void bind_core(py::module_& module) {
  // Native errors become the package's own classes, which live in Python.
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) {
        std::rethrow_exception(pointer);
      }
    } catch (const Error& error) {
      const py::object made = py::module_::import("supple.errors")
                                  .attr("from_native")(to_string(error.code()), error.what());
      PyErr_SetObject(py::type::of(made).ptr(), made.ptr());
    }
  });

  py::class_<Progress>(
      module, "Progress",
      "Progress and cancellation of one long call.\n\n"
      "Pass a new one as `progress=` and watch it from another thread; every member "
      "may be used from any thread.")
      .def(py::init<>())
      .def_property_readonly("fraction", &Progress::fraction, "Done part of the call, 0 to 1.")
      .def_property_readonly("stage", &Progress::stage, "What is being done, in words.")
      .def_property_readonly("seconds_left", &Progress::seconds_left,
                             "Estimated seconds left; None before 2% is done.")
      .def_property_readonly("cancelled", &Progress::cancelled, "Whether cancel was called.")
      .def("cancel", &Progress::cancel, "Ask the call to stop; it raises Cancelled soon after.");

  module.def("thread_count", &thread_count);
  module.def("set_thread_count", &set_thread_count, py::arg("count"));
  module.def("simd_level", [] { return to_string(simd_level()); });
  module.def("blas_name", &blas_name);
}

}  // namespace supple::bindings
