// Source: the weights of normals: Max, "Weights for computing vertex normals from facet normals", J. Graphics Tools 4(2), 1999.
#include "precompute/mesher/skin.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>

#include "precompute/mesh/parts.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesher {
namespace {

constexpr double kMaxTilt = 0.35;  // of the normal at a border, radians

}  // namespace

EdgeSet find_features(const Skin& skin) {
  EdgeSet features;
  for (const auto& [a, b] : skin.folds) features.insert(make_edge(a, b));
  for (const auto& [a, b] : find_border(skin.surface)) features.insert(make_edge(a, b));
  return features;
}

std::vector<Edge> find_border(const TriangleSurface& surface) {
  std::vector<Edge> border;
  for (const auto& [edge, n] : count_faces(surface))
    if (n == 1) border.push_back(edge);
  std::sort(border.begin(), border.end());
  return border;
}

std::vector<std::array<Vec3, 3>> find_skin_normals(const Skin& skin) {
  const auto& points = skin.surface.points;
  const auto& triangles = skin.surface.triangles;
  const EdgeSet features = find_features(skin);
  mesh::Parts parts(3 * triangles.size());                 // over triangle corners
  std::unordered_map<Edge, std::int32_t, EdgeHash> first;  // corner at the lower end of the edge, in its first triangle
  const auto corner_of = [&](std::size_t f, std::int32_t v) {
    const Triangle& t = triangles[f];
    return static_cast<std::int32_t>(3 * f) + (t[0] == v ? 0 : t[1] == v ? 1 : 2);
  };
  for (std::size_t f = 0; f < triangles.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = triangles[f][c], b = triangles[f][(c + 1) % 3];
      const Edge edge = make_edge(a, b);
      if (features.contains(edge)) continue;
      const auto [found, fresh] = first.try_emplace(edge, static_cast<std::int32_t>(f));
      if (fresh) continue;
      for (const std::int32_t v : {a, b}) parts.join(corner_of(static_cast<std::size_t>(found->second), v), corner_of(f, v));
    }
  const auto corners = static_cast<std::int32_t>(3 * triangles.size());
  std::vector<Vec3> sum(3 * triangles.size(), Vec3{});
  for (std::int32_t c = 0; c < corners; ++c) {
    const Triangle& t = triangles[c / 3];
    const Vec3 a = points[t[(c + 1) % 3]] - points[t[c % 3]], b = points[t[(c + 2) % 3]] - points[t[c % 3]];
    const double squares = dot(a, a) * dot(b, b);
    if (squares > 0) sum[parts.find(c)] = sum[parts.find(c)] + (1 / squares) * cross(a, b);
  }
  for (Vec3& n : sum) n = calc_unit(n);
  // At a fold or border: rotated about it until the inward edges are arcs, equally inclined to their chord at both ends.
  struct Rim {
    std::vector<Vec3> along;
    std::vector<std::pair<Vec3, Vec3>> in;  // direction, normal at its end
  };
  std::vector<char> on_rim(points.size(), 0);
  for (const auto& [a, b] : features) on_rim[a] = on_rim[b] = 1;
  std::map<std::int32_t, Rim> rims;
  for (std::size_t f = 0; f < triangles.size(); ++f)
    for (int c = 0; c < 3; ++c)
      for (const int side : {1, 2}) {
        const std::int32_t v = triangles[f][c], w = triangles[f][(c + side) % 3];
        if (on_rim[v] == 0) continue;
        Rim& rim = rims[parts.find(static_cast<std::int32_t>(3 * f) + c)];
        if (features.contains(make_edge(v, w)))
          rim.along.push_back(calc_unit(points[w] - points[v]));
        else if (on_rim[w] == 0)
          rim.in.emplace_back(points[w] - points[v], sum[parts.find(static_cast<std::int32_t>(3 * f) + (c + side) % 3)]);
      }
  std::vector<std::pair<std::int32_t, Vec3>> turned;
  for (const auto& [r, rim] : rims) {
    if (rim.along.size() != 2) continue;
    const Vec3 normal = sum[r], rim_way = rim.along[1] - rim.along[0];
    if (norm(rim_way) < 1.7) continue;  // a corner
    const Vec3 sideways = calc_unit(cross(rim_way, normal));
    double gap = 0, squares = 0;
    for (const auto& [way, other] : rim.in) {
      const Vec3 unit = calc_unit(way);
      const double reach = dot(unit, sideways);
      gap += (dot(normal, unit) + dot(other, unit)) * reach;
      squares += reach * reach;
    }
    if (!(squares > 1e-6)) continue;
    const double tilt = std::atan2(-gap, squares);
    if (std::abs(tilt) < kMaxTilt) turned.emplace_back(r, std::cos(tilt) * normal + std::sin(tilt) * sideways);
  }
  for (const auto& [r, normal] : turned) sum[r] = normal;
  std::vector<std::array<Vec3, 3>> normals(triangles.size());
  for (std::int32_t c = 0; c < corners; ++c) normals[c / 3][c % 3] = sum[parts.find(c)];
  return normals;
}

}  // namespace carillon::mesher
