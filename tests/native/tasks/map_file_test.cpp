// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/map_file.h"

#include "native/scratch_folder.h"
#include "native/support.h"

namespace supple {
namespace {

using test::fails_with;

class MapFile : public ::testing::Test {
 protected:
  MeshView source() const { return {source_.vertices, source_.faces}; }
  MeshView target() const { return {target_.vertices, target_.faces}; }
  void save() const { save_map(path, map, source(), target()); }
  void load() const { load_map(path, source(), target()); }

  zoo::Mesh source_ = zoo::icosphere(1);
  zoo::Mesh target_ = zoo::torus(10, 6);
  SurfaceMap map =
      ClosestSurfacePoints(target_.vertices, target_.faces).query(source_.vertices).map;
  test::ScratchFolder folder;
  std::filesystem::path path = folder.path() / "a b.map";
};

TEST_F(MapFile, ComesBackBitForBit) {
  map.face[3] = -1;
  map.weights.row(3).setZero();
  save();
  const SurfaceMap back = load_map(path, source(), target());
  EXPECT_EQ(back.face, map.face);
  EXPECT_EQ(back.weights, map.weights);
}

TEST_F(MapFile, ReplacesTheOneOfBeforeAndLeavesNothingElse) {
  save();
  map.face[0] = -1;
  save();
  EXPECT_EQ(load_map(path, source(), target()).face[0], -1);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()),
                          std::filesystem::directory_iterator()),
            1);
}

TEST_F(MapFile, SaysWhichMeshIsAnotherAndHow) {
  save();
  const zoo::Mesh first = source_, second = target_;
  source_.vertices(4, 1) += 1e-12;
  EXPECT_TRUE(
      fails_with(ErrorCode::stale_mesh, {"source", "vertices have moved"}, [&] { load(); }));
  source_ = first;
  target_.faces.row(2).reverseInPlace();
  EXPECT_TRUE(fails_with(ErrorCode::stale_mesh, {"target", "faces have changed"}, [&] { load(); }));
  target_ = zoo::torus(10, 7);
  EXPECT_TRUE(fails_with(ErrorCode::stale_mesh,
                         {"target", "60 vertices and 120 faces", "70 vertices and 140 faces"},
                         [&] { load(); }));
  target_ = second;
  EXPECT_NO_THROW(load());
}

TEST_F(MapFile, DamageIsAnError) {
  save();
  const std::string bytes = test::read_bytes(path);
  for (size_t size = 0; size < bytes.size(); size += 13) {
    test::write_bytes(path, bytes.substr(0, size));
    EXPECT_TRUE(fails_with(ErrorCode::array_file, {}, [&] { load(); })) << size;
  }
  for (size_t at = 0; at < bytes.size(); at += 17) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 4);
    test::write_bytes(path, damaged);
    EXPECT_TRUE(fails_with(ErrorCode::array_file, {}, [&] { load(); })) << at;
  }
}

TEST_F(MapFile, NoFileAndNoFolder) {
  EXPECT_TRUE(fails_with(ErrorCode::array_file, {"no map", "a b.map"}, [&] { load(); }));
  path = folder.path() / "nowhere" / "map";
  EXPECT_TRUE(fails_with(ErrorCode::array_file, {"nowhere"}, [&] { save(); }));
}

TEST_F(MapFile, AMapOfOtherMeshesIsNotWritten) {
  std::swap(source_, target_);
  EXPECT_TRUE(fails_with(ErrorCode::wrong_shape, {"source points"}, [&] { save(); }));
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace supple
