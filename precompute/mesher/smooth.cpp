// Method: hill climbing: a node of a flat element tries steps in 26 directions (instead of the paper's active-set ascent: only a handful of
//   elements need it after exudation) and keeps the best for the worst surrounding dihedral angle.
// Source: Freitag and Ollivier-Gooch, "Tetrahedral mesh improvement using swapping and smoothing", IJNME 40, 1997, section 3.
#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

#include "precompute/mesher/tet_quality.hpp"
#include "precompute/mesher/volume_mesh.hpp"

namespace carillon::mesher {
namespace {

constexpr int kMaxPasses = 12;
constexpr std::size_t kManyFlatElements = 100;
constexpr double kMaxDeficitRatio = 0.95;  // least progress: remaining part of the missing angles

/// Of element e of a linear mesh.
double calc_element_flatness(const mesh::TetMesh& mesh, std::int32_t e) {
  const auto tet = mesh.tet(e);
  return calc_flatness({mesh.nodes_m[tet[0]], mesh.nodes_m[tet[1]], mesh.nodes_m[tet[2]], mesh.nodes_m[tet[3]]});
}

enum class Place : char { kInside, kSkin, kFixed };

std::vector<Place> find_places(const mesh::TetMesh& mesh, const std::function<bool(const Vec3&)>& is_fixed) {
  std::vector<Place> places(mesh.nodes_m.size(), Place::kInside);
  for (const Triangle& t : find_boundary(mesh))
    for (const std::int32_t v : t) places[v] = Place::kSkin;
  for (std::size_t v = 0; v < places.size(); ++v)
    if (places[v] == Place::kSkin && is_fixed(mesh.nodes_m[v])) places[v] = Place::kFixed;
  return places;
}

/// Moves nodes to raise the worst dihedral angles around them.
class Improver {
 public:
  Improver(mesh::TetMesh& mesh, double angle_deg, const std::function<std::optional<Vec3>(const Vec3&)>& project,
           const std::function<bool(const Vec3&)>& is_fixed)
      : mesh_(mesh),
        angle_deg_(angle_deg),
        project_(project),
        places_(find_places(mesh, is_fixed)),
        around_(mesh.nodes_m.size()),
        is_stuck_(mesh.nodes_m.size(), 0) {
    for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
      for (const std::int32_t v : mesh.tet(e)) around_[v].push_back(e);
  }

  /// Returns the number of moves.
  std::int64_t run() {
    std::int64_t moved = 0;
    double last = std::numeric_limits<double>::infinity();  // total missing angle of flat elements [degrees]
    for (int pass = 0; pass < kMaxPasses; ++pass) {
      std::vector<std::pair<double, std::int32_t>> flat;
      for (std::int32_t e = 0; e < mesh_.tet_count(); ++e)
        if (const double angle = calc_element_flatness(mesh_, e); angle < angle_deg_) flat.emplace_back(angle, e);
      const double lacking =
          std::accumulate(flat.begin(), flat.end(), 0.0, [&](double sum, const auto& f) { return sum + angle_deg_ - f.first; });
      if (flat.size() > kManyFlatElements && lacking > kMaxDeficitRatio * last)
        break;  // many elements with little progress: the body itself is flat there
      last = lacking;
      std::sort(flat.begin(), flat.end());
      const std::int64_t moves = move_own(flat) + (flat.size() <= kManyFlatElements ? move_neighbours(flat) : 0);
      moved += moves;
      if (moves == 0) break;
    }
    return moved;
  }

 private:
  using Flat = std::vector<std::pair<double, std::int32_t>>;  // angle in degrees, element

  bool is_flat(std::int32_t e) const { return calc_element_flatness(mesh_, e) < angle_deg_; }

  /// Smallest angle around a node; stops at the first not above `min`.
  double calc_worst(std::int32_t v, double min) const {
    double worst = 180;
    for (const std::int32_t e : around_[v]) {
      worst = std::min(worst, calc_element_flatness(mesh_, e));
      if (worst <= min) break;
    }
    return worst;
  }

  /// Pattern search around the best position, with decreasing steps.
  bool climb(std::int32_t v) {
    const Vec3 start = mesh_.nodes_m[v];
    double length = 1e300;
    for (const std::int32_t e : around_[v])
      for (const std::int32_t w : mesh_.tet(e))
        if (w != v) length = std::min(length, norm(mesh_.nodes_m[w] - start));
    double best = calc_worst(v, -1e9) + 0.01;
    Vec3 best_place = start;
    for (const double step : {0.3, 0.15, 0.07, 0.03}) {
      const Vec3 from = best_place;
      for (int n = 0; n < 27; ++n) {
        const Vec3 direction{n % 3 - 1.0, n / 3 % 3 - 1.0, n / 9 - 1.0};
        if (n == 13) continue;
        Vec3 place = from + (step * length / norm(direction)) * direction;
        if (places_[v] == Place::kSkin) {
          const std::optional<Vec3> there = project_(place);
          if (!there) continue;
          place = *there;
        }
        if (norm(place - start) > 0.5 * length) continue;
        mesh_.nodes_m[v] = place;
        if (const double worst = calc_worst(v, best); worst > best) best = worst, best_place = place;
      }
    }
    mesh_.nodes_m[v] = best_place;
    return best_place != start;
  }

  /// Skips a node without a better position until a neighbour has moved.
  bool move(std::int32_t v) {
    if (places_[v] == Place::kFixed || is_stuck_[v]) return false;
    if (!climb(v)) {
      is_stuck_[v] = 1;
      return false;
    }
    for (const std::int32_t e : around_[v])
      for (const std::int32_t w : mesh_.tet(e)) is_stuck_[w] = 0;
    return true;
  }

  std::int64_t move_own(const Flat& flat) {
    std::int64_t moves = 0;
    for (const auto& [angle, e] : flat)
      for (const std::int32_t v : mesh_.tet(e))
        if (is_flat(e) && move(v)) ++moves;
    return moves;
  }

  /// For elements that no single node move improves.
  std::int64_t move_neighbours(const Flat& flat) {
    std::int64_t moves = 0;
    for (const auto& [angle, e] : flat) {
      if (!is_flat(e)) continue;
      std::vector<std::int32_t> next;
      for (const std::int32_t v : mesh_.tet(e))
        for (const std::int32_t other : around_[v])
          for (const std::int32_t w : mesh_.tet(other)) next.push_back(w);
      std::sort(next.begin(), next.end());
      next.erase(std::unique(next.begin(), next.end()), next.end());
      for (const std::int32_t w : next)
        if (is_flat(e) && move(w)) ++moves;
    }
    return moves;
  }

  mesh::TetMesh& mesh_;
  double angle_deg_;
  const std::function<std::optional<Vec3>(const Vec3&)>& project_;
  std::vector<Place> places_;                      // (nodes)
  std::vector<std::vector<std::int32_t>> around_;  // (nodes) elements
  std::vector<char> is_stuck_;                     // (nodes)
};

}  // namespace

std::int64_t better_flat_elements(mesh::TetMesh& mesh, double angle_deg, const std::function<std::optional<Vec3>(const Vec3&)>& project,
                                  const std::function<bool(const Vec3&)>& is_fixed) {
  return Improver(mesh, angle_deg, project, is_fixed).run();
}

}  // namespace carillon::mesher
