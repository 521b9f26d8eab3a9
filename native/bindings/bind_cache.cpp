// SPDX-License-Identifier: GPL-3.0-or-later
#include <pybind11/stl/filesystem.h>

#include "bindings.h"
#include "supple/tasks/prepared_cache.h"

namespace supple::bindings {

void bind_cache(py::module_& module) {
  const auto pair = [](const PreparedCache::Size& size) {
    return std::make_pair(size.files, size.bytes);
  };
  py::class_<PreparedCache>(
      module, "PreparedCache",
      "A folder that keeps prepared meshes, for any number of threads and processes.\n\n"
      "supple.cache makes the one that is used where none is named.")
      .def(py::init<std::filesystem::path, int64_t>(), py::arg("folder"), py::arg("max_bytes"))
      .def_property_readonly("folder", &PreparedCache::folder, "Where the files are.")
      .def_property_readonly("max_bytes", &PreparedCache::max_bytes,
                             "The most the files may take together.")
      .def(
          "size", [pair](const PreparedCache& cache) { return pair(cache.size()); },
          "Number of files and their bytes.", NoGil())
      .def(
          "clear", [pair](const PreparedCache& cache) { return pair(cache.clear()); },
          "Remove all files; return their number and bytes.", NoGil());
}

}  // namespace supple::bindings
