// Measures of a triangle surface.
// Source: winding number at a point: Van Oosterom and Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30, 1983.
#include "precompute/mesher/triangle_surface.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "precompute/mesh/parts.hpp"

namespace carillon::mesher {

FaceCounts count_faces(const TriangleSurface& surface) {
  FaceCounts count;
  for (const Triangle& t : surface.triangles)
    for (int c = 0; c < 3; ++c) ++count[make_edge(t[c], t[(c + 1) % 3])];
  return count;
}

Box calc_box(const std::vector<Vec3>& points) {
  constexpr double kHuge = std::numeric_limits<double>::max();
  Box box{{kHuge, kHuge, kHuge}, {-kHuge, -kHuge, -kHuge}};
  for (const Vec3& p : points)
    for (int c = 0; c < 3; ++c) {
      box.low[c] = std::min(box.low[c], p[c]);
      box.high[c] = std::max(box.high[c], p[c]);
    }
  return box;
}

Box calc_used_box(const TriangleSurface& surface) {
  std::vector<Vec3> used;
  used.reserve(3 * surface.triangles.size());
  for (const Triangle& t : surface.triangles)
    for (const std::int32_t v : t) used.push_back(surface.points[v]);
  return calc_box(used);
}

double calc_volume(const TriangleSurface& surface) {
  // Relative to a surface point: avoids cancellation far from the origin.
  const Vec3 origin = surface.points.empty() ? Vec3{} : surface.points.front();
  double sum = 0;
  for (const Triangle& t : surface.triangles)
    sum += dot(surface.points[t[0]] - origin, cross(surface.points[t[1]] - origin, surface.points[t[2]] - origin));
  return sum / 6;
}

double calc_area(const TriangleSurface& surface) {
  double sum = 0;
  for (const Triangle& t : surface.triangles)
    sum += norm(cross(surface.points[t[1]] - surface.points[t[0]], surface.points[t[2]] - surface.points[t[0]]));
  return sum / 2;
}

std::string format_place(const Vec3& p) { return fmt::format("({:.4g}, {:.4g}, {:.4g}) m", p[0], p[1], p[2]); }

double calc_winding(const TriangleSurface& surface, const Vec3& p) {
  double sum = 0;
  for (const Triangle& t : surface.triangles) {
    const Vec3 a = surface.points[t[0]] - p, b = surface.points[t[1]] - p, c = surface.points[t[2]] - p;
    const double la = norm(a), lb = norm(b), lc = norm(c);
    sum += 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  }
  return sum / (4 * std::numbers::pi);
}

std::vector<TriangleSurface> split_parts(const TriangleSurface& surface, std::vector<std::int32_t>* part_of) {
  mesh::Parts joined(surface.points.size());
  for (const Triangle& t : surface.triangles)
    for (int c = 1; c < 3; ++c) joined.join(t[0], t[c]);
  std::vector<TriangleSurface> parts;
  std::vector<std::int32_t> part(surface.points.size(), -1), number(surface.points.size(), -1);
  if (part_of) part_of->clear();
  for (const Triangle& t : surface.triangles) {
    std::int32_t& own = part[joined.find(t[0])];
    if (own < 0) {
      own = static_cast<std::int32_t>(parts.size());
      parts.emplace_back();
    }
    TriangleSurface& to = parts[own];
    Triangle copy{};
    for (int c = 0; c < 3; ++c) {
      std::int32_t& n = number[t[c]];
      if (n < 0) {
        n = static_cast<std::int32_t>(to.points.size());
        to.points.push_back(surface.points[t[c]]);
      }
      copy[c] = n;
    }
    to.triangles.push_back(copy);
    if (part_of) part_of->push_back(own);
  }
  return parts;
}

bool is_nested(const TriangleSurface& surface) {
  const auto parts = split_parts(surface);
  std::vector<Box> boxes;
  for (const auto& part : parts) boxes.push_back(calc_box(part.points));
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const Vec3& at = parts[p].points.front();
    double around = 0;
    for (std::size_t q = 0; q < parts.size(); ++q) {
      bool in_box = q != p;
      for (int c = 0; c < 3; ++c) in_box = in_box && at[c] >= boxes[q].low[c] && at[c] <= boxes[q].high[c];
      if (in_box) around += calc_winding(parts[q], at);
    }
    const bool outward = calc_volume(parts[p]) > 0;
    if (std::abs(around - (outward ? 0 : 1)) > 0.01) return false;
  }
  return true;
}

}  // namespace carillon::mesher
