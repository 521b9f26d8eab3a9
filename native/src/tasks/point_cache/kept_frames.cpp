// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstring>
#include <unordered_map>
#include <utility>

#include "tasks/point_cache/files.h"

namespace supple {
namespace {

namespace fs = std::filesystem;

// A key is a hash already.
struct KeyHash {
  size_t operator()(const FrameKey& key) const {
    size_t result;
    std::memcpy(&result, key.data(), sizeof(result));
    return result;
  }
};

struct Place {
  size_t file;
  int64_t frame;
  JournalEntry entry;
};

}  // namespace

struct KeptFrames::Impl {
  std::vector<KeyedFile> files;
  std::unordered_multimap<FrameKey, Place, KeyHash> places;
  int keys = 0;

  void add(const fs::path& data, const fs::path& journal) {
    std::optional<KeyedFile> file = keyed_file(data, journal);
    if (!file || file->entries.empty()) {
      return;
    }
    const std::vector<JournalEntry> entries = std::exchange(file->entries, {});
    for (size_t i = 0; i < entries.size(); ++i) {
      keys += places.contains(entries[i].key) ? 0 : 1;
      places.insert({entries[i].key, {files.size(), static_cast<int64_t>(i), entries[i]}});
    }
    files.push_back(std::move(*file));
  }
};

KeptFrames::KeptFrames(const std::vector<fs::path>& paths) {
  auto impl = std::make_unique<Impl>();
  for (const fs::path& path : paths) {
    impl->add(path, keys_of(path));
    // So they lie after a kill between the two renames of `finish`.
    impl->add(path, keys_of(part_of(path)));
    impl->add(part_of(path), keys_of(part_of(path)));
    for (const fs::path& attempt : attempts_of(path)) {
      impl->add(attempt, keys_of(attempt));
    }
  }
  impl_ = std::move(impl);
}
KeptFrames::~KeptFrames() = default;
KeptFrames::KeptFrames(KeptFrames&&) noexcept = default;

std::optional<Positions> KeptFrames::find(const std::string& key) const {
  const auto [first, last] = impl_->places.equal_range(frame_key(key));
  for (auto at = first; at != last; ++at) {
    const Place& place = at->second;
    if (std::optional<Positions> found =
            impl_->files[place.file].verified(place.frame, place.entry)) {
      return found;
    }
  }
  return std::nullopt;
}

int KeptFrames::size() const { return impl_->keys; }

}  // namespace supple
