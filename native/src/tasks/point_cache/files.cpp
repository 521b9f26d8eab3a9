// SPDX-License-Identifier: GPL-3.0-or-later
#include "tasks/point_cache/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <charconv>
#include <system_error>
#include <utility>

#include "core/xxh3.h"
#include "supple/core/error.h"

namespace supple {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

constexpr std::array<char, 12> kMagic = {'P', 'O', 'I', 'N', 'T', 'C', 'A', 'C', 'H', 'E', '2', 0};
constexpr int32_t kVersion = 1;
// Attempts that are kept beside the one under way: each may be as large as the whole.
constexpr int kAttempts = 4;

[[noreturn]] void fail(const fs::path& path, const std::string& what) {
  throw Error(ErrorCode::array_file, "'" + path.string() + "' " + what);
}

std::string advice(int code) {
  switch (code) {
    case ENOENT:
    case ENOTDIR:
      return " Make its folder first.";
    case EISDIR:
    case ENOTEMPTY:
      return " Choose another name.";
    case EACCES:
    case EPERM:
    case EROFS:
      return " Choose a folder you may write to.";
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return " Make room and go on: the frames before are kept.";
    default:
      return " Check the disk.";
  }
}

[[noreturn]] void fail_for(const fs::path& path, const std::string& what, int code) {
  fail(path, what + ": " + std::generic_category().message(code) + "." + advice(code));
}

fs::path with_ending(const fs::path& path, const std::string& ending) {
  fs::path result = path;
  result += ending;
  return result;
}

}  // namespace

DiskFile::DiskFile(fs::path path, int flags) : DiskFile(std::move(path), flags, true) {}

DiskFile::DiskFile(fs::path path, int flags, bool must_exist)
    : path_(std::move(path)), descriptor_(open(path_.c_str(), flags | O_CLOEXEC, 0666)) {
  if (descriptor_ < 0 && (must_exist || (errno != ENOENT && errno != ENOTDIR))) {
    fail_for(path_, "can't be opened", errno);
  }
}

std::optional<DiskFile> DiskFile::existing(const fs::path& path) {
  DiskFile file(path, O_RDONLY, false);
  return file.descriptor_ < 0 ? std::nullopt : std::optional<DiskFile>(std::move(file));
}

DiskFile::DiskFile(DiskFile&& other) noexcept
    : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)) {}

DiskFile::~DiskFile() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);
  }
}

uint64_t DiskFile::size() const {
  struct stat status;
  if (fstat(descriptor_, &status) != 0) {
    fail_for(path_, "can't be read", errno);
  }
  return static_cast<uint64_t>(status.st_size);
}

bool DiskFile::read(void* to, uint64_t bytes, uint64_t offset) const {
  char* at = static_cast<char*>(to);
  while (bytes > 0) {
    const ssize_t done = pread(descriptor_, at, bytes, static_cast<off_t>(offset));
    if (done == 0) {
      return false;
    }
    if (done < 0 && errno != EINTR) {
      fail_for(path_, "can't be read", errno);
    }
    if (done > 0) {
      at += done;
      bytes -= static_cast<uint64_t>(done);
      offset += static_cast<uint64_t>(done);
    }
  }
  return true;
}

void DiskFile::write(const void* from, uint64_t bytes, uint64_t offset) const {
  const char* at = static_cast<const char*>(from);
  while (bytes > 0) {
    const ssize_t done = pwrite(descriptor_, at, bytes, static_cast<off_t>(offset));
    if (done < 0 && errno != EINTR) {
      fail_for(path_, "can't be written", errno);
    }
    if (done > 0) {
      at += done;
      bytes -= static_cast<uint64_t>(done);
      offset += static_cast<uint64_t>(done);
    }
  }
}

void DiskFile::clear() const {
  if (ftruncate(descriptor_, 0) != 0) {
    fail_for(path_, "can't be written", errno);
  }
}

void DiskFile::sync() const {
  if (fsync(descriptor_) != 0) {
    fail_for(path_, "can't be written", errno);
  }
}

void DiskFile::lock() const {
  // Where a file system has no locks, two writers are for the user to avoid.
  if (flock(descriptor_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    fail(path_, "is being written by another bake. Wait for it, or end it.");
  }
}

void rename_file(const fs::path& from, const fs::path& to) {
  std::error_code failed;
  fs::rename(from, to, failed);
  if (failed) {
    fail_for(from, "can't be renamed to '" + to.string() + "'", failed.value());
  }
}

void remove_file(const fs::path& path) {
  std::error_code failed;
  fs::remove(path, failed);
  if (failed) {
    fail_for(path, "can't be removed", failed.value());
  }
}

fs::path keys_of(const fs::path& path) { return with_ending(path, ".keys"); }

fs::path part_of(const fs::path& path) { return with_ending(path, ".part"); }

std::vector<fs::path> attempts_of(const fs::path& path) {
  const fs::path before = with_ending(part_of(path), ".");
  std::vector<fs::path> result;
  for (int i = 1; i <= kAttempts; ++i) {
    result.push_back(with_ending(before, std::to_string(i)));
  }
  return result;
}

PointCacheHeader point_cache_header(int points, float start, float rate) {
  return {kMagic, kVersion, points, start, rate, 0};
}

uint64_t frame_offset(int points, int64_t frame) {
  return sizeof(PointCacheHeader) +
         static_cast<uint64_t>(frame) * static_cast<uint64_t>(points) * 3 * sizeof(float);
}

PointCacheFile::PointCacheFile(DiskFile file) : file_(std::move(file)) {
  const fs::path& path = file_.path();
  if (!file_.read(&header_, sizeof(header_), 0)) {
    fail(path, "has " + std::to_string(file_.size()) +
                   " bytes, fewer than the 32 of a point cache's header. Bake it again.");
  }
  if (header_.magic != kMagic) {
    fail(path, "is no point cache: it does not begin with POINTCACHE2. Choose a PC2 file.");
  }
  if (header_.version != kVersion) {
    fail(path, "is a point cache of version " + std::to_string(header_.version) +
                   "; only version 1 can be read. Bake it again.");
  }
  if (header_.points < 1 || header_.frames < 0) {
    fail(path, "has a damaged header, of " + std::to_string(header_.points) + " points and " +
                   std::to_string(header_.frames) + " frames. Bake it again.");
  }
}

int64_t PointCacheFile::whole_frames() const {
  const uint64_t start = frame_offset(header_.points, 0), size = file_.size();
  const uint64_t frame = frame_offset(header_.points, 1) - start;
  return size < start ? 0 : static_cast<int64_t>((size - start) / frame);
}

Positions PointCacheFile::read(int64_t frame) const {
  Positions positions(header_.points, 3);
  if (!file_.read(positions.data(), static_cast<uint64_t>(positions.size()) * sizeof(float),
                  frame_offset(header_.points, frame))) {
    fail(file_.path(), "ends within frame " + std::to_string(frame) +
                           ": it was cut short while it was read. Bake it again.");
  }
  return positions;
}

FrameKey frame_key(const std::string& digits) {
  FrameKey key;
  bool right = digits.size() == 2 * key.size();
  for (size_t i = 0; right && i < key.size(); ++i) {
    const char* first = digits.data() + 2 * i;
    right = std::from_chars(first, first + 2, key[i], 16).ptr == first + 2;
  }
  if (!right) {
    throw Error(ErrorCode::bad_option,
                "'" + digits +
                    "' is no key of 32 hexadecimal digits. Hash what the frame is "
                    "made from to 16 bytes.");
  }
  return key;
}

JournalEntry journal_entry(const FrameKey& key, const Positions& positions) {
  XXH3_state_t state;
  XXH3_64bits_reset(&state);
  XXH3_64bits_update(&state, key.data(), key.size());
  XXH3_64bits_update(&state, positions.data(),
                     static_cast<size_t>(positions.size()) * sizeof(float));
  return {key, XXH3_64bits_digest(&state)};
}

std::optional<Positions> KeyedFile::verified(int64_t frame, const JournalEntry& entry) const {
  try {
    Positions positions = data.read(frame);
    if (journal_entry(entry.key, positions).checksum == entry.checksum) {
      return positions;
    }
  } catch (const Error&) {
    // Cut short or unreadable by now: not there.
  }
  return std::nullopt;
}

std::optional<KeyedFile> keyed_file(const fs::path& data, const fs::path& journal) {
  try {
    std::optional<DiskFile> data_file = DiskFile::existing(data);
    const std::optional<DiskFile> journal_file = DiskFile::existing(journal);
    if (!data_file || !journal_file) {
      return std::nullopt;
    }
    KeyedFile result{PointCacheFile(std::move(*data_file)), {}};
    const uint64_t count = std::min(journal_file->size() / sizeof(JournalEntry),
                                    static_cast<uint64_t>(result.data.whole_frames()));
    result.entries.resize(count);
    if (!journal_file->read(result.entries.data(), count * sizeof(JournalEntry), 0)) {
      return std::nullopt;
    }
    return result;
  } catch (const Error&) {
    return std::nullopt;
  }
}

}  // namespace supple
