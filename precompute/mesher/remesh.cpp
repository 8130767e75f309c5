// Method: edges longer than 4/3 of the target are split, shorter than 4/5 collapsed (unless a triangle would flip); flips towards valence
//   six; tangential smoothing with projection onto the surface, along folds for fold points; final Delaunay flips. The target length
//   follows the curvature at the triangle scale, ignoring finer detail, and is graded.
// Source: Botsch and Kobbelt, "A remeshing approach to multiresolution modeling", SGP 2004 (uniform length).
#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include "precompute/mesher/skin_editor.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesher {
namespace {

constexpr double kSplitLengthRatio = 4.0 / 3, kCollapseLengthRatio = 4.0 / 5;
constexpr int kSweeps = 8;
constexpr double kGrowth = 0.4;                            // of the target length, per length
constexpr double kMinMitreCosine = 0.98, kPerMitre = 1.3;  // cosine of a fold without a mitre; edges over the width of their mitre

/// Lengthens edges at folds to the width of their mitres.
void widen_folds(const Skin& now, const SkinSizes& sizes, std::vector<double>& size) {
  std::unordered_map<Edge, Vec3, EdgeHash> first;
  std::vector<double> least(size.size(), 0);
  EdgeSet folds;
  for (const auto& [a, b] : now.folds) folds.insert(make_edge(a, b));
  const auto& p = now.surface.points;
  for (const Triangle& t : now.surface.triangles)
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = t[c], b = t[(c + 1) % 3];
      if (!folds.contains(make_edge(a, b))) continue;
      const Vec3 normal = calc_unit(cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]));
      const auto [found, fresh] = first.try_emplace(make_edge(a, b), normal);
      if (fresh) continue;
      const double cosine = std::clamp(dot(normal, found->second), -0.99, 1.0);
      const double takes = sizes.reach_m * std::sqrt((1 - cosine) / (1 + cosine)) + sizes.margin_m;
      if (cosine > kMinMitreCosine) continue;
      for (const std::int32_t v : {a, b}) least[v] = std::max(least[v], kPerMitre * takes);
    }
  for (int sweep = 0; sweep < 3; ++sweep)
    for (const Triangle& t : now.surface.triangles)
      for (int c = 0; c < 3; ++c)
        for (const int side : {1, 2}) {
          const std::int32_t a = t[c], b = t[(c + side) % 3];
          const double way = norm(p[b] - p[a]);
          // Constant within the mitre, then decreasing.
          least[b] = std::max(least[b], least[a] - kGrowth * std::max(way - 0.5 * least[a], 0.0) - (way > least[a] ? way : 0));
        }
  for (std::size_t v = 0; v < size.size(); ++v) size[v] = std::max(size[v], least[v]);
}

/// Target edge length at each point, by the curvature of the triangles.
std::vector<double> find_sizes(const Skin& now, const SkinSizes& sizes) {
  const auto normals = find_skin_normals(now);
  std::vector<double> bend(now.surface.points.size(), 0), weight(bend.size(), 0);
  for (std::size_t f = 0; f < normals.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = now.surface.triangles[f][c], b = now.surface.triangles[f][(c + 1) % 3];
      const Vec3 way = now.surface.points[b] - now.surface.points[a];
      const double square = dot(way, way);
      if (!(square > 0)) continue;
      const double curvature = std::abs(dot(normals[f][(c + 1) % 3] - normals[f][c], way)) / square;
      bend[a] = std::max(bend[a], curvature);
      bend[b] = std::max(bend[b], curvature);
    }
  // Curvature at a single point is noise.
  std::vector<double> mean(bend.size(), 0);
  for (const Triangle& t : now.surface.triangles)
    for (int c = 0; c < 3; ++c) {
      mean[t[c]] += bend[t[(c + 1) % 3]] + bend[t[(c + 2) % 3]];
      weight[t[c]] += 2;
    }
  std::vector<double> size(bend.size());
  for (std::size_t v = 0; v < bend.size(); ++v) {
    const double curvature = weight[v] > 0 ? std::min(bend[v], 1.3 * mean[v] / weight[v]) : bend[v];
    size[v] = std::clamp(curvature > 0 ? sizes.per_radius / curvature : sizes.largest_m, sizes.smallest_m, sizes.largest_m);
  }
  for (int sweep = 0; sweep < 10; ++sweep)
    for (const Triangle& t : now.surface.triangles)
      for (int c = 0; c < 3; ++c) {
        const std::int32_t a = t[c], b = t[(c + 1) % 3];
        const double step = kGrowth * norm(now.surface.points[b] - now.surface.points[a]);
        size[a] = std::min(size[a], size[b] + step);
        size[b] = std::min(size[b], size[a] + step);
      }
  if (sizes.reach_m > 0) widen_folds(now, sizes, size);
  return size;
}

/// Edges longer (sign 1) or shorter (sign -1) than `limit` times their target; longest or shortest first.
std::vector<std::pair<double, Edge>> list_outside(const SkinEditor& skin, double limit, int sign) {
  std::vector<std::pair<double, Edge>> edges;
  for (const Edge& e : skin.list_edges())
    if (const double part = skin.calc_part(e); sign * (part - limit) > 0) edges.emplace_back(-sign * part, e);
  std::sort(edges.begin(), edges.end());
  return edges;
}

void split_long(SkinEditor& skin) {
  const auto& x = skin.get_points();
  for (int round = 0; round < 12; ++round) {
    const auto edges = list_outside(skin, kSplitLengthRatio, 1);
    if (edges.empty()) return;
    // One edge per triangle and round, the longest, keeps the shapes.
    std::vector<char> busy(skin.count_triangles(), 0);
    for (const auto& [order, e] : edges) {
      std::array<std::int32_t, 2> faces{};
      const int count = skin.find_faces(e[0], e[1], faces);
      bool is_free = count > 0;
      for (int n = 0; n < count; ++n) is_free = is_free && busy[faces[n]] == 0;
      if (!is_free) continue;
      for (int n = 0; n < count; ++n) busy[faces[n]] = 1;
      skin.split(e[0], e[1], skin.place(0.5 * (x[e[0]] + x[e[1]]), skin.is_feature(e[0], e[1])));
      busy.resize(skin.count_triangles(), 1);
    }
  }
}

void collapse_short(SkinEditor& skin) {
  const auto& x = skin.get_points();
  for (int round = 0; round < 6; ++round) {
    const auto edges = list_outside(skin, kCollapseLengthRatio, -1);
    std::size_t done = 0;
    for (const auto& [order, e] : edges) {
      if (skin.get_star(e[0]).empty() || skin.get_star(e[1]).empty()) continue;
      std::array<std::int32_t, 2> faces{};
      if (skin.find_faces(e[0], e[1], faces) == 0) continue;
      if (norm(x[e[1]] - x[e[0]]) < kCollapseLengthRatio * skin.calc_wanted(e[0], e[1]))
        done += skin.collapse(e[0], e[1], kSplitLengthRatio);
    }
    if (done == 0) return;
  }
}

void flip_to_valence(SkinEditor& skin) {
  const auto calc_excess = [&](std::int32_t v, int change) {
    bool on_border = false;
    if (skin.get_kind(v) != SkinEditor::kInside)
      for (const std::int32_t f : skin.get_star(v))
        for (const std::int32_t w : skin.get_triangle(f)) on_border = on_border || (w != v && skin.is_border(v, w));
    const int valence = static_cast<int>(skin.get_star(v).size()) + (on_border ? 1 : 0) + change - (on_border ? 4 : 6);
    return valence * valence;
  };
  for (const auto& [p, q] : skin.list_edges()) {
    const std::optional<Quad> quad = skin.find_quad(p, q);
    if (!quad) continue;
    const auto& [a, b, c, d, faces] = *quad;
    const int before = calc_excess(a, 0) + calc_excess(b, 0) + calc_excess(c, 0) + calc_excess(d, 0);
    const int after = calc_excess(a, -1) + calc_excess(b, -1) + calc_excess(c, 1) + calc_excess(d, 1);
    if (after < before) skin.flip(*quad);
  }
}

void flip_to_delaunay(SkinEditor& skin) {
  const auto& x = skin.get_points();
  const auto calc_angle = [&](std::int32_t at, std::int32_t a, std::int32_t b) {
    const Vec3 p = x[a] - x[at], q = x[b] - x[at];
    return std::atan2(norm(cross(p, q)), dot(p, q));
  };
  for (int round = 0; round < 10; ++round) {
    bool again = false;
    for (const auto& [p, q] : skin.list_edges()) {
      const std::optional<Quad> quad = skin.find_quad(p, q);
      if (!quad || skin.would_join_folds(*quad)) continue;
      const auto& [a, b, c, d, faces] = *quad;
      if (calc_angle(c, a, b) + calc_angle(d, a, b) > std::numbers::pi + 1e-9) again = skin.flip(*quad) || again;
    }
    if (!again) return;
  }
}

void relax(SkinEditor& skin) {
  const auto& x = skin.get_points();
  std::vector<Vec3> wanted(x.size());
  std::vector<char> moves(x.size(), 0);
  for (std::int32_t v = 0; v < static_cast<std::int32_t>(x.size()); ++v) {
    if (skin.get_star(v).empty() || skin.get_kind(v) == SkinEditor::kFixed) continue;
    Vec3 sum{}, normal{};
    double weights = 0;
    if (skin.get_kind(v) == SkinEditor::kOnFold) {
      std::array<std::int32_t, 2> ends{-1, -1};
      for (const std::int32_t f : skin.get_star(v))
        for (const std::int32_t w : skin.get_triangle(f))
          if (w != v && skin.is_feature(v, w)) {
            if (ends[0] < 0)
              ends[0] = w;
            else if (w != ends[0])
              ends[1] = w;
          }
      if (ends[1] < 0) continue;
      // Equal parts in target lengths.
      const double wa = 1 / skin.calc_wanted(v, ends[0]), wb = 1 / skin.calc_wanted(v, ends[1]);
      const double la = norm(x[ends[0]] - x[v]), lb = norm(x[ends[1]] - x[v]);
      const double off = 0.5 * (lb * wb - la * wa) / std::max(wa, wb);  // towards ends[1]
      wanted[v] = x[v] + 0.5 * off * calc_unit(off > 0 ? x[ends[1]] - x[v] : x[v] - x[ends[0]]);
      moves[v] = 1;
      continue;
    }
    for (const std::int32_t f : skin.get_star(v)) {
      const Triangle& t = skin.get_triangle(f);
      const Vec3 area = skin.calc_area(t);
      double size = 0;
      for (const std::int32_t w : t) size += skin.get_size(w) / 3;
      const double weight = norm(area) / (size * size);
      sum = sum + (weight / 3) * (x[t[0]] + x[t[1]] + x[t[2]]);
      weights += weight;
      normal = normal + area;
    }
    if (!(weights > 0)) continue;
    normal = calc_unit(normal);
    const Vec3 way = (1 / weights) * sum - x[v];
    wanted[v] = x[v] + (way - dot(way, normal) * normal);
    moves[v] = 1;
  }
  for (std::int32_t v = 0; v < static_cast<std::int32_t>(x.size()); ++v) {
    if (moves[v] == 0) continue;
    const Vec3 p = skin.place(wanted[v], skin.get_kind(v) == SkinEditor::kOnFold);
    if (skin.may_move(v, p)) skin.move(v, p);
  }
}

}  // namespace

Skin remesh(const Skin& start, const SkinSizes& sizes, const SkinPlaces& places) {
  SkinEditor skin(start, places, sizes.largest_m);
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    std::vector<std::int32_t> number;
    const std::vector<double> size = find_sizes(skin.get(number), sizes);
    for (std::size_t v = 0; v < number.size(); ++v)
      if (number[v] >= 0) skin.set_size(static_cast<std::int32_t>(v), size[number[v]]);
    split_long(skin);
    collapse_short(skin);
    flip_to_valence(skin);
    for (int n = 0; n < 3; ++n) relax(skin);
  }
  collapse_short(skin);
  skin.part_chords();
  flip_to_delaunay(skin);
  relax(skin);
  flip_to_delaunay(skin);
  return skin.get();
}

}  // namespace carillon::mesher
