#include "precompute/analytic/triangle_modes.hpp"

#include <Eigen/LU>
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

constexpr double kTolerance = 1e-10;  // of residuals; eigenvalues are good to its square

/// Where the nodes of each element are, and which nodes the rim fixes.
struct Numbering {
  std::vector<std::vector<std::int32_t>> elements;
  std::vector<bool> is_fixed;
};

/// Nodes of corners are those of the net; those of edges are shared by the two triangles at the edge, counted from its smaller end.
Numbering number_nodes(const Net& net, const TriangleBasis& basis) {
  const int p = basis.order();
  Numbering numbering;
  auto next = static_cast<std::int32_t>(net.points_m.size());
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> first_of_edge;
  std::map<std::pair<std::int32_t, std::int32_t>, int> uses;
  for (const bank::Triangle& t : net.triangles) {
    std::vector<std::int32_t> nodes;
    // Point (i, j) of the lattice: barycentric (p - i - j, i, j) / p.
    for (const Point2& point : basis.points()) {
      const int i = static_cast<int>(std::lround(point[0] * p)), j = static_cast<int>(std::lround(point[1] * p)), h = p - i - j;
      const std::array<int, 3> weights{h, i, j};
      const auto zeros = std::count(weights.begin(), weights.end(), 0);
      if (zeros == 2) {
        nodes.push_back(
            t[static_cast<std::size_t>(std::find_if(weights.begin(), weights.end(), [](int w) { return w > 0; }) - weights.begin())]);
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
  numbering.is_fixed.assign(static_cast<std::size_t>(next), false);
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

/// Unknowns in the order in which the elements, along a curve through their middles, meet them first: three that follow each other are
/// near each other, as those of one node of a solid are, for which the solver is made. -1: fixed.
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

}  // namespace

TriangleBasis::TriangleBasis(int order) : order_(order) {
  for (int j = 0; j <= order; ++j)
    for (int i = 0; i + j <= order; ++i) points_.push_back({static_cast<double>(i) / order, static_cast<double>(j) / order});
  la::Matrix values(size(), size());
  for (int q = 0; q < size(); ++q) values.row(q) = calc_monomials(points_[q][0], points_[q][1], 0).transpose();
  inverse_ = values.inverse();
  // The square (x, y) -> (r, s) = (x (1 - y), y) makes Gauss's rule one of the triangle.
  const GaussRule rule = make_gauss_rule(order + 1);
  mass = stiffness_rr = stiffness_rs = stiffness_ss = la::Matrix::Zero(size(), size());
  for (std::size_t a = 0; a < rule.x.size(); ++a)
    for (std::size_t b = 0; b < rule.x.size(); ++b) {
      const double s = rule.x[b], r = rule.x[a] * (1.0 - s), weight = rule.weight[a] * rule.weight[b] * (1.0 - s);
      const la::Vector v = inverse_.transpose() * calc_monomials(r, s, 0), dr = inverse_.transpose() * calc_monomials(r, s, 1),
                       ds = inverse_.transpose() * calc_monomials(r, s, 2);
      mass += weight * v * v.transpose();
      stiffness_rr += weight * dr * dr.transpose();
      stiffness_rs += weight * dr * ds.transpose();
      stiffness_ss += weight * ds * ds.transpose();
    }
}

/// Products of Legendre polynomials of r and of s, or their derivative by r (1) or s (2).
la::Vector TriangleBasis::calc_monomials(double r, double s, int derivative) const {
  const la::Vector along_r = calc_legendre(order_ + 1, r, derivative == 1 ? 1 : 0),
                   along_s = calc_legendre(order_ + 1, s, derivative == 2 ? 1 : 0);
  la::Vector values(size());
  int q = 0;
  for (int j = 0; j <= order_; ++j)
    for (int i = 0; i + j <= order_; ++i) values(q++) = along_r(i) * along_s(j);
  return values;
}

la::Vector TriangleBasis::calc(double r, double s) const { return inverse_.transpose() * calc_monomials(r, s, 0); }

TriangleModes solve_triangles(const Net& net, const TriangleBasis& basis, double max_kappa) {
  Numbering numbering = number_nodes(net, basis);
  PetscInt used = 0;
  const std::vector<PetscInt> unknown = number_unknowns(net, numbering, used);
  const PetscInt unknowns = (used + 2) / 3 * 3;
  std::vector<Eigen::Triplet<double, PetscInt>> stiff, heavy;
  for (std::size_t t = 0; t < net.triangles.size(); ++t) {
    const bank::Triangle& v = net.triangles[t];
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
  // What fills up the last three is far above the band.
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
  layout.fixed.resize(1);  // three points that are no line: no rigid modes
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
