// One path from a surface to the elements of a wall, whose every step is measured against that surface; longer than most files.
// Method: the skin is remeshed to edges by rule, its folds and rims get a ring of narrow triangles, and it is extruded. The number of nodes
//   is met by changing the edges. What came out is compared with the volume of the parallel body, tested against running through itself
//   and for tips that the triangles cut off.
// Source: the volume between parallel surfaces: Steiner's formula (Gray, "Tubes", 2nd ed., Birkhaeuser 2004); the length of bending waves:
//   Cremer, Heckl and Petersson, "Structure-borne sound", 3rd ed., Springer 2005. How long edges may be: measured,
//   docs/howto/thin-walls.md.
// Deviations: at folds the formula has the mitre's area in place of the arc's.
#include "precompute/mesher/thin_wall.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <set>
#include <unordered_map>

#include "precompute/mesh/curved.hpp"
#include "precompute/mesh/parts.hpp"
#include "precompute/mesher/bends.hpp"
#include "precompute/mesher/extrude.hpp"
#include "precompute/mesher/repair.hpp"
#include "precompute/mesher/skin.hpp"
#include "precompute/mesher/tet_quality.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/sort_order.hpp"

namespace carillon::mesher {
namespace {

// Longest edge over the thickness of the wall: beyond, unstructured triangles of second order lock.
constexpr double kMaxEdgePerWall = 8;
constexpr double kWavesPerEdge = 12;
constexpr double kRuleHz = 10000, kPlateSpeed = 5400;  // [m/s] of longitudinal waves in plates of steel, glass or aluminium
constexpr double kPerRadius = 0.35, kMaxPerRadius = 0.7;
constexpr double kMinPerWall = 0.8;        // the shortest edge that curvature may ask for, in walls
constexpr double kPointsPerArea = 1.1547;  // of a triangulation, times its edges' square
constexpr double kCountTolerance = 0.10, kCountAim = 0.07;
constexpr int kMaxAttempts = 8;
constexpr double kRimRing = 0.7, kFoldRing = 0.2,
                 kFoldRingOfEdge = 0.5;  // walls from a rim to its ring, and from the inner corner of a fold
constexpr double kRingFrom = 1.05;       // the mitre of a fold with a ring: it turns by 36 degrees
constexpr double kNoiseLength = 2;       // edges: shorter isolated folds are noise
constexpr std::size_t kScan = 2000;      // triangles of a surface whose sharp edges may be noise
constexpr double kMaxHalfTurn = 1.32;    // of a fold that is mitred [radians]
constexpr double kMaxVolumeError = 0.05, kMaxLost = 0.35;
constexpr double kDefaultMaxNodes = 200'000;

/// Points of the skin times this are nodes of the mesh, about.
double calc_nodes_per_point(int order, int layers) { return order == 1 ? layers + 1 : 4 * (2 * layers + 1); }

struct ThinSizes {
  double edge_m = 0;
  int layers = 1;
  double nodes = 0;  // about
};

/// Several layers pay where edges are shorter than the wall is thick, so that elements stay of one size in all directions.
ThinSizes choose_sizes(double area_m2, double wall_m, const SurfaceOptions& options) {
  constexpr double kPerLayer = 0.65;  // edges that are shorter than this part of a layer get another one
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

/// What the skin is made of, and what leads back to the surface.
class Source {
 public:
  Source(const Body& body, const SurfaceOptions& options, double edge_m)
      : round_(body.round ? &*body.round : nullptr),
        surface_(body.repaired.surface),
        nearest_(body.repaired.surface),
        facets_(round_ ? round_->get_facets() : body.repaired.surface) {
    std::vector<Edge> folds;
    if (round_) {
      folds = round_->list_folds();
    } else {
      constexpr double kFlatDeg = 1;
      for (const Bend& bend : find_bends(facets_, options.sharp_angle_deg).edges)
        if (bend.count == 2 && (options.facets ? bend.turn_deg > kFlatDeg : bend.sharp)) folds.push_back(bend.ends);
    }
    refuse_shared();
    const std::size_t all = folds.size();
    if (!options.facets) drop_noise(folds, options.sharp_angle_deg, edge_m);
    dropped_ = all - folds.size();
    start_ = {facets_, folds};
    find_lines(folds);
  }

  const Skin& get_start() const { return start_; }
  const TriangleSurface& get_facets() const { return facets_; }
  std::size_t get_dropped() const { return dropped_; }

  Vec3 find(const Vec3& p) const {
    const auto [at, triangle] = nearest_.find_on(p);
    return round_ ? round_->find(triangle, at) : at;
  }
  Vec3 find_doubt(const Vec3& p) const {
    if (!round_) return {};
    const auto [at, triangle] = nearest_.find_on(p);
    return round_->find_doubt(triangle, at);
  }
  bool is_doubtful() const { return round_ && round_->is_doubtful(); }
  double calc_distance(const Vec3& p) const { return norm(nearest_.find(p) - p); }

  /// The nearest point of the folds and borders.
  Vec3 find_on_lines(const Vec3& p) const {
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

 private:
  struct Line {
    Vec3 a, way, middle;
    double square, half;
  };

  /// Isolated folds that are shorter than elements are noise; where there are many, all are.
  void drop_noise(std::vector<Edge>& folds, double sharp_angle_deg, double edge_m) const {
    if (facets_.triangles.size() > kScan) {
      // Of a scan, only what is sharp at the size of elements too.
      std::map<Vec3, std::int32_t> number;
      for (const Triangle& t : facets_.triangles)
        for (const std::int32_t v : t) number[facets_.points[v]] = v;
      std::set<Edge> kept;
      const double diagonal = calc_box(facets_.points).diagonal();
      for (const Polyline& curve : find_sharp_curves(facets_, sharp_angle_deg, std::min(2 * edge_m, 0.1 * diagonal), 2 * edge_m))
        for (std::size_t i = 1; i < curve.size(); ++i) {
          const std::int32_t a = number.at(curve[i - 1]), b = number.at(curve[i]);
          kept.insert(make_edge(a, b));
        }
      std::erase_if(folds, [&](const Edge& e) { return !kept.contains(e); });
    }
    mesh::Parts parts(facets_.points.size());
    for (const auto& [a, b] : folds) parts.join(a, b);
    std::map<std::int32_t, double> length;
    const auto& p = facets_.points;
    for (const auto& [a, b] : folds) length[parts.find(a)] += norm(p[b] - p[a]);
    std::erase_if(folds, [&](const Edge& e) { return length[parts.find(e[0])] < kNoiseLength * edge_m; });
  }

  /// Throws where three triangles meet in an edge, or two parts of the surface in a point.
  void refuse_shared() const {
    std::unordered_map<Edge, int, EdgeHash> count;
    for (const Triangle& t : facets_.triangles)
      for (int c = 0; c < 3; ++c) ++count[make_edge(t[c], t[(c + 1) % 3])];
    for (const Triangle& t : facets_.triangles)
      for (int c = 0; c < 3; ++c) {
        const int faces = count.at(make_edge(t[c], t[(c + 1) % 3]));
        if (faces > 2)
          throw WallError(fmt::format("cannot branch: {} triangles meet in one edge at {} (a T-junction)", faces,
                                      format_place(0.5 * (facets_.points[t[c]] + facets_.points[t[(c + 1) % 3]]))));
      }
    // The corners at a point are connected by edges, or it is shared.
    const std::size_t count_of_corners = 3 * facets_.triangles.size();
    mesh::Parts parts(count_of_corners);
    std::unordered_map<Edge, std::array<std::int32_t, 2>, EdgeHash> first;  // by edge: the corners at its lower and its higher point
    for (std::size_t f = 0; f < facets_.triangles.size(); ++f)
      for (int c = 0; c < 3; ++c) {
        const Triangle& t = facets_.triangles[f];
        std::array<std::int32_t, 2> corners{static_cast<std::int32_t>(3 * f) + c, static_cast<std::int32_t>(3 * f) + (c + 1) % 3};
        if (t[c] > t[(c + 1) % 3]) std::swap(corners[0], corners[1]);
        const auto [found, fresh] = first.try_emplace(make_edge(t[c], t[(c + 1) % 3]), corners);
        if (fresh) continue;
        for (int end = 0; end < 2; ++end) parts.join(corners[end], found->second[end]);
      }
    std::vector<std::int32_t> part(facets_.points.size(), -1);
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(count_of_corners); ++c) {
      const std::int32_t v = facets_.triangles[c / 3][c % 3];
      if (part[v] >= 0 && part[v] != parts.find(c))
        throw WallError(
            fmt::format("cannot be connected at one point only: two parts of the surface touch at {}", format_place(facets_.points[v])));
      part[v] = parts.find(c);
    }
  }

  void find_lines(const std::vector<Edge>& folds) {
    std::vector<Edge> edges = round_ ? round_->list_lines() : folds;
    if (!round_) {
      const auto border = find_border(facets_);
      edges.insert(edges.end(), border.begin(), border.end());
    }
    const auto& points = round_ ? surface_.points : facets_.points;
    for (const auto& [a, b] : edges) {
      const Vec3 way = points[b] - points[a];
      if (dot(way, way) > 0) lines_.push_back({points[a], way, points[a] + 0.5 * way, dot(way, way), 0.5 * norm(way)});
    }
  }

  const RoundSurface* round_;
  const TriangleSurface& surface_;  // on which round_ was cut
  NearestPoint nearest_;
  const TriangleSurface& facets_;
  Skin start_;
  std::vector<Line> lines_;
  std::size_t dropped_ = 0;
};

/// The volume between the levels low and high [m] of the surface, along its normals, by Steiner's formula.
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
  // The total curvature of a closed surface is that of its holes alone.
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
  std::int64_t rings = 0;  // points that they added
  std::int64_t nodes = 0;
};

std::int64_t count_mesh_nodes(const TriangleSurface& surface, int order, int layers) {
  std::map<Edge, int> edges;
  std::vector<char> used(surface.points.size(), 0);
  for (const Triangle& t : surface.triangles)
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = t[c], b = t[(c + 1) % 3];
      edges[make_edge(a, b)] = 1;
      used[a] = 1;
    }
  const auto points = static_cast<std::int64_t>(std::count(used.begin(), used.end(), 1));
  const auto count = static_cast<std::int64_t>(edges.size());
  return order == 1 ? (layers + 1) * points : (2 * layers + 1) * (points + count);
}

class ThinMesher {
 public:
  ThinMesher(const ThinBody& body, const SurfaceOptions& options, SurfaceReport& report, const RunPhase& run)
      : body_(body),
        options_(options),
        report_(report),
        run_(run),
        edge_(find_thin_edge(body, options)),
        levels_(find_levels(body.side, body.wall_m)),
        source_(body.skin, options, edge_),
        order_(options.order == 1 ? 1 : 2),
        layers_(choose_sizes(calc_area(body.skin.repaired.surface), body.wall_m, options).layers) {
    places_ = {[&](const Vec3& p) { return source_.find(p); }, [&](const Vec3& p) { return source_.find_on_lines(p); }};
    if (body.low) low_source_.emplace(*body.low, options, edge_);
  }

  mesh::TetMesh make() {
    Attempt attempt;
    run_("remeshing the skin", [&] { attempt = meet_count(); });
    Extruded extruded;
    run_("extruding", [&] { extruded = extrude_or_retry(attempt); });
    run_("comparing with the body", [&] { compare(attempt.skin, extruded); });
    fill_report(attempt, extruded);
    return std::move(extruded.mesh);
  }

 private:
  /// From the inner corner of a fold to its ring.
  double calc_margin(double edge_m) const { return std::min(kFoldRing * body_.wall_m, kFoldRingOfEdge * edge_m); }

  /// The skin with edges of about that length, and rings along its folds and rims.
  Attempt make_skin(double edge_m, double per_radius) {
    ++report_.attempts;
    const double wall = body_.wall_m;
    const SkinSizes sizes{edge_m, std::min(edge_m, std::max(kMinPerWall * wall, 0.2 * edge_m)), per_radius,
                          (body_.low ? 1.5 : 1) * std::max(std::abs(levels_[0]), std::abs(levels_[1])), calc_margin(edge_m)};
    Attempt attempt;
    Skin plain = remesh(source_.get_start(), sizes, places_);
    const std::size_t points = plain.surface.points.size();
    const std::vector<Vec3> ways = find_ways_out(plain);
    const std::vector<Vec3> low = low_source_ ? find_low(plain, ways) : std::vector<Vec3>{};
    std::vector<char> on_border(points, 0);
    for (const auto& [a, b] : find_border(plain.surface)) on_border[a] = on_border[b] = 1;
    attempt.skin = add_rings(plain, places_, [&](const LeavingEdge& leaving) {
      const std::int32_t v = leaving.point;
      const Vec3 &out = ways[static_cast<std::size_t>(v)], &across = leaving.across;
      double distance = on_border[v] != 0 ? kRimRing * wall : 0;
      if (norm(out) > kRingFrom) {
        // The mitre takes so much of the ring's side at the wall's inner corner. A measured corner lies off the plane of edge and fold
        // where the wall is round, and counts along the edge.
        const auto point = static_cast<std::size_t>(v);
        const double shift = low_source_ ? dot(low[point] - plain.surface.points[point], leaving.way) / leaving.sine
                                         : std::max(levels_[0] * dot(out, across), levels_[1] * dot(out, across));
        distance = std::max(shift, 0.0) + calc_margin(edge_m);
      }
      return distance;
    });
    attempt.rings = static_cast<std::int64_t>(attempt.skin.surface.points.size() - points);
    attempt.nodes = count_mesh_nodes(attempt.skin.surface, order_, layers_);
    return attempt;
  }

  Attempt meet_count() {
    const double radius = kPerRadius;
    if (!options_.nodes) return make_skin(edge_, radius);
    const auto asked = static_cast<double>(*options_.nodes);
    const double first = edge_;
    double nearest = 0;
    Attempt best;
    // Curved places may get coarser than the rule, as far as their arcs allow, and finer with the rest.
    const double rule = options_.edge_m ? edge_ : find_edge_rule(body_.wall_m);
    double low = 0, high = HUGE_VAL;  // edges that gave too many and too few
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
    if (std::abs(nearest / asked - 1) > kCountTolerance)
      throw CountRefusal(fmt::format("{}: {} nodes cannot be met within 10 %: the nearest mesh of this wall has {:.0f}; ask for that many",
                                     options_.surface.string(), *options_.nodes, nearest),
                         std::llround(nearest));
    return best;
  }

  /// Where the mitres of folds meet in corners, triangles need room for both sides of the wall; whether they find it depends on the edges.
  Extruded extrude_or_retry(Attempt& attempt) {
    constexpr std::array<double, 7> kFactors{1, 1.06, 0.94, 1.12, 0.88, 1.2, 0.8};
    const bool may_retry = !low_source_ && !attempt.skin.folds.empty();
    const double edge = edge_;
    for (std::size_t n = 0;; ++n) {
      try {
        return extrude_skin(attempt.skin);
      } catch (const WallError&) {
        if (!may_retry || n == kFactors.size()) throw;
      }
      if (n > 0) {
        edge_ = edge * kFactors[n];
        Attempt other = make_skin(edge_, kPerRadius);
        const double off = options_.nodes ? static_cast<double>(other.nodes) / static_cast<double>(*options_.nodes) - 1 : 0;
        if (std::abs(off) <= kCountTolerance) attempt = std::move(other);
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

  /// The point of the other side for each point of the skin.
  std::vector<Vec3> find_low(const Skin& skin, const std::vector<Vec3>& ways) const {
    std::vector<Vec3> low;
    std::vector<char> on_border(skin.surface.points.size(), 0);
    for (const auto& [a, b] : find_border(skin.surface)) on_border[a] = on_border[b] = 1;
    for (std::size_t v = 0; v < skin.surface.points.size(); ++v) {
      const Vec3& p = skin.surface.points[v];
      if (on_border[v] != 0) {
        low.push_back(low_source_->find_on_lines(p));
      } else {
        const double way = low_source_->calc_distance(p);
        low.push_back(low_source_->find(p - (way / norm(ways[v])) * ways[v]));
      }
    }
    return low;
  }

  /// Throws where the mesh is not the body.
  void compare(const Skin& skin, const Extruded& extruded) {
    mesh::TetMesh linear;
    linear.nodes_m = extruded.mesh.nodes_m;
    for (std::int64_t e = 0; e < extruded.mesh.tet_count(); ++e)
      linear.tets.insert(linear.tets.end(), extruded.mesh.tet(e).begin(), extruded.mesh.tet(e).begin() + 4);
    TriangleSurface hull{linear.nodes_m, find_boundary(linear)};
    if (const auto crossing = find_crossing(hull)) {
      const Triangle& t = hull.triangles[(*crossing)[0]];
      const Vec3 at = (1.0 / 3) * (hull.points[t[0]] + hull.points[t[1]] + hull.points[t[2]]);
      throw WallError(fmt::format("of {:.3g} mm runs into itself at {}: two parts of the surface are closer there than the wall is thick",
                                  1000 * body_.wall_m, format_place(at)));
    }
    report_.shells = static_cast<std::int64_t>(split_parts(hull).size());
    // Tips and steps that the triangles cut off.
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
    report_.volume_m3 = 0;
    if (order_ == 2)
      for (std::int64_t e = 0; e < extruded.mesh.tet_count(); ++e) report_.volume_m3 += mesh::calc_curved_volume(extruded.mesh, e);
    else
      report_.volume_m3 = measure(linear).volume_m3;
    report_.expected_volume_m3 =
        body_.expected_volume_m3 > 0 ? body_.expected_volume_m3 : calc_parallel_volume(body_.skin.repaired.surface, levels_[0], levels_[1]);
    const double off = report_.volume_m3 / report_.expected_volume_m3 - 1;
    if (std::abs(off) > kMaxVolumeError)
      throw WallError(fmt::format("in edges of {:.3g} mm has {:+.1f} % of the body's volume too {}", 1000 * edge_, 100 * std::abs(off),
                                  off > 0 ? "much" : "little"));
    const TetMeasures measures = measure(linear);
    report_.min_dihedral_deg = measures.min_dihedral_deg;
    report_.max_dihedral_deg = measures.max_dihedral_deg;
  }

  void fill_report(const Attempt& attempt, Extruded& extruded) {
    mesh::TetMesh& mesh = extruded.mesh;
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
    if (source_.get_dropped() > 0)
      remark(fmt::format("{} sharp edges of facets are shorter than elements and were taken for noise.", source_.get_dropped()));
    if (lost_ > 0.1 * edge_)
      note(fmt::format("The elements cut off up to {:.3g} mm of the surface's details; more nodes keep them.", 1000 * lost_));
    if (source_.is_doubtful()) {
      mesh.doubt_m.assign(mesh.nodes_m.size(), Vec3{});
      const auto points = static_cast<std::int32_t>(p.size());
      std::vector<Vec3> way(p.size());
      for (std::int32_t v = 0; v < points; ++v) {
        way[v] = source_.find_doubt(p[v]);
        for (int l = 0; l <= layers_; ++l) mesh.doubt_m[l * points + v] = way[v];
      }
      // Mid nodes of the skin's edges have their own, the others the mean of their ends'.
      if (order_ == 2)
        for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
          for (std::size_t m = 0; m < 6; ++m)
            mesh.doubt_m[mesh.tet(e)[4 + m]] =
                0.5 * (way[mesh.tet(e)[mesh::kEdges[m][0]] % points] + way[mesh.tet(e)[mesh::kEdges[m][1]] % points]);
      for (std::size_t e = 0; e < extruded.mid_nodes.size(); ++e)
        for (const std::int32_t node : extruded.mid_nodes[e])
          mesh.doubt_m[node] = source_.find_doubt(0.5 * (p[extruded.edges[e][0]] + p[extruded.edges[e][1]]));
      for (const Vec3& w : mesh.doubt_m) report_.doubt_m = std::max(report_.doubt_m, norm(w));
      if (report_.doubt_m > 0)
        remark(
            fmt::format("Some facets are so coarse that they may be planes of the body or samples of a smooth surface, up to {:.3g} m "
                        "apart. What that changes is stated next to the error bars. A surface in finer facets settles it, or --facets if "
                        "they are planes.",
                        report_.doubt_m));
      else
        mesh.doubt_m.clear();
    }
  }

  const ThinBody& body_;
  const SurfaceOptions& options_;
  SurfaceReport& report_;
  const RunPhase& run_;
  double edge_;
  std::array<double, 2> levels_;
  Source source_;
  std::optional<Source> low_source_;
  SkinPlaces places_;
  int order_, layers_;
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

std::string format_thin_estimate(double area_m2, double wall_m, const SurfaceOptions& options) {
  const double nodes = std::clamp(choose_sizes(area_m2, wall_m, options).nodes, 1.0, 1e15);
  base::Json estimate = base::Json::object();
  estimate.set("volume_m3", base::significant(area_m2 * wall_m, 12)).set("area_m2", base::significant(2 * area_m2, 12));
  estimate.set("thickness_m", base::significant(wall_m, 12)).set("nodes", std::llround(nodes));
  return estimate.line();
}

std::optional<TwoSides> find_two_sides(const TriangleSurface& closed) {
  constexpr double kFacing = 0.9;  // cosine
  constexpr double kMaxOfDiagonal = 0.2, kMaxOfMedian = 3;
  constexpr double kMinSide = 0.3, kMaxRim = 0.25;  // of the area
  constexpr std::size_t kMaxTriangles = 200'000;
  const std::size_t count = closed.triangles.size();
  if (count > kMaxTriangles) return std::nullopt;
  const NearestPoint tree(closed);
  std::vector<Vec3> normal(count);
  std::vector<double> area(count), way(count, HUGE_VAL);
  std::vector<std::int32_t> other(count, -1);
  for (std::size_t f = 0; f < count; ++f) {
    const Triangle& t = closed.triangles[f];
    const Vec3 a = cross(closed.points[t[1]] - closed.points[t[0]], closed.points[t[2]] - closed.points[t[0]]);
    area[f] = 0.5 * norm(a);
    if (area[f] > 0) normal[f] = normalise(a);
  }
  for (std::size_t f = 0; f < count; ++f) {
    if (!(area[f] > 0)) continue;
    const Triangle& t = closed.triangles[f];
    const Vec3 middle = (1.0 / 3) * (closed.points[t[0]] + closed.points[t[1]] + closed.points[t[2]]);
    const auto hit = tree.find_hit(middle, -1.0 * normal[f], static_cast<std::int32_t>(f));
    if (!hit || -dot(normal[f], normal[hit->second]) < kFacing) continue;
    way[f] = hit->first;
    other[f] = hit->second;
  }
  const double all = std::accumulate(area.begin(), area.end(), 0.0);
  double sum = 0, median = HUGE_VAL;
  for (const std::size_t f : base::find_sort_order(way))
    if ((sum += area[f]) >= 0.5 * all) {
      median = way[f];
      break;
    }
  if (!(median < kMaxOfDiagonal * calc_box(closed.points).diagonal())) return std::nullopt;
  std::vector<char> thin(count, 0);
  for (std::size_t f = 0; f < count; ++f) thin[f] = way[f] < kMaxOfMedian * median;
  // The sides: thin triangles that are connected by edges.
  mesh::Parts parts(count);
  std::unordered_map<Edge, std::int32_t, EdgeHash> first;
  for (std::size_t f = 0; f < count; ++f) {
    if (thin[f] == 0) continue;
    const Triangle& t = closed.triangles[f];
    for (int c = 0; c < 3; ++c) {
      const auto [found, fresh] = first.try_emplace(make_edge(t[c], t[(c + 1) % 3]), static_cast<std::int32_t>(f));
      if (!fresh) parts.join(static_cast<std::int32_t>(f), found->second);
    }
  }
  std::map<std::int32_t, double> sides;
  for (std::size_t f = 0; f < count; ++f)
    if (thin[f] != 0) sides[parts.find(static_cast<std::int32_t>(f))] += area[f];
  std::vector<std::pair<double, std::int32_t>> largest;
  for (const auto& [side, a] : sides) largest.emplace_back(-a, side);
  std::sort(largest.begin(), largest.end());
  if (largest.size() < 2 || -largest[1].first < kMinSide * all) return std::nullopt;
  if (all + largest[0].first + largest[1].first > kMaxRim * all) return std::nullopt;
  double facing = 0;
  TwoSides result;
  result.thickness_m = median;
  for (std::size_t f = 0; f < count; ++f) {
    if (thin[f] == 0) continue;
    const std::int32_t side = parts.find(static_cast<std::int32_t>(f));
    for (int n = 0; n < 2; ++n) {
      if (side != largest[n].second) continue;
      (n == 0 ? result.outer : result.inner).triangles.push_back(closed.triangles[f]);
      if (thin[other[f]] != 0 && parts.find(other[f]) == largest[1 - n].second) facing += area[f];
    }
  }
  constexpr double kMinFacing = 0.9;
  if (facing < kMinFacing * -(largest[0].first + largest[1].first)) return std::nullopt;
  for (TriangleSurface* side : {&result.outer, &result.inner}) {
    std::unordered_map<std::int32_t, std::int32_t> number;
    for (Triangle& t : side->triangles)
      for (std::int32_t& v : t) {
        const auto [found, fresh] = number.try_emplace(v, static_cast<std::int32_t>(side->points.size()));
        if (fresh) side->points.push_back(closed.points[v]);
        v = found->second;
      }
  }
  return result;
}

mesh::TetMesh mesh_thin_wall(const ThinBody& body, const SurfaceOptions& options, SurfaceReport& report, const RunPhase& run,
                             const std::function<void(const std::string&)>& show) {
  const double area = calc_area(body.skin.repaired.surface);
  const ThinSizes sizes = choose_sizes(area, body.wall_m, options);
  if (sizes.nodes > kMaxNodes)
    throw InputError(fmt::format("{}: edges of {:.3g} m would give about {:.3g} nodes, more than {:.0g}; ask for longer ones",
                                 options.surface.string(), sizes.edge_m, sizes.nodes, kMaxNodes));
  if (const double size = calc_box(body.skin.repaired.surface.points).diagonal(); sizes.edge_m > size && options.edge_m)
    throw InputError(fmt::format("{}: edges of {:.3g} m are longer than the body ({:.3g} m); ask for shorter ones",
                                 options.surface.string(), sizes.edge_m, size));
  show(fmt::format("estimate {}", format_thin_estimate(area, body.wall_m, options)));
  return ThinMesher(body, options, report, run).make();
}

}  // namespace carillon::mesher
