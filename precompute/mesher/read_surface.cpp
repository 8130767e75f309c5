// Reads a surface: chooses the reader by file extension and triangulates polygons. Files are untrusted, hence own readers
// (surface_text.cpp, read_ply.cpp, read_stl.cpp, read_gltf.cpp).
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "precompute/mesher/surface_text.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/foreign.hpp"

namespace carillon::mesher {
namespace {

/// Upper limit of the file size: kMaxTriangles as text with normals, colours and textures.
constexpr std::uint64_t kMaxBytes = 4ULL << 30;

/// "obj", "stl", "ply", "off", "gltf" or "glb".
std::string find_format(const std::filesystem::path& path) {
  const std::string ending = base::find_extension(path);
  constexpr std::array<std::string_view, 6> kEndings{".obj", ".stl", ".ply", ".off", ".gltf", ".glb"};
  if (std::find(kEndings.begin(), kEndings.end(), ending) == kEndings.end())
    throw InputError(fmt::format("{}: a surface is read from .obj, .stl, .ply, .off, .gltf or .glb files, not from '{}'; convert it first",
                                 path.string(), ending));
  return ending.substr(1);
}

using Polygon = std::vector<std::size_t>;

/// Newell normal of a polygon, not normalised.
Vec3 calc_normal(const std::vector<Vec3>& points, const Polygon& polygon) {
  Vec3 sum{};
  for (std::size_t c = 0; c < polygon.size(); ++c) sum = sum + cross(points[polygon[c]], points[polygon[(c + 1) % polygon.size()]]);
  return sum;
}

/// Triangulates a polygon by ear clipping: first the convex corner that contains no other corner and is least acute. `work` counts corner
/// visits; beyond a limit polygons become fans, which bounds the time.
void add_polygon(const std::vector<Vec3>& points, Polygon polygon, std::vector<Triangle>& triangles, double& work) {
  constexpr std::size_t kMaxCornersCutByEars = 1000;
  constexpr double kMaxWork = 3e9;
  const Vec3 normal = calc_normal(points, polygon);
  const auto turn = [&](std::size_t a, std::size_t b, std::size_t c) {
    return dot(normal, cross(points[b] - points[a], points[c] - points[a]));
  };
  while (polygon.size() > 3 && polygon.size() <= kMaxCornersCutByEars && work < kMaxWork) {
    const std::size_t n = polygon.size();
    work += static_cast<double>(n) * static_cast<double>(n);
    std::size_t best = n;
    double best_quality = -2;
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t a = polygon[(i + n - 1) % n], b = polygon[i], c = polygon[(i + 1) % n];
      if (!(turn(a, b, c) > 0)) continue;
      bool ear = true;
      for (std::size_t j = 0; j < n && ear; ++j) {
        const std::size_t q = polygon[j];
        if (q == a || q == b || q == c) continue;
        ear = !(turn(a, b, q) >= 0 && turn(b, c, q) >= 0 && turn(c, a, q) >= 0);
      }
      const double ab = norm(points[b] - points[a]), bc = norm(points[c] - points[b]);
      const double quality = ear && ab > 0 && bc > 0 ? dot(points[b] - points[a], points[c] - points[b]) / (ab * bc) : -2;
      if (ear && -std::abs(quality) > best_quality) best = i, best_quality = -std::abs(quality);
    }
    if (best == n) break;  // degenerate or self-crossing: the rest becomes a fan
    triangles.push_back({static_cast<std::int32_t>(polygon[(best + n - 1) % n]), static_cast<std::int32_t>(polygon[best]),
                         static_cast<std::int32_t>(polygon[(best + 1) % n])});
    polygon.erase(polygon.begin() + static_cast<std::ptrdiff_t>(best));
  }
  for (std::size_t c = 1; c + 1 < polygon.size(); ++c)
    triangles.push_back(
        {static_cast<std::int32_t>(polygon[0]), static_cast<std::int32_t>(polygon[c]), static_cast<std::int32_t>(polygon[c + 1])});
}

}  // namespace

TriangleSurface parse_surface(std::string_view bytes, const std::string& name, const std::string& format) {
  if (format != "stl" || bytes.starts_with("\xFF\xFE")) base::refuse_utf16(bytes, name);  // a binary STL file may begin with any bytes
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);                          // UTF-8 byte-order mark
  PolygonSoup soup = format == "obj"    ? parse_obj(bytes, name)
                     : format == "off"  ? parse_off(bytes, name)
                     : format == "ply"  ? parse_ply(bytes, name)
                     : format == "gltf" ? parse_gltf(bytes, name)
                     : format == "glb"  ? parse_glb(bytes, name)
                                        : parse_stl(bytes, name);
  TriangleSurface surface;
  surface.points = std::move(soup.points);
  std::size_t first = 0;
  Polygon polygon;
  double work = 0;
  for (const std::int32_t count : soup.counts) {
    const std::size_t last = first + static_cast<std::size_t>(count);
    if (count == 3) {
      surface.triangles.push_back({soup.corners[first], soup.corners[first + 1], soup.corners[first + 2]});
    } else {
      polygon.assign(soup.corners.begin() + static_cast<std::ptrdiff_t>(first), soup.corners.begin() + static_cast<std::ptrdiff_t>(last));
      add_polygon(surface.points, polygon, surface.triangles, work);
    }
    first = last;
  }
  if (static_cast<std::int64_t>(surface.triangles.size()) > kMaxTriangles)
    throw InputError(fmt::format("{}: {} (it has {})", name, kTooManyTriangles, surface.triangles.size()));
  if (surface.triangles.empty())
    throw InputError(
        fmt::format("{}: no triangles in it ({} points were read); a closed triangle surface is needed", name, surface.points.size()));
  return surface;
}

TriangleSurface read_surface(const std::filesystem::path& path) {
  const std::string format = find_format(path), name = path.string();
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw InputError(fmt::format("{}: there is no such file{}", name, base::hint_backslash(path)));
  if (!std::filesystem::is_regular_file(path, error))
    throw InputError(fmt::format("{}: this is a folder or a device, not a file; give the file of a surface", name));
  const std::string bytes = base::read_file(path, "surface", kMaxBytes);
  if (bytes.empty()) throw InputError(fmt::format("{}: the file is empty; export it again", name));
  return parse_surface(bytes, name, format);
}

}  // namespace carillon::mesher
