// Method:     four points of each fine facet are assigned to the nearest coarse facet; least-squares fit of a linear function there with
//   the facet's own Gram matrix, plus a constant that restores the flux.
// Source:     docs/equations.md E10.
#include "precompute/air/transfer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/nearest.hpp"

namespace carillon::air {
namespace {

/// Centroids of the four quarters of a triangle, barycentric.
constexpr std::array<Vec3, 4> kMiddles{Vec3{2.0 / 3, 1.0 / 6, 1.0 / 6}, Vec3{1.0 / 6, 2.0 / 3, 1.0 / 6}, Vec3{1.0 / 6, 1.0 / 6, 2.0 / 3},
                                       Vec3{1.0 / 3, 1.0 / 3, 1.0 / 3}};

constexpr double kSingular = 1e-3;  // minimum determinant relative to an evenly covered facet: the covered part is nearly a line

double calc_area(const std::vector<Vec3>& nodes, const Triangle& t) {
  return 0.5 * norm(cross(nodes[t[1]] - nodes[t[0]], nodes[t[2]] - nodes[t[0]]));
}

}  // namespace

Radiator transfer(const Radiator& fine, std::vector<Vec3> nodes_m, std::vector<Triangle> triangles) {
  bank::Bank coarse;  // surface to search
  coarse.vertices_m = std::move(nodes_m);
  coarse.triangles = std::move(triangles);
  const bank::SurfaceTree tree(coarse);
  const std::size_t modes = fine.count_motions(), facets = coarse.triangles.size();
  std::vector<double> moments(facets * 3 * modes), flow(facets * modes);
  std::vector<Mat3> gram(facets);
  for (std::size_t t = 0; t < fine.triangles.size(); ++t) {
    const Triangle& corners = fine.triangles[t];
    const double weight = calc_area(fine.nodes_m, corners) / 4.0;
    const float* v = &fine.velocity[t * 3 * modes];
    for (const Vec3& at : kMiddles) {
      Vec3 place{};
      for (std::size_t c = 0; c < 3; ++c) place = place + at[c] * fine.nodes_m[corners[c]];
      const bank::NearestPlace found = tree.find(place);
      const std::size_t facet = found.triangle;
      const Vec3& hat = found.barycentric;
      for (std::size_t i = 0; i < 3; ++i) gram[facet][i] = gram[facet][i] + (weight * hat[i]) * hat;
      for (std::size_t m = 0; m < modes; ++m) {
        const double flows = weight * (at[0] * v[m] + at[1] * v[modes + m] + at[2] * v[2 * modes + m]);
        flow[facet * modes + m] += flows;
        for (std::size_t i = 0; i < 3; ++i) moments[(facet * 3 + i) * modes + m] += hat[i] * flows;
      }
    }
  }
  Radiator radiator{.nodes_m = coarse.vertices_m,
                    .triangles = coarse.triangles,
                    .velocity = {},
                    .wave_number_1_m = fine.wave_number_1_m,
                    .sphere = fine.sphere,
                    .rigid = fine.rigid};
  for (const Vec3& node : radiator.nodes_m)
    radiator.sphere.radius_m = std::max(radiator.sphere.radius_m, norm(node - radiator.sphere.centre_m));
  radiator.velocity.resize(facets * 3 * modes);
  for (std::size_t t = 0; t < facets; ++t) {
    const double area = calc_area(coarse.vertices_m, coarse.triangles[t]);
    if (!(area > 0.0)) continue;
    double covered = 0.0;
    for (const Vec3& row : gram[t])
      for (const double x : row) covered += x;
    if (!(covered > 0.0)) continue;
    const double even = std::pow(covered / 12.0, 3) * 4.0;  // determinant of covered / 12 (1 + 11^T)
    const bool is_linear = dot(gram[t][0], cross(gram[t][1], gram[t][2])) > kSingular * even;
    const Mat3 inverse = is_linear ? calc_inverse(gram[t]) : Mat3{};
    for (std::size_t m = 0; m < modes; ++m) {
      Vec3 corner{};
      if (is_linear)
        for (std::size_t i = 0; i < 3; ++i)
          for (std::size_t j = 0; j < 3; ++j) corner[i] += inverse[i][j] * moments[(t * 3 + j) * modes + m];
      const double lacking = flow[t * modes + m] / area - (corner[0] + corner[1] + corner[2]) / 3.0;
      for (std::size_t i = 0; i < 3; ++i) radiator.velocity[(t * 3 + i) * modes + m] = static_cast<float>(corner[i] + lacking);
    }
  }
  return radiator;
}

}  // namespace carillon::air
