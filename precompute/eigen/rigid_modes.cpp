// Method: A rigid motion of component c is u(x) = sum_j a_j b_j(x), with three translations b = e_i and three rotations b = p_i x (x - x_c)
// / R about the centre x_c, along the principal axes p_i of its nodes. Fixed nodes require H a = 0 (H: 3 rows per fixed node, 6 columns);
// the null space of H comes from its singular value decomposition. The motions are made M-orthonormal by Gram-Schmidt, twice.
// Source: Geradin, Rixen, Mechanical Vibrations, 3rd ed. 2015, section 2.2 (rigid body modes); Golub, Van Loan, section 2.4 (null space).
#include "precompute/eigen/rigid_modes.hpp"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "precompute/comm/communicator.hpp"
#include "precompute/la/decompositions.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;
using Matrix3 = Eigen::Matrix3d;
using Vector3 = Eigen::Vector3d;
using Motions = Eigen::Matrix<double, 6, Eigen::Dynamic>;

// Smaller singular values and lengths, relative to the largest, count as zero.
constexpr double kRankTolerance = 1e-9;
constexpr double kLineTolerance = 1e-10;

Vector3 to_vector(const Vec3& x) { return {x[0], x[1], x[2]}; }

// Centre, principal axes and size of a component, fixed nodes included, the same on every rank.
struct Body {
  Vector3 centre = Vector3::Zero();
  Matrix3 axes = Matrix3::Identity();  // columns
  double radius = 1;                   // [m] root mean square distance from the centre
  Motions motions;                     // columns: admissible combinations of the six basis motions
};

// Displacement of the basis motions at x (3 x 6).
Eigen::Matrix<double, 3, 6> calc_basis(const Body& body, const Vector3& x) {
  Eigen::Matrix<double, 3, 6> basis;
  basis.leftCols<3>().setIdentity();
  const Vector3 arm = (x - body.centre) / body.radius;
  for (int i = 0; i < 3; ++i) basis.col(3 + i) = body.axes.col(i).cross(arm);
  return basis;
}

// Sums over the nodes of each component: count and position, then second moments about the centre.
std::vector<Body> calc_bodies(const comm::Communicator& comm, const NodeLayout& nodes) {
  const std::size_t count = nodes.component_count;
  std::vector<double> sums(4 * count, 0.0);
  const auto for_each_node = [&](auto&& visit) {
    for (std::size_t i = 0; i < nodes.nodes_m.size(); ++i) visit(static_cast<std::size_t>(nodes.component[i]), to_vector(nodes.nodes_m[i]));
    if (!comm.is_root()) return;  // Every rank knows the fixed nodes; only rank 0 adds them.
    for (std::size_t c = 0; c < std::min(count, nodes.fixed.size()); ++c) {
      for (const Vec3& x : nodes.fixed[c]) visit(c, to_vector(x));
    }
  };
  for_each_node([&](std::size_t c, const Vector3& x) {
    sums[4 * c] += 1;
    for (int d = 0; d < 3; ++d) sums[4 * c + 1 + static_cast<std::size_t>(d)] += x[d];
  });
  comm.sum(sums);
  std::vector<Body> bodies(count);
  for (std::size_t c = 0; c < count; ++c) {
    if (sums[4 * c] > 0) bodies[c].centre = Vector3(sums[4 * c + 1], sums[4 * c + 2], sums[4 * c + 3]) / sums[4 * c];
  }
  std::vector<double> moments(9 * count, 0.0);
  for_each_node([&](std::size_t c, const Vector3& x) {
    Eigen::Map<Matrix3> moment(moments.data() + 9 * c);
    moment += (x - bodies[c].centre) * (x - bodies[c].centre).transpose();
  });
  comm.sum(moments);
  for (std::size_t c = 0; c < count; ++c) {
    const Matrix3 moment = Eigen::Map<Matrix3>(moments.data() + 9 * c);
    const double square = moment.trace() / std::max(sums[4 * c], 1.0);
    if (square <= 0) continue;
    bodies[c].radius = std::sqrt(square);
    bodies[c].axes = Eigen::SelfAdjointEigenSolver<Matrix3>(moment).eigenvectors();
  }
  return bodies;
}

// Combinations of basis motions that vanish at the fixed nodes.
Motions calc_admissible_motions(const Body& body, const std::vector<Vec3>& fixed) {
  if (fixed.empty()) return Motions::Identity(6, 6);
  // H^T H would square the condition number; R of H = Q R is as small and preserves it.
  la::Matrix constraints(3 * static_cast<Eigen::Index>(fixed.size()), 6);
  for (std::size_t i = 0; i < fixed.size(); ++i)
    constraints.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = calc_basis(body, to_vector(fixed[i]));
  const la::Svd svd = la::calc_svd(constraints.rows() > 6 ? la::calc_qr(constraints, 0).r : constraints);
  Eigen::Index rank = 0;
  while (rank < svd.values.size() && svd.values[rank] > kRankTolerance * svd.values[0]) ++rank;
  return svd.v.rightCols(6 - rank);
}

double calc_dot(Vec a, Vec b) {
  PetscScalar dot = 0;
  check(VecDot(a, b, &dot));
  return dot;
}

double calc_mass_norm(Mat mass, Vec vector, Vec work) {
  check(MatMult(mass, vector, work));
  return std::sqrt(std::max(calc_dot(vector, work), 0.0));
}

// Sets `motion` to the displacements of component c for the combination a of its basis motions.
void fill_motion(const NodeLayout& nodes, std::int32_t c, const Body& body, const Eigen::Matrix<double, 6, 1>& a, Vec motion) {
  PetscScalar* values = nullptr;
  check(VecZeroEntries(motion));
  check(VecGetArray(motion, &values));
  for (std::size_t i = 0; i < nodes.nodes_m.size(); ++i) {
    if (nodes.component[i] == c) Eigen::Map<Vector3>(values + 3 * i) = calc_basis(body, to_vector(nodes.nodes_m[i])) * a;
  }
  check(VecRestoreArray(motion, &values));
}

// M-orthonormalises `candidate` against `basis`, the motions of the same component; false if its remaining norm is negligible relative to
// `unit`, the norm of a translation.
bool orthonormalise(Mat mass, Vec candidate, Vec work, const std::vector<Vec>& basis, double unit) {
  for (int pass = 0; pass < 2; ++pass) {
    check(MatMult(mass, candidate, work));
    for (Vec other : basis) check(VecAXPY(candidate, -calc_dot(other, work), other));
  }
  const double after = calc_mass_norm(mass, candidate, work);
  if (!(after > kLineTolerance * unit)) return false;
  check(VecScale(candidate, 1 / after));
  return true;
}

// ||K r|| must vanish relative to ||diag(K) r||, the bound from the entries of K.
void check_stress_free(Mat stiffness, Vec motion, Vec work, Vec diagonal, std::int32_t component) {
  check(MatMult(stiffness, motion, work));
  PetscReal force = 0;
  check(VecNorm(work, NORM_2, &force));
  check(VecPointwiseMult(work, diagonal, motion));
  PetscReal scale = 0;
  check(VecNorm(work, NORM_2, &scale));
  constexpr double kForceTolerance = 1e-6;
  if (!(force <= kForceTolerance * scale)) {
    throw SolveError(
        fmt::format("A rigid motion of component {} causes elastic forces ({:.2g} of the largest possible): the stiffness matrix and "
                    "the node layout are not of the same body, or fixed nodes are missing from the layout.",
                    component, force / scale));
  }
}

}  // namespace

std::vector<petsc::VecHandle> make_rigid_modes(const la::Pencil& pencil, const NodeLayout& nodes,
                                               std::vector<std::int64_t>& per_component) {
  const Mat stiffness = pencil.stiffness, mass = pencil.mass;
  const comm::Communicator comm = petsc::get_communicator(stiffness);
  std::vector<Body> bodies = calc_bodies(comm, nodes);
  petsc::VecHandle work;
  petsc::VecHandle diagonal;
  petsc::VecHandle candidate;
  check(MatCreateVecs(stiffness, candidate.out(), work.out()));
  check(VecDuplicate(work, diagonal.out()));
  check(MatGetDiagonal(stiffness, diagonal));
  std::vector<petsc::VecHandle> modes;
  static const std::vector<Vec3> none;
  per_component.clear();
  for (std::int32_t c = 0; c < nodes.component_count; ++c) {
    Body& body = bodies[c];
    const auto& fixed = static_cast<std::size_t>(c) < nodes.fixed.size() ? nodes.fixed[c] : none;
    body.motions = calc_admissible_motions(body, fixed);
    fill_motion(nodes, c, body, Eigen::Matrix<double, 6, 1>::Unit(0), candidate);
    const double unit = calc_mass_norm(mass, candidate, work);
    std::vector<Vec> of_component;
    for (Eigen::Index j = 0; j < body.motions.cols(); ++j) {
      fill_motion(nodes, c, body, body.motions.col(j), candidate);
      if (!orthonormalise(mass, candidate, work, of_component, unit)) continue;
      check_stress_free(stiffness, candidate, work, diagonal, c);
      petsc::VecHandle kept;
      check(VecDuplicate(candidate, kept.out()));
      check(VecCopy(candidate, kept));
      of_component.push_back(kept);
      modes.push_back(std::move(kept));
    }
    per_component.push_back(static_cast<std::int64_t>(of_component.size()));
  }
  // M-orthonormal so far; the square root of the factor is a power of two as well.
  for (petsc::VecHandle& mode : modes) check(VecScale(mode, 1 / std::sqrt(pencil.mass_factor)));
  return modes;
}

}  // namespace carillon::eigen
