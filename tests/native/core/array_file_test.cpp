// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/array_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "native/scratch_folder.h"
#include "native/support.h"

namespace supple {
namespace {

// One of each type, fixed and free shapes, and an empty one.
struct Content {
  RowMatrix<double> field;
  Points points;
  Eigen::VectorXd values;
  RowMatrix<float> weights;
  Eigen::VectorXi order;
  RowMatrix<float> nothing;

  std::vector<NamedArray> arrays() {
    return {{"field", field},     {"points", points}, {"values", values},
            {"weights", weights}, {"order", order},   {"nothing", nothing}};
  }
  bool operator==(const Content& other) const {
    // Bit for bit: NaN equals itself, and -0 is not 0.
    const auto same = [](const auto& a, const auto& b) {
      return a.rows() == b.rows() && a.cols() == b.cols() &&
             (a.size() == 0 || std::memcmp(a.data(), b.data(), sizeof(*a.data()) * a.size()) == 0);
    };
    return same(field, other.field) && same(points, other.points) && same(values, other.values) &&
           same(weights, other.weights) && same(order, other.order) && same(nothing, other.nothing);
  }
};

Content some_content() {
  Content content;
  content.field = test::noise(4, 3, 1);
  content.points = test::noise(2, 3, 2);
  content.values = test::noise(3, 1, 3);
  content.values[0] = std::numeric_limits<double>::quiet_NaN();
  content.values[1] = -0.0;
  content.weights = test::noise(2, 5, 4).cast<float>();
  content.order = Eigen::VectorXi::LinSpaced(5, -2, 2);
  content.nothing.resize(0, 7);
  return content;
}

class ArrayFile : public ::testing::Test {
 protected:
  void SetUp() override {
    write_array_file(path, key, written.arrays());
    bytes = test::read_bytes(path);
  }
  bool read() { return read_array_file(path, key, found.arrays()); }
  ::testing::AssertionResult refused(const std::string& content) {
    test::write_bytes(path, content);
    return test::fails_with(ErrorCode::array_file, {path.filename().string().c_str()},
                            [this] { read(); });
  }

  test::ScratchFolder folder;
  const std::filesystem::path path = folder.path() / "arrays";
  const std::string key = "0123456789abcdef0123456789abcdef";
  Content written = some_content(), found;
  std::string bytes;
};

TEST_F(ArrayFile, ComesBackBitForBit) {
  EXPECT_TRUE(read());
  EXPECT_TRUE(found == written);
  EXPECT_EQ(static_cast<int64_t>(bytes.size()), array_file_size(written.arrays()));
}

TEST_F(ArrayFile, ComesBackWhereItIsReadInPieces) {
  Content large = some_content();
  large.field = test::noise(70001, 3, 5);
  std::filesystem::remove(path);
  write_array_file(path, key, large.arrays());
  EXPECT_TRUE(read());
  EXPECT_TRUE(found == large);
}

TEST_F(ArrayFile, OneThatIsNotThereIsNoError) {
  std::filesystem::remove(path);
  EXPECT_FALSE(read());
}

TEST_F(ArrayFile, AChangeOfAnyByteIsFound) {
  for (size_t i = 0; i < bytes.size(); ++i) {
    for (const int change : {0x01, 0x80, 0xff}) {
      std::string damaged = bytes;
      damaged[i] = static_cast<char>(damaged[i] ^ change);
      ASSERT_TRUE(refused(damaged)) << "byte " << i << " by " << change;
    }
  }
}

TEST_F(ArrayFile, EveryTruncationAndAnExtraByteAreFound) {
  for (size_t size = 0; size < bytes.size(); ++size) {
    ASSERT_TRUE(refused(bytes.substr(0, size))) << size << " bytes";
  }
  EXPECT_TRUE(refused(bytes + '\0'));
}

TEST_F(ArrayFile, RandomBytesAreRefused) {
  std::mt19937 random(7);
  for (int i = 0; i < 500; ++i) {
    std::string garbage(random() % (2 * bytes.size()), '\0');
    for (char& byte : garbage) {
      byte = static_cast<char>(random());
    }
    // Every second one gets past the first check.
    if (i % 2 == 0 && garbage.size() > 16) {
      garbage.replace(0, 16, bytes, 0, 16);
    }
    ASSERT_TRUE(refused(garbage)) << "attempt " << i;
  }
}

TEST_F(ArrayFile, AnotherKeyIsRefused) {
  EXPECT_TRUE(test::fails_with(ErrorCode::array_file, {"key"}, [this] {
    read_array_file(path, "fedcba9876543210fedcba9876543210", found.arrays());
  }));
}

TEST_F(ArrayFile, OtherArraysThanThoseWrittenAreRefused) {
  const auto refuses = [this](std::vector<NamedArray> arrays, const char* part) {
    return test::fails_with(ErrorCode::array_file, {part},
                            [&] { read_array_file(path, key, arrays); });
  };
  std::vector<NamedArray> arrays = found.arrays();
  arrays.pop_back();
  EXPECT_TRUE(refuses(arrays, "no file of these arrays"));
  arrays = found.arrays();
  arrays[0].name = "other";
  EXPECT_TRUE(refuses(arrays, "'other'"));
  arrays = found.arrays();
  RowMatrix<float> narrow;
  arrays[0] = NamedArray("field", narrow);
  EXPECT_TRUE(refuses(arrays, "'field'"));
  arrays = found.arrays();
  Eigen::VectorXd column;
  arrays[0] = NamedArray("field", column);  // 4 x 3 fits no vector
  EXPECT_TRUE(refuses(arrays, "shape of 'field'"));
}

TEST_F(ArrayFile, IsNeverWrittenOverAnother) {
  EXPECT_TRUE(test::fails_with(ErrorCode::array_file, {"can't be made"},
                               [this] { write_array_file(path, key, written.arrays()); }));
  EXPECT_EQ(test::read_bytes(path), bytes);
}

TEST_F(ArrayFile, AFolderThatIsNoneIsAnError) {
  EXPECT_TRUE(test::fails_with(ErrorCode::array_file, {"can't be made"}, [this] {
    write_array_file(path / "below a file", key, written.arrays());
  }));
}

TEST_F(ArrayFile, NamesAndKeysThatAreTooLongAreRefused) {
  EXPECT_TRUE(test::fails_with(ErrorCode::bad_option, {"32 bytes"}, [this] {
    write_array_file(folder.path() / "new", key + "0", written.arrays());
  }));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "new"));
}

}  // namespace
}  // namespace supple
