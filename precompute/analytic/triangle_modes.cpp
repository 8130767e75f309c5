#include "precompute/analytic/triangle_modes.hpp"

#include <fmt/core.h>
#include <slepceps.h>

#include <Eigen/LU>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "precompute/analytic/polynomials.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::analytic {
namespace {

using petsc::check;
using Sparse = Eigen::SparseMatrix<double, Eigen::RowMajor, PetscInt>;

constexpr double kTolerance = 1e-12;

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

void use_mumps(EPS eps) {
  KSP ksp = nullptr;
  PC pc = nullptr;
  check(EPSKrylovSchurGetKSP(eps, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCCHOLESKY));
  check(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
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
  std::vector<PetscInt> unknown(numbering.is_fixed.size(), -1);
  PetscInt unknowns = 0;
  for (std::size_t n = 0; n < unknown.size(); ++n)
    if (!numbering.is_fixed[n]) unknown[n] = unknowns++;
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
  Sparse stiffness(unknowns, unknowns), mass(unknowns, unknowns);
  stiffness.setFromTriplets(stiff.begin(), stiff.end());
  mass.setFromTriplets(heavy.begin(), heavy.end());
  stiff = {};
  heavy = {};
  const petsc::MatHandle k = wrap(stiffness), m = wrap(mass);
  petsc::EpsHandle eps;
  check(EPSCreate(PETSC_COMM_SELF, eps.out()));
  check(EPSSetOperators(eps, k, m));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetType(eps, EPSKRYLOVSCHUR));
  check(EPSSetWhichEigenpairs(eps, EPS_ALL));
  check(EPSSetInterval(eps, 0.0, max_kappa));
  check(EPSSetTolerances(eps, kTolerance, PETSC_DEFAULT));
  ST st = nullptr;
  check(EPSGetST(eps, &st));
  check(STSetType(st, STSINVERT));
  use_mumps(eps);
  check(EPSSolve(eps));
  PetscInt count = 0;
  check(EPSGetConverged(eps, &count));
  TriangleModes modes;
  modes.elements = std::move(numbering.elements);
  modes.shapes = la::Matrix::Zero(static_cast<Eigen::Index>(unknown.size()), count);
  la::Vector x(unknowns);
  petsc::VecHandle vector;
  check(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, unknowns, x.data(), vector.out()));
  for (PetscInt i = 0; i < count; ++i) {
    PetscScalar kappa = 0.0;
    check(EPSGetEigenpair(eps, i, &kappa, nullptr, vector, nullptr));
    const la::Vector mx = mass * x, kx = stiffness * x;
    modes.kappa.push_back(kappa);
    modes.residuals.push_back((kx - kappa * mx).norm() / (kappa * mx.norm()));
    const double scale = 1.0 / std::sqrt(x.dot(mx));
    for (std::size_t n = 0; n < unknown.size(); ++n)
      if (unknown[n] >= 0) modes.shapes(static_cast<Eigen::Index>(n), i) = scale * x(unknown[n]);
  }
  if (!std::is_sorted(modes.kappa.begin(), modes.kappa.end())) throw SolveError("internal: eigenvalues of the membrane are not sorted");
  return modes;
}

}  // namespace carillon::analytic
