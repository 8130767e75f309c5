// Arrays of a mesh file, read by offset on any rank.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "precompute/mesh/parallel/layout.hpp"
#include "runtime/base/error.hpp"

namespace carillon::parallel_mesh {

/// A file read by offset.
class Source {
 public:
  Source(const std::filesystem::path& file, std::string name)
      : name_(std::move(name)), handle_(::open(file.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (handle_ < 0)
      throw SystemError(fmt::format("{}: cannot be opened on every rank ({}); put it where all nodes of the machine see it", name_,
                                    std::strerror(errno)));
  }
  ~Source() { ::close(handle_); }
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;

  /// Rows first ... first + rows - 1 as T (double or std::int64_t).
  template <typename T>
  std::vector<T> read(const Array& array, std::int64_t first, std::int64_t rows) const {
    std::vector<T> values(rows * array.columns);
    std::array<unsigned char, 1 << 16> block;
    const std::size_t in_block = block.size() / static_cast<std::size_t>(array.bytes);
    for (std::size_t done = 0; done < values.size();) {
      const std::size_t now = std::min(in_block, values.size() - done);
      fill(block.data(), now * static_cast<std::size_t>(array.bytes),
           array.offset + (first * array.columns + static_cast<std::int64_t>(done)) * array.bytes, array.name);
      for (std::size_t i = 0; i < now; ++i)
        values[done + i] = static_cast<T>(convert<T>(block.data() + i * static_cast<std::size_t>(array.bytes), array));
      done += now;
    }
    return values;
  }

 private:
  void fill(unsigned char* into, std::size_t bytes, std::int64_t at, const std::string& array) const {
    while (bytes > 0) {
      const ssize_t got = ::pread(handle_, into, bytes, at);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) throw SystemError(fmt::format("{}: array '{}' cannot be read: {}", name_, array, std::strerror(errno)));
      if (got == 0) throw InputError(fmt::format("{}: the file ends within array '{}'; write it again", name_, array));
      into += got;
      at += got;
      bytes -= static_cast<std::size_t>(got);
    }
  }

  template <typename T>
  static T convert(const unsigned char* bytes, const Array& array) {
    static_assert(std::endian::native == std::endian::little);
    std::uint64_t word = 0;
    for (int i = 0; i < array.bytes; ++i) word |= std::uint64_t{bytes[array.is_big_endian ? array.bytes - 1 - i : i]} << (8 * i);
    if (array.is_floating) {
      if (array.bytes == 4) return static_cast<T>(std::bit_cast<float>(static_cast<std::uint32_t>(word)));
      return static_cast<T>(std::bit_cast<double>(word));
    }
    const int spare = 64 - 8 * array.bytes;
    if (array.is_signed) return static_cast<T>(static_cast<std::int64_t>(word << spare) >> spare);
    return static_cast<T>(std::min<std::uint64_t>(word, INT64_MAX));
  }

  std::string name_;
  int handle_;
};

}  // namespace carillon::parallel_mesh
