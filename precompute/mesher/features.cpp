// Method: edges whose faces turn by more than an angle are joined to curves, split where curves meet or bend. A curve counts as a
//   sharp edge of the body if its two sides, each averaged over a patch the size of an element, still turn by that much, which
//   on a noisy surface they do not, and if it is longer than an element.
// Source: our own; the angle threshold is common practice.
// Deviations: none.
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {
namespace {

using Edge = std::array<std::int32_t, 2>;

// A curve is a crease if over most of its length the mean normals of its two sides turn by most of the sharp angle. Set by trial
// on the Stanford bunny (no curve but the creases of ears and paws) and on boxes, cylinders and screws (all of theirs).
constexpr double kMeanTurnPart = 0.85;
constexpr double kCreasePart = 0.8;
// Curves are split where they bend by more than this, because the mesher rounds all bends but the ends of curves.
constexpr double kBendDeg = 30;

struct EdgeData {
  std::array<std::int32_t, 2> faces{-1, -1};
  int face_count = 0;
  double turn_deg = 0;
};
using EdgeMap = std::map<Edge, EdgeData>;  // ordered: the curves come in a fixed order

Edge make_edge(std::int32_t a, std::int32_t b) { return a < b ? Edge{a, b} : Edge{b, a}; }

Vec3 calc_unit(const Vec3& a) {
  const double length = norm(a);
  return length > 0 ? (1 / length) * a : Vec3{};
}

EdgeMap find_edges(const TriangleSurface& surface, const std::vector<Vec3>& normals) {
  EdgeMap edges;
  for (std::size_t f = 0; f < surface.triangles.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      EdgeData& edge = edges[make_edge(surface.triangles[f][c], surface.triangles[f][(c + 1) % 3])];
      if (edge.face_count < 2) edge.faces[edge.face_count] = static_cast<std::int32_t>(f);
      ++edge.face_count;
    }
  for (auto& [ends, edge] : edges) {
    if (edge.face_count != 2) continue;
    const Vec3 &a = normals[edge.faces[0]], &b = normals[edge.faces[1]];
    edge.turn_deg = std::atan2(norm(cross(a, b)), dot(a, b)) * 180 / std::numbers::pi;
  }
  return edges;
}

/// Vertices of the curves, in order; a closed one repeats its first.
std::vector<std::vector<std::int32_t>> join_curves(const TriangleSurface& surface, const std::vector<Edge>& sharp) {
  std::map<std::int32_t, std::vector<std::int32_t>> neighbours;
  for (const Edge& e : sharp) {
    neighbours[e[0]].push_back(e[1]);
    neighbours[e[1]].push_back(e[0]);
  }
  const auto is_end = [&](std::int32_t v) {
    const auto& around = neighbours[v];
    if (around.size() != 2) return true;
    const Vec3& p = surface.points[v];
    const Vec3 a = calc_unit(p - surface.points[around[0]]), b = calc_unit(surface.points[around[1]] - p);
    return dot(a, b) < std::cos(kBendDeg * std::numbers::pi / 180);
  };
  std::map<Edge, bool> used;
  std::vector<std::vector<std::int32_t>> curves;
  const auto walk = [&](std::int32_t start, std::int32_t second) {
    std::vector<std::int32_t> curve{start, second};
    used[make_edge(start, second)] = true;
    while (curve.back() != start && !is_end(curve.back())) {
      const auto& around = neighbours[curve.back()];
      const std::int32_t next = around[0] == curve[curve.size() - 2] ? around[1] : around[0];
      if (used[make_edge(curve.back(), next)]) break;
      used[make_edge(curve.back(), next)] = true;
      curve.push_back(next);
    }
    curves.push_back(curve);
  };
  for (const auto& [v, around] : std::map(neighbours))
    if (is_end(v))
      for (const std::int32_t w : around)
        if (!used[make_edge(v, w)]) walk(v, w);
  for (const Edge& e : sharp)  // what is left are closed curves without an end
    if (!used[e]) walk(e[0], e[1]);
  return curves;
}

/// The mean normal, by area, of the faces reached from `seed` within `radius` of p without crossing a sharp edge.
Vec3 calc_mean_normal(const TriangleSurface& surface, const EdgeMap& edges, std::int32_t seed, const Vec3& p, double radius,
                      double sharp_angle_deg) {
  constexpr std::size_t kMaxFaces = 500;
  std::vector<std::int32_t> reached{seed};
  std::set<std::int32_t> seen{seed};
  Vec3 sum{};
  for (std::size_t next = 0; next < reached.size() && next < kMaxFaces; ++next) {
    const Triangle& t = surface.triangles[reached[next]];
    sum = sum + cross(surface.points[t[1]] - surface.points[t[0]], surface.points[t[2]] - surface.points[t[0]]);
    for (int c = 0; c < 3; ++c) {
      const EdgeData& edge = edges.at(make_edge(t[c], t[(c + 1) % 3]));
      const Vec3 middle = 0.5 * (surface.points[t[c]] + surface.points[t[(c + 1) % 3]]);
      if (edge.face_count != 2 || edge.turn_deg > sharp_angle_deg || norm(middle - p) > radius) continue;
      for (const std::int32_t f : edge.faces)
        if (seen.insert(f).second) reached.push_back(f);
    }
  }
  return calc_unit(sum);
}

/// True if the two sides of the curve, each averaged over `radius`, still turn by most of the angle along most of its length.
bool is_crease(const TriangleSurface& surface, const EdgeMap& edges, const std::vector<std::int32_t>& curve, double sharp_angle_deg,
               double radius) {
  double length = 0, crease = 0;
  for (std::size_t i = 0; i + 1 < curve.size(); ++i) {
    const Vec3 &a = surface.points[curve[i]], &b = surface.points[curve[i + 1]];
    const EdgeData& edge = edges.at(make_edge(curve[i], curve[i + 1]));
    const Vec3 left = calc_mean_normal(surface, edges, edge.faces[0], 0.5 * (a + b), radius, sharp_angle_deg);
    const Vec3 right = calc_mean_normal(surface, edges, edge.faces[1], 0.5 * (a + b), radius, sharp_angle_deg);
    length += norm(b - a);
    if (dot(left, right) < std::cos(kMeanTurnPart * sharp_angle_deg * std::numbers::pi / 180)) crease += norm(b - a);
  }
  return crease > kCreasePart * length;
}

}  // namespace

std::vector<Polyline> find_sharp_curves(const TriangleSurface& surface, double sharp_angle_deg, double shortest_m, double radius) {
  std::vector<Vec3> normals;
  normals.reserve(surface.triangles.size());
  for (const Triangle& t : surface.triangles)
    normals.push_back(calc_unit(cross(surface.points[t[1]] - surface.points[t[0]], surface.points[t[2]] - surface.points[t[0]])));
  const EdgeMap edges = find_edges(surface, normals);
  std::vector<Edge> sharp;
  for (const auto& [ends, edge] : edges)
    if (edge.face_count == 2 && edge.turn_deg > sharp_angle_deg) sharp.push_back(ends);

  const auto all = join_curves(surface, sharp);
  std::vector<char> kept(all.size(), 0);
  std::set<std::int32_t> ends;
  // Short curves are noise, but for those between the ends of long ones: the edges of a plate along its thickness.
  for (const bool is_long : {true, false})
    for (std::size_t n = 0; n < all.size(); ++n) {
      const auto& curve = all[n];
      double length = 0;
      for (std::size_t i = 0; i + 1 < curve.size(); ++i) length += norm(surface.points[curve[i + 1]] - surface.points[curve[i]]);
      if (!(length > 0) || (length >= shortest_m) != is_long) continue;
      if (!is_long && !(ends.contains(curve.front()) && ends.contains(curve.back()))) continue;
      kept[n] = is_crease(surface, edges, curve, sharp_angle_deg, radius);
      if (kept[n] && is_long) ends.insert({curve.front(), curve.back()});
    }
  std::vector<Polyline> out;
  for (std::size_t n = 0; n < all.size(); ++n) {
    if (!kept[n]) continue;
    out.emplace_back();
    for (const std::int32_t v : all[n]) out.back().push_back(surface.points[v]);
  }
  return out;
}

}  // namespace carillon::mesher
