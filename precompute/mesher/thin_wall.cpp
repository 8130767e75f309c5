// Method: the skin is remeshed to a ruled edge length, folds and rims get a ring of narrow triangles, and it is extruded. The node count is
//   met by varying the edge length. The mesh is compared with the volume of the parallel body (at folds with the mitre's area), and tested
//   for self-intersection and cut tips. Edge limits are measured: docs/howto/choose-accuracy.md.
// Source: volume between parallel surfaces: Steiner's formula (Gray, "Tubes", 2nd ed., Birkhaeuser 2004); bending wave length: Cremer,
//   Heckl and Petersson, "Structure-borne sound", 3rd ed., Springer 2005.
#include "precompute/mesher/thin_wall.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <unordered_map>
#include <vector>

#include "precompute/mesh/parts.hpp"
#include "precompute/mesher/bends.hpp"
#include "precompute/mesher/body.hpp"
#include "precompute/mesher/extrude.hpp"
#include "precompute/mesher/place_nodes.hpp"
#include "precompute/mesher/repair.hpp"
#include "precompute/mesher/skin.hpp"
#include "precompute/mesher/tet_quality.hpp"
#include "runtime/base/failure.hpp"

namespace carillon::mesher {
namespace {

/// Triangles, folds and borders of a body's surface, and projections onto them. Invariant: no edge of three triangles, no point shared by
/// two parts. Refers to the body.
class WallSource {
 public:
  /// edge_m: of the skin; shorter isolated folds are noise. Throws WallError for a surface that branches or touches itself at a point.
  WallSource(const Body& body, const SurfaceOptions& options, double edge_m);

  const Skin& get_start() const { return start_; }
  const TriangleSurface& get_facets() const { return start_.surface; }
  std::size_t count_dropped_folds() const { return dropped_; }

  /// Nearest point of the smooth surface, or of the facets.
  Vec3 find(const Vec3& p) const;
  /// Nearest point of the folds and borders.
  Vec3 find_on_lines(const Vec3& p) const;
  double calc_distance(const Vec3& p) const { return norm(nearest_.find(p) - p); }

  /// As RoundSurface; zero without one.
  bool is_doubtful() const { return round_ && round_->is_doubtful(); }
  Vec3 find_doubt(const Vec3& p) const;

 private:
  struct Line {
    Vec3 a, way, middle;
    double square, half;
  };
  void find_lines(const TriangleSurface& surface, const std::vector<Edge>& folds);

  const RoundSurface* round_;
  NearestPoint nearest_;  // of the cut of round_, or of the facets
  Skin start_;
  std::vector<Line> lines_;
  std::size_t dropped_ = 0;
};

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

// Largest ratio of edge length to thickness: longer second-order triangles lock.
constexpr double kMaxEdgePerWall = 8;
constexpr double kWavesPerEdge = 12;
constexpr double kRuleHz = 10000, kPlateSpeed = 5400;  // [m/s] longitudinal waves in plates of steel, glass or aluminium
constexpr double kPerRadius = 0.35, kMaxPerRadius = 0.7;
constexpr double kMinPerWall = 0.8;        // shortest edges of curved places, in wall thicknesses
constexpr double kPointsPerArea = 1.1547;  // triangulation points, times squared edge over area
constexpr double kCountAim = 0.07;
constexpr int kMaxAttempts = 8;
constexpr double kRimRing = 0.7, kFoldRing = 0.2,
                 kFoldRingOfEdge = 0.5;  // over the wall: distance from a rim, and from a fold's inner corner, to the ring
constexpr double kRingFrom = 1.05;       // mitre of a fold with a ring (36 degrees turn)
constexpr double kMaxHalfTurn = 1.32;    // of a mitred fold [radians]
constexpr double kMaxVolumeError = 0.05, kMaxLost = 0.35;
constexpr double kDefaultMaxNodes = 200'000;

/// Approximate mesh nodes per skin point.
double calc_nodes_per_point(int order, int layers) { return order == 1 ? layers + 1 : 4 * (2 * layers + 1); }

struct ThinSizes {
  double edge_m = 0;
  int layers = 1;
  double nodes = 0;  // approximate
};

/// Short edges get several layers: one layer bends too stiffly at folds, however fine it is in the plane.
ThinSizes choose_sizes(double area_m2, double wall_m, const SurfaceOptions& options) {
  constexpr double kPerLayer = 1.0;  // shortest edge over layer thickness
  constexpr int kMaxLayers = 6;
  ThinSizes sizes;
  for (;; ++sizes.layers) {
    const double per_area = kPointsPerArea * calc_nodes_per_point(options.order, sizes.layers) * area_m2;
    const double rule = std::max(find_edge_rule(wall_m), std::sqrt(per_area / kDefaultMaxNodes));
    sizes.edge_m = options.edge_m ? *options.edge_m : options.nodes ? std::sqrt(per_area / static_cast<double>(*options.nodes)) : rule;
    sizes.nodes = options.nodes ? static_cast<double>(*options.nodes) : per_area / (sizes.edge_m * sizes.edge_m);
    if (sizes.layers == kMaxLayers || sizes.edge_m > kPerLayer * wall_m / sizes.layers) return sizes;
  }
}

/// Volume between the levels low and high [m] along the surface normals, by Steiner's formula.
double calc_parallel_volume(const TriangleSurface& surface, double low, double high) {
  std::map<Edge, std::vector<std::int32_t>> faces;
  for (std::size_t f = 0; f < surface.triangles.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = surface.triangles[f][c], b = surface.triangles[f][(c + 1) % 3];
      faces[make_edge(a, b)].push_back(static_cast<std::int32_t>(f));
    }
  const auto& p = surface.points;
  const auto calc_normal = [&](std::int32_t f) {
    const Triangle& t = surface.triangles[f];
    const Vec3 area = cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]);
    return norm(area) > 0 ? normalise(area) : area;
  };
  double bend = 0;
  bool is_closed = true;
  for (const auto& [edge, own] : faces) {
    if (own.size() != 2) {
      is_closed = false;
      continue;
    }
    const Vec3 a = calc_normal(own[0]), b = calc_normal(own[1]);
    const double turn = std::atan2(norm(cross(a, b)), dot(a, b));
    double sign = 1;
    for (const std::int32_t v : surface.triangles[own[1]])
      if (v != edge[0] && v != edge[1] && dot(a, p[v] - p[edge[0]]) > 0) sign = -1;
    bend += 2 * sign * norm(p[edge[1]] - p[edge[0]]) * std::tan(std::min(0.5 * turn, kMaxHalfTurn));
  }
  // The total curvature of a closed surface depends on its genus only.
  double total = 0;
  if (is_closed) {
    std::vector<char> used(p.size(), 0);
    for (const Triangle& t : surface.triangles)
      for (const std::int32_t v : t) used[v] = 1;
    const auto points = static_cast<double>(std::count(used.begin(), used.end(), 1));
    total = 2 * std::numbers::pi * (points - static_cast<double>(faces.size()) + static_cast<double>(surface.triangles.size()));
  }
  return calc_area(surface) * (high - low) + bend * (high * high - low * low) / 2 + total * (high * high * high - low * low * low) / 3;
}

std::array<double, 2> find_levels(Side side, double wall_m) {
  if (side == Side::kOutside) return {-wall_m, 0};
  if (side == Side::kInside) return {0, wall_m};
  return {-wall_m / 2, wall_m / 2};
}

struct Attempt {
  Skin skin;
  double edge_m = 0;       // asked for
  std::int64_t rings = 0;  // points added by rings
  std::int64_t nodes = 0;
};

/// Of a surface without unused points.
std::int64_t count_mesh_nodes(const TriangleSurface& surface, int order, int layers) {
  const auto points = static_cast<std::int64_t>(surface.points.size());
  return order == 1 ? (layers + 1) * points : (2 * layers + 1) * (points + static_cast<std::int64_t>(count_faces(surface).size()));
}

/// Of each point.
std::vector<char> mark_border(const TriangleSurface& surface) {
  std::vector<char> on_border(surface.points.size(), 0);
  for (const auto& [a, b] : find_border(surface)) on_border[a] = on_border[b] = 1;
  return on_border;
}

class ThinMesher {
 public:
  ThinMesher(const ThinBody& body, const SurfaceOptions& options, const ThinSizes& sizes, SurfaceReport& report, Phases& phases)
      : body_(body),
        options_(options),
        report_(report),
        phases_(phases),
        edge_(sizes.edge_m),
        levels_(find_levels(body.side, body.wall_m)),
        source_(body.skin, options, edge_),
        order_(options.order == 1 ? 1 : 2),
        layers_(sizes.layers) {
    places_ = {[&](const Vec3& p) { return source_.find(p); }, [&](const Vec3& p) { return source_.find_on_lines(p); }};
    if (body.low) low_source_.emplace(*body.low, options, edge_);
  }

  mesh::TetMesh make() {
    Attempt attempt;
    Extruded extruded;
    const auto run = [&] {
      phases_.run("remeshing the skin", [&] { attempt = meet_count(); });
      phases_.run("extruding", [&] { extruded = extrude_or_retry(attempt); });
      phases_.run("comparing with the body", [&] { compare(attempt.skin, extruded.mesh); });
    };
    const double edge = edge_;
    try {
      run();
    } catch (const WallError&) {
      if (!has_divided_) throw;
      divides_ = false;  // sharp folds
      edge_ = edge;
      run();
    }
    fill_report(attempt, extruded);
    spread_doubt(attempt.skin.surface, extruded);
    return std::move(extruded.mesh);
  }

 private:
  /// Distance from the inner corner of a fold to its ring.
  double calc_margin(double edge_m) const { return std::min(kFoldRing * body_.wall_m, kFoldRingOfEdge * edge_m); }

  /// Skin with edges of about that length, and rings along its folds and rims.
  Attempt make_skin(double edge_m, double per_radius) {
    ++report_.attempts;
    const double wall = body_.wall_m;
    const SkinSizes sizes{edge_m, std::min(edge_m, std::max(kMinPerWall * wall, 0.2 * edge_m)), per_radius,
                          (body_.low ? 1.5 : 1) * std::max(std::abs(levels_[0]), std::abs(levels_[1])), calc_margin(edge_m)};
    Attempt attempt;
    attempt.edge_m = edge_m;
    Skin plain = remesh(source_.get_start(), sizes, places_);
    const std::size_t points = plain.surface.points.size();
    const std::vector<Vec3> ways = find_ways_out(plain);
    const std::vector<Vec3> low = low_source_ ? find_low(plain, ways) : std::vector<Vec3>{};
    const std::vector<char> on_border = mark_border(plain.surface);
    attempt.skin = add_rings(plain, places_, [&](const LeavingEdge& leaving) {
      const std::int32_t v = leaving.point;
      const Vec3 &out = ways[v], &across = leaving.across;
      double distance = on_border[v] != 0 ? kRimRing * wall : 0;
      if (norm(out) > kRingFrom) {
        // Width of the mitre at the wall's inner corner, which for a round wall is off the plane of edge and fold; measured along the edge.
        const std::size_t point = v;
        const double shift = low_source_ ? dot(low[point] - plain.surface.points[point], leaving.way) / leaving.sine
                                         : std::max(levels_[0] * dot(out, across), levels_[1] * dot(out, across));
        distance = std::max(shift, 0.0) + calc_margin(edge_m);
      }
      return distance;
    });
    attempt.rings = static_cast<std::int64_t>(attempt.skin.surface.points.size() - points);
    attempt.nodes = count_mesh_nodes(divide(attempt.skin, edge_m).surface, order_, layers_);
    return attempt;
  }

  /// Relative error of the node count.
  double calc_miss(const Skin& skin) const {
    const auto nodes = static_cast<double>(count_mesh_nodes(skin.surface, order_, layers_));
    return options_.nodes ? nodes / static_cast<double>(*options_.nodes) - 1 : 0.0;
  }

  Skin divide(const Skin& skin, double edge_m) {
    if (!divides_) return skin;
    std::vector<char> is_mitred;
    for (const Vec3& way : find_ways_out(skin)) is_mitred.push_back(norm(way) > kRingFrom ? 1 : 0);
    Skin divided = divide_mitres(skin, places_, edge_m, is_mitred);
    has_divided_ = has_divided_ || !divided.mitre_points.empty();
    return divided;
  }

  Attempt meet_count() {
    const double radius = kPerRadius;
    if (!options_.nodes) return make_skin(edge_, radius);
    const auto asked = static_cast<double>(*options_.nodes);
    const double first = edge_;
    double nearest = 0;
    Attempt best;
    // Curved places: longer than the rule if their arcs permit, shorter otherwise.
    const double rule = options_.edge_m ? edge_ : find_edge_rule(body_.wall_m);
    double low = 0, high = HUGE_VAL;  // edges with too many and too few nodes
    for (int n = 0; n < kMaxAttempts; ++n) {
      Attempt attempt = make_skin(edge_, std::min(kMaxPerRadius, std::max(radius * edge_ / rule, 0.5 * radius)));
      const auto count = static_cast<double>(attempt.nodes);
      if (std::abs(count / asked - 1) < std::abs(nearest / asked - 1) || nearest == 0) nearest = count, best = std::move(attempt);
      if (std::abs(nearest / asked - 1) <= kCountAim) break;
      (count > asked ? low : high) = edge_;
      double next = edge_ * std::clamp(std::sqrt(count / asked), 0.4, 2.0);
      if (next <= low || next >= high) next = low > 0 && high < HUGE_VAL ? std::sqrt(low * high) : next;
      if (next > 30 * first) break;
      if (std::abs(next / edge_ - 1) < 1e-3) break;
      edge_ = next;
    }
    if (std::abs(nearest / asked - 1) <= kCountTolerance) return best;
    if (divides_ && has_divided_) throw WallError("has no divided mitres for this count");
    throw CountRefusal(fmt::format("{}: {} nodes cannot be met within 10 %: the nearest mesh of this wall has {:.0f}; ask for that many",
                                   options_.surface.string(), *options_.nodes, nearest),
                       std::llround(nearest));
  }

  /// Corner triangles between fold mitres need space for both sides of the wall; other edge lengths may provide it.
  Extruded extrude_or_retry(Attempt& attempt) {
    constexpr std::array<double, 7> kFactors{1, 1.06, 0.94, 1.12, 0.88, 1.2, 0.8};
    const bool may_retry = !low_source_ && !attempt.skin.folds.empty();
    const double edge = edge_;
    for (std::size_t n = 0;; ++n) {
      try {
        Skin divided = divide(attempt.skin, attempt.edge_m);
        if (!divided.mitre_points.empty() && std::abs(calc_miss(divided)) > kCountTolerance)
          throw WallError("has more points in its mitres than were asked for");
        Extruded extruded = extrude_skin(divided);
        attempt.skin = std::move(divided);
        return extruded;
      } catch (const WallError&) {
        if (!may_retry || n == kFactors.size()) throw;
      }
      if (n > 0) {
        edge_ = edge * kFactors[n];
        Attempt other = make_skin(edge_, kPerRadius);
        if ((divides_ && has_divided_) || std::abs(calc_miss(other.skin)) <= kCountTolerance) attempt = std::move(other);
      }
      attempt.skin = make_room(attempt.skin, places_, find_ways_out(attempt.skin), levels_);
    }
  }

  Extruded extrude_skin(const Skin& skin) {
    Wall wall;
    wall.order = order_;
    wall.layers = layers_;
    wall.straight = options_.straight;
    wall.levels_m.assign(skin.surface.points.size(), levels_);
    wall.middle = [&](const Vec3& p, bool is_fold) { return is_fold ? source_.find_on_lines(p) : source_.find(p); };
    if (low_source_) {
      wall.low_m = find_low(skin, find_ways_out(skin));
      wall.low_middle = [&](const Vec3& p) { return low_source_->find(p); };
    }
    return extrude(skin, wall);
  }

  /// Point of the other side for each skin point.
  std::vector<Vec3> find_low(const Skin& skin, const std::vector<Vec3>& ways) const {
    std::vector<Vec3> low;
    const std::vector<char> on_border = mark_border(skin.surface);
    for (std::size_t v = 0; v < skin.surface.points.size(); ++v) {
      const Vec3& p = skin.surface.points[v];
      if (on_border[v] != 0) {
        low.push_back(low_source_->find_on_lines(p));
      } else {
        const double way = low_source_->calc_distance(p);
        low.push_back(low_source_->find(p - (way / norm(ways[v])) * ways[v]));
      }
    }
    for (const MitrePoint& point : skin.mitre_points) point.interpolate(low);
    return low;
  }

  /// Throws WallError for a mesh that misrepresents the body.
  void compare(const Skin& skin, const mesh::TetMesh& mesh) {
    const TriangleSurface hull{mesh.nodes_m, find_boundary(mesh)};
    if (const auto crossing = find_crossing(hull)) {
      const Triangle& t = hull.triangles[(*crossing)[0]];
      const Vec3 at = (1.0 / 3) * (hull.points[t[0]] + hull.points[t[1]] + hull.points[t[2]]);
      throw WallError(fmt::format("of {:.3g} mm runs into itself at {}: two parts of the surface are closer there than the wall is thick",
                                  1000 * body_.wall_m, format_place(at)));
    }
    report_.shells = static_cast<std::int64_t>(split_parts(hull).size());
    // Tips and steps cut off by the triangles.
    const NearestPoint nearest(skin.surface);
    double farthest = 0;
    Vec3 where{};
    const auto& points = source_.get_facets().points;
    for (const Triangle& t : source_.get_facets().triangles)
      for (const std::int32_t v : t) {
        const double way = norm(nearest.find(points[v]) - points[v]);
        if (way > farthest) farthest = way, where = points[v];
      }
    lost_ = farthest;
    const double size = calc_box(points).diagonal();
    if (farthest > kMaxLost * edge_ && farthest > 0.02 * size)
      throw WallError(
          fmt::format("in edges of {:.3g} mm lacks {:.3g} mm of the surface at {}", 1000 * edge_, 1000 * farthest, format_place(where)));
    report_.farthest_outside_m = 0;
    report_.volume_m3 = calc_mesh_volume(mesh);
    report_.expected_volume_m3 =
        body_.expected_volume_m3 > 0 ? body_.expected_volume_m3 : calc_parallel_volume(body_.skin.repaired.surface, levels_[0], levels_[1]);
    const double off = report_.volume_m3 / report_.expected_volume_m3 - 1;
    if (std::abs(off) > kMaxVolumeError)
      throw WallError(fmt::format("in edges of {:.3g} mm has {:+.1f} % of the body's volume too {}", 1000 * edge_, 100 * std::abs(off),
                                  off > 0 ? "much" : "little"));
    const TetMeasures measures = measure(mesh);
    report_.min_dihedral_deg = measures.min_dihedral_deg;
    report_.max_dihedral_deg = measures.max_dihedral_deg;
  }

  void fill_report(const Attempt& attempt, const Extruded& extruded) {
    const mesh::TetMesh& mesh = extruded.mesh;
    const auto& p = attempt.skin.surface.points;
    double sum = 0;
    for (const auto& [a, b] : extruded.edges) sum += norm(p[b] - p[a]);
    report_.method = Method::kExtrusion;
    report_.layers = layers_;
    report_.edge_m = edge_;
    report_.mean_edge_m = sum / static_cast<double>(extruded.edges.size());
    report_.edge_per_wall = report_.mean_edge_m / extruded.thickness_mean_m;
    report_.layers_mean = layers_;
    report_.wall_min_m = extruded.thickness_min_m;
    report_.wall_mean_m = extruded.thickness_mean_m;
    report_.wall_max_m = extruded.thickness_max_m;
    report_.nodes = static_cast<std::int64_t>(mesh.nodes_m.size());
    report_.corner_nodes = static_cast<std::int64_t>(p.size()) * (layers_ + 1);
    report_.tets = mesh.tet_count();
    report_.straightened_tets = extruded.straightened;
    report_.mesh_extent_m = calc_box(mesh.nodes_m).extent();
    report_.curved_edges = order_ == 2 && !options_.straight ? static_cast<std::int64_t>(2 * extruded.edges.size()) : 0;
    report_.sharp_edges_m = 0;
    for (const auto& [a, b] : attempt.skin.folds) report_.sharp_edges_m += norm(p[b] - p[a]);
    report_.sharp_curves = attempt.skin.folds.empty() ? 0 : 1;
    const auto note = [&](std::string text) { report_.notes.push_back(std::move(text)); };
    const auto remark = [&](std::string text) { report_.remarks.push_back(std::move(text)); };
    if (layers_ == 1)
      remark(fmt::format(
          "One layer of elements lies through the wall, in edges {:.1f} times as long as it is thick: errors fall with the square "
          "of the edges rather than their fourth power.",
          report_.edge_per_wall));
    if (report_.edge_per_wall > 1.15 * kMaxEdgePerWall)
      note(
          fmt::format("The edges are {:.1f} times as long as the wall is thick, where {:g} are the most that keep the elements from "
                      "locking in bending: "
                      "the frequencies will be rough; ask for more nodes.",
                      report_.edge_per_wall, kMaxEdgePerWall));
    if (order_ == 1)
      note("One layer of linear elements is far too stiff in bending: its frequencies are of no use but for a first look; take order 2.");
    if (attempt.rings > 0) remark(fmt::format("Folds and rims have a ring of narrow elements ({} points of the skin).", attempt.rings));
    if (source_.count_dropped_folds() > 0)
      remark(fmt::format("{} sharp edges of facets are shorter than elements and were taken for noise.", source_.count_dropped_folds()));
    if (lost_ > 0.1 * edge_)
      note(fmt::format("The elements cut off up to {:.3g} mm of the surface's details; more nodes keep them.", 1000 * lost_));
  }

  /// Surface ambiguity at every mesh node; empty if unambiguous.
  void spread_doubt(const TriangleSurface& skin, Extruded& extruded) {
    if (!source_.is_doubtful()) return;
    mesh::TetMesh& mesh = extruded.mesh;
    const auto& p = skin.points;
    mesh.doubt_m.assign(mesh.nodes_m.size(), Vec3{});
    const auto points = static_cast<std::int32_t>(p.size());
    std::vector<Vec3> way(p.size());
    for (std::int32_t v = 0; v < points; ++v) {
      way[v] = source_.find_doubt(p[v]);
      for (int l = 0; l <= layers_; ++l) mesh.doubt_m[l * points + v] = way[v];
    }
    // Mid nodes of skin edges have their own value, others the mean of their ends.
    if (order_ == 2)
      for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
        for (std::size_t m = 0; m < 6; ++m)
          mesh.doubt_m[mesh.tet(e)[4 + m]] =
              0.5 * (way[mesh.tet(e)[mesh::kEdges[m][0]] % points] + way[mesh.tet(e)[mesh::kEdges[m][1]] % points]);
    for (std::size_t e = 0; e < extruded.mid_nodes.size(); ++e)
      for (const std::int32_t node : extruded.mid_nodes[e])
        mesh.doubt_m[node] = source_.find_doubt(0.5 * (p[extruded.edges[e][0]] + p[extruded.edges[e][1]]));
    remark_doubt(mesh, report_);
    if (!(report_.doubt_m > 0)) mesh.doubt_m.clear();
  }

  const ThinBody& body_;
  const SurfaceOptions& options_;
  SurfaceReport& report_;
  Phases& phases_;
  double edge_;
  std::array<double, 2> levels_;
  WallSource source_;
  std::optional<WallSource> low_source_;
  SkinPlaces places_;
  int order_, layers_;
  bool divides_ = true, has_divided_ = false;  // mitres
  double lost_ = 0;
};

}  // namespace

double find_edge_rule(double wall_m) {
  const double wave = std::sqrt(2 * std::numbers::pi / std::sqrt(12.0) * kPlateSpeed * wall_m / kRuleHz);
  return std::min(wave / kWavesPerEdge, kMaxEdgePerWall * wall_m);
}

double find_thin_edge(const ThinBody& body, const SurfaceOptions& options) {
  return choose_sizes(calc_area(body.skin.repaired.surface), body.wall_m, options).edge_m;
}

mesh::TetMesh mesh_thin_wall(const ThinBody& body, const SurfaceOptions& options, SurfaceReport& report, Phases& phases) {
  const double area = calc_area(body.skin.repaired.surface);
  const ThinSizes sizes = choose_sizes(area, body.wall_m, options);
  check_edge(options, sizes.edge_m, calc_box(body.skin.repaired.surface.points).diagonal(), sizes.nodes, kMaxNodes);
  phases.show(fmt::format("about {:.0f} nodes", sizes.nodes));
  return ThinMesher(body, options, sizes, report, phases).make();
}

}  // namespace carillon::mesher
