// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/map_file.h"

#include <algorithm>
#include <random>
#include <string>
#include <system_error>
#include <vector>

#include "supple/core/array_file.h"
#include "supple/core/content_hash.h"
#include "supple/core/error.h"

namespace supple {
namespace {

namespace fs = std::filesystem;

// What the arrays mean. Another number where that changes.
constexpr const char* kKey = "supple surface map 1";

// A hash as numbers, one a character.
Eigen::VectorXi name_of(std::initializer_list<std::span<const std::byte>> pieces) {
  const std::string digits = content_hash(pieces);
  Eigen::VectorXi name(static_cast<Eigen::Index>(digits.size()));
  std::copy(digits.begin(), digits.end(), name.data());
  return name;
}

struct MeshName {
  MeshName() = default;
  explicit MeshName(const MeshView& mesh)
      : size(2),
        faces(name_of({bytes_of(mesh.faces)})),
        vertices(name_of({bytes_of(mesh.vertices)})) {
    size << static_cast<int>(mesh.vertices.rows()), static_cast<int>(mesh.faces.rows());
  }
  Eigen::VectorXi size, faces, vertices;
};

struct Content {
  SurfaceMap map;
  MeshName source, target;

  std::vector<NamedArray> arrays() {
    return {{"face", map.face},
            {"weights", map.weights},
            {"source size", source.size},
            {"source faces", source.faces},
            {"source vertices", source.vertices},
            {"target size", target.size},
            {"target faces", target.faces},
            {"target vertices", target.vertices}};
  }
};

bool same(const Eigen::VectorXi& a, const Eigen::VectorXi& b) {
  return a.size() == b.size() && a == b;
}

std::string counts(const Eigen::VectorXi& size) {
  return size.size() != 2
             ? "other counts"
             : std::to_string(size[0]) + " vertices and " + std::to_string(size[1]) + " faces";
}

void check_same(const fs::path& path, const char* which, const MeshName& saved,
                const MeshName& now) {
  const std::string start = "The map " + path.string() + " was made for another " + which + ": ";
  const std::string fix = " Make the map anew, or load it with the mesh it was made for.";
  if (!same(saved.size, now.size)) {
    throw Error(ErrorCode::stale_mesh, start + "that one had " + counts(saved.size) +
                                           ", this one has " + counts(now.size) + "." + fix);
  }
  if (!same(saved.faces, now.faces)) {
    throw Error(ErrorCode::stale_mesh, start + "its faces have changed." + fix);
  }
  if (!same(saved.vertices, now.vertices)) {
    throw Error(ErrorCode::stale_mesh, start + "its vertices have moved." + fix);
  }
}

}  // namespace

void save_map(const fs::path& path, const SurfaceMap& map, const MeshView& source,
              const MeshView& target) {
  check_surface_map(map, source.vertices.rows(), target.faces);
  Content content{map, MeshName(source), MeshName(target)};
  // Written beside it and renamed, so that there is a whole file at any time.
  fs::path part = path;
  part += '.';
  part += std::to_string(std::random_device{}());
  part += ".part";
  write_array_file(part, kKey, content.arrays());
  std::error_code failed;
  fs::rename(part, path, failed);
  if (failed) {
    std::error_code ignored;
    fs::remove(part, ignored);
    throw Error(ErrorCode::array_file,
                "The map can't be written to " + path.string() + ": " + failed.message() + ".");
  }
}

SurfaceMap load_map(const fs::path& path, const MeshView& source, const MeshView& target) {
  Content content;
  if (!read_array_file(path, kKey, content.arrays())) {
    throw Error(ErrorCode::array_file, "There is no map " + path.string() + ".");
  }
  check_same(path, "source", content.source, MeshName(source));
  check_same(path, "target", content.target, MeshName(target));
  check_surface_map(content.map, source.vertices.rows(), target.faces);
  return std::move(content.map);
}

}  // namespace supple
