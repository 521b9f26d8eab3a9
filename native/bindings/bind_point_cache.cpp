// SPDX-License-Identifier: GPL-3.0-or-later
#include <pybind11/stl/filesystem.h>

#include "bindings.h"
#include "supple/tasks/point_cache.h"

namespace supple::bindings {

void bind_point_cache(py::module_& module) {
  py::class_<PointCacheReader>(module, "PointCacheReader")
      .def(py::init<std::filesystem::path>(), py::arg("path"), NoGil())
      .def_property_readonly("points", &PointCacheReader::points)
      .def_property_readonly("start", &PointCacheReader::start)
      .def_property_readonly("rate", &PointCacheReader::rate)
      .def_property_readonly("frames", &PointCacheReader::frames)
      .def("read", &PointCacheReader::read, py::arg("frame"), NoGil());

  py::class_<PointCacheWriter>(module, "PointCacheWriter")
      .def(py::init<std::filesystem::path, int, float, float, int>(), py::arg("path"),
           py::arg("points"), py::arg("start"), py::arg("rate"), py::arg("frame_count"), NoGil())
      .def_property_readonly("frames", &PointCacheWriter::frames)
      .def("append", &PointCacheWriter::append, py::arg("key"), py::arg("positions"), NoGil())
      .def("finish", &PointCacheWriter::finish, NoGil())
      .def("close", &PointCacheWriter::close, NoGil())
      .def("discard", &PointCacheWriter::discard, NoGil());

  py::class_<KeptFrames>(module, "KeptFrames")
      .def(py::init<std::vector<std::filesystem::path>>(), py::arg("paths"), NoGil())
      .def("find", &KeptFrames::find, py::arg("key"), NoGil())
      .def("size", &KeptFrames::size);
}

}  // namespace supple::bindings
