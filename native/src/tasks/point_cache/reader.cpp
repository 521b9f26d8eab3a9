// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/error.h"
#include "tasks/point_cache/files.h"

namespace supple {
namespace {

namespace fs = std::filesystem;

DiskFile opened(const fs::path& path) {
  std::optional<DiskFile> file = DiskFile::existing(path);
  if (!file) {
    throw Error(ErrorCode::array_file,
                "There is no point cache '" + path.string() + "'. Check its name, or bake it.");
  }
  return std::move(*file);
}

}  // namespace

struct PointCacheReader::Impl {
  PointCacheFile file;
};

PointCacheReader::PointCacheReader(const fs::path& path)
    : impl_(std::make_unique<Impl>(Impl{PointCacheFile(opened(path))})) {
  const int64_t whole = impl_->file.whole_frames();
  if (whole < frames()) {
    throw Error(ErrorCode::array_file, "'" + path.string() + "' promises " +
                                           std::to_string(frames()) + " frames of " +
                                           std::to_string(points()) + " points and has only " +
                                           std::to_string(whole) + " whole ones. Bake it again.");
  }
}
PointCacheReader::~PointCacheReader() = default;
PointCacheReader::PointCacheReader(PointCacheReader&&) noexcept = default;

int PointCacheReader::points() const { return impl_->file.header().points; }
float PointCacheReader::start() const { return impl_->file.header().start; }
float PointCacheReader::rate() const { return impl_->file.header().rate; }
int PointCacheReader::frames() const { return impl_->file.header().frames; }

Positions PointCacheReader::read(int frame) const {
  if (frame < 0 || frame >= frames()) {
    throw Error(ErrorCode::index_out_of_range, "There is no frame " + std::to_string(frame) +
                                                   " in '" + impl_->file.file().path().string() +
                                                   "', which has " + std::to_string(frames()) +
                                                   " frames, counted from 0.");
  }
  return impl_->file.read(frame);
}

}  // namespace supple
