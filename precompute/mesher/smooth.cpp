// Method: hill climbing. A node of a flat element tries steps in 26 directions and keeps the one after which the worst dihedral angle
//   of the elements around it is best.
// Source: optimisation-based smoothing after Freitag and Ollivier-Gooch, "Tetrahedral mesh improvement using swapping and
//   smoothing", IJNME 40, 1997, section 3.
// Deviations: steps of fixed directions instead of their active-set ascent: only a handful of elements need it after exudation.
#include "precompute/mesher/smooth.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "precompute/mesher/tet_quality.hpp"

namespace carillon::mesher {
namespace {

constexpr int kMaxPasses = 12;
constexpr std::size_t kMany = 100;
constexpr double kHardly = 0.95;  // of what they lacked before the pass
// A boundary node whose faces turn away from their mean by more than this lies on an edge (cosine of 25 degrees).
constexpr double kSmooth = 0.906;

/// Of element e of a linear mesh.
double calc_element_flatness(const mesh::TetMesh& mesh, std::int32_t e) {
  const auto tet = mesh.tet(e);
  return calc_flatness({mesh.nodes_m[tet[0]], mesh.nodes_m[tet[1]], mesh.nodes_m[tet[2]], mesh.nodes_m[tet[3]]});
}

enum class Place : char { kInside, kSkin, kEdge };

std::vector<Place> find_places(const mesh::TetMesh& mesh) {
  std::vector<Place> places(mesh.nodes_m.size(), Place::kInside);
  std::vector<Vec3> mean(mesh.nodes_m.size(), Vec3{});
  const auto boundary = find_boundary(mesh);
  const auto calc_normal = [&](const Triangle& t) {
    return cross(mesh.nodes_m[t[1]] - mesh.nodes_m[t[0]], mesh.nodes_m[t[2]] - mesh.nodes_m[t[0]]);
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
  std::vector<std::vector<std::int32_t>> around(mesh.nodes_m.size());
  for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
    for (const std::int32_t v : mesh.tet(e)) around[v].push_back(e);
  // Of the elements around a node; one that is not above `min` is enough to know.
  const auto calc_worst = [&](std::int32_t v, double min) {
    double worst = 180;
    for (const std::int32_t e : around[v]) {
      worst = std::min(worst, calc_element_flatness(mesh, e));
      if (worst <= min) break;
    }
    return worst;
  };
  const auto climb = [&](std::int32_t v) {
    const Vec3 start = mesh.nodes_m[v];
    double length = 1e300;
    for (const std::int32_t e : around[v])
      for (const std::int32_t w : mesh.tet(e))
        if (w != v) length = std::min(length, norm(mesh.nodes_m[w] - start));
    const double before = calc_worst(v, -1e9);
    double best = before + 0.01;
    Vec3 best_place = start;
    for (const double step : {0.3, 0.15, 0.07, 0.03})
      for (int n = 0; n < 27; ++n) {
        const Vec3 direction{n % 3 - 1.0, n / 3 % 3 - 1.0, n / 9 - 1.0};
        if (n == 13) continue;
        Vec3 place = start + (step * length / norm(direction)) * direction;
        if (places[v] == Place::kSkin) place = project(place);
        if (norm(place - start) > 0.5 * length) continue;
        mesh.nodes_m[v] = place;
        if (const double worst = calc_worst(v, best); worst > best) best = worst, best_place = place;
      }
    mesh.nodes_m[v] = best_place;
    return best_place != start;
  };
  // A node that found no better place finds none until one next to it has moved.
  std::vector<char> is_stuck(mesh.nodes_m.size(), 0);
  const auto move = [&](std::int32_t v) {
    if (is_stuck[v]) return false;
    if (!climb(v)) {
      is_stuck[v] = 1;
      return false;
    }
    for (const std::int32_t e : around[v])
      for (const std::int32_t w : mesh.tet(e)) is_stuck[w] = 0;
    return true;
  };
  std::int64_t moved = 0;
  double last = std::numeric_limits<double>::infinity();  // degrees that flat elements lack, summed
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    std::vector<std::pair<double, std::int32_t>> flat;
    for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
      if (const double angle = calc_element_flatness(mesh, e); angle < angle_deg) flat.emplace_back(angle, e);
    // Where many hardly become better it is the body that is flat there.
    const double lacking =
        std::accumulate(flat.begin(), flat.end(), 0.0, [&](double sum, const auto& f) { return sum + angle_deg - f.first; });
    if (flat.size() > kMany && lacking > kHardly * last) break;
    last = lacking;
    std::sort(flat.begin(), flat.end());
    std::int64_t moves = 0;
    for (const auto& [angle, e] : flat)
      for (const std::int32_t v : mesh.tet(e))
        if (places[v] != Place::kEdge && calc_element_flatness(mesh, e) < angle_deg && move(v)) ++moves;
    moved += moves;
    if (moves == 0) break;
  }
  return moved;
}

}  // namespace carillon::mesher
