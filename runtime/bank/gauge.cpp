#include "runtime/bank/gauge.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "runtime/bank/surface.hpp"

namespace carillon::bank {
namespace {

using StrainWeights = std::vector<std::pair<std::size_t, double>>;

constexpr double kSameFaceCosine = 0.9;  // cosine of the angle between triangles of one face
constexpr int kGaugeRings = 5;
constexpr double kGaugeReach = 0.025;          // of the body's size
constexpr std::size_t kMinGaugeVertices = 24;  // of a cubic, which has ten coefficients
constexpr double kMinGaugeSingular = 1e-6;     // of the fit; below: a strip too narrow for all terms

/// A triangle of a bank, its unit normal and area.
struct Facet {
  std::array<Vec3, 3> corner;
  Vec3 normal;
  double area_m2;
  Facet(const Bank& bank, const Triangle& triangle)
      : corner{bank.vertices_m[triangle[0]], bank.vertices_m[triangle[1]], bank.vertices_m[triangle[2]]} {
    const Vec3 twice = calc_normal(bank.vertices_m, triangle);
    area_m2 = 0.5 * norm(twice);
    normal = calc_unit(twice);
  }
  /// Gradient of the barycentric coordinate of a corner, along a direction.
  double calc_slope(std::size_t k, const Vec3& along) const {
    return dot(along, cross(normal, corner[(k + 2) % 3] - corner[(k + 1) % 3])) / (2.0 * area_m2);
  }
};

Vec3 lay_on(const Vec3& direction, const Vec3& normal) { return direction - dot(direction, normal) * normal; }

/// Means over the triangles about the corners.
StrainWeights average_triangles(const Bank& bank, const Facet& own, const Triangle& corners, const Vec3& barycentric,
                                const Vec3& direction) {
  StrainWeights weights;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const std::size_t first = weights.size();
    double area_m2 = 0.0;
    for (const Triangle& triangle : bank.triangles) {
      if (std::find(triangle.begin(), triangle.end(), corners[corner]) == triangle.end()) continue;
      const Facet face(bank, triangle);
      if (!(face.area_m2 > 0.0) || dot(face.normal, own.normal) < kSameFaceCosine) continue;
      area_m2 += face.area_m2;
      const Vec3 along = calc_unit(lay_on(direction, face.normal));
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t axis = 0; axis < 3; ++axis)
          weights.emplace_back(static_cast<std::size_t>(triangle[k]) * 3 + axis, face.area_m2 * face.calc_slope(k, along) * along[axis]);
    }
    for (std::size_t i = first; i < weights.size(); ++i) weights[i].second *= barycentric[corner] / area_m2;
  }
  return weights;
}

/// Vertices of the same face around a triangle, ring by ring.
std::vector<std::int32_t> find_gauge_patch(const Bank& bank, const Facet& own, const Triangle& corners, const Vec3& point_m,
                                           double reach_m) {
  std::vector<char> is_in(bank.vertex_count(), 0);
  std::vector<std::int32_t> patch(corners.begin(), corners.end());
  for (const std::int32_t v : corners) is_in[v] = 1;
  for (int ring = 0; ring < kGaugeRings; ++ring) {
    const std::size_t before = patch.size();
    std::vector<std::int32_t> added;
    for (const Triangle& triangle : bank.triangles) {
      if (std::none_of(triangle.begin(), triangle.end(), [&](std::int32_t v) { return is_in[v] != 0; })) continue;
      const Facet face(bank, triangle);
      if (!(face.area_m2 > 0.0) || dot(face.normal, own.normal) < kSameFaceCosine) continue;
      for (const std::int32_t v : triangle)
        if (is_in[v] == 0 && norm(bank.vertices_m[v] - point_m) <= reach_m) added.push_back(v);
    }
    for (const std::int32_t v : added)
      if (std::exchange(is_in[v], 1) == 0) patch.push_back(v);
    if (patch.size() == before) break;
  }
  return patch;
}

/// Slope of a cubic through a patch; empty where it has too few vertices.
StrainWeights fit_cubic(const Bank& bank, const Facet& own, const std::vector<std::int32_t>& patch, const Vec3& point_m,
                        const Vec3& along) {
  if (patch.size() < kMinGaugeVertices) return {};
  const Vec3 across = cross(own.normal, along);
  double reach_m = 0.0;
  for (const std::int32_t v : patch) reach_m = std::max(reach_m, norm(bank.vertices_m[v] - point_m));
  Eigen::MatrixXd terms(static_cast<Eigen::Index>(patch.size()), 10);
  for (Eigen::Index i = 0; const std::int32_t v : patch) {
    const Vec3 from = (1.0 / reach_m) * (bank.vertices_m[v] - point_m);
    const double x = dot(from, along), y = dot(from, across);
    terms.row(i++) << 1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y;
  }
  Eigen::JacobiSVD<Eigen::MatrixXd> svd(terms, Eigen::ComputeThinU | Eigen::ComputeThinV);
  svd.setThreshold(kMinGaugeSingular);
  const Eigen::VectorXd slope = svd.solve(Eigen::MatrixXd::Identity(terms.rows(), terms.rows())).row(1) / reach_m;
  StrainWeights weights;
  for (std::size_t i = 0; i < patch.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      weights.emplace_back(static_cast<std::size_t>(patch[i]) * 3 + axis, slope[static_cast<Eigen::Index>(i)] * along[axis]);
  return weights;
}

}  // namespace

std::vector<std::pair<std::size_t, double>> calc_strain_weights(const Bank& bank, std::int32_t triangle, const Vec3& barycentric,
                                                                const Vec3& direction) {
  const Triangle& corners = bank.triangles[triangle];
  const Facet own(bank, corners);
  if (!(own.area_m2 > 0.0)) throw InputError("sensor: its triangle has no area; move it");
  const Vec3 laid = lay_on(direction, own.normal);
  if (!(norm(laid) > 1e-3)) throw InputError("sensor: a strain gauge lies in the surface, and its direction is normal to it");
  const Vec3 point_m = calc_point(bank, triangle, barycentric);
  const auto [low, high] = find_extent(bank.vertices_m);
  const double size_m = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  StrainWeights weights =
      fit_cubic(bank, own, find_gauge_patch(bank, own, corners, point_m, kGaugeReach * size_m), point_m, calc_unit(laid));
  return weights.empty() ? average_triangles(bank, own, corners, barycentric, direction) : weights;
}

}  // namespace carillon::bank
