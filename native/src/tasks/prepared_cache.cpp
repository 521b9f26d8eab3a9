// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/prepared_cache.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <random>
#include <system_error>

#include "supple/core/error.h"

namespace supple {
namespace {

namespace fs = std::filesystem;

// prepared-KEY.supple, and while it is written prepared-KEY.RANDOM.part
constexpr std::string_view kPrefix = "prepared-", kSuffix = ".supple", kPartSuffix = ".part";
constexpr size_t kKeyDigits = 32, kRandomDigits = 16;
// Nothing takes this long to write: who began it is gone.
constexpr std::chrono::hours kStale(1);

enum class Kind { foreign, kept, part };

bool is_hex(std::string_view text) {
  return text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

Kind kind_of(std::string_view name) {
  if (!name.starts_with(kPrefix)) {
    return Kind::foreign;
  }
  name.remove_prefix(kPrefix.size());
  if (!is_hex(name.substr(0, kKeyDigits))) {
    return Kind::foreign;
  }
  if (name.size() == kKeyDigits + kSuffix.size() && name.ends_with(kSuffix)) {
    return Kind::kept;
  }
  const bool part = name.size() == kKeyDigits + 1 + kRandomDigits + kPartSuffix.size() &&
                    name[kKeyDigits] == '.' && name.ends_with(kPartSuffix) &&
                    is_hex(name.substr(kKeyDigits + 1, kRandomDigits));
  return part ? Kind::part : Kind::foreign;
}

std::string random_digits() {
  std::random_device device;
  const uint64_t number = (uint64_t{device()} << 32) | device();
  std::string digits(kRandomDigits, '0');
  for (size_t i = 0; i < kRandomDigits; ++i) {
    digits[i] = "0123456789abcdef"[(number >> (4 * i)) & 15];
  }
  return digits;
}

struct File {
  fs::path path;
  int64_t bytes = 0;
  fs::file_time_type used;
};

// The regular files of one kind. Those that vanish meanwhile are left out.
std::vector<File> files_in(const fs::path& folder, Kind kind) {
  std::vector<File> files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code gone;
    if (kind_of(it->path().filename().string()) != kind ||
        it->symlink_status(gone).type() != fs::file_type::regular) {
      continue;
    }
    const auto bytes = static_cast<int64_t>(it->file_size(gone));
    const fs::file_time_type used = it->last_write_time(gone);
    if (!gone) {
      files.push_back({it->path(), bytes, used});
    }
  }
  return files;
}

bool remove_file(const fs::path& path) {
  std::error_code ignored;  // gone already, or not ours to remove: the answer is no
  return fs::remove(path, ignored);
}

std::string mebibytes(int64_t bytes) {
  return std::to_string((bytes + (1 << 20) - 1) >> 20) + " MiB";
}

}  // namespace

PreparedCache::PreparedCache(fs::path folder, int64_t max_bytes)
    : folder_(std::move(folder)), max_bytes_(max_bytes) {
  if (folder_.empty() || max_bytes_ < 0) {
    throw Error(ErrorCode::bad_option,
                "A cache of prepared meshes needs a folder and a size of 0 bytes or more.");
  }
}

fs::path PreparedCache::file_of(const std::string& key) const {
  if (key.size() != kKeyDigits || !is_hex(key)) {
    throw Error(ErrorCode::bad_option, "'" + key + "' is no key of 32 hexadecimal digits.");
  }
  return folder_ / (std::string(kPrefix) + key + std::string(kSuffix));
}

bool PreparedCache::load(const std::string& key, std::span<const NamedArray> arrays,
                         const std::function<bool()>& fits, std::vector<Note>& notes) const {
  const fs::path path = file_of(key);
  try {
    if (!read_array_file(path, key, arrays)) {
      return false;
    }
    if (!fits()) {
      throw Error(ErrorCode::array_file, "'" + path.string() + "' has arrays of another mesh.");
    }
  } catch (const Error& error) {
    remove_file(path);
    notes.push_back({"cache_rebuilt", 1,
                     std::string("A file of the disk cache was damaged, so the mesh was prepared "
                                 "again: ") +
                         error.what()});
    return false;
  }
  std::error_code ignored;  // a cache one may only read still serves
  fs::last_write_time(path, fs::file_time_type::clock::now(), ignored);
  return true;
}

void PreparedCache::store(const std::string& key, std::span<const NamedArray> arrays,
                          std::vector<Note>& notes) const {
  const fs::path path = file_of(key);
  const int64_t bytes = array_file_size(arrays);
  if (bytes > max_bytes_) {
    notes.push_back({"cache_too_small", 1,
                     "The disk cache does not keep this mesh: it takes " + mebibytes(bytes) +
                         " and the cache may have " + mebibytes(max_bytes_) +
                         ". Raise the cache's size."});
    return;
  }
  try {
    fs::create_directories(folder_);
    fs::path part = path;
    part.replace_extension(random_digits());
    part += kPartSuffix;
    write_array_file(part, key, arrays);
    try {
      fs::rename(part, path);
    } catch (const fs::filesystem_error&) {
      remove_file(part);
      throw;
    }
  } catch (const std::exception& error) {
    notes.push_back({"cache_unwritable", 1,
                     std::string("The disk cache can't be written, so this mesh will be prepared "
                                 "again next time: ") +
                         error.what()});
    return;
  }
  make_room(path);
}

void PreparedCache::make_room(const fs::path& stored) const {
  const fs::file_time_type now = fs::file_time_type::clock::now();
  for (const File& part : files_in(folder_, Kind::part)) {
    if (now - part.used > kStale) {
      remove_file(part.path);
    }
  }
  std::vector<File> files = files_in(folder_, Kind::kept);
  std::sort(files.begin(), files.end(),
            [](const File& a, const File& b) { return a.used < b.used; });
  int64_t total = 0;
  for (const File& file : files) {
    total += file.bytes;
  }
  for (const File& file : files) {
    if (total <= max_bytes_) {
      return;
    }
    // Where one can't be removed, the next is.
    if (file.path.filename() != stored.filename() && remove_file(file.path)) {
      total -= file.bytes;
    }
  }
}

PreparedCache::Size PreparedCache::size() const {
  Size size;
  for (const File& file : files_in(folder_, Kind::kept)) {
    ++size.files;
    size.bytes += file.bytes;
  }
  return size;
}

PreparedCache::Size PreparedCache::clear() const {
  Size removed;
  for (const File& file : files_in(folder_, Kind::kept)) {
    if (remove_file(file.path)) {
      ++removed.files;
      removed.bytes += file.bytes;
    }
  }
  for (const File& part : files_in(folder_, Kind::part)) {
    remove_file(part.path);
  }
  return removed;
}

}  // namespace supple
