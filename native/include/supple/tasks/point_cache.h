// SPDX-License-Identifier: GPL-3.0-or-later
// Point caches: where a mesh's vertices are at each frame, as Blender's Mesh Cache modifier reads
// it. The format is PC2, of 3ds Max's Point Cache modifier:
//
//   12 bytes   "POINTCACHE2" and a zero
//   i32, i32   version 1, number of points n
//   f32, f32   start frame, sample rate in frames a sample
//   i32        number of samples
//   the samples, one after the other, n x 3 f32 each
//
// Beside a cache PATH that a PointCacheWriter wrote is its journal PATH.keys, 24 bytes a frame:
//
//   16 bytes   key: a hash of everything the frame was made from
//   u64        XXH3-64 of the key and the frame's data
//
// Numbers are little-endian. A frame is only ever reused where its checksum is right, so a journal
// that lies beside another cache's data, or a damaged byte in either file, costs frames, never
// gives wrong ones.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "supple/core/types.h"

namespace supple {

/// n x 3, one point a row, as a point cache stores them.
using Positions = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Any PC2 file. It is kept open, so one that replaces it meanwhile changes nothing here. Any
/// number of threads may read at the same time.
class PointCacheReader {
 public:
  /// Errors: `array_file` where there is none, it is no PC2 file of version 1, or it has fewer
  /// samples than its header promises; more bytes than those are ignored.
  explicit PointCacheReader(const std::filesystem::path& path);
  ~PointCacheReader();
  PointCacheReader(PointCacheReader&&) noexcept;

  int points() const;
  float start() const;
  float rate() const;
  int frames() const;
  /// Sample `frame`, counted from 0. Errors: `index_out_of_range`, `array_file`.
  Positions read(int frame) const;

 private:
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

/// Writes a cache frame by frame, so that a kill at any moment loses at most the frame that was
/// being written.
///
/// It writes PATH.part and PATH.part.keys, and `finish` gives them their names: what is at PATH is
/// whole at any time, the bake of before until the new one is finished. PATH.part is a valid PC2
/// file from its first moment on (it is begun as PATH.part.new), of the frames whose data is
/// complete: data is written before its journal entry, and the header counts a frame last.
///
/// What an earlier attempt left as PATH.part is not lost where a new one begins: it is moved to
/// PATH.part.1 to PATH.part.4, the oldest of four making way, unless others hold all its frames.
/// KeptFrames finds them there; `finish` and `discard` remove them.
///
/// A second writer of the same path, of this process or another, is refused while one is open. Not
/// for several threads at once.
class PointCacheWriter {
 public:
  /// path: of a file. points, frame_count: 1 or more; the frames that `finish` asks for. start:
  /// finite. rate: finite and above 0. Errors: `bad_option`; `array_file` where the folder is
  /// missing or can't be written, a folder has one of the names, or another writer has the path.
  PointCacheWriter(std::filesystem::path path, int points, float start, float rate,
                   int frame_count);
  /// As `close`.
  ~PointCacheWriter();
  PointCacheWriter(PointCacheWriter&&) noexcept;

  /// Writes the next frame. key: 32 hexadecimal digits, as `content_hash` makes them, over
  /// everything the frame is made from.
  /// Errors: `bad_option` for another key, a frame too many, or a closed writer; `wrong_shape`;
  /// `not_finite`; `array_file` where it can't be written, such as on a full disk: the frames of
  /// before are kept, and the same frame may be tried again.
  void append(const std::string& key, const Positions& positions);
  /// Number of frames appended.
  int frames() const { return frames_; }

  /// Has the system bring everything to the disk, replaces PATH and PATH.keys, and closes.
  /// Errors: `bad_option` before the last frame or where it is closed; `array_file`, which leaves
  /// PATH as it was and the writer open.
  void finish();
  /// Leaves PATH.part for a resume. No-op where it is closed.
  void close();
  /// Removes PATH.part and what earlier attempts left; PATH stays as it was. Closes.
  /// Errors: `bad_option` where it is closed; `array_file`.
  void discard();

 private:
  struct State;
  State& open_state() const;

  std::unique_ptr<State> state_;
  int frames_ = 0;
};

/// The frames that earlier bakes left, found by their keys: of finished caches, of attempts that
/// were killed, and of pieces that other processes bake. Files are kept open, so that a writer may
/// begin, go on and finish at the same paths. Memory: some bytes a frame, for keys. Any number of
/// threads may ask at the same time.
class KeptFrames {
 public:
  /// Opens, of each path, PATH with its journal and everything a PointCacheWriter of it has not
  /// finished. What is not there, or no cache, or can't be read, has no frames.
  explicit KeptFrames(const std::vector<std::filesystem::path>& paths);
  ~KeptFrames();
  KeptFrames(KeptFrames&&) noexcept;

  /// The frame of that key, or nothing where there is none whose data is as it was written.
  /// Errors: `bad_option` for what is no key of 32 hexadecimal digits.
  std::optional<Positions> find(const std::string& key) const;
  /// Number of different keys. Their data is verified only when it is asked for.
  int size() const;

 private:
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

}  // namespace supple
