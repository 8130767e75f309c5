// Method: edges whose faces turn by more than an angle are joined to curves, split where curves meet or bend. Short curves with a loose end
//   are noise and are removed first, repeatedly, since spurs split the curve they branch from. A curve is a sharp edge of the body if its
//   two sides, each averaged over an element-sized patch, still turn by that much; on noisy surfaces they do not. If many edges are sharp
//   and many start, end or meet irregularly, the surface is a scan without sharp edges. Smoothing: bounded displacement, equal weights.
// Source: Taubin, "A signal processing approach to fair surface design", SIGGRAPH 1995 (smoothing).
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <tuple>
#include <utility>

#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesher {
namespace {

// A curve is a crease if over most of its length the mean normals of its sides turn by most of the sharp angle. Tuned on the Stanford bunny
// (only the creases of ears and paws) and on boxes, cylinders and screws (all edges).
constexpr double kMeanTurnPart = 0.85;
constexpr double kCreasePart = 0.8;
// Curves are split at larger bends, because the mesher rounds all bends except at curve ends.
constexpr double kBendDeg = 30;

// A surface is a scan if more than this part of its edges is sharp, and if more than this part of the points on them has one sharp edge, or
// four or more; except surfaces of few triangles. Generated scans have 10 to 60 % and 35 to 75 %, the Stanford bunny 0.6 % sharp edges;
// boxes, screws and letters have points of two and three.
constexpr double kRoughPart = 0.05, kOddPart = 0.25;
constexpr std::size_t kMinScanTriangles = 500;
// One smoothing sweep: a shrinking and an expanding step; number of sweeps.
constexpr double kShrink = 0.5, kSwell = -0.53;
constexpr int kSweeps = 6;
// Faces whose normals cancel to less than this part of their area wrap around: the wall of a bore.
constexpr double kCancelled = 0.3;

struct EdgeData {
  Edge ends{};
  std::array<std::int32_t, 2> faces{-1, -1};
  int face_count = 0;
  double turn_deg = 0;
  bool is_wall = false;  // sharp and no noise: ends the averaging patches of curves
};

/// Edges of a surface, in a fixed order.
class Edges {
 public:
  explicit Edges(const TriangleSurface& surface) : of_face_(surface.triangles.size()) {
    std::vector<Vec3> normals;
    normals.reserve(surface.triangles.size());
    for (const Triangle& t : surface.triangles)
      normals.push_back(calc_unit(cross(surface.points[t[1]] - surface.points[t[0]], surface.points[t[2]] - surface.points[t[0]])));
    struct Side {
      Edge ends;
      std::int32_t face;
      int corner;
    };
    std::vector<Side> sides;
    sides.reserve(3 * surface.triangles.size());
    for (std::size_t f = 0; f < surface.triangles.size(); ++f)
      for (int c = 0; c < 3; ++c)
        sides.push_back({make_edge(surface.triangles[f][c], surface.triangles[f][(c + 1) % 3]), static_cast<std::int32_t>(f), c});
    std::sort(sides.begin(), sides.end(),
              [](const Side& a, const Side& b) { return std::tie(a.ends, a.face, a.corner) < std::tie(b.ends, b.face, b.corner); });
    for (const Side& side : sides) {
      if (edges_.empty() || edges_.back().ends != side.ends) edges_.push_back({.ends = side.ends});
      EdgeData& edge = edges_.back();
      if (edge.face_count < 2) edge.faces[edge.face_count] = side.face;
      ++edge.face_count;
      of_face_[side.face][side.corner] = static_cast<std::int32_t>(edges_.size()) - 1;
    }
    for (EdgeData& edge : edges_) {
      if (edge.face_count != 2) continue;
      const Vec3 &a = normals[edge.faces[0]], &b = normals[edge.faces[1]];
      edge.turn_deg = std::atan2(norm(cross(a, b)), dot(a, b)) * 180 / std::numbers::pi;
    }
  }

  const std::vector<EdgeData>& get_all() const { return edges_; }
  std::vector<Edge> find_sharp(double sharp_angle_deg) const {
    std::vector<Edge> sharp;
    for (const EdgeData& edge : edges_)
      if (edge.face_count == 2 && edge.turn_deg > sharp_angle_deg) sharp.push_back(edge.ends);
    return sharp;
  }
  /// Edge from corner c of a face to the next.
  const EdgeData& at(std::int32_t face, int corner) const { return edges_[of_face_[face][corner]]; }
  EdgeData& at(const Edge& ends) {
    return *std::lower_bound(edges_.begin(), edges_.end(), ends, [](const EdgeData& edge, const Edge& key) { return edge.ends < key; });
  }

 private:
  std::vector<EdgeData> edges_;
  std::vector<std::array<std::int32_t, 3>> of_face_;
};

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
  for (const Edge& e : sharp)  // the rest are closed curves
    if (!used[e]) walk(e[0], e[1]);
  return curves;
}

double calc_length(const TriangleSurface& surface, const std::vector<std::int32_t>& curve) {
  double length = 0;
  for (std::size_t i = 0; i + 1 < curve.size(); ++i) length += norm(surface.points[curve[i + 1]] - surface.points[curve[i]]);
  return length;
}

/// Curves of the sharp edges, without loose-ended ones shorter than `shortest_m`, after splitting.
std::vector<std::vector<std::int32_t>> find_tied_curves(const TriangleSurface& surface, std::vector<Edge> sharp, double shortest_m) {
  while (true) {
    const auto curves = join_curves(surface, sharp);
    std::map<std::int32_t, int> valence;
    for (const Edge& e : sharp) ++valence[e[0]], ++valence[e[1]];
    // A bend splits a curve; neither new end is loose.
    const auto is_loose = [&](const std::vector<std::int32_t>& curve) {
      return (valence[curve.front()] == 1 || valence[curve.back()] == 1) && calc_length(surface, curve) < shortest_m;
    };
    std::vector<Edge> tied;
    for (const auto& curve : curves)
      if (!is_loose(curve))
        for (std::size_t i = 0; i + 1 < curve.size(); ++i) tied.push_back(make_edge(curve[i], curve[i + 1]));
    if (tied.size() == sharp.size()) return curves;
    std::sort(tied.begin(), tied.end());
    sharp = std::move(tied);
  }
}

/// Sum of area normals of the faces reached from `seed` within `radius` of p without crossing a wall; and their area.
std::pair<Vec3, double> sum_normals(const TriangleSurface& surface, const Edges& edges, std::int32_t seed, const Vec3& p, double radius) {
  constexpr std::size_t kMaxFaces = 500;
  std::vector<std::int32_t> reached{seed};
  std::set<std::int32_t> seen{seed};
  Vec3 sum{};
  double area = 0;
  for (std::size_t next = 0; next < reached.size() && next < kMaxFaces; ++next) {
    const Triangle& t = surface.triangles[reached[next]];
    const Vec3 normal = cross(surface.points[t[1]] - surface.points[t[0]], surface.points[t[2]] - surface.points[t[0]]);
    sum = sum + normal;
    area += norm(normal);
    for (int c = 0; c < 3; ++c) {
      const EdgeData& edge = edges.at(reached[next], c);
      const Vec3 middle = 0.5 * (surface.points[t[c]] + surface.points[t[(c + 1) % 3]]);
      if (edge.face_count != 2 || edge.is_wall || norm(middle - p) > radius) continue;
      for (const std::int32_t f : edge.faces)
        if (seen.insert(f).second) reached.push_back(f);
    }
  }
  return {sum, area};
}

/// True if the sides of the curve, averaged over `radius`, turn by most of the angle along most of its length.
bool is_crease(const TriangleSurface& surface, Edges& edges, const std::vector<std::int32_t>& curve, double sharp_angle_deg,
               double radius) {
  double length = 0, crease = 0;
  for (std::size_t i = 0; i + 1 < curve.size(); ++i) {
    const Vec3 &a = surface.points[curve[i]], &b = surface.points[curve[i + 1]];
    const EdgeData& edge = edges.at(make_edge(curve[i], curve[i + 1]));
    const auto [left, left_area] = sum_normals(surface, edges, edge.faces[0], 0.5 * (a + b), radius);
    const auto [right, right_area] = sum_normals(surface, edges, edge.faces[1], 0.5 * (a + b), radius);
    const bool turns = dot(calc_unit(left), calc_unit(right)) < std::cos(kMeanTurnPart * sharp_angle_deg * std::numbers::pi / 180);
    length += norm(b - a);
    if (turns || norm(left) < kCancelled * left_area || norm(right) < kCancelled * right_area) crease += norm(b - a);
  }
  return crease > kCreasePart * length;
}

}  // namespace

bool is_scan(const TriangleSurface& surface, double sharp_angle_deg) {
  if (surface.triangles.size() < kMinScanTriangles) return false;
  const Edges edges(surface);
  const std::vector<Edge> sharp = edges.find_sharp(sharp_angle_deg);
  if (static_cast<double>(sharp.size()) < kRoughPart * static_cast<double>(edges.get_all().size())) return false;
  std::vector<std::int32_t> valence(surface.points.size(), 0);
  for (const Edge& e : sharp) ++valence[e[0]], ++valence[e[1]];
  const auto any = std::count_if(valence.begin(), valence.end(), [](std::int32_t n) { return n > 0; });
  const auto odd = std::count_if(valence.begin(), valence.end(), [](std::int32_t n) { return n == 1 || n > 3; });
  return static_cast<double>(odd) > kOddPart * static_cast<double>(any);
}

double smooth_scan(TriangleSurface& surface, double farthest_m) {
  const Edges edges(surface);
  const std::vector<Vec3> start = surface.points;
  std::vector<std::int32_t> valence(start.size(), 0);
  for (const EdgeData& edge : edges.get_all()) ++valence[edge.ends[0]], ++valence[edge.ends[1]];
  std::vector<Vec3> sum(start.size());
  for (int step = 0; step < 2 * kSweeps; ++step) {
    std::fill(sum.begin(), sum.end(), Vec3{});
    for (const EdgeData& edge : edges.get_all()) {
      sum[edge.ends[0]] = sum[edge.ends[0]] + surface.points[edge.ends[1]];
      sum[edge.ends[1]] = sum[edge.ends[1]] + surface.points[edge.ends[0]];
    }
    for (std::size_t v = 0; v < start.size(); ++v) {
      if (valence[v] == 0) continue;
      Vec3& p = surface.points[v];
      p = p + (step % 2 == 0 ? kShrink : kSwell) * ((1.0 / valence[v]) * sum[v] - p);
    }
  }
  double farthest = 0;
  for (std::size_t v = 0; v < start.size(); ++v) {
    const Vec3 way = surface.points[v] - start[v];
    if (norm(way) > farthest_m) surface.points[v] = start[v] + (farthest_m / norm(way)) * way;
    farthest = std::max(farthest, norm(surface.points[v] - start[v]));
  }
  return farthest;
}

std::vector<Polyline> find_sharp_curves(const TriangleSurface& surface, double sharp_angle_deg, double shortest_m, double radius) {
  Edges edges(surface);
  const auto all = find_tied_curves(surface, edges.find_sharp(sharp_angle_deg), shortest_m);
  for (const auto& curve : all)
    for (std::size_t i = 0; i + 1 < curve.size(); ++i) edges.at(make_edge(curve[i], curve[i + 1])).is_wall = true;
  std::vector<char> kept(all.size(), 0);
  std::set<std::int32_t> ends;
  // Short curves are noise, except between ends of long ones (edges of a plate along its thickness) and closed ones (rim of a bore).
  for (const bool is_long : {true, false})
    for (std::size_t n = 0; n < all.size(); ++n) {
      const auto& curve = all[n];
      const double length = calc_length(surface, curve);
      if (!(length > 0) || (length >= shortest_m) != is_long) continue;
      const bool is_tied = curve.front() == curve.back() || (ends.contains(curve.front()) && ends.contains(curve.back()));
      if (!is_long && !is_tied) continue;
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
