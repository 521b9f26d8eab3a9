// SPDX-License-Identifier: GPL-3.0-or-later
// A surface map on disk, with what names the two meshes it was made for.
#pragma once

#include <filesystem>

#include "supple/core/types.h"
#include "supple/geometry/surface_map.h"
#include "supple/tasks/mesh_view.h"

namespace supple {

/// Writes `map`, of source vertices to the target's surface, replacing a file of that name; one
/// that can't be written whole leaves what was there. Errors: those of `check_surface_map`;
/// `array_file`.
void save_map(const std::filesystem::path& path, const SurfaceMap& map, const MeshView& source,
              const MeshView& target);

/// The map of a file. Errors: `array_file` where there is none, or it is damaged or no map;
/// `stale_mesh` where a mesh is not, bit for bit, the one it was made for: the message says which,
/// and whether its faces or only its vertices' positions are others.
SurfaceMap load_map(const std::filesystem::path& path, const MeshView& source,
                    const MeshView& target);

}  // namespace supple
