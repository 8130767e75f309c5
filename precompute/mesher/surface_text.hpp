// Lines and words of the text formats of surfaces, with their places for messages. Inner header of the surface readers; std only.
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

/// The bytes of a text file line by line. LF, CRLF and CR end a line.
class SurfaceText {
 public:
  /// `comment`: from this character on a line is not read; '\0': none. `at`, `line`: where to begin, and how many lines lie before.
  SurfaceText(std::string_view bytes, std::string name, char comment, std::size_t at = 0, std::int64_t line = 0)
      : bytes_(bytes), name_(std::move(name)), comment_(comment), at_(at), number_(line) {}

  /// The words of the next line, none for an empty one; false at the end of the file. The words point into the bytes.
  bool next(std::vector<std::string_view>& words);
  /// The same, of the next line that has words.
  bool next_filled(std::vector<std::string_view>& words);

  std::size_t at() const { return at_; }  // the first byte of the next line
  std::int64_t number() const { return number_; }
  const std::string& name() const { return name_; }

  /// Throws InputError "name:line: message", of the last line read or of another one.
  template <class... Args>
  [[noreturn]] void refuse(fmt::format_string<Args...> format, Args&&... args) const {
    refuse_line(number_, fmt::format(format, std::forward<Args>(args)...));
  }
  [[noreturn]] void refuse_line(std::int64_t line, const std::string& message) const {
    throw InputError(fmt::format("{}:{}: {}", name_, line, message));
  }

  /// A coordinate: a finite number below 1e30; anything else is refused.
  double read_coordinate(std::string_view word) const;

 private:
  std::string_view bytes_;
  std::string name_;
  char comment_;
  std::size_t at_;
  std::int64_t number_;
};

constexpr double kLargestCoordinate = 1e30;

/// A whole number that fills the word; nothing if it is none or leaves 63 bits.
std::optional<std::int64_t> read_whole(std::string_view word);
/// A number that fills the word, infinite or not a number among them.
std::optional<double> read_number(std::string_view word);

/// What a surface file holds: polygons as it has them, of three corners and more; indices are within the points.
struct PolygonSoup {
  std::vector<Vec3> points;
  std::vector<std::int32_t> corners;  // of all polygons, one after the other
  std::vector<std::int32_t> counts;   // corners of each polygon
  void add_triangle(std::int32_t a, std::int32_t b, std::int32_t c) {
    corners.insert(corners.end(), {a, b, c});
    counts.push_back(3);
  }
};

/// More points or corners than this are refused: indices are of 32 bits.
constexpr std::int64_t kMaxPoints = 400'000'000;

/// A surface of more triangles is refused: its repair takes minutes, and the sound needs far fewer.
constexpr std::int64_t kMaxTriangles = 5'000'000;
inline constexpr const char* kTooManyTriangles =
    "more than 5,000,000 triangles; reduce it in a modeller: a few hundred thousand triangles sound the same";

/// The readers of one format each. They throw InputError naming the line or byte for whatever is not as the format has it, and take no
/// more memory than a small multiple of the file.
PolygonSoup parse_obj(std::string_view bytes, const std::string& name);
PolygonSoup parse_off(std::string_view bytes, const std::string& name);
PolygonSoup parse_ply(std::string_view bytes, const std::string& name);
PolygonSoup parse_stl(std::string_view bytes, const std::string& name);
/// glTF 2: JSON, and one binary file. Buffers of other files lie next to `name`.
PolygonSoup parse_gltf(std::string_view bytes, const std::string& name);
PolygonSoup parse_glb(std::string_view bytes, const std::string& name);

}  // namespace carillon::mesher
