// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings.h"
#include "supple/tasks/sequence.h"

namespace supple::bindings {

void bind_sequence(py::module_& module) {
  module.def(
      "handle_frames",
      [](const PreparedMesh& prepared, const std::vector<Eigen::VectorXi>& handles,
         const Points& vertices) {
        const StartPose pose(prepared, vertices);
        std::vector<Eigen::Matrix4d> frames;
        for (const Eigen::VectorXi& handle : handles) {
          frames.push_back(handle_frame(prepared, handle, pose));
        }
        return frames;
      },
      py::arg("prepared"), py::arg("handles"), py::arg("vertices"), NoGil());
  module.def("part_of_motion", &part_of_motion, py::arg("matrix"), py::arg("centre"),
             py::arg("part"), NoGil());
  module.def("range_share", &range_share, py::arg("frame"), py::arg("first"), py::arg("last"),
             py::arg("ease_in"), py::arg("ease_out"), NoGil());

  py::class_<SequenceFrame>(module, "SequenceFrame")
      .def(py::init([](const Points& vertices,
                       const std::vector<std::optional<Eigen::Matrix4d>>& corrections,
                       double share) {
             return SequenceFrame{vertices, corrections, share};
           }),
           py::arg("vertices"), py::arg("corrections"), py::arg("share"));
  py::class_<SequenceEditor>(module, "SequenceEditor")
      .def(py::init([](std::shared_ptr<Editor> editor, const EditOptions& options) {
             return std::make_unique<SequenceEditor>(std::move(editor), options);
           }),
           py::arg("editor"), py::arg("options"))
      .def(
          "solve",
          [](const SequenceEditor& editor, const std::vector<SequenceFrame>& frames,
             Progress* progress) { return editor.solve(frames, range(progress)); },
          py::arg("frames"), py::arg("progress") = nullptr, NoGil());
}

}  // namespace supple::bindings
