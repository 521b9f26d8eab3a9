// SPDX-License-Identifier: GPL-3.0-or-later
#include <fcntl.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <system_error>

#include "supple/core/error.h"
#include "tasks/point_cache/files.h"

namespace supple {
namespace {

namespace fs = std::filesystem;

using KeySet = std::set<FrameKey>;

KeySet keys_in(const fs::path& data) {
  KeySet keys;
  if (const std::optional<KeyedFile> file = keyed_file(data, keys_of(data))) {
    for (const JournalEntry& entry : file->entries) {
      keys.insert(entry.key);
    }
  }
  return keys;
}

bool includes(const KeySet& all, const KeySet& some) {
  return std::includes(all.begin(), all.end(), some.begin(), some.end());
}

void remove_pair(const fs::path& data) {
  remove_file(data);
  remove_file(keys_of(data));
}

void refuse_folders(const fs::path& path) {
  const fs::path part = part_of(path);
  for (const fs::path& name : {path, keys_of(path), part, keys_of(part)}) {
    std::error_code ignored;  // what can't be looked at can't be opened, which says why
    if (fs::is_directory(name, ignored)) {
      throw Error(ErrorCode::array_file,
                  "'" + name.string() + "' is a folder. Remove it, or choose another name.");
    }
  }
}

// A kill between the two renames of `finish` leaves the keys of what is finished as PATH.part.keys.
void complete_finish(const fs::path& path) {
  const fs::path journal = keys_of(part_of(path));
  std::error_code ignored;  // what can't be looked at can't be opened either
  if (fs::exists(part_of(path), ignored)) {
    return;
  }
  const std::optional<KeyedFile> file = keyed_file(path, journal);
  if (!file || file->data.whole_frames() != static_cast<int64_t>(file->entries.size())) {
    return;
  }
  for (size_t i = 0; i < file->entries.size(); ++i) {
    if (!file->verified(static_cast<int64_t>(i), file->entries[i])) {
      return;
    }
  }
  rename_file(journal, keys_of(path));
}

// Where the unfinished frames of an earlier attempt may go: a free name, or the oldest's.
fs::path place_aside(const fs::path& path) {
  fs::path oldest;
  fs::file_time_type when = fs::file_time_type::max();
  for (const fs::path& attempt : attempts_of(path)) {
    std::error_code missing;
    const fs::file_time_type written = fs::last_write_time(attempt, missing);
    if (missing) {
      return attempt;
    }
    if (written < when) {
      oldest = attempt;
      when = written;
    }
  }
  return oldest;
}

// Keeps what an earlier attempt has and nothing else does.
void set_aside(const fs::path& path) {
  const fs::path part = part_of(path);
  const KeySet unfinished = keys_in(part);
  if (includes(keys_in(path), unfinished)) {
    return;
  }
  for (const fs::path& attempt : attempts_of(path)) {
    const KeySet keys = keys_in(attempt);
    if (includes(keys, unfinished)) {
      return;
    }
    if (includes(unfinished, keys)) {
      remove_pair(attempt);
    }
  }
  // The journal is copied first, so that a kill never parts it from the data.
  const fs::path place = place_aside(path);
  std::error_code failed;
  fs::copy_file(keys_of(part), keys_of(place), fs::copy_options::overwrite_existing, failed);
  if (failed) {
    throw Error(ErrorCode::array_file, "'" + keys_of(part).string() + "' can't be copied to '" +
                                           keys_of(place).string() + "': " + failed.message() +
                                           ". Make room, or choose another folder.");
  }
  rename_file(part, place);
}

}  // namespace

struct PointCacheWriter::State {
  fs::path path;
  int points, frame_count;
  DiskFile data, keys;

  // Begun under a third name, since what is called PATH.part has a header at any moment.
  static State begin(fs::path path, int points, float start, float rate, int frame_count);
};

PointCacheWriter::State PointCacheWriter::State::begin(fs::path path, int points, float start,
                                                       float rate, int frame_count) {
  refuse_folders(path);
  const fs::path part = part_of(path);
  fs::path fresh = part;
  fresh += ".new";
  DiskFile data(fresh, O_RDWR | O_CREAT);
  // First the new file, then the one before: of two that begin at once, one meets the other.
  data.lock();
  try {
    const std::optional<DiskFile> before = DiskFile::existing(part);
    if (before) {
      before->lock();
    }
    const PointCacheHeader header = point_cache_header(points, start, rate);
    data.clear();
    data.write(&header, sizeof(header), 0);
    complete_finish(path);
    set_aside(path);
    DiskFile keys(keys_of(part), O_RDWR | O_CREAT | O_TRUNC);
    rename_file(fresh, part);
    return {std::move(path), points, frame_count, std::move(data), std::move(keys)};
  } catch (...) {
    std::error_code ignored;  // the error that is under way says more
    fs::remove(fresh, ignored);
    throw;
  }
}

PointCacheWriter::PointCacheWriter(fs::path path, int points, float start, float rate,
                                   int frame_count) {
  if (points < 1 || frame_count < 1 || !std::isfinite(start) || !std::isfinite(rate) ||
      rate <= 0.0f) {
    throw Error(ErrorCode::bad_option,
                "A point cache needs 1 or more points and frames, a finite start and a rate above "
                "0, not " +
                    std::to_string(points) + " points, " + std::to_string(frame_count) +
                    " frames, start " + std::to_string(start) + " and rate " +
                    std::to_string(rate) + ".");
  }
  if (!path.has_filename()) {
    throw Error(ErrorCode::bad_option,
                "'" + path.string() + "' is no name for a point cache. Name a file.");
  }
  state_ = std::make_unique<State>(State::begin(std::move(path), points, start, rate, frame_count));
}
PointCacheWriter::~PointCacheWriter() = default;
PointCacheWriter::PointCacheWriter(PointCacheWriter&&) noexcept = default;

PointCacheWriter::State& PointCacheWriter::open_state() const {
  if (!state_) {
    throw Error(ErrorCode::bad_option,
                "This point cache's writer is closed. Make a new one to go on.");
  }
  return *state_;
}

void PointCacheWriter::append(const std::string& key, const Positions& positions) {
  const State& state = open_state();
  const std::string frame =
      "Frame " + std::to_string(frames_) + " of '" + state.path.string() + "'";
  if (frames_ == state.frame_count) {
    throw Error(ErrorCode::bad_option, frame + " is one too many: it was begun for " +
                                           std::to_string(state.frame_count) +
                                           " frames. Finish it.");
  }
  if (positions.rows() != state.points) {
    throw Error(ErrorCode::wrong_shape, frame + " has " + std::to_string(positions.rows()) +
                                            " points; each must have " +
                                            std::to_string(state.points) + ".");
  }
  if (!positions.allFinite()) {
    throw Error(ErrorCode::not_finite, frame +
                                           " has positions that are NaN or infinite. Look "
                                           "for their cause in what the frame is made from.");
  }
  const JournalEntry entry = journal_entry(frame_key(key), positions);
  const int32_t count = frames_ + 1;
  state.data.write(positions.data(), static_cast<uint64_t>(positions.size()) * sizeof(float),
                   frame_offset(state.points, frames_));
  state.keys.write(&entry, sizeof(entry), static_cast<uint64_t>(frames_) * sizeof(entry));
  state.data.write(&count, sizeof(count), offsetof(PointCacheHeader, frames));
  frames_ = count;
}

void PointCacheWriter::finish() {
  const State& state = open_state();
  if (frames_ < state.frame_count) {
    throw Error(ErrorCode::bad_option, "'" + state.path.string() + "' has " +
                                           std::to_string(frames_) + " of " +
                                           std::to_string(state.frame_count) +
                                           " frames. Append the rest, or close it and resume.");
  }
  refuse_folders(state.path);
  state.data.sync();
  state.keys.sync();
  const fs::path part = part_of(state.path);
  // The data first: from here on the new cache is the one in use. A kill before the second costs
  // nothing, see `complete_finish`.
  rename_file(part, state.path);
  rename_file(keys_of(part), keys_of(state.path));
  for (const fs::path& attempt : attempts_of(state.path)) {
    remove_pair(attempt);
  }
  close();
}

void PointCacheWriter::close() { state_.reset(); }

void PointCacheWriter::discard() {
  const fs::path path = open_state().path;
  remove_pair(part_of(path));
  for (const fs::path& attempt : attempts_of(path)) {
    remove_pair(attempt);
  }
  close();
}

}  // namespace supple
