// Lines and tokens of text surface formats, with positions for messages. Internal header of the surface readers; std only.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesher {

/// Lines of a text file, ended by LF, CRLF or CR.
class SurfaceText {
 public:
  /// `comment`: starts a comment; '\0': none. `at`, `line`: start position, and number of lines before it.
  SurfaceText(std::string_view bytes, std::string name, char comment, std::size_t at = 0, std::int64_t line = 0)
      : bytes_(bytes), name_(std::move(name)), comment_(comment), at_(at), number_(line) {}

  /// Tokens of the next line, empty for an empty one; false at the end of the file. Tokens point into the bytes.
  bool next(std::vector<std::string_view>& words);
  /// The same for the next non-empty line.
  bool next_filled(std::vector<std::string_view>& words);

  std::size_t at() const { return at_; }  // first byte of the next line
  std::int64_t number() const { return number_; }
  const std::string& name() const { return name_; }

  /// Throws InputError "name:line: message" for the last line read or another one.
  template <class... Args>
  [[noreturn]] void refuse(fmt::format_string<Args...> format, Args&&... args) const {
    refuse_line(number_, fmt::format(format, std::forward<Args>(args)...));
  }
  [[noreturn]] void refuse_line(std::int64_t line, const std::string& message) const {
    throw InputError(fmt::format("{}:{}: {}", name_, line, message));
  }

  /// A coordinate: a finite number below 1e30; refuses anything else.
  double read_coordinate(std::string_view word) const;

 private:
  std::string_view bytes_;
  std::string name_;
  char comment_;
  std::size_t at_;
  std::int64_t number_;
};

constexpr double kLargestCoordinate = 1e30;

/// Integer that fills the token; empty if it is none or exceeds 63 bits.
std::optional<std::int64_t> read_whole(std::string_view word);
/// Number that fills the token; may be infinite or NaN.
std::optional<double> read_number(std::string_view word);

/// Contents of a surface file: polygons of three or more corners; indices are within the points.
struct PolygonSoup {
  std::vector<Vec3> points;
  std::vector<std::int32_t> corners;  // of all polygons, concatenated
  std::vector<std::int32_t> counts;   // corners of each polygon
  void add_triangle(std::int32_t a, std::int32_t b, std::int32_t c) {
    corners.insert(corners.end(), {a, b, c});
    counts.push_back(3);
  }
};

/// Limit of points and corners: 32-bit indices.
constexpr std::int64_t kMaxPoints = 400'000'000;

/// Limit of triangles: repair takes minutes above, without audible benefit.
constexpr std::int64_t kMaxTriangles = 5'000'000;
inline constexpr const char* kTooManyTriangles =
    "more than 5,000,000 triangles; reduce it in a modeller: a few hundred thousand triangles sound the same";

/// One reader per format. They throw InputError with line or byte for malformed input; memory is bounded by a small multiple of the file
/// size.
PolygonSoup parse_obj(std::string_view bytes, const std::string& name);
PolygonSoup parse_off(std::string_view bytes, const std::string& name);
PolygonSoup parse_ply(std::string_view bytes, const std::string& name);
PolygonSoup parse_stl(std::string_view bytes, const std::string& name);
/// glTF 2: JSON and binary. External buffers are next to `name`.
PolygonSoup parse_gltf(std::string_view bytes, const std::string& name);
PolygonSoup parse_glb(std::string_view bytes, const std::string& name);

}  // namespace carillon::mesher
