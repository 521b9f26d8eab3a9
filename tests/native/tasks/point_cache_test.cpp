// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/tasks/point_cache.h"

#include <sys/resource.h>

#include <algorithm>
#include <bit>
#include <csignal>
#include <limits>

#include "native/scratch_folder.h"
#include "native/support.h"

namespace supple {
namespace {

namespace fs = std::filesystem;
using test::fails_with;
using test::read_bytes;
using test::write_bytes;

constexpr int kPoints = 5, kFrames = 6;
constexpr size_t kHeader = 32, kFrameBytes = kPoints * 12, kEntry = 24;
constexpr float kStart = 1.0f, kRate = 0.5f;

/// Frame `number` of a made-up animation: no two numbers in all frames are the same.
Positions frame(int number) {
  Positions positions(kPoints, 3);
  for (int i = 0; i < 3 * kPoints; ++i) {
    positions.data()[i] = static_cast<float>(100 * number + i) + 0.25f;
  }
  return positions;
}

std::string key(int number) {
  std::string digits = std::to_string(number);
  return std::string(32 - digits.size(), 'a') + digits;
}

void put(std::string& bytes, uint32_t word) {
  for (int shift = 0; shift < 32; shift += 8) {
    bytes += static_cast<char>((word >> shift) & 255);
  }
}

/// The PC2 file of these frames, made from the format's definition.
std::string pc2(const std::vector<int>& numbers) {
  std::string bytes("POINTCACHE2\0", 12);
  for (const uint32_t word :
       {1u, static_cast<uint32_t>(kPoints), std::bit_cast<uint32_t>(kStart),
        std::bit_cast<uint32_t>(kRate), static_cast<uint32_t>(numbers.size())}) {
    put(bytes, word);
  }
  for (const int number : numbers) {
    const Positions positions = frame(number);
    for (Eigen::Index i = 0; i < positions.rows(); ++i) {
      for (const float value : {positions(i, 0), positions(i, 1), positions(i, 2)}) {
        put(bytes, std::bit_cast<uint32_t>(value));
      }
    }
  }
  return bytes;
}

fs::path with(const fs::path& path, const std::string& ending) { return path.string() + ending; }

class PointCache : public ::testing::Test {
 protected:
  PointCacheWriter writer(int frame_count = kFrames) const {
    return PointCacheWriter(path, kPoints, kStart, kRate, frame_count);
  }
  static void append(PointCacheWriter& to, const std::vector<int>& numbers) {
    for (const int number : numbers) {
      to.append(key(number), frame(number));
    }
  }
  void bake(const std::vector<int>& numbers) const {
    PointCacheWriter to = writer(static_cast<int>(numbers.size()));
    append(to, numbers);
    to.finish();
  }
  /// As a kill leaves it.
  void begin(const std::vector<int>& numbers) const {
    PointCacheWriter to = writer();
    append(to, numbers);
  }
  KeptFrames kept() const { return KeptFrames({path}); }
  /// Which of these frames are found; a wrong one fails.
  static std::vector<int> found(const KeptFrames& kept, const std::vector<int>& numbers) {
    std::vector<int> result;
    for (const int number : numbers) {
      if (const std::optional<Positions> positions = kept.find(key(number))) {
        EXPECT_EQ(*positions, frame(number)) << number;
        result.push_back(number);
      }
    }
    return result;
  }
  /// Bakes what is not kept, and says which those were.
  std::vector<int> resume(const std::vector<int>& numbers) const {
    const KeptFrames before = kept();
    PointCacheWriter to = writer(static_cast<int>(numbers.size()));
    std::vector<int> computed;
    for (const int number : numbers) {
      std::optional<Positions> positions = before.find(key(number));
      if (!positions) {
        computed.push_back(number);
        positions = frame(number);
      }
      to.append(key(number), *positions);
    }
    to.finish();
    return computed;
  }
  std::vector<std::string> names() const {
    std::vector<std::string> result;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder.path())) {
      result.push_back(entry.path().filename().string());
    }
    std::sort(result.begin(), result.end());
    return result;
  }

  const std::vector<int> all{0, 1, 2, 3, 4, 5};
  test::ScratchFolder folder;
  fs::path path = folder.path() / "a b.pc2";
  fs::path keys = with(path, ".keys"), part = with(path, ".part"),
           part_keys = with(path, ".part.keys");
};
using Numbers = std::vector<int>;
using Names = std::vector<std::string>;

// --- reading
// --------------------------------------------------------------------------------------

TEST_F(PointCache, ReadsAFileOfTheFormat) {
  write_bytes(path, pc2(all));
  const PointCacheReader reader(path);
  EXPECT_EQ(reader.points(), kPoints);
  EXPECT_EQ(reader.start(), kStart);
  EXPECT_EQ(reader.rate(), kRate);
  ASSERT_EQ(reader.frames(), kFrames);
  for (int i = kFrames - 1; i >= 0; --i) {
    EXPECT_EQ(reader.read(i), frame(i));
  }
  for (const int outside : {-1, kFrames}) {
    EXPECT_TRUE(fails_with(ErrorCode::index_out_of_range, {"a b.pc2", "6 frames"},
                           [&] { reader.read(outside); }));
  }
}

TEST_F(PointCache, ReadsTheFileThatWasOpenedThoughAnotherReplacesIt) {
  bake(all);
  const PointCacheReader reader(path);
  bake({9});
  EXPECT_EQ(reader.read(5), frame(5));
}

TEST_F(PointCache, AFileCutShortAnywhereIsAnErrorThatSaysWhatIsLeft) {
  const std::string bytes = pc2(all);
  for (size_t size = 0; size < bytes.size(); size += 7) {
    write_bytes(path, bytes.substr(0, size));
    const size_t whole = size < kHeader ? 0 : (size - kHeader) / kFrameBytes;
    const std::string left = size < kHeader ? std::to_string(size) + " bytes"
                                            : "only " + std::to_string(whole) + " whole";
    EXPECT_TRUE(fails_with(ErrorCode::array_file, {"a b.pc2", left.c_str()}, [&] {
      PointCacheReader{path};
    })) << size;
  }
}

TEST_F(PointCache, WhatIsNoPointCacheIsAnError) {
  const auto fails = [&](const char* part_of_message) {
    return fails_with(ErrorCode::array_file, {"a b.pc2", part_of_message},
                      [&] { PointCacheReader{path}; });
  };
  EXPECT_TRUE(fails("no point cache"));
  const auto with_word = [&](size_t at, uint32_t word) {
    std::string bytes = pc2(all), four;
    put(four, word);
    write_bytes(path, bytes.replace(at, 4, four));
  };
  with_word(8, 0);
  EXPECT_TRUE(fails("POINTCACHE2"));
  with_word(12, 2);
  EXPECT_TRUE(fails("version 2"));
  with_word(16, 0);
  EXPECT_TRUE(fails("0 points"));
  with_word(16, 0x7fffffff);
  EXPECT_TRUE(fails("only 0 whole"));
  with_word(28, 0xffffffff);
  EXPECT_TRUE(fails("-1 frames"));
  with_word(28, 0x7fffffff);
  EXPECT_TRUE(fails("only 6 whole"));
  fs::remove(path);
  fs::create_directory(path);
  EXPECT_TRUE(fails("can't be read"));
}

// --- writing
// --------------------------------------------------------------------------------------

TEST_F(PointCache, WritesTheFormatByteForByte) {
  bake(all);
  EXPECT_EQ(read_bytes(path), pc2(all));
  EXPECT_EQ(names(), (Names{"a b.pc2", "a b.pc2.keys"}));
  const std::string journal = read_bytes(keys);
  ASSERT_EQ(journal.size(), kFrames * kEntry);
  EXPECT_EQ(journal.substr(3 * kEntry, 16), std::string(15, '\xaa') + "\xa3");
}

TEST_F(PointCache, TheUnfinishedOneIsAValidFileAtEveryFrame) {
  PointCacheWriter to = writer();
  Numbers done;
  for (const int number : all) {
    EXPECT_EQ(read_bytes(part), pc2(done));
    EXPECT_EQ(read_bytes(part_keys).size(), done.size() * kEntry);
    append(to, {number});
    done.push_back(number);
    EXPECT_EQ(to.frames(), static_cast<int>(done.size()));
  }
  EXPECT_EQ(read_bytes(part), pc2(all));
  EXPECT_FALSE(fs::exists(path));
}

TEST_F(PointCache, TheFinishedOneStaysUntilTheNextIsFinished) {
  bake({9, 8});
  const std::string before = read_bytes(keys);
  PointCacheWriter to = writer();
  append(to, all);
  EXPECT_EQ(read_bytes(path), pc2({9, 8}));
  EXPECT_EQ(read_bytes(keys), before);
  to.finish();
  EXPECT_EQ(read_bytes(path), pc2(all));
}

TEST_F(PointCache, DiscardRemovesWhatIsUnfinishedAndNothingElse) {
  bake({9, 8});
  begin({1});
  begin({2});
  PointCacheWriter to = writer();
  append(to, {0, 1});
  to.discard();
  EXPECT_EQ(names(), (Names{"a b.pc2", "a b.pc2.keys"}));
  EXPECT_EQ(read_bytes(path), pc2({9, 8}));
}

TEST_F(PointCache, WhatTheWriterRefuses) {
  PointCacheWriter to = writer(1);
  const auto refuses = [](ErrorCode code, const char* message, const std::function<void()>& call) {
    return fails_with(code, {message}, call);
  };
  for (const char* wrong : {"", "0123", "0123456789abcdef0123456789abcdeg"}) {
    EXPECT_TRUE(
        refuses(ErrorCode::bad_option, "32 hexadecimal", [&] { to.append(wrong, frame(0)); }));
    EXPECT_TRUE(refuses(ErrorCode::bad_option, "32 hexadecimal", [&] { kept().find(wrong); }));
  }
  EXPECT_TRUE(
      refuses(ErrorCode::wrong_shape, "4 points", [&] { to.append(key(0), frame(0).topRows(4)); }));
  Positions broken = frame(0);
  broken(2, 1) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(refuses(ErrorCode::not_finite, "Frame 0", [&] { to.append(key(0), broken); }));
  EXPECT_TRUE(refuses(ErrorCode::bad_option, "0 of 1", [&] { to.finish(); }));
  append(to, {0});
  EXPECT_TRUE(refuses(ErrorCode::bad_option, "too many", [&] { append(to, {1}); }));
  to.finish();
  EXPECT_EQ(read_bytes(path), pc2({0}));
  EXPECT_TRUE(refuses(ErrorCode::bad_option, "closed", [&] { append(to, {1}); }));
  EXPECT_TRUE(refuses(ErrorCode::bad_option, "closed", [&] { to.finish(); }));
  EXPECT_TRUE(refuses(ErrorCode::bad_option, "closed", [&] { to.discard(); }));
  to.close();

  const float infinite = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(refuses(ErrorCode::bad_option, "no name",
                      [] { PointCacheWriter("", kPoints, kStart, kRate, 1); }));
  EXPECT_TRUE(refuses(ErrorCode::bad_option, "0 points",
                      [&] { PointCacheWriter(path, 0, kStart, kRate, 1); }));
  EXPECT_TRUE(refuses(ErrorCode::bad_option, "0 frames",
                      [&] { PointCacheWriter(path, 1, kStart, kRate, 0); }));
  EXPECT_TRUE(refuses(ErrorCode::bad_option, "start",
                      [&] { PointCacheWriter(path, 1, infinite, kRate, 1); }));
  EXPECT_TRUE(
      refuses(ErrorCode::bad_option, "rate", [&] { PointCacheWriter(path, 1, kStart, 0.0f, 1); }));
}

TEST_F(PointCache, ASecondWriterOfTheSamePathIsRefused) {
  PointCacheWriter to = writer();
  append(to, {0, 1});
  EXPECT_TRUE(
      fails_with(ErrorCode::array_file, {"a b.pc2.part", "another bake"}, [&] { writer(); }));
  append(to, {2, 3, 4, 5});
  to.finish();
  EXPECT_EQ(read_bytes(path), pc2(all));
  EXPECT_EQ(names(), (Names{"a b.pc2", "a b.pc2.keys"}));
}

// --- reuse
// ----------------------------------------------------------------------------------------

TEST_F(PointCache, OnlyFramesWithOtherInputsAreComputedAgain) {
  EXPECT_EQ(kept().size(), 0);
  EXPECT_EQ(resume(all), all);
  EXPECT_EQ(kept().size(), kFrames);
  EXPECT_EQ(resume(all), Numbers{});
  EXPECT_EQ(resume({7, 0, 1, 1, 8, 5}), (Numbers{7, 8}));
  EXPECT_EQ(read_bytes(path), pc2({7, 0, 1, 1, 8, 5}));
  EXPECT_EQ(kept().size(), 5);
}

TEST_F(PointCache, AResumeGivesTheBytesOfAnUninterruptedBake) {
  bake(all);
  const std::string journal = read_bytes(keys);
  for (size_t count = 0; count <= all.size(); ++count) {
    fs::remove(path);
    fs::remove(keys);
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(count);
    begin({all.begin(), middle});
    EXPECT_EQ(resume(all), Numbers(middle, all.end()));
    EXPECT_EQ(read_bytes(path), pc2(all));
    EXPECT_EQ(read_bytes(keys), journal);
    EXPECT_EQ(names(), (Names{"a b.pc2", "a b.pc2.keys"}));
  }
}

TEST_F(PointCache, CutAnywhereItKeepsTheFramesThatAreWhole) {
  begin(all);
  const std::string data = read_bytes(part), journal = read_bytes(part_keys);
  for (size_t size = 0; size <= data.size(); size += 11) {
    write_bytes(part, data.substr(0, size));
    const size_t whole = size < kHeader ? 0 : (size - kHeader) / kFrameBytes;
    EXPECT_EQ(found(kept(), all).size(), whole) << size;
  }
  write_bytes(part, data);
  for (size_t size = 0; size <= journal.size(); size += 3) {
    write_bytes(part_keys, journal.substr(0, size));
    EXPECT_EQ(found(kept(), all).size(), size / kEntry) << size;
  }
  // What one counts and the others lack, as between the writes of one frame.
  for (const int counted : {0, 3, 5}) {
    std::string uncounted = data;
    uncounted[28] = static_cast<char>(counted);
    write_bytes(part, uncounted);
    write_bytes(part_keys, journal.substr(0, 4 * kEntry + 3));
    EXPECT_EQ(found(kept(), all), (Numbers{0, 1, 2, 3}));
  }
  fs::remove(part_keys);
  EXPECT_EQ(kept().size(), 0);
}

TEST_F(PointCache, ADamagedByteCostsItsFrameAndNoOther) {
  bake(all);
  const std::string data = read_bytes(path), journal = read_bytes(keys);
  const auto damaged = [](std::string bytes, size_t at) {
    bytes[at] = static_cast<char>(bytes[at] ^ 1);
    return bytes;
  };
  const auto without = [this](size_t number) {
    Numbers rest = all;
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(number));
    return rest;
  };
  for (size_t at = 0; at < kFrames * kFrameBytes; at += 7) {
    write_bytes(path, damaged(data, kHeader + at));
    EXPECT_EQ(found(kept(), all), without(at / kFrameBytes)) << at;
  }
  write_bytes(path, data);
  for (size_t at = 0; at < journal.size(); at += 5) {
    write_bytes(keys, damaged(journal, at));
    EXPECT_EQ(found(kept(), all), without(at / kEntry)) << at;
  }
  write_bytes(keys, damaged(journal, 2 * kEntry));
  EXPECT_EQ(resume(all), Numbers{2});
  EXPECT_EQ(read_bytes(path), data);
  EXPECT_EQ(read_bytes(keys), journal);
}

TEST_F(PointCache, AKeyThatWasDamagedIntoAnotherFramesFindsNothing) {
  bake({0, 1});
  std::string journal = read_bytes(keys);
  journal.replace(0, 16, journal.substr(kEntry, 16));
  write_bytes(keys, journal);
  EXPECT_EQ(found(kept(), {0, 1}), Numbers{1});  // the right one of two with its key
}

TEST_F(PointCache, AJournalBesideOtherDataFindsOnlyWhatIsTheSame) {
  bake({0, 1, 2, 3, 4, 5});
  const std::string journal = read_bytes(keys);
  bake({0, 7, 2, 1, 8, 9});
  write_bytes(keys, journal);
  EXPECT_EQ(found(kept(), {0, 1, 2, 3, 4, 5, 7, 8, 9}), (Numbers{0, 2}));
  write_bytes(path, "no point cache");
  EXPECT_EQ(kept().size(), 0);
}

TEST_F(PointCache, AKillBetweenTheTwoRenamesLosesNothing) {
  bake({0, 1, 2, 3, 4, 5});
  const std::string old_journal = read_bytes(keys);
  bake({0, 7, 2, 3, 8, 9});
  const std::string data = read_bytes(path), journal = read_bytes(keys);
  const auto killed_there = [&] {
    write_bytes(path, data);
    write_bytes(part_keys, journal);
    write_bytes(keys, old_journal);
  };
  killed_there();
  EXPECT_EQ(resume({0, 7, 2, 3, 8, 9}), Numbers{});
  EXPECT_EQ(read_bytes(path), data);
  EXPECT_EQ(read_bytes(keys), journal);
  // Also where the next one is killed, and by it.
  killed_there();
  begin({11});
  EXPECT_EQ(read_bytes(keys), journal);
  EXPECT_EQ(resume({0, 7, 2, 3, 8, 11}), Numbers{});
  // Where the keys are of something else, those of the data stay.
  fs::remove(part);
  write_bytes(part_keys, old_journal);
  begin({});
  EXPECT_EQ(resume({0, 7, 2, 3, 8, 11}), Numbers{});
}

TEST_F(PointCache, WhatAttemptsLeftIsKeptThroughFurtherOnes) {
  begin({0, 1, 2, 3});
  begin({0, 7});  // killed long before where the first was
  begin({});
  EXPECT_EQ(found(kept(), {0, 1, 2, 3, 7}), (Numbers{0, 1, 2, 3, 7}));
  EXPECT_EQ(resume({0, 1, 2, 3, 7, 4}), Numbers{4});
  EXPECT_EQ(names(), (Names{"a b.pc2", "a b.pc2.keys"}));
}

TEST_F(PointCache, AttemptsThatOthersHoldAreNotKept) {
  begin({0, 1});
  begin({0});
  begin({0, 1, 2});
  begin({});
  EXPECT_EQ(names(),
            (Names{"a b.pc2.part", "a b.pc2.part.1", "a b.pc2.part.1.keys", "a b.pc2.part.keys"}));
  EXPECT_EQ(found(kept(), all), (Numbers{0, 1, 2}));
}

TEST_F(PointCache, OfManyAttemptsTheOldestGoes) {
  const fs::file_time_type now = fs::file_time_type::clock::now();
  for (const int number : {0, 1, 2, 3, 4}) {
    begin({number});
    fs::last_write_time(part, now + std::chrono::seconds(number));
  }
  EXPECT_EQ(found(kept(), all), (Numbers{0, 1, 2, 3, 4}));
  begin({5});
  EXPECT_EQ(found(kept(), all), (Numbers{1, 2, 3, 4, 5}));
}

TEST_F(PointCache, TheWriterMayComeBeforeTheLookAtWhatIsKept) {
  begin({0, 1, 2});
  PointCacheWriter to = writer();
  const KeptFrames before = kept();
  EXPECT_EQ(found(before, all), (Numbers{0, 1, 2}));
  append(to, all);
  to.finish();
  bake({9});
  EXPECT_EQ(found(before, all), (Numbers{0, 1, 2}));
}

TEST_F(PointCache, IsJoinedFromPieces) {
  const fs::path whole = path;
  std::vector<fs::path> paths{whole};
  for (const int first : {0, 2, 4}) {
    path = folder.path() / ("piece" + std::to_string(first));
    paths.push_back(path);
    PointCacheWriter to = writer(2);
    append(to, {first, first + 1});
    if (first != 2) {  // one piece was killed at its end
      to.finish();
    }
  }
  paths.push_back(folder.path() / "nowhere" / "piece");
  const KeptFrames pieces(paths);
  EXPECT_EQ(found(pieces, all), all);
  path = whole;
  PointCacheWriter to = writer();
  for (const int number : all) {
    to.append(key(number), pieces.find(key(number)).value());
  }
  to.finish();
  EXPECT_EQ(read_bytes(whole), pc2(all));
}

// --- the disk
// -------------------------------------------------------------------------------------

TEST_F(PointCache, NoFolderAndAFolderInTheWay) {
  bake(all);
  for (const char* ending : {".keys", ".part", ".part.keys", ".part.new"}) {
    const fs::path inside = with(path, ending) / "inside";
    fs::remove(with(path, ending));
    fs::create_directories(inside);
    EXPECT_TRUE(fails_with(ErrorCode::array_file, {ending}, [&] { writer(); }));
    EXPECT_TRUE(fs::exists(inside));
    EXPECT_EQ(read_bytes(path), pc2(all));
    fs::remove_all(with(path, ending));
  }
  PointCacheWriter to = writer();
  append(to, all);
  fs::create_directory(keys);
  EXPECT_TRUE(fails_with(ErrorCode::array_file, {".keys", "folder"}, [&] { to.finish(); }));
  EXPECT_EQ(read_bytes(path), pc2(all));
  fs::remove(keys);
  to.finish();

  path = folder.path() / "nowhere" / "cache.pc2";
  EXPECT_TRUE(fails_with(ErrorCode::array_file, {"nowhere", "Make its folder"}, [&] { writer(); }));
}

/// No file grows past `bytes` while this lives, as on a disk that is full there.
class FullDisk {
 public:
  explicit FullDisk(size_t bytes) : signal_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, signal_);
  }

 private:
  void (*signal_)(int);
  rlimit before_;
};

TEST_F(PointCache, AFullDiskIsAnErrorAndTheFramesBeforeStay) {
  bake({9, 8});
  for (size_t room = kHeader + 3; room < kHeader + kFrames * kFrameBytes; room += 23) {
    const size_t whole = (room - kHeader) / kFrameBytes;
    const Numbers fits(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(whole));
    PointCacheWriter to = writer();
    {
      const FullDisk full(room);
      append(to, fits);
      for (int again = 0; again < 2; ++again) {
        EXPECT_TRUE(fails_with(ErrorCode::array_file, {"a b.pc2.part", "Make room"},
                               [&] { append(to, {static_cast<int>(whole)}); }));
      }
    }
    EXPECT_EQ(PointCacheReader(part).frames(), static_cast<int>(whole));
    EXPECT_EQ(read_bytes(path), pc2({9, 8}));
    append(to, {all.begin() + static_cast<std::ptrdiff_t>(whole), all.end()});
    EXPECT_EQ(read_bytes(part), pc2(all));
    to.discard();
  }
}

TEST_F(PointCache, AFullDiskBeforeTheFirstFrameLeavesEverything) {
  begin({0, 1});
  const Names before = names();
  {
    const FullDisk full(10);
    EXPECT_TRUE(fails_with(ErrorCode::array_file, {"Make room"}, [&] { writer(); }));
  }
  EXPECT_EQ(names(), before);
  EXPECT_EQ(found(kept(), all), (Numbers{0, 1}));
}

}  // namespace
}  // namespace supple
