// Writer of glTF 2 files: one buffer with views and accessors; the rest of the JSON is set by the caller.
//
//   gltf::Writer writer("carillon-bank 0.2.0");
//   const int points = writer.add_vertices(positions);
//   writer.json().set("meshes", ...);
//   writer.write_glb([&](std::string_view bytes) { file.append(bytes); });
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "runtime/base/json.hpp"

namespace carillon::gltf {

/// Lengths and offsets are always consistent. Memory: the bytes of the buffer.
class Writer {
 public:
  /// `generator`: program name for "asset".
  explicit Writer(const std::string& generator);

  /// The add functions append a view and an accessor and return the accessor's index.
  /// Vertex attributes, rows of three. `has_bounds`: with "min" and "max", required for positions.
  int add_vertices(std::span<const float> rows, bool has_bounds);
  /// Triangle corners below `vertices`: 16 bits each if possible, else 32.
  int add_indices(std::span<const std::int32_t> corners, std::size_t vertices);
  /// Scalars other than vertex attributes.
  int add_scalars(std::span<const float> values);
  /// Rows of two.
  int add_pairs(std::span<const float> values);
  /// Rows of three, in blocks: fill(block, numbers) writes all numbers of a block.
  int add_rows(std::size_t blocks, std::size_t rows, const std::function<void(std::size_t block, std::span<float> numbers)>& fill);
  /// Raw bytes, aligned to 8; returns the view's index.
  int add_bytes(std::span<const std::byte> bytes);

  /// JSON without "asset", "buffers", "bufferViews" and "accessors".
  base::Json& json() { return json_; }

  /// Writes the file to `sink` in pieces, in order. Throws InputError above the 4 GiB limit of GLB.
  void write_glb(const std::function<void(std::string_view)>& sink) const;

 private:
  template <class T>
  int add_view(std::span<const T> values, std::size_t alignment, int target, std::size_t later_bytes = 0);
  int add_accessor(int view, int component, const char* type, std::size_t count);

  base::Json json_, views_, accessors_;
  std::string buffer_;
  int view_count_ = 0, accessor_count_ = 0;
};

}  // namespace carillon::gltf
