#include "precompute/mesher/wall_source.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <unordered_map>

#include "precompute/mesh/parts.hpp"
#include "precompute/mesher/bends.hpp"
#include "precompute/mesher/extrude.hpp"

namespace carillon::mesher {
namespace {

constexpr double kMaxNoiseEdges = 2;              // in edges: shorter isolated folds are noise
constexpr std::size_t kMinNoisyTriangles = 2000;  // in triangles; sharp edges of larger surfaces may be noise

/// Removes isolated folds shorter than elements.
void drop_noise(const TriangleSurface& facets, std::vector<Edge>& folds, double sharp_angle_deg, double edge_m) {
  if (facets.triangles.size() > kMinNoisyTriangles) {
    // Folds of a scan are also sharp at element size.
    std::map<Vec3, std::int32_t> number;
    for (const Triangle& t : facets.triangles)
      for (const std::int32_t v : t) number[facets.points[v]] = v;
    std::set<Edge> kept;
    const double diagonal = calc_box(facets.points).diagonal();
    for (const Polyline& curve : find_sharp_curves(facets, sharp_angle_deg, std::min(2 * edge_m, 0.1 * diagonal), 2 * edge_m))
      for (std::size_t i = 1; i < curve.size(); ++i) kept.insert(make_edge(number.at(curve[i - 1]), number.at(curve[i])));
    std::erase_if(folds, [&](const Edge& e) { return !kept.contains(e); });
  }
  mesh::Parts parts(facets.points.size());
  for (const auto& [a, b] : folds) parts.join(a, b);
  std::map<std::int32_t, double> length;
  const auto& p = facets.points;
  for (const auto& [a, b] : folds) length[parts.find(a)] += norm(p[b] - p[a]);
  std::erase_if(folds, [&](const Edge& e) { return length[parts.find(e[0])] < kMaxNoiseEdges * edge_m; });
}

/// Throws WallError for an edge of three triangles, or a point shared by two parts.
void refuse_shared(const TriangleSurface& facets) {
  const FaceCounts count = count_faces(facets);
  for (const Triangle& t : facets.triangles)
    for (int c = 0; c < 3; ++c) {
      const int faces = count.at(make_edge(t[c], t[(c + 1) % 3]));
      if (faces > 2)
        throw WallError(fmt::format("cannot branch: {} triangles meet in one edge at {} (a T-junction)", faces,
                                    format_place(0.5 * (facets.points[t[c]] + facets.points[t[(c + 1) % 3]]))));
    }
  // Unconnected corners at one point: shared by two parts.
  const std::size_t count_of_corners = 3 * facets.triangles.size();
  mesh::Parts parts(count_of_corners);
  std::unordered_map<Edge, std::array<std::int32_t, 2>, EdgeHash> first;  // by edge: corners at its lower and higher point
  for (std::size_t f = 0; f < facets.triangles.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      const Triangle& t = facets.triangles[f];
      std::array<std::int32_t, 2> corners{static_cast<std::int32_t>(3 * f) + c, static_cast<std::int32_t>(3 * f) + (c + 1) % 3};
      if (t[c] > t[(c + 1) % 3]) std::swap(corners[0], corners[1]);
      const auto [found, fresh] = first.try_emplace(make_edge(t[c], t[(c + 1) % 3]), corners);
      if (fresh) continue;
      for (int end = 0; end < 2; ++end) parts.join(corners[end], found->second[end]);
    }
  std::vector<std::int32_t> part(facets.points.size(), -1);
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(count_of_corners); ++c) {
    const std::int32_t v = facets.triangles[c / 3][c % 3];
    if (part[v] >= 0 && part[v] != parts.find(c))
      throw WallError(
          fmt::format("cannot be connected at one point only: two parts of the surface touch at {}", format_place(facets.points[v])));
    part[v] = parts.find(c);
  }
}

}  // namespace

WallSource::WallSource(const Body& body, const SurfaceOptions& options, double edge_m)
    : round_(body.round ? &*body.round : nullptr),
      nearest_(body.repaired.surface),
      start_{round_ ? round_->get_facets() : body.repaired.surface, {}} {
  std::vector<Edge>& folds = start_.folds;
  if (round_) {
    folds = round_->list_folds();
  } else {
    constexpr double kMaxFlatTurnDeg = 1;
    for (const Bend& bend : find_bends(start_.surface, options.sharp_angle_deg).edges)
      if (bend.count == 2 && (options.facets ? bend.turn_deg > kMaxFlatTurnDeg : bend.sharp)) folds.push_back(bend.ends);
  }
  refuse_shared(start_.surface);
  const std::size_t all = folds.size();
  if (!options.facets) drop_noise(start_.surface, folds, options.sharp_angle_deg, edge_m);
  dropped_ = all - folds.size();
  find_lines(body.repaired.surface, folds);
}

void WallSource::find_lines(const TriangleSurface& surface, const std::vector<Edge>& folds) {
  std::vector<Edge> edges = round_ ? round_->list_lines() : folds;
  if (!round_) {
    const auto border = find_border(surface);
    edges.insert(edges.end(), border.begin(), border.end());
  }
  const auto& points = surface.points;
  for (const auto& [a, b] : edges) {
    const Vec3 way = points[b] - points[a];
    if (dot(way, way) > 0) lines_.push_back({points[a], way, points[a] + 0.5 * way, dot(way, way), 0.5 * norm(way)});
  }
}

Vec3 WallSource::find(const Vec3& p) const {
  const auto [at, triangle] = nearest_.find_on(p);
  return round_ ? round_->find(triangle, at) : at;
}

Vec3 WallSource::find_on_lines(const Vec3& p) const {
  double best = HUGE_VAL;
  Vec3 found = p;
  for (const Line& line : lines_) {
    const double off = norm(p - line.middle) - line.half;
    if (off > 0 && off * off >= best) continue;
    const double t = std::clamp(dot(p - line.a, line.way) / line.square, 0.0, 1.0);
    const Vec3 q = line.a + t * line.way;
    const double square = dot(p - q, p - q);
    if (square < best) best = square, found = q;
  }
  return round_ ? find(found) : found;  // from the chord of the cut to the curve
}

Vec3 WallSource::find_doubt(const Vec3& p) const {
  if (!round_) return {};
  const auto [at, triangle] = nearest_.find_on(p);
  return round_->find_doubt(triangle, at);
}

}  // namespace carillon::mesher
