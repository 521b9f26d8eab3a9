// SPDX-License-Identifier: GPL-3.0-or-later
// The files of a point cache as they lie on the disk (supple/tasks/point_cache.h).
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "supple/tasks/point_cache.h"

namespace supple {

/// A file of the system, closed with its object, read and written at places, so that threads can
/// share it. Everything that fails is an `array_file` that names the file and the reason.
class DiskFile {
 public:
  /// flags: of open(2).
  DiskFile(std::filesystem::path path, int flags);
  /// For reading; nothing where there is none.
  static std::optional<DiskFile> existing(const std::filesystem::path& path);
  DiskFile(DiskFile&& other) noexcept;
  ~DiskFile();

  const std::filesystem::path& path() const { return path_; }
  uint64_t size() const;
  /// False where the file ends before.
  bool read(void* to, uint64_t bytes, uint64_t offset) const;
  void write(const void* from, uint64_t bytes, uint64_t offset) const;
  void clear() const;
  void sync() const;
  /// Refuses where another has it locked; the system lets go of it when its process ends.
  void lock() const;

 private:
  DiskFile(std::filesystem::path path, int flags, bool must_exist);
  std::filesystem::path path_;
  int descriptor_;
};

/// Both replace or remove what is there. Errors: `array_file`.
void rename_file(const std::filesystem::path& from, const std::filesystem::path& to);
void remove_file(const std::filesystem::path& path);

/// PATH.keys for PATH.
std::filesystem::path keys_of(const std::filesystem::path& path);
std::filesystem::path part_of(const std::filesystem::path& path);
/// Where earlier attempts may be, PATH.part.1 and on.
std::vector<std::filesystem::path> attempts_of(const std::filesystem::path& path);

struct PointCacheHeader {
  std::array<char, 12> magic;
  int32_t version, points;
  float start, rate;
  int32_t frames;
};
static_assert(sizeof(PointCacheHeader) == 32, "written as it lies in memory");
/// The header of a file without frames.
PointCacheHeader point_cache_header(int points, float start, float rate);
uint64_t frame_offset(int points, int64_t frame);

/// A PC2 file, whatever its header says about frames.
class PointCacheFile {
 public:
  /// Errors: `array_file` where the header is none of PC2.
  explicit PointCacheFile(DiskFile file);
  const DiskFile& file() const { return file_; }
  const PointCacheHeader& header() const { return header_; }
  /// Frames whose bytes are all there now.
  int64_t whole_frames() const;
  Positions read(int64_t frame) const;

 private:
  DiskFile file_;
  PointCacheHeader header_;
};

using FrameKey = std::array<unsigned char, 16>;
struct JournalEntry {
  FrameKey key;
  uint64_t checksum;
};
static_assert(sizeof(JournalEntry) == 24, "written as it lies in memory");

/// Errors: `bad_option` where it is not 32 hexadecimal digits.
FrameKey frame_key(const std::string& digits);
JournalEntry journal_entry(const FrameKey& key, const Positions& positions);

/// Data and the entries of its whole frames.
struct KeyedFile {
  PointCacheFile data;
  std::vector<JournalEntry> entries;

  /// The frame, where it is what the entry was written for.
  std::optional<Positions> verified(int64_t frame, const JournalEntry& entry) const;
};
/// Nothing where one of them is not there, is something else or can't be read: a cache does not
/// fail for what it could have kept.
std::optional<KeyedFile> keyed_file(const std::filesystem::path& data,
                                    const std::filesystem::path& journal);

}  // namespace supple
