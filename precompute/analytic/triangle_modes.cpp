#include "precompute/analytic/triangle_modes.hpp"

#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "precompute/analytic/polynomials.hpp"
#include "precompute/eigen/solve_modes.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::analytic {
namespace {

using petsc::check;
using Sparse = Eigen::SparseMatrix<double, Eigen::RowMajor, PetscInt>;

constexpr double kTolerance = 1e-10;  // residual; the eigenvalue error is its square

/// Node positions of each element, and the fixed nodes of the rim.
struct Numbering {
  std::vector<std::vector<std::int32_t>> elements;
  std::vector<bool> is_fixed;
};

/// Corner nodes are those of the mesh; edge nodes are shared by two triangles and counted from the end with the smaller number.
Numbering number_nodes(const Net& net, const TriangleBasis& basis) {
  const int p = basis.order();
  Numbering numbering;
  auto next = static_cast<std::int32_t>(net.points_m.size());
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> first_of_edge;
  std::map<std::pair<std::int32_t, std::int32_t>, int> uses;
  for (const Triangle& t : net.triangles) {
    std::vector<std::int32_t> nodes;
    for (const std::array<int, 3>& weights : basis.places()) {
      const auto zeros = std::count(weights.begin(), weights.end(), 0);
      if (zeros == 2) {
        nodes.push_back(t[std::find_if(weights.begin(), weights.end(), [](int w) { return w > 0; }) - weights.begin()]);
      } else if (zeros == 1) {
        const int off = weights[0] == 0 ? 0 : weights[1] == 0 ? 1 : 2, a = (off + 1) % 3, b = (off + 2) % 3;
        const bool is_up = t[a] < t[b];
        const auto [entry, is_new] = first_of_edge.try_emplace({std::min(t[a], t[b]), std::max(t[a], t[b])}, next);
        if (is_new) next += p - 1;
        nodes.push_back(entry->second + (is_up ? weights[b] : weights[a]) - 1);
      } else {
        nodes.push_back(next++);
      }
    }
    for (int k = 0; k < 3; ++k) ++uses[{std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])}];
    numbering.elements.push_back(std::move(nodes));
  }
  numbering.is_fixed.assign(next, false);
  for (const auto& [edge, count] : uses) {
    if (count > 1) continue;
    numbering.is_fixed[edge.first] = numbering.is_fixed[edge.second] = true;
    const auto found = first_of_edge.find(edge);
    for (int k = 0; found != first_of_edge.end() && k < p - 1; ++k) numbering.is_fixed[found->second + k] = true;
  }
  return numbering;
}

petsc::MatHandle wrap(Sparse& matrix) {
  petsc::MatHandle handle;
  check(MatCreateSeqAIJWithArrays(PETSC_COMM_SELF, static_cast<PetscInt>(matrix.rows()), static_cast<PetscInt>(matrix.cols()),
                                  matrix.outerIndexPtr(), matrix.innerIndexPtr(), matrix.valuePtr(), handle.out()));
  check(MatSetOption(handle, MAT_SYMMETRIC, PETSC_TRUE));
  return handle;
}

/// Unknowns in the order of first use by the elements along a space-filling curve: three consecutive unknowns are neighbours, like those of
/// one solid node, as the solver expects. -1: fixed.
std::vector<PetscInt> number_unknowns(const Net& net, const Numbering& numbering, PetscInt& count) {
  Point2 low{1e300, 1e300}, high{-1e300, -1e300};
  for (const Point2& point : net.points_m)
    for (std::size_t c = 0; c < 2; ++c) low[c] = std::min(low[c], point[c]), high[c] = std::max(high[c], point[c]);
  const double side = std::max(high[0] - low[0], high[1] - low[1]);
  std::vector<std::pair<std::uint64_t, std::size_t>> order;
  for (std::size_t t = 0; t < net.triangles.size(); ++t) {
    std::array<std::uint64_t, 2> cell{};
    for (std::size_t c = 0; c < 2; ++c) {
      double middle = 0.0;
      for (const std::int32_t v : net.triangles[t]) middle += net.points_m[v][c] / 3.0;
      cell[c] = static_cast<std::uint64_t>((middle - low[c]) / side * 0x7fffffff);
    }
    std::uint64_t key = 0;
    for (int bit = 30; bit >= 0; --bit) key = key << 2 | (cell[0] >> bit & 1) << 1 | (cell[1] >> bit & 1);
    order.emplace_back(key, t);
  }
  std::sort(order.begin(), order.end());
  std::vector<PetscInt> unknown(numbering.is_fixed.size(), -1);
  count = 0;
  for (const auto& [key, t] : order)
    for (const std::int32_t n : numbering.elements[t])
      if (!numbering.is_fixed[n] && unknown[n] < 0) unknown[n] = count++;
  return unknown;
}

/// Point of the triangle: mean of its points on the three sides, weighted by proximity.
Point2 place_point(const std::array<int, 3>& place, const std::vector<std::vector<double>>& lobatto) {
  const int order = place[0] + place[1] + place[2];
  std::array<double, 3> sum{};
  double total = 0.0;
  for (int side = 0; side < 3; ++side) {
    const int a = (side + 1) % 3, b = (side + 2) % 3, n = place[a] + place[b];
    const double weight = lobatto[order][n];
    sum[a] += weight * lobatto[n][place[a]];
    sum[b] += weight * lobatto[n][place[b]];
    total += weight;
  }
  return {sum[1] / total, sum[2] / total};
}

}  // namespace

TriangleBasis::TriangleBasis(int order) : order_(order) {
  std::vector<std::vector<double>> lobatto;  // by order, up to this one
  for (int n = 0; n <= order; ++n) lobatto.push_back(make_lobatto_points(n));
  for (int j = 0; j <= order; ++j)
    for (int i = 0; i + j <= order; ++i) {
      places_.push_back({order - i - j, i, j});
      points_.push_back(place_point(places_.back(), lobatto));
    }
  la::Matrix values(size(), size());
  for (int q = 0; q < size(); ++q) values.row(q) = calc_polynomials(points_[q][0], points_[q][1]).col(0).transpose();
  inverse_ = la::calc_inverse(values);
  mass = inverse_.transpose() * inverse_;
  // The map (x, y) -> (r, s) = (x (1 - y), y) of the square turns Gauss's rule into one for the triangle.
  const GaussRule rule = make_gauss_rule(order + 1);
  la::Matrix rr = la::Matrix::Zero(size(), size()), rs = rr, ss = rr;
  for (std::size_t a = 0; a < rule.x.size(); ++a)
    for (std::size_t b = 0; b < rule.x.size(); ++b) {
      const double s = rule.x[b], r = rule.x[a] * (1.0 - s), weight = rule.weight[a] * rule.weight[b] * (1.0 - s);
      const auto p = calc_polynomials(r, s);
      rr += weight * p.col(1) * p.col(1).transpose();
      rs += weight * p.col(1) * p.col(2).transpose();
      ss += weight * p.col(2) * p.col(2).transpose();
    }
  stiffness_rr = inverse_.transpose() * rr * inverse_;
  stiffness_rs = inverse_.transpose() * rs * inverse_;
  stiffness_ss = inverse_.transpose() * ss * inverse_;
}

/// sqrt(2 (2 i + 1) (i + j + 1)) t^i P_i(x / t) P_j^(2 i + 1, 0)(2 s - 1), t = 1 - s, x = 2 r - t; both factors by recurrence.
Eigen::Matrix<double, Eigen::Dynamic, 3> TriangleBasis::calc_polynomials(double r, double s) const {
  using Row = Eigen::RowVector3d;  // value, by r, by s
  const auto times = [](const Row& a, const Row& b) { return Row(a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[2] * b[0]); };
  const Row t(1.0 - s, 0.0, -1.0), x(2.0 * r - t[0], 2.0, 1.0), z(2.0 * s - 1.0, 0.0, 2.0), one(1.0, 0.0, 0.0);
  std::vector<Row> legendre{one, x};
  for (int i = 1; i < order_; ++i)
    legendre.push_back(((2 * i + 1) * times(x, legendre[i]) - i * times(times(t, t), legendre[i - 1])) / (i + 1));
  Eigen::Matrix<double, Eigen::Dynamic, 3> values(size(), 3);
  int q = 0;
  for (int j = 0; j <= order_; ++j)
    for (int i = 0; i + j <= order_; ++i) {
      const double a = 2 * i + 1;
      Row before = one, now = j == 0 ? one : Row(0.5 * ((a + 2.0) * z + a * one));
      for (int n = 2; n <= j; ++n) {  // Jacobi polynomials with beta = 0 (Abramowitz and Stegun 1964, 22.7.1)
        const double c = 2.0 * n + a;
        const Row next = ((c - 1.0) * (c * (c - 2.0) * times(z, now) + a * a * now) - 2.0 * (n + a - 1.0) * (n - 1.0) * c * before) /
                         (2.0 * n * (n + a) * (c - 2.0));
        before = now;
        now = next;
      }
      values.row(q++) = std::sqrt(2.0 * a * (i + j + 1)) * times(legendre[i], now);
    }
  return values;
}

la::Vector TriangleBasis::calc(double r, double s) const { return inverse_.transpose() * calc_polynomials(r, s).col(0); }

TriangleModes solve_triangles(const Net& net, const TriangleBasis& basis, double max_kappa) {
  Numbering numbering = number_nodes(net, basis);
  PetscInt used = 0;
  const std::vector<PetscInt> unknown = number_unknowns(net, numbering, used);
  const PetscInt unknowns = (used + 2) / 3 * 3;
  std::vector<Eigen::Triplet<double, PetscInt>> stiff, heavy;
  for (std::size_t t = 0; t < net.triangles.size(); ++t) {
    const Triangle& v = net.triangles[t];
    const Point2 &a = net.points_m[v[0]], &b = net.points_m[v[1]], &c = net.points_m[v[2]];
    // x = a + r (b - a) + s (c - a): gradients of r and s.
    const double bx = b[0] - a[0], by = b[1] - a[1], cx = c[0] - a[0], cy = c[1] - a[1], twice = bx * cy - by * cx;
    const double rr = (cx * cx + cy * cy) / twice, rs = -(bx * cx + by * cy) / twice, ss = (bx * bx + by * by) / twice;
    const la::Matrix k = rr * basis.stiffness_rr + rs * (basis.stiffness_rs + basis.stiffness_rs.transpose()) + ss * basis.stiffness_ss;
    for (int i = 0; i < basis.size(); ++i)
      for (int j = 0; j < basis.size(); ++j) {
        const PetscInt row = unknown[numbering.elements[t][i]], column = unknown[numbering.elements[t][j]];
        if (row < 0 || column < 0) continue;
        stiff.emplace_back(row, column, k(i, j));
        heavy.emplace_back(row, column, twice * basis.mass(i, j));
      }
  }
  // Padding unknowns lie far above the band.
  for (PetscInt n = used; n < unknowns; ++n) {
    stiff.emplace_back(n, n, 1.0);
    heavy.emplace_back(n, n, 1e-6 / max_kappa);
  }
  Sparse stiffness(unknowns, unknowns), mass(unknowns, unknowns);
  stiffness.setFromTriplets(stiff.begin(), stiff.end());
  mass.setFromTriplets(heavy.begin(), heavy.end());
  stiff = {};
  heavy = {};
  const petsc::MatHandle k = wrap(stiffness), m = wrap(mass);
  eigen::NodeLayout layout;
  layout.nodes_m.resize(static_cast<std::size_t>(unknowns) / 3);
  layout.component.assign(layout.nodes_m.size(), 0);
  for (std::size_t t = 0; t < net.triangles.size(); ++t)
    for (const std::int32_t n : numbering.elements[t])
      if (unknown[n] >= 0) {
        const Point2& at = net.points_m[net.triangles[t][0]];
        layout.nodes_m[static_cast<std::size_t>(unknown[n]) / 3] = {at[0], at[1], 0.0};
      }
  layout.fixed.resize(1);  // three points not on a line: no rigid modes
  for (const std::int32_t v : net.triangles[0]) layout.fixed[0].push_back({net.points_m[v][0], net.points_m[v][1], 0.0});
  eigen::Options options;
  options.low_hz = 0.0;
  options.high_hz = std::sqrt(max_kappa) / (2.0 * std::numbers::pi);
  options.tolerance = kTolerance;
  const eigen::Modes solved = eigen::solve_modes({k, m, std::move(layout)}, options);
  TriangleModes modes;
  modes.elements = std::move(numbering.elements);
  modes.kappa = solved.lambda;
  modes.residuals = solved.residual;
  const auto count = static_cast<Eigen::Index>(solved.lambda.size());
  modes.shapes = la::Matrix::Zero(static_cast<Eigen::Index>(unknown.size()), count);
  if (count == 0) return modes;
  const PetscScalar* values = nullptr;
  check(MatDenseGetArrayRead(solved.shapes, &values));
  for (Eigen::Index i = 0; i < count; ++i)
    for (std::size_t n = 0; n < unknown.size(); ++n)
      if (unknown[n] >= 0) modes.shapes(static_cast<Eigen::Index>(n), i) = values[i * unknowns + unknown[n]];
  check(MatDenseRestoreArrayRead(solved.shapes, &values));
  return modes;
}

}  // namespace carillon::analytic
