// Method: coplanar triangles are merged into panes. From every edge that turns by less than 50 degrees a row of panes is followed to both
//   sides: through four-cornered panes to the opposite side, straight through others. The row ends at a sharp edge, at a pane more than
//   three times wider or a polygon, and where the turn changes its sign or its size by more than a factor. The row length distinguishes a
//   faceted arc from a bevel. Thresholds are measured: docs/decisions/surface-meshing.md.
#include "precompute/mesher/bends.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <set>

#include "runtime/base/vector.hpp"

namespace carillon::mesher {
namespace {

constexpr double kMaxCoplanarTurnDeg = 0.1;  // coplanar below this turn
constexpr double kMinCornerTurnDeg = 10;     // turn at a corner of a pane's outline
constexpr double kMaxWidthRatio = 3;         // largest width ratio of panes in a row
constexpr double kMaxTurnRatio = 3.3;        // largest ratio of turns in a row
constexpr double kMaxTurnDeg = 50;           // largest turn of a faceted smooth surface
constexpr double kMaxCircleTurnDeg = 25;     // fifteen or more sides are a circle
constexpr int kMinArcPanes = 4;              // panes of an arc
constexpr int kMinDoubtfulArcLength = 5;     // bends and panes of a possible arc: two panes between planes, or three without neighbours
constexpr int kMaxPanesPerSide = 4;          // per side

/// Outline of a pane.
struct Outline {
  std::vector<std::int32_t> edges;  // indices into Bends
  std::vector<int> side;            // side of each edge, numbered around; empty if the outline is not a single loop
  int sides = 0;
  int triangles = 0;
  int sharp = 0;       // edges that end the smooth surface
  int neighbours = 0;  // panes across the other edges
  double rim_turn_deg = 0;
};

struct Row {
  int bends = 1;  // of one sign
  int panes = 0;
};

class Judge {
 public:
  Judge(const TriangleSurface& surface, double sharp_angle_deg) : surface_(surface), sharp_angle_deg_(sharp_angle_deg) {
    for (const Triangle& t : surface.triangles) out_.normals.push_back(calc_unit(cross(at(t[1]) - at(t[0]), at(t[2]) - at(t[0]))));
    find_edges();
    find_panes();
    find_outlines();
  }

  Bends judge() {
    find_rim_turns();
    for (std::int32_t p = 0; p < static_cast<std::int32_t>(place_.size()); ++p)
      if (place_[p] >= 0) outlines_[place_[p]].rim_turn_deg = calc_rim_turn(p);
    find_rows();
    std::vector<Bend> judged = out_.edges;
    for (std::size_t e = 0; e < judged.size(); ++e)
      if (is_bend(judged[e])) judge(judged[e]);
    out_.edges = std::move(judged);
    for (const Bend& edge : out_.edges) out_.doubtful = out_.doubtful || edge.doubtful;
    return std::move(out_);
  }

 private:
  const Vec3& at(std::int32_t v) const { return surface_.points[v]; }
  Vec3 calc_middle(const Bend& edge) const { return 0.5 * (at(edge.ends[0]) + at(edge.ends[1])); }
  std::int32_t pane_of(const Bend& edge, int side) const { return out_.pane[edge.faces[side]]; }
  const Outline& outline_of(std::int32_t pane) const { return outlines_[place_[pane]]; }
  bool is_plane(const Bend& edge) const { return edge.count == 2 && edge.turn_deg < kMaxCoplanarTurnDeg; }
  bool is_bend(const Bend& edge) const { return edge.count == 2 && edge.turn_deg >= kMaxCoplanarTurnDeg && edge.turn_deg <= kMaxTurnDeg; }

  void find_edges() {
    std::map<std::array<std::int32_t, 2>, std::int32_t> number;  // ordered: deterministic numbering of new points
    for (const Triangle& t : surface_.triangles)
      for (int c = 0; c < 3; ++c) number[{std::min(t[c], t[(c + 1) % 3]), std::max(t[c], t[(c + 1) % 3])}];
    for (auto& [ends, place] : number) {
      place = static_cast<std::int32_t>(out_.edges.size());
      out_.edges.push_back({.ends = ends});
    }
    out_.corners_at.resize(surface_.points.size());
    for (std::size_t f = 0; f < surface_.triangles.size(); ++f) {
      const Triangle& t = surface_.triangles[f];
      out_.edges_of.emplace_back();
      for (int c = 0; c < 3; ++c) {
        const std::int32_t e = number.at({std::min(t[c], t[(c + 1) % 3]), std::max(t[c], t[(c + 1) % 3])});
        out_.edges_of.back()[c] = e;
        Bend& edge = out_.edges[e];
        if (edge.count < 2) edge.faces[edge.count] = static_cast<std::int32_t>(f);
        ++edge.count;
        out_.corners_at[t[c]].push_back(static_cast<std::int32_t>(3 * f) + c);
      }
    }
    for (Bend& edge : out_.edges) {
      if (edge.count != 2) continue;
      const Vec3 &a = out_.normals[edge.faces[0]], &b = out_.normals[edge.faces[1]];
      if (!(norm(a) > 0 && norm(b) > 0)) continue;
      edge.turn_deg = std::atan2(norm(cross(a, b)), dot(a, b)) * 180 / std::numbers::pi;
      edge.sharp = edge.turn_deg > sharp_angle_deg_;
      for (const std::int32_t v : surface_.triangles[edge.faces[1]])
        if (v != edge.ends[0] && v != edge.ends[1]) edge.sign = dot(a, at(v) - at(edge.ends[0])) > 0 ? -1 : 1;
    }
  }

  void find_panes() {
    auto& pane = out_.pane;
    pane.resize(surface_.triangles.size());
    std::iota(pane.begin(), pane.end(), 0);
    const auto find = [&](std::int32_t f) {
      while (pane[f] != f) f = pane[f] = pane[pane[f]];
      return f;
    };
    for (const Bend& edge : out_.edges)
      if (is_plane(edge)) {
        const std::int32_t a = find(edge.faces[0]), b = find(edge.faces[1]);
        pane[std::max(a, b)] = std::min(a, b);
      }
    for (std::size_t f = 0; f < pane.size(); ++f) pane[f] = find(static_cast<std::int32_t>(f));
  }

  void find_outlines() {
    place_.assign(surface_.triangles.size(), -1);
    for (const std::int32_t p : out_.pane) {
      if (place_[p] < 0) {
        place_[p] = static_cast<std::int32_t>(outlines_.size());
        outlines_.emplace_back();
      }
      ++outlines_[place_[p]].triangles;
    }
    for (std::size_t e = 0; e < out_.edges.size(); ++e) {
      const Bend& edge = out_.edges[e];
      if (is_plane(edge)) continue;
      for (int side = 0; side < std::min(edge.count, 2); ++side) {
        Outline& outline = outlines_[place_[pane_of(edge, side)]];
        outline.edges.push_back(static_cast<std::int32_t>(e));
        if (!is_bend(edge)) ++outline.sharp;
      }
    }
    for (std::int32_t p = 0; p < static_cast<std::int32_t>(place_.size()); ++p) {
      if (place_[p] < 0) continue;
      Outline& outline = outlines_[place_[p]];
      number_sides(outline);
      std::set<std::int32_t> neighbours;
      for (const std::int32_t e : outline.edges)
        if (is_bend(out_.edges[e])) neighbours.insert(pane_of(out_.edges[e], pane_of(out_.edges[e], 0) == p ? 1 : 0));
      outline.neighbours = static_cast<int>(neighbours.size());
    }
  }

  /// Walks around the outline and starts a new side at every corner.
  void number_sides(Outline& outline) const {
    const std::size_t n = outline.edges.size();
    if (n == 0) return;
    std::map<std::int32_t, std::vector<std::size_t>> at_point;
    for (std::size_t i = 0; i < n; ++i)
      for (const std::int32_t v : out_.edges[outline.edges[i]].ends) at_point[v].push_back(i);
    for (const auto& [v, around] : at_point)
      if (around.size() != 2) return;
    std::vector<std::size_t> order;
    std::vector<char> corner;  // at the start of each edge, in walking order
    std::size_t i = 0;
    std::int32_t v = out_.edges[outline.edges[0]].ends[0];
    do {
      const auto& [a, b] = out_.edges[outline.edges[i]].ends;
      const std::int32_t next = a == v ? b : a;
      const auto& around = at_point.at(v);
      const auto& [c, d] = out_.edges[outline.edges[around[0] == i ? around[1] : around[0]]].ends;
      const Vec3 in = calc_unit(at(v) - at(c == v ? d : c)), forth = calc_unit(at(next) - at(v));
      order.push_back(i);
      corner.push_back(dot(in, forth) < std::cos(kMinCornerTurnDeg * std::numbers::pi / 180));
      const auto& beyond = at_point.at(next);
      i = beyond[0] == i ? beyond[1] : beyond[0];
      v = next;
    } while (i != 0 && order.size() < n);
    if (order.size() != n) return;
    outline.sides = static_cast<int>(std::count(corner.begin(), corner.end(), 1));
    const std::size_t first = static_cast<std::size_t>(std::find(corner.begin(), corner.end(), 1) - corner.begin()) % n;
    outline.side.resize(n);
    int side = -1;
    for (std::size_t k = 0; k < n; ++k) {
      if (corner[(first + k) % n] || side < 0) ++side;
      outline.side[order[(first + k) % n]] = side;
    }
  }

  /// Edge at which a row that enters the pane by `entry` leaves it; -1 if none.
  std::int32_t find_exit(std::int32_t pane, std::int32_t entry) const {
    const Outline& outline = outline_of(pane);
    const Bend& from = out_.edges[entry];
    const Vec3 start = calc_middle(from);
    std::int32_t best = -1;
    double min = HUGE_VAL;
    const auto find_nearest = [&](int other_side) {
      for (std::size_t i = 0; i < outline.edges.size(); ++i) {
        if (outline.side[i] != other_side) continue;
        const double distance = norm(calc_middle(out_.edges[outline.edges[i]]) - start);
        if (distance < min) min = distance, best = outline.edges[i];
      }
      return best;
    };
    const std::size_t own = std::find(outline.edges.begin(), outline.edges.end(), entry) - outline.edges.begin();
    if (outline.sides == 4) return find_nearest((outline.side[own] + 2) % 4);
    if (outline.sides == 3) {  // one side on the rim: connect the other two
      std::array<bool, 3> rim{};
      for (std::size_t i = 0; i < outline.edges.size(); ++i)
        rim[outline.side[i]] = rim[outline.side[i]] || !is_bend(out_.edges[outline.edges[i]]);
      const int a = (outline.side[own] + 1) % 3, b = (outline.side[own] + 2) % 3;
      if (rim[a] != rim[b]) return find_nearest(rim[a] ? b : a);
    }
    const int side = pane_of(from, 0) == pane ? 0 : 1;
    const Vec3 along = calc_unit(at(from.ends[1]) - at(from.ends[0])), normal = out_.normals[from.faces[side]];
    Vec3 inward = calc_unit(cross(normal, along));
    for (const std::int32_t v : surface_.triangles[from.faces[side]])
      if (v != from.ends[0] && v != from.ends[1] && dot(inward, at(v) - start) < 0) inward = -1.0 * inward;
    for (const std::int32_t e : outline.edges) {
      if (e == entry) continue;
      const Vec3 a = at(out_.edges[e].ends[0]) - start, b = at(out_.edges[e].ends[1]) - start;
      const double qa = dot(along, a), qb = dot(along, b);
      if ((qa < 0) == (qb < 0)) continue;
      const double distance = dot(inward, a) + (dot(inward, b) - dot(inward, a)) * qa / (qa - qb);
      if (distance > 1e-9 * norm(a) && distance < min) min = distance, best = e;
    }
    return best;
  }

  /// Follows the panes from the edge to one side. `width`: of the narrower pane at the edge.
  void follow(std::int32_t start, int side, double width, Row& row) const {
    const Bend& first = out_.edges[start];
    std::int32_t entry = start, pane = pane_of(first, side);
    for (int n = 0; n < kMaxPanesPerSide; ++n) {
      const std::int32_t exit = find_exit(pane, entry);
      if (exit < 0) return;
      const Bend& edge = out_.edges[exit];
      if (calc_width(entry, exit) > kMaxWidthRatio * width) return;
      ++row.panes;
      const double ratio = edge.turn_deg / first.turn_deg;
      const Outline& outline = outline_of(pane);
      if (outline.sides > 4 && outline.neighbours > 4) return;  // a cap
      if (!is_bend(edge) || edge.sign != first.sign || ratio > kMaxTurnRatio || ratio < 1 / kMaxTurnRatio) return;
      ++row.bends;
      pane = pane_of(edge, pane_of(edge, 0) == pane ? 1 : 0);
      entry = exit;
    }
  }

  double calc_width(std::int32_t entry, std::int32_t exit) const {
    const Bend& from = out_.edges[entry];
    const Vec3 along = calc_unit(at(from.ends[1]) - at(from.ends[0]));
    return norm(cross(along, calc_middle(out_.edges[exit]) - calc_middle(from)));
  }

  /// Extent of the pane from the line of the edge.
  double calc_reach(std::int32_t pane, const Bend& edge) const {
    const Vec3 along = calc_unit(at(edge.ends[1]) - at(edge.ends[0]));
    double reach = 0;
    for (const std::int32_t e : outline_of(pane).edges)
      for (const std::int32_t v : out_.edges[e].ends) reach = std::max(reach, norm(cross(along, at(v) - at(edge.ends[0]))));
    return reach;
  }

  /// Turn of the smooth part's rim at each point on a sharp edge; sides of a pyramid meet in corners.
  void find_rim_turns() {
    std::map<std::int32_t, std::vector<std::int32_t>> along;
    for (const Bend& edge : out_.edges)
      if (!is_bend(edge) && !is_plane(edge)) along[edge.ends[0]].push_back(edge.ends[1]), along[edge.ends[1]].push_back(edge.ends[0]);
    for (const auto& [v, others] : along) rim_turn_deg_[v] = others.size() == 2 ? calc_turn(others[0], v, others[1]) : -1;
  }

  double calc_turn(std::int32_t before, std::int32_t v, std::int32_t next) const {
    const Vec3 in = at(v) - at(before), forth = at(next) - at(v);
    return std::atan2(norm(cross(in, forth)), dot(in, forth)) * 180 / std::numbers::pi;
  }

  /// Other end of the pane's sharp edge at v; -1 for none or two.
  std::int32_t find_rim(std::int32_t pane, std::int32_t v) const {
    std::int32_t found = -1;
    for (const std::int32_t e : outline_of(pane).edges) {
      const auto& [a, b] = out_.edges[e].ends;
      if (is_bend(out_.edges[e]) || (a != v && b != v)) continue;
      if (found >= 0) return -1;
      found = a == v ? b : a;
    }
    return found;
  }

  /// Least turn of the rim where a bend of the pane meets it; 0 if none does.
  double calc_rim_turn(std::int32_t pane) const {
    double min = HUGE_VAL;
    for (const std::int32_t e : outline_of(pane).edges) {
      const Bend& edge = out_.edges[e];
      if (!is_bend(edge)) continue;
      for (const std::int32_t v : edge.ends) {
        const auto found = rim_turn_deg_.find(v);
        if (found == rim_turn_deg_.end()) continue;
        double turn = found->second;
        if (turn < 0) {  // several sharp edges: use those of both panes
          const std::int32_t before = find_rim(pane_of(edge, 0), v), next = find_rim(pane_of(edge, 1), v);
          if (before < 0 || next < 0) continue;
          turn = calc_turn(before, v, next);
        }
        min = std::min(min, turn);
      }
    }
    return min < HUGE_VAL ? min : 0;
  }

  /// True for a single triangle without a side on a sharp edge, or with one.
  bool is_facet(std::int32_t pane) const { return outline_of(pane).triangles == 1 && outline_of(pane).sharp <= 1; }

  static std::array<std::int32_t, 2> make_pair(std::int32_t a, std::int32_t b) { return {std::min(a, b), std::max(a, b)}; }

  /// Longest row across the common line of two panes.
  void find_rows() {
    for (std::size_t e = 0; e < out_.edges.size(); ++e) {
      const Bend& edge = out_.edges[e];
      if (!is_bend(edge)) continue;
      const std::array<std::int32_t, 2> panes{pane_of(edge, 0), pane_of(edge, 1)};
      if (is_facet(panes[0]) || is_facet(panes[1])) continue;
      Row& longest = rows_[make_pair(panes[0], panes[1])];
      if (longest.panes >= kMinArcPanes) continue;
      const auto place = static_cast<std::int32_t>(e);
      double width = HUGE_VAL;
      for (int side = 0; side < 2; ++side)
        if (const std::int32_t exit = find_exit(panes[side], place); exit >= 0) width = std::min(width, calc_width(place, exit));
      Row row;
      for (int side = 0; side < 2; ++side) follow(place, side, width, row);
      if (row.panes > longest.panes) longest = row;
    }
  }

  void judge(Bend& edge) const {
    const std::array<std::int32_t, 2> panes{pane_of(edge, 0), pane_of(edge, 1)};
    // A polygon inside a smooth part: not produced by strips or nets.
    const auto is_polygon = [&](int side) {
      const Outline& outline = outline_of(panes[side]);
      return outline.sides > 4 && outline.sharp == 0;
    };
    if (is_polygon(0) && is_polygon(1)) {
      edge.sharp = true;
      return;
    }
    if (const auto row = rows_.find(make_pair(panes[0], panes[1])); row != rows_.end() && row->second.panes < kMinArcPanes) {
      edge.sharp = true;
      edge.doubtful = edge.turn_deg <= sharp_angle_deg_ && row->second.bends + row->second.panes >= kMinDoubtfulArcLength;
      return;
    }
    // A shallow pyramid turns less at its edges than its outline.
    const double turn = std::max(edge.turn_deg, std::min(outline_of(panes[0]).rim_turn_deg, outline_of(panes[1]).rim_turn_deg));
    edge.sharp = turn > sharp_angle_deg_;
    edge.doubtful = turn > kMaxCircleTurnDeg && turn <= kMaxTurnDeg;
    if (edge.sharp) return;
    std::array<double, 2> reach{};
    for (int side = 0; side < 2; ++side) reach[side] = calc_reach(panes[side], edge);
    for (int side = 0; side < 2; ++side)
      if (reach[side] > kMaxWidthRatio * reach[1 - side] || is_polygon(side)) edge.straight = side;
  }

  const TriangleSurface& surface_;
  double sharp_angle_deg_;
  Bends out_;
  std::vector<std::int32_t> place_;  // (T) index of the pane's outline
  std::vector<Outline> outlines_;
  std::map<std::int32_t, double> rim_turn_deg_;
  std::map<std::array<std::int32_t, 2>, Row> rows_;  // by pane pair
};

}  // namespace

Bends find_bends(const TriangleSurface& surface, double sharp_angle_deg) { return Judge(surface, sharp_angle_deg).judge(); }

bool is_tip(const TriangleSurface& surface, const Bends& bends, std::int32_t v, const Vec3& normal) {
  constexpr double kMinSlopeRad = 0.05;         // radians; 3 degrees
  constexpr double kMaxFurtherTurnRatio = 0.4;  // of the slope: on a ball the next edge turns by twice this
  const auto at = [&](std::int32_t n) -> const Vec3& { return surface.points[n]; };
  double all = 0;
  std::map<std::int32_t, int> panes;
  for (const std::int32_t corner : bends.corners_at[v]) {
    // Through the pane to its far side, across coplanar triangles.
    std::int32_t f = corner / 3, e = bends.edges_of[f][(corner % 3 + 1) % 3];
    const Vec3 away = calc_unit(0.5 * (at(bends.edges[e].ends[0]) + at(bends.edges[e].ends[1])) - at(v));
    const double slope = -dot(away, normal);
    if (std::abs(slope) < kMinSlopeRad || slope * all < 0) return false;
    all += slope;
    ++panes[bends.pane[f]];
    const Vec3 sideways = cross(bends.normals[f], away);
    for (std::size_t n = 0; n < bends.pane.size() && bends.edges[e].count == 2 && bends.edges[e].turn_deg < kMaxCoplanarTurnDeg; ++n) {
      f = bends.edges[e].faces[bends.edges[e].faces[0] == f ? 1 : 0];
      std::int32_t next = -1;
      for (const std::int32_t other : bends.edges_of[f]) {
        const auto& [a, b] = bends.edges[other].ends;
        if (other != e && (dot(sideways, at(a) - at(v)) < 0) != (dot(sideways, at(b) - at(v)) < 0)) next = other;
      }
      if (next < 0) break;
      e = next;
    }
    const Bend& edge = bends.edges[e];
    if (edge.sharp || edge.turn_deg < kMaxCoplanarTurnDeg) continue;
    if (edge.sign * slope > 0 && edge.turn_deg * std::numbers::pi / 180 > kMaxFurtherTurnRatio * std::asin(std::min(std::abs(slope), 1.0)))
      return false;
  }
  return panes.size() > 2;
}

}  // namespace carillon::mesher
