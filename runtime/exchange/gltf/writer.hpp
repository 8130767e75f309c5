// A glTF 2 file being made: one buffer, views and accessors that are added one after the other, and the rest of the JSON, which is the
// caller's.
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

/// Lengths and offsets are consistent at any time. Memory: the bytes of the buffer.
class Writer {
 public:
  /// `generator`: the program, for "asset".
  explicit Writer(const std::string& generator);

  /// Each adds a view and an accessor, and returns the accessor's number.
  /// Rows of three, attributes of vertices. `has_bounds`: with "min" and "max", which positions need.
  int add_vertices(std::span<const float> rows, bool has_bounds);
  /// Corners of triangles, below `vertices`: 16 bits each where that many fit, else 32.
  int add_indices(std::span<const std::int32_t> corners, std::size_t vertices);
  /// Numbers that are no vertex attribute.
  int add_scalars(std::span<const float> values);
  /// Rows of three, in blocks: fill(block, numbers) writes all numbers of one block.
  int add_rows(std::size_t blocks, std::size_t rows, const std::function<void(std::size_t block, std::span<float> numbers)>& fill);
  /// Bytes as they are, at a multiple of 8; gives the view's number.
  int add_bytes(std::span<const std::byte> bytes);

  /// The JSON except "asset", "buffers", "bufferViews" and "accessors".
  base::Json& json() { return json_; }

  /// Writes the file to the sink in pieces, in order. Throws InputError for more than the 4 GiB that GLB can hold.
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
