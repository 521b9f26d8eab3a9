// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "supple/core/array_file.h"
#include "supple/geometry/mesh.h"

namespace supple {

/// A folder that keeps what preparing meshes computed, one file a mesh, found by a key. Any number
/// of threads and processes may use one folder at the same time: files appear whole or not at all,
/// and a file that another has removed was never there.
///
/// Nothing here throws for what is in the folder or becomes of it: a cache that fails costs time,
/// never work. What failed is added to `notes`.
class PreparedCache {
 public:
  /// folder: made when first stored to; files of other names in it are left alone. max_bytes: the
  /// most its files may take together.
  /// Errors: `bad_option` where the folder's name is empty or max_bytes is below 0.
  PreparedCache(std::filesystem::path folder, int64_t max_bytes);

  /// Fills the arrays from what was stored for `key`, and marks it as used now; false where there
  /// is nothing, and the arrays are undefined then. A file that is not as it was written, or for
  /// whose arrays `fits` says no, is removed.
  /// key: as `content_hash` makes it. Notes: `cache_rebuilt`, with what was wrong with the file.
  bool load(const std::string& key, std::span<const NamedArray> arrays,
            const std::function<bool()>& fits, std::vector<Note>& notes) const;

  /// Stores the arrays for `key`, then removes files, the least recently used first, until all take
  /// max_bytes at most. Arrays that take more by themselves are not stored.
  /// Notes: `cache_unwritable`, `cache_too_small`.
  void store(const std::string& key, std::span<const NamedArray> arrays,
             std::vector<Note>& notes) const;

  struct Size {
    int64_t files = 0, bytes = 0;
  };
  /// What is kept now; nothing where there is no such folder.
  Size size() const;
  /// Removes everything kept; returns what was removed.
  Size clear() const;

  const std::filesystem::path& folder() const { return folder_; }
  int64_t max_bytes() const { return max_bytes_; }

 private:
  std::filesystem::path file_of(const std::string& key) const;
  void make_room(const std::filesystem::path& stored) const;

  std::filesystem::path folder_;
  int64_t max_bytes_;
};

}  // namespace supple
