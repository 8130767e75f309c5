// Method: hill climbing. A node of a flat element tries steps in 26 directions and keeps the one after which the worst dihedral angle
//   of the elements around it is best.
// Source: optimisation-based smoothing after Freitag and Ollivier-Gooch, "Tetrahedral mesh improvement using swapping and
//   smoothing", IJNME 40, 1997, section 3.
// Deviations: steps of fixed directions instead of their active-set ascent: only a handful of elements need it after exudation.
#include "precompute/mesher/smooth.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "precompute/mesher/tet_quality.hpp"

namespace carillon::mesher {
namespace {

constexpr int kMostPasses = 12;
// A boundary node whose faces turn away from their mean by more than this lies on an edge (cosine of 25 degrees).
constexpr double kSmooth = 0.906;

enum class Place : char { kInside, kSkin, kEdge };

/// The smallest of all dihedral angles and of 180 degrees minus them, in degrees; negative if the element is inverted.
double calc_flatness(const mesh::TetMesh& mesh, std::int32_t e) {
  const auto tet = mesh.tet(e);
  std::array<Vec3, 4> p, normal;
  for (int c = 0; c < 4; ++c) p[c] = mesh.nodes[tet[c]];
  if (!(dot(p[1] - p[0], cross(p[2] - p[0], p[3] - p[0])) > 0)) return -1;
  for (int f = 0; f < 4; ++f)
    normal[f] = cross(p[mesh::kFaces[f][1]] - p[mesh::kFaces[f][0]], p[mesh::kFaces[f][2]] - p[mesh::kFaces[f][0]]);
  double worst = 180;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j) {
      const double turn = std::atan2(norm(cross(normal[i], normal[j])), dot(normal[i], normal[j])) * 180 / std::numbers::pi;
      worst = std::min({worst, turn, 180 - turn});
    }
  return worst;
}

std::vector<Place> find_places(const mesh::TetMesh& mesh) {
  std::vector<Place> places(mesh.nodes.size(), Place::kInside);
  std::vector<Vec3> mean(mesh.nodes.size(), Vec3{});
  const auto boundary = find_boundary(mesh);
  const auto calc_normal = [&](const Triangle& t) {
    return cross(mesh.nodes[t[1]] - mesh.nodes[t[0]], mesh.nodes[t[2]] - mesh.nodes[t[0]]);
  };
  for (const Triangle& t : boundary)
    for (const std::int32_t v : t) mean[v] = mean[v] + calc_normal(t), places[v] = Place::kSkin;
  for (const Triangle& t : boundary) {
    const Vec3 normal = calc_normal(t);
    for (const std::int32_t v : t)
      if (dot(normal, mean[v]) < kSmooth * norm(normal) * norm(mean[v])) places[v] = Place::kEdge;
  }
  return places;
}

}  // namespace

std::int64_t better_flat_elements(mesh::TetMesh& mesh, double angle_deg, const std::function<Vec3(const Vec3&)>& project) {
  const auto places = find_places(mesh);
  std::vector<std::vector<std::int32_t>> around(mesh.nodes.size());
  for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
    for (const std::int32_t v : mesh.tet(e)) around[v].push_back(e);
  const auto calc_worst = [&](std::int32_t v) {
    double worst = 180;
    for (const std::int32_t e : around[v]) worst = std::min(worst, calc_flatness(mesh, e));
    return worst;
  };
  const auto climb = [&](std::int32_t v) {
    const Vec3 start = mesh.nodes[v];
    double length = 1e300;
    for (const std::int32_t e : around[v])
      for (const std::int32_t w : mesh.tet(e))
        if (w != v) length = std::min(length, norm(mesh.nodes[w] - start));
    const double before = calc_worst(v);
    double best = before + 0.01;
    Vec3 best_place = start;
    for (const double step : {0.3, 0.15, 0.07, 0.03})
      for (int n = 0; n < 27; ++n) {
        const Vec3 direction{n % 3 - 1.0, n / 3 % 3 - 1.0, n / 9 - 1.0};
        if (n == 13) continue;
        Vec3 place = start + (step * length / norm(direction)) * direction;
        if (places[v] == Place::kSkin) place = project(place);
        if (norm(place - start) > 0.5 * length) continue;
        mesh.nodes[v] = place;
        if (const double worst = calc_worst(v); worst > best) best = worst, best_place = place;
      }
    mesh.nodes[v] = best_place;
    return best_place != start;
  };
  std::int64_t moved = 0;
  for (int pass = 0; pass < kMostPasses; ++pass) {
    std::vector<std::pair<double, std::int32_t>> flat;
    for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
      if (const double angle = calc_flatness(mesh, e); angle < angle_deg) flat.emplace_back(angle, e);
    std::sort(flat.begin(), flat.end());
    std::int64_t moves = 0;
    for (const auto& [angle, e] : flat)
      for (const std::int32_t v : mesh.tet(e))
        if (places[v] != Place::kEdge && calc_flatness(mesh, e) < angle_deg && climb(v)) ++moves;
    moved += moves;
    if (moves == 0) break;
  }
  return moved;
}

}  // namespace carillon::mesher
