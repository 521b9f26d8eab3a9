// SPDX-License-Identifier: GPL-3.0-or-later
#include "supple/core/array_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <vector>

#ifdef _WIN32
#include <io.h>
#else
#include <unistd.h>
#endif

#include "supple/core/error.h"
#include "xxh3.h"

namespace supple {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

constexpr std::array<char, 8> kMagic = {'S', 'U', 'P', 'P', 'L', 'E', 'A', 'F'};
constexpr uint32_t kVersion = 1;
// Read and hashed in turn: small enough to stay in the processor's cache in between.
constexpr uint64_t kPiece = uint64_t{1} << 19;

struct Header {
  std::array<char, 8> magic;
  uint32_t version, count;
  uint64_t file_size;
  std::array<char, 32> key;
};
struct Entry {
  std::array<char, 32> name;
  uint32_t type, zero;
  int64_t rows, cols;
  uint64_t checksum;
};
// Written as they lie in memory, so nothing may lie between their members.
static_assert(sizeof(Header) == 56 && std::has_unique_object_representations_v<Header>);
static_assert(sizeof(Entry) == 64 && std::has_unique_object_representations_v<Entry>);

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what) {
  throw Error(ErrorCode::array_file, "'" + path.string() + "' " + what);
}

std::array<char, 32> padded(const std::string& text) {
  std::array<char, 32> result{};
  if (text.size() > result.size()) {
    throw Error(ErrorCode::bad_option, "'" + text + "' is longer than 32 bytes. Shorten it.");
  }
  std::copy(text.begin(), text.end(), result.begin());
  return result;
}

uint64_t scalar_size(ArrayType type) { return type == ArrayType::float64 ? 8 : 4; }

uint64_t data_size(const NamedArray& array) {
  return static_cast<uint64_t>(array.rows) * static_cast<uint64_t>(array.cols) *
         scalar_size(array.type);
}

uint64_t directory_end(size_t count) {
  return sizeof(Header) + count * sizeof(Entry) + sizeof(uint64_t);
}

uint64_t head_checksum(const Header& header, const std::vector<Entry>& entries) {
  XXH3_state_t state;
  XXH3_64bits_reset(&state);
  XXH3_64bits_update(&state, &header, sizeof(Header));
  XXH3_64bits_update(&state, entries.data(), entries.size() * sizeof(Entry));
  return XXH3_64bits_digest(&state);
}

// Closed and, unless `keep` was called, removed.
class NewFile {
 public:
  explicit NewFile(const std::filesystem::path& path)
      : path_(path), file_(std::fopen(path.string().c_str(), "wbx")) {
    if (file_ == nullptr) {
      fail_here("can't be made");
    }
  }
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;
  ~NewFile() {
    if (file_ != nullptr) {
      std::fclose(file_);
      std::error_code ignored;  // nothing more can be done about it here
      std::filesystem::remove(path_, ignored);
    }
  }
  void write(const void* data, uint64_t size) {
    if (size > 0 && std::fwrite(data, 1, size, file_) != size) {
      fail_here("can't be written whole");
    }
  }
  void keep() {
#ifdef _WIN32
    const bool synced = std::fflush(file_) == 0 && _commit(_fileno(file_)) == 0;
#else
    const bool synced = std::fflush(file_) == 0 && fsync(fileno(file_)) == 0;
#endif
    if (!synced) {
      fail_here("can't be written whole");
    }
    std::fclose(std::exchange(file_, nullptr));
  }

 private:
  [[noreturn]] void fail_here(const char* what) const {
    fail(path_, std::string(what) + ": " + std::strerror(errno) + ".");
  }
  const std::filesystem::path& path_;
  std::FILE* file_;
};

class Reader {
 public:
  Reader(const std::filesystem::path& path, std::ifstream& stream) : path_(path), stream_(stream) {
    stream_.seekg(0, std::ios::end);
    const std::streamoff end = stream_.tellg();
    stream_.seekg(0);
    if (!stream_ || end < 0) {
      fail(path_, "can't be read.");
    }
    size_ = static_cast<uint64_t>(end);
  }
  uint64_t size() const { return size_; }
  void read(void* destination, uint64_t bytes) {
    stream_.read(static_cast<char*>(destination), static_cast<std::streamsize>(bytes));
    if (!stream_ || static_cast<uint64_t>(stream_.gcount()) != bytes) {
      fail(path_, "ends too early or can't be read.");
    }
  }
  /// Reads `bytes` and returns their checksum.
  uint64_t read_hashed(void* destination, uint64_t bytes) {
    XXH3_state_t state;
    XXH3_64bits_reset(&state);
    char* to = static_cast<char*>(destination);
    while (bytes > 0) {
      const uint64_t piece = std::min(bytes, kPiece);
      read(to, piece);
      XXH3_64bits_update(&state, to, piece);
      to += piece;
      bytes -= piece;
    }
    return XXH3_64bits_digest(&state);
  }

 private:
  const std::filesystem::path& path_;
  std::ifstream& stream_;
  uint64_t size_ = 0;
};

// Bytes of the array, or nothing where its shape is none or needs more than `most`.
std::optional<uint64_t> claimed_size(const Entry& entry, ArrayType type, uint64_t most) {
  if (entry.rows < 0 || entry.cols < 0) {
    return std::nullopt;
  }
  const auto rows = static_cast<uint64_t>(entry.rows), cols = static_cast<uint64_t>(entry.cols);
  if (cols > 0 && rows > most / scalar_size(type) / cols) {
    return std::nullopt;
  }
  return rows * cols * scalar_size(type);
}

}  // namespace

int64_t array_file_size(std::span<const NamedArray> arrays) {
  uint64_t size = directory_end(arrays.size());
  for (const NamedArray& array : arrays) {
    size += data_size(array);
  }
  return static_cast<int64_t>(size);
}

void write_array_file(const std::filesystem::path& path, const std::string& key,
                      std::span<const NamedArray> arrays) {
  const Header header{kMagic, kVersion, static_cast<uint32_t>(arrays.size()),
                      static_cast<uint64_t>(array_file_size(arrays)), padded(key)};
  std::vector<Entry> entries;
  for (const NamedArray& array : arrays) {
    entries.push_back({padded(array.name), static_cast<uint32_t>(array.type), 0, array.rows,
                       array.cols, XXH3_64bits(array.data, data_size(array))});
  }
  const uint64_t checksum = head_checksum(header, entries);
  NewFile file(path);
  file.write(&header, sizeof(Header));
  file.write(entries.data(), entries.size() * sizeof(Entry));
  file.write(&checksum, sizeof(checksum));
  for (const NamedArray& array : arrays) {
    file.write(array.data, data_size(array));
  }
  file.keep();
}

bool read_array_file(const std::filesystem::path& path, const std::string& key,
                     std::span<const NamedArray> arrays) {
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    // Asking now whether the file exists would answer for one that another process has just made.
    if (errno == ENOENT || errno == ENOTDIR) {
      return false;
    }
    fail(path, std::string("can't be opened: ") + std::strerror(errno) + ".");
  }
  Reader reader(path, stream);
  const uint64_t data_start = directory_end(arrays.size());
  if (reader.size() < data_start) {
    fail(path, "is too short.");
  }
  Header header;
  reader.read(&header, sizeof(Header));
  if (header.magic != kMagic || header.version != kVersion || header.count != arrays.size()) {
    fail(path, "is no file of these arrays.");
  }
  std::vector<Entry> entries(arrays.size());
  uint64_t checksum = 0;
  reader.read(entries.data(), entries.size() * sizeof(Entry));
  reader.read(&checksum, sizeof(checksum));
  if (checksum != head_checksum(header, entries)) {
    fail(path, "has a damaged head.");
  }
  if (header.key != padded(key)) {
    fail(path, "belongs to another key.");
  }
  if (header.file_size != reader.size()) {
    fail(path, "has lost or gained bytes at its end.");
  }

  uint64_t left = reader.size() - data_start;
  for (size_t i = 0; i < arrays.size(); ++i) {
    const NamedArray& array = arrays[i];
    const Entry& entry = entries[i];
    const std::optional<uint64_t> bytes = claimed_size(entry, array.type, left);
    if (entry.name != padded(array.name) || entry.type != static_cast<uint32_t>(array.type) ||
        entry.zero != 0 || !bytes) {
      fail(path, "has something else where '" + array.name + "' should be.");
    }
    void* destination = array.reshape(entry.rows, entry.cols);
    if (destination == nullptr && *bytes > 0) {
      fail(path, "has another shape of '" + array.name + "'.");
    }
    if (reader.read_hashed(destination, *bytes) != entry.checksum) {
      fail(path, "has damaged values in '" + array.name + "'.");
    }
    left -= *bytes;
  }
  if (left != 0) {
    fail(path, "has bytes that belong to no array.");
  }
  return true;
}

}  // namespace supple
