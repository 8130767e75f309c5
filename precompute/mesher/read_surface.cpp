// Reads triangle surfaces through CGAL's polygon soup readers, behind checks of what those readers would trust:
// the counts in headers, indices, coordinates.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/IO/OBJ.h>
#include <CGAL/IO/OFF.h>
#include <CGAL/IO/PLY.h>
#include <CGAL/IO/STL.h>
#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <fstream>
#include <new>
#include <sstream>
#include <stdexcept>

#include "precompute/mesher/scan_text.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/config/error.hpp"

namespace carillon::mesher {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Soup = std::vector<std::vector<std::size_t>>;

std::string find_format(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending != ".obj" && ending != ".stl" && ending != ".ply" && ending != ".off")
    throw InputError(
        fmt::format("{}: a surface is read from .obj, .stl, .ply or .off files, not from '{}'; convert it first", path.string(), ending));
  return ending.substr(1);
}

/// Throws if the header promises more than the file can hold: the readers would allocate it before they look.
void check_counts(const std::filesystem::path& path, const std::string& format, std::uintmax_t bytes) {
  std::ifstream in(path, std::ios::binary);
  const auto refuse = [&](const std::string& what, double count) {
    throw InputError(
        fmt::format("{}: the header promises {:.0f} {}, but the file has only {} bytes; it is cut off or damaged, export it again",
                    path.string(), count, what, bytes));
  };
  std::string line;
  if (format == "ply") {
    std::getline(in, line);
    if (line.rfind("ply", 0) != 0) throw InputError(fmt::format("{}: line 1 is not 'ply'; this is no PLY file", path.string()));
    for (int n = 0; n < 1000 && std::getline(in, line) && line.rfind("end_header", 0) != 0; ++n) {
      std::istringstream words(line);
      std::string element, name;
      double count = 0;
      if (words >> element >> name >> count && element == "element" && !(count >= 0 && count <= static_cast<double>(bytes)))
        refuse(name, count);
    }
  } else if (format == "off") {
    // Words without comments: OFF (or one of its kinds), then the number of vertices and of faces.
    std::string word;
    double counts[2] = {0, 0};
    int found = 0;
    while (found < 2 && std::getline(in, line)) {
      line = line.substr(0, line.find('#'));
      std::istringstream words(line);
      while (found < 2 && words >> word) {
        char* end = nullptr;
        const double value = std::strtod(word.c_str(), &end);
        if (end != word.c_str() && *end == '\0')
          counts[found++] = value;
        else if (found > 0)
          break;
      }
    }
    if (!(counts[0] >= 0 && 2 * counts[0] <= static_cast<double>(bytes))) refuse("vertices", counts[0]);
    if (!(counts[1] >= 0 && 2 * counts[1] <= static_cast<double>(bytes))) refuse("faces", counts[1]);
  } else if (format == "stl") {
    char header[84] = {};
    in.read(header, sizeof header);
    const bool ascii = std::strncmp(header, "solid", 5) == 0;
    std::uint32_t count = 0;
    std::memcpy(&count, header + 80, 4);
    if (!ascii && (in.gcount() < 84 || 84 + 50 * static_cast<double>(count) > static_cast<double>(bytes))) refuse("triangles", count);
  }
}

/// Newell's normal of a polygon, not normalised.
Vec3 calc_normal(const std::vector<Vec3>& points, const std::vector<std::size_t>& polygon) {
  Vec3 sum{};
  for (std::size_t c = 0; c < polygon.size(); ++c) sum = sum + cross(points[polygon[c]], points[polygon[(c + 1) % polygon.size()]]);
  return sum;
}

/// Cuts a polygon into triangles, ear by ear: first the corner that is convex, holds no other corner, and is least acute.
void add_polygon(const std::vector<Vec3>& points, std::vector<std::size_t> polygon, std::vector<Triangle>& triangles) {
  constexpr std::size_t kMostCornersCutByEars = 1000;
  const Vec3 normal = calc_normal(points, polygon);
  const auto turn = [&](std::size_t a, std::size_t b, std::size_t c) {
    return dot(normal, cross(points[b] - points[a], points[c] - points[a]));
  };
  while (polygon.size() > 3 && polygon.size() <= kMostCornersCutByEars) {
    const std::size_t n = polygon.size();
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
    if (best == n) break;  // degenerate or crossing itself: the rest becomes a fan
    triangles.push_back({static_cast<std::int32_t>(polygon[(best + n - 1) % n]), static_cast<std::int32_t>(polygon[best]),
                         static_cast<std::int32_t>(polygon[(best + 1) % n])});
    polygon.erase(polygon.begin() + static_cast<std::ptrdiff_t>(best));
  }
  for (std::size_t c = 1; c + 1 < polygon.size(); ++c)
    triangles.push_back(
        {static_cast<std::int32_t>(polygon[0]), static_cast<std::int32_t>(polygon[c]), static_cast<std::int32_t>(polygon[c + 1])});
}

}  // namespace

TriangleSurface read_surface(const std::filesystem::path& path) {
  const std::string format = find_format(path), name = path.string();
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw InputError(fmt::format("{}: there is no such file", name));
  if (!std::filesystem::is_regular_file(path, error))
    throw InputError(fmt::format("{}: this is a folder or a device, not a file; give the file of a surface", name));
  const auto bytes = std::filesystem::file_size(path, error);
  if (error) throw InputError(fmt::format("{}: cannot be read: {}", name, error.message()));
  if (bytes == 0) throw InputError(fmt::format("{}: the file is empty", name));
  check_counts(path, format, bytes);
  scan_text(path, format);

  std::vector<Kernel::Point_3> soup_points;
  Soup polygons;
  bool whole = false;
  try {
    whole = format == "obj"   ? CGAL::IO::read_OBJ(name, soup_points, polygons)
            : format == "off" ? CGAL::IO::read_OFF(name, soup_points, polygons)
            : format == "ply" ? CGAL::IO::read_PLY(name, soup_points, polygons)
                              : CGAL::IO::read_STL(name, soup_points, polygons);
  } catch (const std::bad_alloc&) {
    throw InputError(fmt::format("{}: a count in it is larger than the memory; it is damaged, export it again", name));
  } catch (const std::length_error&) {
    throw InputError(fmt::format("{}: a count in it is negative or far too large; it is damaged, export it again", name));
  } catch (const std::exception& failure) {
    throw InputError(fmt::format("{}: cannot be read as {}: {}; export it again", name, format, failure.what()));
  }
  if (soup_points.empty() || polygons.empty())
    throw InputError(fmt::format("{}: no triangles in it ({} points, {} faces were read); a closed triangle surface is needed", name,
                                 soup_points.size(), polygons.size()));
  if (!whole)
    throw InputError(fmt::format("{}: cannot be read as {} beyond {} points and {} faces; it is cut off or damaged, export it again", name,
                                 format, soup_points.size(), polygons.size()));
  if (soup_points.size() > 200'000'000 || polygons.size() > 200'000'000)
    throw InputError(
        fmt::format("{}: {} points and {} faces are too many; reduce the surface first", name, soup_points.size(), polygons.size()));

  TriangleSurface surface;
  surface.points.reserve(soup_points.size());
  for (const auto& p : soup_points) {
    surface.points.push_back({p.x(), p.y(), p.z()});
    for (const double x : surface.points.back())
      if (!(std::abs(x) <= 1e30))
        throw InputError(fmt::format("{}: vertex {} has the coordinate {}; every coordinate must be a finite number below 1e30", name,
                                     surface.points.size(), x));
  }
  for (std::size_t f = 0; f < polygons.size(); ++f) {
    for (const std::size_t v : polygons[f])
      if (v >= surface.points.size())
        throw InputError(fmt::format("{}: face {} names vertex {} of {}; the file is damaged, export it again", name, f + 1,
                                     static_cast<std::int64_t>(v) + 1, surface.points.size()));
    if (polygons[f].size() >= 3) add_polygon(surface.points, polygons[f], surface.triangles);
  }
  if (surface.triangles.empty()) throw InputError(fmt::format("{}: no triangles in it; a closed triangle surface is needed", name));
  return surface;
}

}  // namespace carillon::mesher
