// Method:     Each element uses the quadrature rule of its stiffness: the linear strains of the mesh's displacements are then a subspace of
//   the strains at the points, B^T B = K, and static condensation is the projection onto it.
// Source:     docs/equations.md E1, E13; quadrature and mean dilatation as in precompute/fem/element.cpp.
// Deviations: For nearly incompressible T10, quadratic strain too meets the part of lambda above fem::kMaxDisplacementLambda mu by its mean
//   dilatation only.
#include "precompute/coupling/strains.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "precompute/fem/element.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::coupling {
namespace {

constexpr double kShear = std::numbers::sqrt2;  // factor of shear components in Mandel notation

using Points = std::vector<fem::Point>;

/// Exact to degree 2 on a straight tetrahedron.
const Points& get_rule_of_degree_2() {
  static const Points rule = [] {
    const double a = (5 + 3 * std::sqrt(5.0)) / 20, b = (5 - std::sqrt(5.0)) / 20;
    Points points;
    for (int i = 0; i < 4; ++i) {
      fem::Point point{{b, b, b, b}, 0.25};
      point.at[i] = a;
      points.push_back(point);
    }
    return points;
  }();
  return rule;
}

/// C in Mandel notation, without the mean dilatation's part.
Matrix6 make_stiffness(const fem::Solid& solid) {
  Matrix6 c;
  for (int a = 0; a < 6; ++a)
    for (int b = 0; b < 6; ++b) {
      if (solid.isotropic) {
        c(a, b) = (a < 3 && b < 3 ? solid.displacement_lambda_pa : 0.0) + (a == b ? 2 * solid.lame_mu_pa : 0.0);
        continue;
      }
      const auto [r, t] = kComponents[a];
      const auto [s, d] = kComponents[b];
      c(a, b) = solid.tensor_pa[27 * r + 9 * s + 3 * t + d] * (a < 3 ? 1 : kShear) * (b < 3 ? 1 : kShear);
    }
  return c;
}

}  // namespace

Strains::Strains(const mesh::LocalMesh& local, const fem::Materials& materials) : local_(&local), materials_(&materials) {
  for (const material::Material& material : materials.list) {
    const fem::Solid solid(material);
    solids_.push_back({make_stiffness(solid).llt().matrixU(), solid.mean_dilatation_modulus_pa});
  }
  first_row_.push_back(0);
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    bool curved = false;
    if (local.order == 2) {
      std::array<Vec3, 10> x;
      for (std::size_t i = 0; i < 10; ++i) x[i] = local.nodes_m[nodes(e)[i]];
      curved = !fem::is_straight(x);
    }
    is_curved_.push_back(static_cast<char>(curved));
    const int points = local.order == 1 ? 1 : curved ? 14 : 4;
    first_row_.push_back(first_row_.back() + 6 * points + (solids_[material(e)].mean_dilatation_modulus_pa > 0 ? 1 : 0));
  }
}

std::span<const std::int32_t> Strains::nodes(std::int32_t e) const {
  const std::size_t width = local_->nodes_per_tet();
  return {local_->tets.data() + static_cast<std::size_t>(e) * width, width};
}

void Strains::calc_points(std::int32_t e, ElementPoints& out) const {
  const auto numbers = nodes(e);
  std::array<Vec3, 10> x;
  for (std::size_t i = 0; i < numbers.size(); ++i) x[i] = local_->nodes_m[numbers[i]];
  out.nodes = static_cast<int>(numbers.size());
  if (out.nodes == 4) {  // stored as a straight T10, whose corner slopes of the barycentric coordinates equal those of the T4
    for (std::size_t i = 0; i < 6; ++i)
      for (std::size_t k = 0; k < 3; ++k) x[4 + i][k] = (x[mesh::kEdges[i][0]][k] + x[mesh::kEdges[i][1]][k]) / 2;
    const fem::Jacobian jacobian = fem::calc_jacobian(x, fem::calc_shape({0.25, 0.25, 0.25, 0.25}));
    out.volume_m3.assign(1, jacobian.determinant / 6);
    out.at.assign(1, {0.25, 0.25, 0.25, 0.25});
    out.slope.assign(1, {});
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t d = 0; d < 3; ++d) {
        out.slope[0][3 * (d + 1) + k] = jacobian.inverse[d][k];
        out.slope[0][k] -= jacobian.inverse[d][k];
      }
    return;
  }
  static const std::vector<fem::Shape> kStraight = fem::calc_shapes(get_rule_of_degree_2());
  static const std::vector<fem::Shape> kCurved = fem::calc_shapes(fem::get_rule_of_degree_5());
  const bool curved = is_curved_[e] != 0;
  const Points& rule = curved ? fem::get_rule_of_degree_5() : get_rule_of_degree_2();
  const std::vector<fem::Shape>& shapes = curved ? kCurved : kStraight;
  out.volume_m3.resize(rule.size());
  out.at.resize(rule.size());
  out.slope.assign(rule.size(), {});
  for (std::size_t p = 0; p < rule.size(); ++p) {
    const fem::Jacobian jacobian = fem::calc_jacobian(x, shapes[p]);
    out.volume_m3[p] = rule[p].weight * jacobian.determinant / 6;
    out.at[p] = rule[p].at;
    for (std::size_t i = 0; i < 10; ++i)
      for (std::size_t d = 0; d < 3; ++d)
        for (std::size_t k = 0; k < 3; ++k) out.slope[p][3 * i + k] += shapes[p].derivative[i][d] * jacobian.inverse[d][k];
  }
}

void Strains::scale(std::int32_t e, const ElementPoints& points, RowMatrix& strains) const {
  const ScaledSolid& solid = solids_[material(e)];
  if (solid.mean_dilatation_modulus_pa > 0) {
    const Eigen::Index mean = strains.rows() - 1;
    double volume = 0;
    strains.row(mean).setZero();
    for (int p = 0; p < points.point_count(); ++p) {
      const double w = points.volume_m3[p];
      volume += w;
      strains.row(mean) += w * (strains.row(6 * p) + strains.row(6 * p + 1) + strains.row(6 * p + 2));
    }
    strains.row(mean) *= std::sqrt(solid.mean_dilatation_modulus_pa / volume);
  }
  for (int p = 0; p < points.point_count(); ++p) {
    const double w = std::sqrt(points.volume_m3[p]);
    for (int a = 0; a < 6; ++a) {  // U is upper triangular: rows above are done, those below are still strains
      auto row = strains.row(6 * p + a);
      row *= w * solid.root(a, a);
      for (int b = a + 1; b < 6; ++b)
        if (solid.root(a, b) != 0) row += w * solid.root(a, b) * strains.row(6 * p + b);
    }
  }
}

void Strains::calc_linear(std::int32_t e, const ElementPoints& points, RowMatrix& b) const {
  b.setZero(row_count(e), 3 * points.nodes);
  for (int p = 0; p < points.point_count(); ++p)
    for (int c = 0; c < 6; ++c) {
      const auto [k, l] = kComponents[c];
      const double factor = c < 3 ? 0.5 : 0.5 * kShear;
      for (int i = 0; i < points.nodes; ++i) {
        const double* slope = points.slope[p].data() + 3 * i;
        b(6 * p + c, 3 * i + k) += factor * slope[l];
        b(6 * p + c, 3 * i + l) += factor * slope[k];
      }
    }
  scale(e, points, b);
}

void Strains::gather(std::int32_t e, const double* nodal, std::ptrdiff_t width, RowMatrix& values) const {
  const auto numbers = nodes(e);
  values.resize(3 * static_cast<Eigen::Index>(numbers.size()), width);
  for (std::size_t i = 0; i < numbers.size(); ++i)
    values.middleRows(3 * static_cast<Eigen::Index>(i), 3) =
        Eigen::Map<const RowMatrix>(nodal + static_cast<std::ptrdiff_t>(numbers[i]) * 3 * width, 3, width);
}

void Strains::calc_gradients(const ElementPoints& points, const RowMatrix& values, RowMatrix& gradients) {
  gradients.setZero(9 * points.point_count(), values.cols());
  for (int p = 0; p < points.point_count(); ++p)
    for (int i = 0; i < points.nodes; ++i)
      for (int a = 0; a < 3; ++a)
        for (int k = 0; k < 3; ++k) gradients.row(9 * p + 3 * a + k) += points.slope[p][3 * i + k] * values.row(3 * i + a);
}

void Strains::calc_pair_strains(std::int32_t e, const ElementPoints& points, const RowMatrix& gradients, const Pairs& pairs,
                                std::ptrdiff_t first, std::ptrdiff_t count, RowMatrix& z) const {
  z.resize(row_count(e), count);
  for (int p = 0; p < points.point_count(); ++p)
    for (int c = 0; c < 6; ++c) {
      const auto [k, l] = kComponents[c];
      const double factor = c < 3 ? 0.5 : 0.5 * kShear;
      for (std::ptrdiff_t j = 0; j < pairs.modes; ++j) {  // pairs (0, j) ... (j, j) are consecutive
        const std::ptrdiff_t column = pairs.find(0, j);
        const std::ptrdiff_t from = std::max(first, column), end = std::min(first + count, column + j + 1);
        if (from >= end) continue;
        const std::ptrdiff_t i = from - column, n = end - from;
        auto out = z.row(6 * p + c).segment(from - first, n);
        out.setZero();
        for (int a = 0; a < 3; ++a) {
          const auto hk = gradients.row(9 * p + 3 * a + k), hl = gradients.row(9 * p + 3 * a + l);
          out += factor * (hk(j) * hl.segment(i, n) + hl(j) * hk.segment(i, n));
        }
        if (i + n == j + 1) out(n - 1) *= 0.5;
      }
    }
  scale(e, points, z);
}

void Strains::calc_square_strains(std::int32_t e, const ElementPoints& points, const RowMatrix& gradients, RowMatrix& z) const {
  z.setZero(row_count(e), gradients.cols());
  for (int p = 0; p < points.point_count(); ++p)
    for (int c = 0; c < 6; ++c) {
      const auto [k, l] = kComponents[c];
      const double factor = c < 3 ? 0.5 : 0.5 * kShear;
      for (int a = 0; a < 3; ++a)
        z.row(6 * p + c).array() += factor * gradients.row(9 * p + 3 * a + k).array() * gradients.row(9 * p + 3 * a + l).array();
    }
  scale(e, points, z);
}

la::Matrix Strains::calc_stress(std::int32_t e, const ElementPoints& points, int point, const Eigen::Ref<const la::Matrix>& values) const {
  const ScaledSolid& solid = solids_[material(e)];
  const double w = points.volume_m3[point];
  la::Matrix stress = std::sqrt(w) * solid.root.transpose() * values.middleRows(6 * point, 6);
  stress.bottomRows(3) /= kShear;
  if (solid.mean_dilatation_modulus_pa > 0) {
    const double volume = std::accumulate(points.volume_m3.begin(), points.volume_m3.end(), 0.0);
    for (int c = 0; c < 3; ++c) stress.row(c) += w * std::sqrt(solid.mean_dilatation_modulus_pa / volume) * values.row(values.rows() - 1);
  }
  return stress;
}

}  // namespace carillon::coupling
