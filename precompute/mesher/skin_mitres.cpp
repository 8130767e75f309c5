// Triangles at the mitres of folds: rings along folds and rims, and space in corners for both sides of a wall.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/mesher/skin_editor.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesher {
namespace {

constexpr double kMinRingPart = 0.15, kMaxRingPart = 0.75;  // of edges at rings
constexpr double kMinCopyAreaRatio = 0.13,
                 kMinCopyShapeRatio = 0.1;  // least area ratio of a triangle's copies; and over its longest edge squared

}  // namespace

Skin add_rings(const Skin& start, const SkinPlaces& places, const RingDistance& distance_m) {
  SkinEditor skin(start, places, 1);
  const auto& x = skin.get_points();
  skin.part_chords();
  std::vector<Edge> cut;
  for (const auto& [a, b] : skin.list_edges()) {
    if (skin.is_feature(a, b) || (skin.get_kind(a) == SkinEditor::kInside) == (skin.get_kind(b) == SkinEditor::kInside)) continue;
    cut.push_back(skin.get_kind(a) != SkinEditor::kInside ? Edge{a, b} : Edge{b, a});
  }
  const auto along = skin.find_along();
  struct Leaving : LeavingEdge {
    double distance = 0;
  };
  // Folds at a within a right angle of the edge a b, with the distances of their rings.
  const auto list_leaving = [&](std::int32_t a, std::int32_t b) {
    const Vec3 way = calc_unit(x[b] - x[a]);
    std::vector<Leaving> leaving;
    for (const std::int32_t c : along.at(a)) {
      const Vec3 side = calc_unit(x[c] - x[a]);
      const double cosine = dot(side, way);
      const Vec3 across = calc_unit(way - cosine * side);
      if (cosine > 0) leaving.push_back({{a, way, across, std::max(std::sqrt(std::max(1 - cosine * cosine, 0.0)), kMinSine)}});
    }
    if (leaving.empty()) leaving.push_back({{a, way, way, 1}});
    for (Leaving& one : leaving) one.distance = distance_m(one);
    return leaving;
  };
  // Points between fold and ring move out to the ring.
  for (int round = 0; round < 2; ++round)
    for (const auto& [a, b] : cut)
      for (const Leaving& leaving : list_leaving(a, b)) {
        const double gap = leaving.distance - norm(x[b] - x[a]) * leaving.sine;
        if (!(gap > 0)) continue;
        const Vec3 p = places.on_surface(x[b] + gap * leaving.across);
        if (skin.may_move(b, p)) skin.move(b, p);
      }
  for (const auto& [a, b] : cut) {
    double part = 0;
    for (const Leaving& leaving : list_leaving(a, b)) part = std::max(part, leaving.distance / (norm(x[b] - x[a]) * leaving.sine));
    if (part < kMinRingPart || part > kMaxRingPart) continue;
    skin.split(a, b, places.on_surface(x[a] + part * (x[b] - x[a])));
  }
  return skin.get();
}

Skin divide_mitres(const Skin& start, const SkinPlaces& places, double edge_m, const std::vector<char>& is_mitred) {
  SkinEditor skin(start, places, 0);
  const auto& x = skin.get_points();
  const auto along = skin.find_along();
  // Distance of a point from the folds at `fold`.
  const auto calc_distance = [&](std::int32_t fold, std::int32_t point) {
    const Vec3 way = x[point] - x[fold];
    double least = norm(way);
    for (const std::int32_t other : along.at(fold)) {
      const Vec3 side = calc_unit(x[other] - x[fold]);
      least = std::min(least, norm(way - dot(way, side) * side));
    }
    return least;
  };
  constexpr int kMaxDivisions = 6;  // finer elements there would be needles
  for (int division = 0; division < kMaxDivisions; ++division) {
    for (const auto& [a, b] : skin.list_edges()) {
      const bool is_a = skin.get_kind(a) != SkinEditor::kInside;
      if (is_a == (skin.get_kind(b) != SkinEditor::kInside)) continue;
      const std::int32_t fold = is_a ? a : b, end = is_a ? b : a;
      if (is_mitred[fold] == 0) continue;
      const double parts = std::min(std::round(calc_distance(fold, end) / edge_m), kMaxDivisions + 1.0);
      if (parts < 2) continue;
      const double part = 1 - 1 / parts;
      skin.add_mitre_point({static_cast<std::int32_t>(x.size()), fold, end, part});
      skin.split(fold, end, places.on_surface(x[fold] + part * (x[end] - x[fold])));
    }
  }
  return skin.get();
}

Skin make_room(const Skin& start, const SkinPlaces& places, const std::vector<Vec3>& ways, const std::array<double, 2>& levels_m) {
  SkinEditor skin(start, places, 0);
  const auto& x = skin.get_points();
  constexpr int kRounds = 12;
  // Area ratio of a triangle's copies, at most its shape; negative if folded.
  const auto rate = [&](const Triangle& t, std::int32_t v, const Vec3& p) {
    std::array<Vec3, 3> q;
    for (int c = 0; c < 3; ++c) q[c] = t[c] == v ? p : x[t[c]];
    const Vec3 normal = calc_unit(cross(q[1] - q[0], q[2] - q[0]));
    double longest = 0, least = HUGE_VAL, most = 0;
    for (int c = 0; c < 3; ++c) longest = std::max(longest, norm(q[(c + 1) % 3] - q[c]));
    for (const double level : levels_m) {
      const auto at = [&](int c) { return q[c] + level * ways[t[c]]; };
      const double area = dot(cross(at(1) - at(0), at(2) - at(0)), normal);
      least = std::min(least, area);
      most = std::max(most, std::abs(area));
    }
    return most > 0 ? least / std::max(most, kMinCopyShapeRatio * longest * longest) : 0.0;
  };
  const auto rate_star = [&](std::int32_t v, const Vec3& p) {
    double least = HUGE_VAL;
    for (const std::int32_t f : skin.get_star(v)) least = std::min(least, rate(skin.get_triangle(f), v, p));
    return least;
  };
  // Alternately: flips for narrow triangles, then point moves that widen the narrowest around them.
  for (int round = 0; round < kRounds; ++round) {
    for (const auto& [a, b] : skin.list_edges()) {
      const std::optional<Quad> quad = skin.find_quad(a, b);
      if (!quad || skin.would_join_folds(*quad)) continue;
      const auto rate_quad = [&, faces = quad->faces] {
        return std::min(rate(skin.get_triangle(faces[0]), -1, {}), rate(skin.get_triangle(faces[1]), -1, {}));
      };
      const double before = rate_quad();
      if (before > kMinCopyAreaRatio || !skin.flip(*quad) || rate_quad() > before) continue;
      if (const auto back = skin.find_quad(quad->c, quad->d)) skin.flip(*back);
    }
    bool again = false;
    for (std::int32_t v = 0; v < static_cast<std::int32_t>(x.size()); ++v) {
      if (skin.get_star(v).empty() || skin.get_kind(v) == SkinEditor::kFixed) continue;
      double best = rate_star(v, x[v]);
      if (best > kMinCopyAreaRatio) continue;
      double reach = HUGE_VAL;
      Vec3 normal{};
      std::vector<Vec3> ends;  // along the fold
      for (const std::int32_t f : skin.get_star(v)) {
        normal = normal + skin.calc_area(skin.get_triangle(f));
        for (const std::int32_t w : skin.get_triangle(f)) {
          if (w == v) continue;
          reach = std::min(reach, norm(x[w] - x[v]));
          if (skin.is_feature(v, w)) ends.push_back(x[w]);
        }
      }
      std::vector<Vec3> ways_to;  // unit
      if (skin.get_kind(v) == SkinEditor::kOnFold) {
        for (const Vec3& end : ends) ways_to.push_back(calc_unit(end - x[v]));
      } else {
        normal = calc_unit(normal);
        const Vec3 along = calc_unit(cross(normal, std::abs(normal[0]) < 0.7 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
        const Vec3 across = cross(normal, along);
        for (int n = 0; n < 12; ++n)
          ways_to.push_back(std::cos(n * std::numbers::pi / 6) * along + std::sin(n * std::numbers::pi / 6) * across);
      }
      Vec3 found = x[v];
      for (const double part : {0.9, 0.5, 0.25, 0.1, 0.03})
        for (const Vec3& way : ways_to) {
          const Vec3 p = skin.place(x[v] + (part * reach) * way, skin.get_kind(v) == SkinEditor::kOnFold);
          const double now = rate_star(v, p);
          if (now > best + 1e-3 && skin.may_move(v, p)) best = now, found = p;
        }
      again = again || norm(found - x[v]) > 0;
      skin.move(v, found);
    }
    if (!again) break;
  }
  return skin.get();
}

}  // namespace carillon::mesher
