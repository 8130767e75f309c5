// Method: prisms between two offset copies of the skin, each cut into three tetrahedra by a point order. Offsets follow the normals, at
//   folds the mitre. Mid-side nodes of skin edges lie on the true surface (or on the arc between the normals) and are offset along the mean
//   direction, corrected to keep the wall thickness; vertical edges are halved; diagonals get the mean of the edges above and below, so
//   that prism sides are ruled.
// Source: Dompierre, Labbe, Vallet and Camarero, "How to subdivide pyramids, prisms and hexahedra into tetrahedra", 8th International
//   Meshing Roundtable, 1999 (diagonals); Vlachos, Peters, Boyd and Mitchell, "Curved PN triangles", I3D 2001 (arcs).
#include "precompute/mesher/extrude.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <unordered_map>
#include <utility>

#include "precompute/mesh/curved.hpp"
#include "runtime/base/sort_order.hpp"

namespace carillon::mesher {
namespace {

constexpr double kMaxMitre = 4;              // over the thickness: folds of 29 degrees between the sides
constexpr double kMinAreaRatio = 0.05;       // least ratio of a triangle's areas on the two sides of the wall
constexpr double kMinNormalCosine = 0.9998;  // cosine of 1.1 degrees
constexpr int kSmoothings = 30;

/// Shortest correction of `way` with the components `wanted` along the unit normals.
Vec3 correct_way(Vec3 way, const std::vector<Vec3>& normals, double wanted) {
  Mat3 matrix{};
  constexpr double kRegularisation = 1e-6;  // regularisation for directions without a normal; the iterations compensate for it
  for (int i = 0; i < 3; ++i) matrix[i][i] = kRegularisation;
  for (const Vec3& n : normals)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) matrix[i][j] += n[i] * n[j];
  const Mat3 inverse = calc_inverse(matrix);
  for (int n = 0; n < 3; ++n) {
    Vec3 right{};
    for (const Vec3& normal : normals) right = right + (wanted - dot(way, normal)) * normal;
    way = way + inverse * right;
  }
  return way;
}

/// Distinct normals at each point.
std::vector<std::vector<Vec3>> find_point_normals(const Skin& skin, const std::vector<std::array<Vec3, 3>>& normals) {
  std::vector<std::vector<Vec3>> at(skin.surface.points.size());
  for (std::size_t f = 0; f < normals.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      auto& own = at[skin.surface.triangles[f][c]];
      const Vec3& n = normals[f][c];
      if (norm(n) > 0 && std::none_of(own.begin(), own.end(), [&](const Vec3& m) { return dot(m, n) > kMinNormalCosine; }))
        own.push_back(n);
    }
  return at;
}

std::vector<Vec3> find_ways_out(const Skin& skin, const std::vector<std::array<Vec3, 3>>& normals) {
  std::vector<Vec3> out;
  const auto at = find_point_normals(skin, normals);
  for (std::size_t v = 0; v < at.size(); ++v) {
    const Vec3 way = correct_way({}, at[v], 1);
    if (const double length = norm(way); length > kMaxMitre)
      throw WallError(
          fmt::format("cannot be mitred at {}: the surface is folded there to {:.0f} degrees between its sides, and {:.0f} are the least",
                      format_place(skin.surface.points[v]), 2 * std::asin(1 / length) * 180 / std::numbers::pi,
                      2 * std::asin(1 / kMaxMitre) * 180 / std::numbers::pi));
    out.push_back(way);
  }
  for (const MitrePoint& point : skin.mitre_points) point.interpolate(out);
  return out;
}

struct Middle {
  Vec3 at{}, way{};  // on the skin; offset direction
};

class Extruder {
 public:
  Extruder(const Skin& skin, const Wall& wall) : skin_(skin), wall_(wall), normals_(find_skin_normals(skin)) {
    ways_ = find_ways_out(skin, normals_);
    if (!wall_.low_m.empty()) {
      wall_.levels_m.clear();
      for (std::size_t v = 0; v < count(); ++v) {
        // Scaled so that the component along the normal, or the largest one at a fold, is one.
        const Vec3 way = skin.surface.points[v] - wall.low_m[v];
        const double part = dot(way, ways_[v]) / dot(ways_[v], ways_[v]);
        const double thickness = part > 0 ? part : norm(way);
        if (thickness > 0) ways_[v] = (1 / thickness) * way;
        wall_.levels_m.push_back({-thickness, 0});
      }
    }
    rank_points();
    smooth_ways();
  }

  Extruded run() {
    measure();
    make_prisms();
    find_edges();
    if (wall_.order == 2) {
      make_middles();
      result_.straightened = wall_.straight ? 0 : mesh::straighten_folded_elements(result_.mesh);
    }
    name_nodes();
    return std::move(result_);
  }

 private:
  std::size_t count() const { return skin_.surface.points.size(); }
  double level(std::size_t v, double part) const { return wall_.levels_m[v][0] + part * (wall_.levels_m[v][1] - wall_.levels_m[v][0]); }
  Vec3 find_at(std::int32_t v, double part) const { return skin_.surface.points[v] + level(static_cast<std::size_t>(v), part) * ways_[v]; }
  double calc_volume(const std::array<Vec3, 4>& x) const { return dot(cross(x[1] - x[0], x[2] - x[0]), x[3] - x[0]); }

  /// Tetrahedra of the prism over a triangle: points in ascending order, and which corners are high.
  static constexpr std::array<std::array<std::array<int, 2>, 4>, 3> kCut{
      {{{{0, 0}, {1, 0}, {2, 0}, {2, 1}}}, {{{0, 0}, {1, 0}, {2, 1}, {1, 1}}}, {{{0, 0}, {0, 1}, {1, 1}, {2, 1}}}}};

  Triangle sort(Triangle t, bool& odd) const {
    odd = false;
    for (const auto& [i, j] : {std::pair{0, 1}, std::pair{1, 2}, std::pair{0, 1}})
      if (rank_[t[i]] > rank_[t[j]]) std::swap(t[i], t[j]), odd = !odd;
    return t;
  }

  /// Point order that cuts the prisms: first points whose offsets diverge (ridges), last those whose offsets converge, so that diagonals of
  /// leaning sides are the short ones.
  void rank_points() {
    std::vector<double> lean(count(), 0);
    for (const Triangle& t : skin_.surface.triangles)
      for (int c = 0; c < 3; ++c)
        for (const int side : {1, 2}) {
          const Vec3 edge = skin_.surface.points[t[(c + side) % 3]] - skin_.surface.points[t[c]];
          lean[t[c]] += dot(ways_[t[c]], edge) / norm(edge);
        }
    constexpr double kLeans = 0.5;
    std::vector<double> classes;
    for (const double l : lean) classes.push_back(l < -kLeans ? 0 : l > kLeans ? 2 : 1);
    for (const MitrePoint& point : skin_.mitre_points) point.interpolate(classes);
    const auto order = base::find_sort_order(classes);
    rank_.resize(count());
    for (std::size_t n = 0; n < order.size(); ++n) rank_[order[n]] = static_cast<std::int32_t>(n);
  }

  /// True if the sides of the wall over the triangle are correctly oriented and no tetrahedron is flat.
  bool is_sound(const Triangle& triangle) const {
    std::array<Vec3, 2> area;
    for (int side = 0; side < 2; ++side)
      area[side] = cross(find_at(triangle[1], side) - find_at(triangle[0], side), find_at(triangle[2], side) - find_at(triangle[0], side));
    const double low = norm(area[0]), high = norm(area[1]);
    if (!(dot(area[0], area[1]) > 0.5 * low * high) || std::min(low, high) < kMinAreaRatio * std::max(low, high)) return false;
    bool odd = false;
    const Triangle t = sort(triangle, odd);
    for (int layer = 0; layer < wall_.layers; ++layer)
      for (const auto& cut : kCut) {
        std::array<Vec3, 4> x;
        double longest = 0;
        for (int c = 0; c < 4; ++c) x[c] = find_at(t[cut[c][0]], (layer + cut[c][1]) / static_cast<double>(wall_.layers));
        for (int c = 0; c < 4; ++c)
          for (int k = 0; k < c; ++k) longest = std::max(longest, norm(x[c] - x[k]));
        if (!((odd ? -1 : 1) * calc_volume(x) > 1e-6 * longest * longest * longest)) return false;
      }
    return true;
  }

  /// Smooths offset directions at folded prisms; refuses prisms that stay folded.
  void smooth_ways() {
    std::vector<char> fixed(count(), 0);
    for (const auto& [a, b] : skin_.folds) fixed[a] = fixed[b] = 1;
    for (int n = 0;; ++n) {
      std::vector<char> bad(count(), 0);
      const Triangle* first = nullptr;
      std::int64_t faults = 0;
      for (const Triangle& t : skin_.surface.triangles) {
        if (is_sound(t)) continue;
        if (first == nullptr) first = &t;
        ++faults;
        for (const std::int32_t v : t) bad[v] = 1;
      }
      if (first == nullptr) return;
      if (n == kSmoothings) {
        const Vec3 middle =
            (1.0 / 3) * (skin_.surface.points[(*first)[0]] + skin_.surface.points[(*first)[1]] + skin_.surface.points[(*first)[2]]);
        const std::size_t v = (*first)[0];
        throw WallError(fmt::format("is too thick for the bend of the surface at {}: {:.3g} mm fold over there{}", format_place(middle),
                                    1000 * (wall_.levels_m[v][1] - wall_.levels_m[v][0]),
                                    faults > 1 ? fmt::format(", and at {} more triangles", faults - 1) : ""));
      }
      std::vector<Vec3> sum(count(), Vec3{});
      std::vector<double> weight(count(), 0);
      for (const Triangle& t : skin_.surface.triangles)
        for (int c = 0; c < 3; ++c)
          for (const int side : {1, 2}) {
            sum[t[c]] = sum[t[c]] + ways_[t[(c + side) % 3]];
            ++weight[t[c]];
          }
      for (std::size_t v = 0; v < count(); ++v)
        if (bad[v] != 0 && fixed[v] == 0) ways_[v] = 0.5 * (ways_[v] + (1 / weight[v]) * sum[v]);
    }
  }

  void measure() {
    const auto at = find_point_normals(skin_, normals_);
    double sum = 0;
    result_.thickness_min_m = HUGE_VAL;
    for (std::size_t v = 0; v < count(); ++v) {
      double part = HUGE_VAL;
      for (const Vec3& n : at[v]) part = std::min(part, dot(n, ways_[v]));
      if (at[v].empty()) continue;
      const double thickness = part * (wall_.levels_m[v][1] - wall_.levels_m[v][0]);
      result_.thickness_min_m = std::min(result_.thickness_min_m, thickness);
      result_.thickness_max_m = std::max(result_.thickness_max_m, thickness);
      sum += thickness;
    }
    result_.thickness_mean_m = sum / static_cast<double>(count());
  }

  void make_prisms() {
    mesh::TetMesh& mesh = result_.mesh;
    mesh.order = 1;
    const auto points = static_cast<std::int32_t>(count());
    for (int l = 0; l <= wall_.layers; ++l)
      for (std::int32_t v = 0; v < points; ++v) mesh.nodes_m.push_back(find_at(v, l / static_cast<double>(wall_.layers)));
    for (const Triangle& triangle : skin_.surface.triangles) {
      bool odd = false;
      const Triangle t = sort(triangle, odd);
      for (int l = 0; l < wall_.layers; ++l)
        for (const auto& cut : kCut) {
          std::array<std::int32_t, 4> tet;
          std::array<Vec3, 4> x;
          for (int c = 0; c < 4; ++c) {
            tet[c] = (l + cut[c][1]) * points + t[cut[c][0]];
            x[c] = mesh.nodes_m[tet[c]];
          }
          const double volume = calc_volume(x);
          if (volume < 0) std::swap(tet[0], tet[1]);
          result_.expected_volume_m3 += std::abs(volume) / 6;
          mesh.tets.insert(mesh.tets.end(), tet.begin(), tet.end());
          mesh.regions.push_back(0);
        }
    }
  }

  void find_edges() {
    for (const Triangle& t : skin_.surface.triangles)
      for (int c = 0; c < 3; ++c) {
        const std::int32_t a = t[c], b = t[(c + 1) % 3];
        if (place_of_.try_emplace(make_edge(a, b), static_cast<std::int32_t>(result_.edges.size())).second)
          result_.edges.push_back(make_edge(a, b));
      }
  }

  /// Tangents along folds and borders for their arcs: at points with two of them and no corner, by the circle through three points.
  std::map<std::int32_t, std::vector<std::int32_t>> find_chains() const {
    std::map<std::int32_t, std::vector<std::int32_t>> along;
    for (const std::vector<Edge>* edges : std::array{&skin_.folds, &std::as_const(border_)})
      for (const auto& [a, b] : *edges) {
        along[a].push_back(b);
        along[b].push_back(a);
      }
    return along;
  }

  Vec3 calc_tangent(const std::vector<std::int32_t>& others, std::int32_t v, std::int32_t to) const {
    if (others.size() != 2) return {};
    const auto& p = skin_.surface.points;
    const Vec3 in = p[v] - p[others[0] == to ? others[1] : others[0]], out = p[to] - p[v];
    if (dot(in, out) < 0.76 * norm(in) * norm(out)) return {};
    const Vec3 tangent = (norm(out) / norm(in)) * in + (norm(in) / norm(out)) * out;
    return normalise(tangent);
  }

  std::vector<Middle> find_middles() {
    border_ = find_border(skin_.surface);
    std::unordered_map<Edge, char, EdgeHash> features;
    for (const std::vector<Edge>* edges : std::array{&skin_.folds, &std::as_const(border_)})
      for (const auto& [a, b] : *edges) features[make_edge(a, b)] = 1;
    const auto along = find_chains();
    const auto& p = skin_.surface.points;
    struct Side {
      Vec3 low, high;  // normals at the ends of the edge
    };
    std::vector<std::vector<Side>> sides(result_.edges.size());
    for (std::size_t f = 0; f < normals_.size(); ++f)
      for (int c = 0; c < 3; ++c) {
        const std::int32_t a = skin_.surface.triangles[f][c], b = skin_.surface.triangles[f][(c + 1) % 3];
        Side side{normals_[f][c], normals_[f][(c + 1) % 3]};
        if (a > b) std::swap(side.low, side.high);
        sides[place_of_.at(make_edge(a, b))].push_back(side);
      }
    std::vector<Middle> middles(result_.edges.size());
    for (std::size_t e = 0; e < middles.size(); ++e) {
      const auto [a, b] = result_.edges[e];
      const Vec3 chord = p[b] - p[a];
      const double square = dot(chord, chord), length = std::sqrt(square);
      const bool is_fold = features.contains(make_edge(a, b));
      Middle& m = middles[e];
      m.at = 0.5 * (p[a] + p[b]);
      Vec3 bulge{};
      std::vector<Vec3> across;  // per side, normal at the middle
      double wanted = 0;
      for (const Side& side : sides[e]) {
        const Vec3 sum = side.low + side.high;
        across.push_back(normalise(sum - (dot(chord, sum) / square) * chord));
        bulge = bulge - (dot(chord, side.low) / 8) * side.low + (dot(chord, side.high) / 8) * side.high;
        wanted += 0.5 * (dot(ways_[a], side.low) + dot(ways_[b], side.high));
      }
      const auto sided = static_cast<double>(sides[e].size());
      bulge = (1 / sided) * bulge;
      if (is_fold) {
        Vec3 from = calc_tangent(along.at(a), a, b), to = -1.0 * calc_tangent(along.at(b), b, a);
        const auto mirror = [&](const Vec3& t) { return (2 * dot(t, chord) / square) * chord - t; };
        if (!(norm(from) > 0) && norm(to) > 0) from = mirror(to);
        if (!(norm(to) > 0) && norm(from) > 0) to = mirror(from);
        bulge = (length / 8) * (from - to);
      }
      constexpr double kMaxBulge = 0.2;
      if (norm(bulge) > kMaxBulge * length) bulge = {};
      if (wall_.middle) {
        const Vec3 found = wall_.middle(m.at, is_fold);
        m.at = norm(found - m.at) < kMaxBulge * length ? found : m.at + bulge;
      } else {
        m.at = m.at + bulge;
      }
      if (across.size() == 2 && dot(across[0], across[1]) > kMinNormalCosine) across.pop_back();
      Vec3 way = 0.5 * (ways_[a] + ways_[b]);
      // Rotated by the arc, with the length at the ends.
      way = correct_way(way, across, wanted / sided);
      const double longest = 1.1 * std::max(norm(ways_[a]), norm(ways_[b]));
      m.way = norm(way) > longest ? (longest / norm(way)) * way : way;
    }
    return middles;
  }

  void make_middles() {
    mesh::TetMesh& mesh = result_.mesh;
    mesh.order = 2;
    const std::vector<Middle> middles = wall_.straight ? std::vector<Middle>{} : find_middles();
    const auto points = static_cast<std::int32_t>(count());
    std::unordered_map<Edge, std::int32_t, EdgeHash> made;
    std::vector<std::int32_t> tets;
    tets.reserve(mesh.tets.size() / 4 * 10);
    const auto find_middle = [&](std::int32_t i, std::int32_t j) -> Vec3 {
      const std::int32_t a = i % points, b = j % points;
      if (wall_.straight || a == b) return 0.5 * (mesh.nodes_m[i] + mesh.nodes_m[j]);
      const Middle& m = middles[place_of_.at(make_edge(a, b))];
      Vec3 sum{};
      for (const std::int32_t node : {i, j}) {  // on the level of each end
        const double part = (node / points) / static_cast<double>(wall_.layers);
        const double level_m = 0.5 * (level(static_cast<std::size_t>(a), part) + level(static_cast<std::size_t>(b), part));
        Vec3 at = m.at + level_m * m.way;
        if (part == 0 && wall_.low_middle) {
          const Vec3 found = wall_.low_middle(at);
          if (norm(found - at) < 0.2 * norm(skin_.surface.points[a] - skin_.surface.points[b])) at = found;
        }
        sum = sum + 0.5 * at;
      }
      return sum;
    };
    for (std::size_t e = 0; e < mesh.tets.size() / 4; ++e) {
      const std::int32_t* corner = &mesh.tets[4 * e];
      tets.insert(tets.end(), corner, corner + 4);
      for (const auto& [i, j] : mesh::kEdges) {
        const auto [found, fresh] = made.try_emplace(make_edge(corner[i], corner[j]), static_cast<std::int32_t>(mesh.nodes_m.size()));
        if (fresh) {
          const Vec3 at = find_middle(corner[i], corner[j]);
          mesh.nodes_m.push_back(at);
        }
        tets.push_back(found->second);
      }
    }
    mesh.tets = std::move(tets);
    made_ = std::move(made);
    for (const auto& [a, b] : result_.edges)
      result_.mid_nodes.push_back({made_.at(make_edge(wall_.layers * points + a, wall_.layers * points + b)), made_.at(make_edge(a, b))});
  }

  void name_nodes() {
    const auto points = static_cast<std::int32_t>(count());
    auto& sets = result_.mesh.node_sets;
    for (std::int32_t v = 0; v < points; ++v) {
      sets["inner"].push_back(v);
      sets["outer"].push_back(wall_.layers * points + v);
    }
    for (const auto& [high, low] : result_.mid_nodes) {
      sets["outer"].push_back(high);
      sets["inner"].push_back(low);
    }
    border_ = find_border(skin_.surface);
    if (!border_.empty()) {
      std::unordered_map<Edge, char, EdgeHash> columns;  // border edges, and points on them
      for (const auto& [a, b] : border_) columns[make_edge(a, b)] = columns[make_edge(a, a)] = columns[make_edge(b, b)] = 1;
      auto& rim = sets["rim"];
      for (std::int32_t node = 0; node < points * (wall_.layers + 1); ++node)
        if (columns.contains(make_edge(node % points, node % points))) rim.push_back(node);
      for (const auto& [ends, node] : made_)
        if (columns.contains(make_edge(ends[0] % points, ends[1] % points))) rim.push_back(node);
    }
    for (auto& [name, nodes] : sets) {
      std::sort(nodes.begin(), nodes.end());
      nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    }
  }

  const Skin& skin_;
  Wall wall_;
  std::vector<std::array<Vec3, 3>> normals_;
  std::vector<Vec3> ways_;
  std::vector<std::int32_t> rank_;  // position of each point in the cutting order
  std::vector<Edge> border_;
  std::unordered_map<Edge, std::int32_t, EdgeHash> place_of_, made_;  // skin edges; mid nodes by their ends
  Extruded result_;
};

}  // namespace

std::vector<Vec3> find_ways_out(const Skin& skin) { return find_ways_out(skin, find_skin_normals(skin)); }

Extruded extrude(const Skin& skin, const Wall& wall) { return Extruder(skin, wall).run(); }

}  // namespace carillon::mesher
