// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/prepared_cache.h"

#include <atomic>
#include <chrono>
#include <thread>

#include "native/scratch_folder.h"
#include "native/tasks/editing.h"

namespace supple {
namespace {

namespace fs = std::filesystem;
using std::chrono::hours;

constexpr int64_t kPlenty = int64_t{1} << 30;

std::vector<std::string> codes(const std::vector<Note>& notes) {
  std::vector<std::string> result;
  for (const Note& note : notes) {
    if (note.code.starts_with("cache")) {
      result.push_back(note.code);
    }
  }
  return result;
}
using Codes = std::vector<std::string>;

// --- the folder ---------------------------------------------------------------------------------

class Cache : public ::testing::Test {
 protected:
  static std::string key(int number) {
    const std::string digits = std::to_string(number);
    return std::string(32 - digits.size(), '0') + digits;
  }
  fs::path file(int number) const {
    return folder.path() / ("prepared-" + key(number) + ".supple");
  }
  // Arrays whose values are `number`, 8000 bytes of them, as file `number`.
  void store(const PreparedCache& cache, int number) {
    Eigen::VectorXd values = Eigen::VectorXd::Constant(1000, number);
    const std::vector<NamedArray> arrays{{"values", values}};
    cache.store(key(number), arrays, notes);
  }
  bool load(const PreparedCache& cache, int number) {
    Eigen::VectorXd values;
    const std::vector<NamedArray> arrays{{"values", values}};
    const bool found = cache.load(
        key(number), arrays, [] { return true; }, notes);
    EXPECT_TRUE(!found || values == Eigen::VectorXd::Constant(1000, number));
    return found;
  }
  void age(int number, int by) const {
    fs::last_write_time(file(number), fs::file_time_type::clock::now() - hours(by));
  }

  test::ScratchFolder folder;
  const PreparedCache cache{folder.path(), kPlenty};
  std::vector<Note> notes;
};

TEST_F(Cache, FindsWhatWasStoredAndNothingElse) {
  EXPECT_FALSE(load(cache, 1));
  store(cache, 1);
  EXPECT_TRUE(load(cache, 1));
  EXPECT_FALSE(load(cache, 2));
  EXPECT_EQ(codes(notes), Codes{});
  EXPECT_EQ(cache.size().files, 1);
  EXPECT_EQ(cache.size().bytes, static_cast<int64_t>(fs::file_size(file(1))));
}

TEST_F(Cache, TheLeastRecentlyUsedGoWhereThereIsNoRoom) {
  for (int i = 1; i <= 4; ++i) {
    store(cache, i);
    age(i, 10 - i);
  }
  EXPECT_TRUE(load(cache, 1));  // used now, though the oldest
  const PreparedCache small(folder.path(), 3 * 9000);
  store(small, 5);
  EXPECT_TRUE(fs::exists(file(1)));
  EXPECT_FALSE(fs::exists(file(2)));
  EXPECT_FALSE(fs::exists(file(3)));
  EXPECT_TRUE(fs::exists(file(4)));
  EXPECT_TRUE(fs::exists(file(5)));
  EXPECT_LE(small.size().bytes, small.max_bytes());
}

TEST_F(Cache, TheOneJustStoredStaysWhateverTheClockSays) {
  store(cache, 1);
  fs::last_write_time(file(1), fs::file_time_type::clock::now() + hours(24));
  store(PreparedCache(folder.path(), 9000), 2);
  EXPECT_FALSE(fs::exists(file(1)));
  EXPECT_TRUE(fs::exists(file(2)));
}

TEST_F(Cache, WhatExceedsTheWholeIsNotKeptAndReported) {
  store(cache, 1);
  store(PreparedCache(folder.path(), 7000), 2);
  EXPECT_TRUE(fs::exists(file(1)));
  EXPECT_FALSE(fs::exists(file(2)));
  EXPECT_EQ(codes(notes), Codes{"cache_too_small"});
}

TEST_F(Cache, ForeignFilesAreNeverTouched) {
  const std::string part = "prepared-" + key(1) + ".0123456789abcdef.part";
  const std::vector<std::string> foreign = {
      "notes.txt",
      "prepared-.supple",
      "prepared-" + key(1),
      "prepared-" + key(1) + ".supple.bak",
      "prepared-" + std::string(31, '0') + "G.supple",
      "prepared-" + key(1) + ".part",
      part + ".txt",
  };
  const auto old = fs::file_time_type::clock::now() - hours(1000);
  for (const std::string& name : foreign) {
    test::write_bytes(folder.path() / name, std::string(20000, 'x'));
    fs::last_write_time(folder.path() / name, old);
  }
  fs::create_directory(file(7));  // a folder with a file's name
  store(PreparedCache(folder.path(), 9000), 2);
  store(PreparedCache(folder.path(), 9000), 3);
  EXPECT_EQ(cache.size().files, 1);
  cache.clear();
  for (const std::string& name : foreign) {
    EXPECT_TRUE(fs::exists(folder.path() / name)) << name;
  }
  EXPECT_TRUE(fs::exists(file(7)));
}

TEST_F(Cache, LeftoversGoWhenTheyAreOld) {
  const fs::path fresh = folder.path() / ("prepared-" + key(1) + ".0123456789abcdef.part");
  const fs::path stale = folder.path() / ("prepared-" + key(1) + ".fedcba9876543210.part");
  test::write_bytes(fresh, "begun");
  test::write_bytes(stale, "begun");
  fs::last_write_time(stale, fs::file_time_type::clock::now() - hours(2));
  store(cache, 2);
  EXPECT_TRUE(fs::exists(fresh));
  EXPECT_FALSE(fs::exists(stale));
  cache.clear();
  EXPECT_FALSE(fs::exists(fresh));
}

TEST_F(Cache, ADamagedFileIsRemovedAndReported) {
  store(cache, 1);
  test::write_bytes(file(1), test::read_bytes(file(1)).substr(0, 500));
  EXPECT_FALSE(load(cache, 1));
  EXPECT_FALSE(fs::exists(file(1)));
  EXPECT_EQ(codes(notes), Codes{"cache_rebuilt"});
  EXPECT_NE(notes[0].message.find(file(1).filename().string()), std::string::npos);
}

TEST_F(Cache, ArraysThatDoNotFitAreRemovedAndReported) {
  store(cache, 1);
  Eigen::VectorXd values;
  const std::vector<NamedArray> arrays{{"values", values}};
  EXPECT_FALSE(cache.load(
      key(1), arrays, [] { return false; }, notes));
  EXPECT_FALSE(fs::exists(file(1)));
  EXPECT_EQ(codes(notes), Codes{"cache_rebuilt"});
}

TEST_F(Cache, AFolderThatCannotBeIsReported) {
  test::write_bytes(folder.path() / "file", "");
  const PreparedCache blocked(folder.path() / "file" / "cache", kPlenty);
  EXPECT_FALSE(load(blocked, 1));
  store(blocked, 1);
  EXPECT_EQ(codes(notes), Codes{"cache_unwritable"});
  EXPECT_EQ(blocked.size().files, 0);
  EXPECT_EQ(blocked.clear().files, 0);
}

TEST_F(Cache, AFileThatCannotBeReplacedLeavesNothingBehind) {
  fs::create_directories(file(1) / "inside");
  store(cache, 1);
  EXPECT_EQ(codes(notes), Codes{"cache_unwritable"});
  for (const fs::directory_entry& entry : fs::directory_iterator(folder.path())) {
    EXPECT_NE(entry.path().extension(), ".part");
  }
}

TEST_F(Cache, OptionsOutOfRange) {
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"folder"}, [] { PreparedCache("", 1); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"0"}, [] { PreparedCache("a", -1); }));
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"../1"}, [this] {
    cache.load(
        "../1", {}, [] { return true; }, notes);
  }));
}

TEST_F(Cache, ManyAtOnce) {
  // Room for two of three, so that files appear and go while others read them.
  const PreparedCache small(folder.path(), 2 * 9000);
  std::atomic<int> wrong = 0, hits = 0;
  std::vector<std::thread> threads;
  std::vector<std::vector<Note>> said(4);
  for (size_t t = 0; t < said.size(); ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 150; ++i) {
        const int number = 1 + (i + static_cast<int>(t)) % 3;
        Eigen::VectorXd values;
        std::vector<NamedArray> arrays{{"values", values}};
        if (small.load(
                key(number), arrays, [] { return true; }, said[t])) {
          ++hits;
          wrong += values == Eigen::VectorXd::Constant(1000, number) ? 0 : 1;
        } else {
          values = Eigen::VectorXd::Constant(1000, number);
          arrays = {{"values", values}};
          small.store(key(number), arrays, said[t]);
        }
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(hits, 0);
  for (const std::vector<Note>& one : said) {
    EXPECT_EQ(codes(one), Codes{});
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(folder.path())) {
    EXPECT_EQ(entry.path().extension(), ".supple");
  }
}

// --- prepared meshes ----------------------------------------------------------------------------

class CachedMesh : public ::testing::Test {
 protected:
  std::shared_ptr<const PreparedMesh> prepare(const PreparedCache* from,
                                              const PrepareOptions& options = kOptions) const {
    return std::make_shared<PreparedMesh>(mesh.vertices, mesh.faces, options, ProgressRange(),
                                          from);
  }
  fs::path only_file() const {
    std::vector<fs::path> found;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder.path())) {
      found.push_back(entry.path());
    }
    EXPECT_EQ(found.size(), 1u);
    return found.at(0);
  }
  void expect_same_solution(const PreparedMesh& a, const PreparedMesh& b) const {
    const test::Edit edit = test::bending(mesh.vertices);
    const auto network = test::editing_network(kOptions.eigenfunctions);
    const auto solve = [&](const PreparedMesh& prepared) {
      const std::shared_ptr<const PreparedMesh> borrowed(std::shared_ptr<void>(), &prepared);
      return Editor(borrowed, edit.handles, network).solve(edit.targets).vertices;
    };
    EXPECT_TRUE(solve(a) == solve(b));
    EXPECT_TRUE(a.basis.mass == b.basis.mass);
    EXPECT_TRUE(a.basis.values == b.basis.values);
    EXPECT_EQ(a.basis.residual, b.basis.residual);
  }

  static constexpr PrepareOptions kOptions{.eigenfunctions = 32, .samples = 200};
  zoo::Mesh mesh = zoo::perturbed_sphere(3, 2);
  test::ScratchFolder folder;
  const PreparedCache cache{folder.path(), kPlenty};
};

TEST_F(CachedMesh, SolvesAsAFreshOneBitForBit) {
  const auto plain = prepare(nullptr), first = prepare(&cache), second = prepare(&cache);
  EXPECT_FALSE(plain->from_cache);
  EXPECT_FALSE(first->from_cache);
  EXPECT_TRUE(second->from_cache);
  expect_same_solution(*plain, *first);
  expect_same_solution(*plain, *second);
}

TEST_F(CachedMesh, EveryVertexAsASampleToo) {
  const PrepareOptions options{.eigenfunctions = 32, .samples = 0};
  const auto first = prepare(&cache, options), second = prepare(&cache, options);
  EXPECT_TRUE(second->from_cache);
  EXPECT_EQ(second->sampled.samples.size(), mesh.vertices.rows());
  expect_same_solution(*first, *second);
}

TEST_F(CachedMesh, IsFoundByItsGeometryAndSettingsAlone) {
  prepare(&cache);
  EXPECT_FALSE(prepare(&cache, {.eigenfunctions = 31, .samples = 200})->from_cache);
  EXPECT_FALSE(prepare(&cache, {.eigenfunctions = 32, .samples = 199})->from_cache);
  const double x = mesh.vertices(5, 0);
  mesh.vertices(5, 0) += 1e-12;
  EXPECT_FALSE(prepare(&cache)->from_cache);
  mesh.vertices(5, 0) = x;
  mesh.faces.row(0).swap(mesh.faces.row(1));
  EXPECT_FALSE(prepare(&cache)->from_cache);
  mesh.faces.row(0).swap(mesh.faces.row(1));
  EXPECT_TRUE(prepare(&cache)->from_cache);
}

TEST_F(CachedMesh, ADamagedFileIsRebuiltAndReported) {
  const auto first = prepare(&cache);
  std::string bytes = test::read_bytes(only_file());
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 4);
  test::write_bytes(only_file(), bytes);
  const auto rebuilt = prepare(&cache);
  EXPECT_FALSE(rebuilt->from_cache);
  EXPECT_EQ(codes(rebuilt->notes), Codes{"cache_rebuilt"});
  expect_same_solution(*first, *rebuilt);
  const auto again = prepare(&cache);
  EXPECT_TRUE(again->from_cache);
  EXPECT_EQ(codes(again->notes), Codes{});
}

TEST_F(CachedMesh, AFileWithTheRightSumsAndWrongArraysIsRebuilt) {
  const auto first = prepare(&cache);
  const fs::path file = only_file();
  const std::string key = file.stem().string().substr(std::string("prepared-").size());
  RowMatrix<double> functions = first->basis.functions;
  Eigen::VectorXd values = first->basis.values, residual = Eigen::VectorXd::Zero(1);
  Eigen::VectorXi ordering = first->symbolic->ordering(), samples = first->sampled.samples;
  RowMatrix<float> projector = first->sampled.domain.projector;
  const auto replace = [&] {
    fs::remove(file);
    const std::vector<NamedArray> arrays{{"eigenfunctions", functions}, {"eigenvalues", values},
                                         {"residual", residual},        {"ordering", ordering},
                                         {"samples", samples},          {"projector", projector}};
    write_array_file(file, key, arrays);
  };
  replace();
  EXPECT_TRUE(prepare(&cache)->from_cache);  // the names above are those in use
  std::swap(ordering[3], ordering[4]);
  ordering[5] = ordering[6];
  replace();
  EXPECT_EQ(codes(prepare(&cache)->notes), Codes{"cache_rebuilt"});
  ordering = first->symbolic->ordering();
  samples[3] = static_cast<int>(mesh.vertices.rows());
  replace();
  EXPECT_EQ(codes(prepare(&cache)->notes), Codes{"cache_rebuilt"});
  samples[3] = -1;
  replace();
  EXPECT_EQ(codes(prepare(&cache)->notes), Codes{"cache_rebuilt"});
  samples = first->sampled.samples;
  projector = projector.leftCols(7).eval();
  replace();
  EXPECT_EQ(codes(prepare(&cache)->notes), Codes{"cache_rebuilt"});
  functions = functions.topRows(50).eval();
  replace();
  EXPECT_EQ(codes(prepare(&cache)->notes), Codes{"cache_rebuilt"});
}

TEST_F(CachedMesh, WorksWhereNothingCanBeKept) {
  test::write_bytes(folder.path() / "file", "");
  const PreparedCache blocked(folder.path() / "file" / "cache", kPlenty);
  const auto prepared = prepare(&blocked);
  EXPECT_EQ(codes(prepared->notes), Codes{"cache_unwritable"});
  expect_same_solution(*prepare(nullptr), *prepared);
}

TEST_F(CachedMesh, NothingIsKeptOfOneThatWasCancelled) {
  Progress progress;
  progress.cancel();
  EXPECT_TRUE(test::fails_with(ErrorCode::cancelled, {}, [&] {
    PreparedMesh(mesh.vertices, mesh.faces, kOptions, ProgressRange(&progress), &cache);
  }));
  EXPECT_EQ(cache.size().files, 0);
}

TEST_F(CachedMesh, TheSmallestAreNotKept) {
  mesh = zoo::icosphere(1);  // 42 vertices
  prepare(&cache);
  EXPECT_EQ(cache.size().files, 0);
}

class CachedZoo : public ::testing::TestWithParam<zoo::Entry> {};

TEST_P(CachedZoo, ComesBack) {
  const zoo::Mesh& mesh = GetParam().mesh;
  const test::ScratchFolder folder;
  const PreparedCache cache(folder.path(), kPlenty);
  const PrepareOptions options{.eigenfunctions = 20, .samples = 100};
  const PreparedMesh first(mesh.vertices, mesh.faces, options, {}, &cache);
  const PreparedMesh second(mesh.vertices, mesh.faces, options, {}, &cache);
  EXPECT_EQ(second.from_cache, cache.size().files == 1);
  EXPECT_TRUE(first.basis.functions == second.basis.functions);
  EXPECT_TRUE(first.sampled.samples == second.sampled.samples);
  EXPECT_TRUE(first.sampled.domain.functions == second.sampled.domain.functions);
  EXPECT_TRUE(first.sampled.domain.projector == second.sampled.domain.projector);
  EXPECT_TRUE(first.sampled.rest.shape == second.sampled.rest.shape);
  EXPECT_TRUE(first.sampled.scales == second.sampled.scales);
  EXPECT_EQ(codes(second.notes), Codes{});
}
SUPPLE_OVER_THE_ZOO(CachedZoo);

}  // namespace
}  // namespace supple
