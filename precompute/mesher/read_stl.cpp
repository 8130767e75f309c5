// Method: a file is binary if its size fits its count, if it does not begin with "solid", or if its first bytes contain a zero. Triangles
//   in file order; equal points are joined later. Normals and attribute bytes are ignored.
// Source: 3D Systems, "StereoLithography Interface Specification", 1989.
#include <bit>
#include <cmath>

#include "precompute/mesh/cursor.hpp"
#include "precompute/mesher/surface_text.hpp"

namespace carillon::mesher {
namespace {

using mesh::quote_excerpt;

constexpr std::size_t kHeader = 84, kRecord = 50;

std::uint32_t read_count(std::string_view bytes) {
  std::uint32_t count = 0;
  for (std::size_t n = 0; n < 4; ++n) count |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[80 + n])) << (8 * n);
  return count;
}

std::string lower(std::string_view word) {
  std::string out(word);
  for (char& c : out)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return out;
}

bool is_binary(std::string_view bytes) {
  if (bytes.size() >= kHeader && kHeader + kRecord * static_cast<std::uint64_t>(read_count(bytes)) == bytes.size()) return true;
  const auto first = bytes.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos || lower(bytes.substr(first, 5)) != "solid") return true;
  return bytes.substr(0, 1024).find('\0') != std::string_view::npos;
}

PolygonSoup parse_binary(std::string_view bytes, const std::string& name) {
  if (bytes.size() < kHeader)
    throw InputError(
        fmt::format("{}: neither a text STL file, which begins with 'solid', nor a binary one, whose header alone has {} bytes; "
                    "export it again",
                    name, kHeader));
  const std::uint32_t count = read_count(bytes);
  if (kHeader + kRecord * static_cast<std::uint64_t>(count) > bytes.size())
    throw InputError(fmt::format(
        "{}: byte 80: the header promises {} triangles, but the file has only {} bytes; it is cut off or damaged, export it again", name,
        count, bytes.size()));
  if (count > kMaxPoints / 3) throw InputError(fmt::format("{}: {} triangles are too many; reduce the surface first", name, count));
  PolygonSoup soup;
  soup.points.reserve(3 * count);
  soup.counts.reserve(count);
  soup.corners.reserve(3 * count);
  for (std::uint32_t t = 0; t < count; ++t) {
    const std::size_t corners = kHeader + kRecord * t + 12;
    for (std::size_t n = 0; n < 9; ++n) {
      std::uint32_t bits = 0;
      for (std::size_t b = 0; b < 4; ++b)
        bits |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[corners + 4 * n + b])) << (8 * b);
      const double x = std::bit_cast<float>(bits);
      if (!(std::abs(x) <= kLargestCoordinate))
        throw InputError(
            fmt::format("{}: byte {}: the coordinate {} of triangle {} must be a finite number below 1e30; export the surface again", name,
                        corners + 4 * n, x, t + 1));
      if (n % 3 == 0) soup.points.emplace_back();
      soup.points.back()[n % 3] = x;
    }
    const auto last = static_cast<std::int32_t>(soup.points.size());
    soup.add_triangle(last - 3, last - 2, last - 1);
  }
  return soup;
}

PolygonSoup parse_text(std::string_view bytes, const std::string& name) {
  SurfaceText text(bytes, name, '\0');
  PolygonSoup soup;
  std::vector<std::string_view> words;
  std::size_t corners = 0;
  bool in_facet = false, in_solid = false;
  while (text.next_filled(words)) {
    const std::string word = lower(words[0]);
    if (word == "vertex") {
      if (words.size() != 4) text.refuse("a vertex has {} coordinates in place of three; export the surface again", words.size() - 1);
      if (!in_facet || corners == 3) text.refuse("a vertex that belongs to no triangle; export the surface again");
      if (static_cast<std::int64_t>(soup.points.size()) >= kMaxPoints)
        text.refuse("more than {} corners are too many; reduce the surface first", kMaxPoints);
      soup.points.push_back({text.read_coordinate(words[1]), text.read_coordinate(words[2]), text.read_coordinate(words[3])});
      ++corners;
    } else if (word == "facet") {
      if (in_facet) text.refuse("a facet within a facet: an endfacet is missing; export the surface again");
      in_facet = true;
      corners = 0;
    } else if (word == "endfacet") {
      if (!in_facet || corners != 3) text.refuse("a facet ends with {} corners in place of three; export the surface again", corners);
      const auto last = static_cast<std::int32_t>(soup.points.size());
      soup.add_triangle(last - 3, last - 2, last - 1);
      in_facet = false;
    } else if (word == "solid" || word == "endsolid") {
      if (in_facet) text.refuse("the solid begins or ends within a facet; export the surface again");
      in_solid = word == "solid";
    } else if (word != "outer" && word != "endloop") {
      text.refuse("found {} where a word of an STL file (facet, outer loop, vertex ...) should be; export the surface again",
                  quote_excerpt(words[0]));
    }
  }
  if (in_facet || in_solid) text.refuse("the file ends before its endsolid; it is cut off, export it again");
  return soup;
}

}  // namespace

PolygonSoup parse_stl(std::string_view bytes, const std::string& name) {
  return is_binary(bytes) ? parse_binary(bytes, name) : parse_text(bytes, name);
}

}  // namespace carillon::mesher
