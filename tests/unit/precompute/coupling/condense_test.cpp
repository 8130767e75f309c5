// Condensed energy against the full Saint Venant-Kirchhoff energy of a small mesh, minimised over all other displacements by Newton's
// method with Eigen; invariance to ranks, rotations of the modes, the construction of the fields and the stored form.
#include "precompute/coupling/condense.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "precompute/coupling/points.hpp"
#include "precompute/coupling/static_answer.hpp"
#include "precompute/coupling/stresses.hpp"
#include "precompute/la/node_matrix.hpp"
#include "precompute/mesh/check.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/ranks.hpp"
#include "tests/unit/precompute/coupling/bodies.hpp"

namespace carillon::coupling {
namespace {

using tests::make_box;
using tests::make_solid;
using tests::ModalBody;
using tests::solve_body;

const material::Material kSteel = make_solid(200e9, 0.3, 7800);

/// Saint Venant-Kirchhoff energy of T10 with four points, forces and stiffness, dense, one rank. Free nodes come first.
class FullEnergy {
 public:
  FullEnergy(const mesh::LocalMesh& local, const material::Material& material) : free_(3 * local.free_nodes) {
    const double a = 0.5854101966249685, b = 0.1381966011250105;
    lambda_ = material.lame_lambda_pa();
    mu_ = material.lame_mu_pa();
    for (std::int32_t e = 0; e < local.tet_count(); ++e)
      for (int p = 0; p < 4; ++p) {
        std::array<double, 4> l{b, b, b, b};
        l[p] = a;
        Point point;
        Eigen::Matrix<double, 10, 4> slope = Eigen::Matrix<double, 10, 4>::Zero();  // by barycentric coordinates
        for (int i = 0; i < 4; ++i) slope(i, i) = 4 * l[i] - 1;
        constexpr int kEnds[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};
        for (int i = 0; i < 6; ++i) {
          slope(4 + i, kEnds[i][0]) = 4 * l[kEnds[i][1]];
          slope(4 + i, kEnds[i][1]) = 4 * l[kEnds[i][0]];
        }
        Eigen::Matrix<double, 3, 10> x;
        for (int i = 0; i < 10; ++i) {
          point.node[i] = local.tets[10 * e + i];
          for (int k = 0; k < 3; ++k) x(k, i) = local.nodes_m[point.node[i]][k];
        }
        Eigen::Matrix<double, 10, 3> by_xi;
        for (int k = 0; k < 3; ++k) by_xi.col(k) = slope.col(k + 1) - slope.col(0);
        const Eigen::Matrix3d jacobian = x * by_xi;
        point.slope = by_xi * jacobian.inverse();
        point.weight = jacobian.determinant() / 24;
        points_.push_back(point);
      }
  }

  double calc(const Eigen::VectorXd& u, Eigen::VectorXd* force, Eigen::MatrixXd* stiffness) const {
    double energy = 0;
    if (force != nullptr) force->setZero(free_);
    if (stiffness != nullptr) stiffness->setZero(free_, free_);
    for (const Point& point : points_) {
      Eigen::Matrix<double, 3, 10> values = Eigen::Matrix<double, 3, 10>::Zero();
      for (int i = 0; i < 10; ++i)
        if (const int row = 3 * point.node[i]; row < free_) values.col(i) = u.segment<3>(row);
      const Eigen::Matrix3d h = values * point.slope, f = Eigen::Matrix3d::Identity() + h;
      const Eigen::Matrix3d strain = 0.5 * (h + h.transpose() + h.transpose() * h);
      const Eigen::Matrix3d stress = lambda_ * strain.trace() * Eigen::Matrix3d::Identity() + 2 * mu_ * strain;
      energy += point.weight * (0.5 * lambda_ * strain.trace() * strain.trace() + mu_ * strain.squaredNorm());
      if (force == nullptr) continue;
      // dE = sym(F^T dH): its 6 rows in Voigt's form
      Eigen::Matrix<double, 6, 30> b;
      constexpr int kAxes[6][2] = {{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}};
      for (int c = 0; c < 6; ++c)
        for (int i = 0; i < 10; ++i)
          for (int k = 0; k < 3; ++k) {
            const int p = kAxes[c][0], q = kAxes[c][1];
            b(c, 3 * i + k) = f(k, p) * point.slope(i, q) + (p == q ? 0.0 : f(k, q) * point.slope(i, p));
          }
      Eigen::Matrix<double, 6, 1> s;
      for (int c = 0; c < 6; ++c) s[c] = stress(kAxes[c][0], kAxes[c][1]);
      Eigen::Matrix<double, 6, 6> law = Eigen::Matrix<double, 6, 6>::Zero();
      law.topLeftCorner<3, 3>().setConstant(lambda_);
      law.diagonal() += (Eigen::Matrix<double, 6, 1>() << 2, 2, 2, 1, 1, 1).finished() * mu_;
      const Eigen::Matrix<double, 30, 1> g = point.weight * b.transpose() * s;
      Eigen::Matrix<double, 30, 30> k = point.weight * b.transpose() * law * b;
      const Eigen::Matrix<double, 10, 10> initial = point.weight * point.slope * stress * point.slope.transpose();
      for (int i = 0; i < 10; ++i)
        for (int j = 0; j < 10; ++j)
          for (int d = 0; d < 3; ++d) k(3 * i + d, 3 * j + d) += initial(i, j);
      for (int i = 0; i < 10; ++i) {
        const int row = 3 * point.node[i];
        if (row >= free_) continue;
        force->segment<3>(row) += g.segment<3>(3 * i);
        for (int j = 0; j < 10; ++j)
          if (const int column = 3 * point.node[j]; column < free_ && stiffness != nullptr)
            stiffness->block<3, 3>(row, column) += k.block<3, 3>(3 * i, 3 * j);
      }
    }
    return energy;
  }

  /// Minimum energy over displacements with the modal coordinates q of `phi` (free, N); m_phi = M phi.
  double minimise(const Eigen::MatrixXd& phi, const Eigen::MatrixXd& m_phi, const Eigen::VectorXd& q) const {
    Eigen::VectorXd u = phi * q, force;
    Eigen::MatrixXd stiffness;
    double energy = 0;
    const Eigen::Index n = free_, modes = phi.cols();
    for (int step = 0; step < 12; ++step) {
      energy = calc(u, &force, &stiffness);
      Eigen::MatrixXd system = Eigen::MatrixXd::Zero(n + modes, n + modes);
      system.topLeftCorner(n, n) = stiffness / lambda_;
      system.topRightCorner(n, modes) = m_phi / m_phi.cwiseAbs().maxCoeff();
      system.bottomLeftCorner(modes, n) = system.topRightCorner(n, modes).transpose();
      Eigen::VectorXd side = Eigen::VectorXd::Zero(n + modes);
      side.head(n) = -force / lambda_;
      const Eigen::VectorXd change = system.partialPivLu().solve(side).head(n);
      u += change;
      if (change.norm() < 1e-13 * u.norm()) break;
    }
    return energy;
  }

 private:
  struct Point {
    std::array<int, 10> node{};
    Eigen::Matrix<double, 10, 3> slope;
    double weight = 0;
  };
  Eigen::Index free_;
  double lambda_ = 0, mu_ = 0;
  std::vector<Point> points_;
};

/// A strip with held ends, thin and flat, or a shallow arch.
mesh::TetMesh make_strip(double rise_m) {
  mesh::TetMesh mesh = make_box({6, 1, 1}, {0.2, 0.02, 0.001}, 1);
  for (Vec3& x : mesh.nodes_m) x[2] += 4 * rise_m * (x[0] / 0.2) * (1 - x[0] / 0.2);
  return mesh::to_quadratic(mesh);  // elements stay straight: four points are exact
}
bool is_end(const Vec3& x) { return x[0] < 1e-9 || x[0] > 0.2 - 1e-9; }

struct Oracle {
  ModalBody body;
  Eigen::MatrixXd phi, m_phi;
  FullEnergy energy;
};

Oracle make_oracle(double rise_m, int modes) {
  ModalBody body = solve_body(PETSC_COMM_SELF, make_strip(rise_m), is_end, kSteel, modes);
  const la::LocalColumns shapes(body.modes.shapes);
  Eigen::MatrixXd phi(shapes.rows, modes), image(shapes.rows, modes);
  for (int j = 0; j < modes; ++j) phi.col(j) = Eigen::Map<const Eigen::VectorXd>(shapes.column(j), shapes.rows);
  const la::NodeMatrix mass(body.system.mass);
  mass.multiply({phi.data(), phi.rows(), phi.rows(), modes}, {image.data(), phi.rows(), phi.rows(), modes});
  FullEnergy energy(body.pieces.local, kSteel);
  return {std::move(body), phi, image, std::move(energy)};
}

std::vector<double> negate(std::vector<double> q) {
  for (double& value : q) value = -value;
  return q;
}

/// V(q) and V(-q) of the full energy without the linear one.
std::array<double, 2> calc_full(const Oracle& oracle, const std::vector<double>& q) {
  const auto modes = static_cast<Eigen::Index>(q.size());
  const Eigen::Map<const Eigen::VectorXd> at(q.data(), modes);
  double linear = 0;
  for (std::size_t i = 0; i < q.size(); ++i) linear += 0.5 * oracle.body.modes.lambda[i] * q[i] * q[i];
  const Eigen::MatrixXd phi = oracle.phi.leftCols(modes), m_phi = oracle.m_phi.leftCols(modes);
  return {oracle.energy.minimise(phi, m_phi, at) - linear, oracle.energy.minimise(phi, m_phi, -at) - linear};
}

std::vector<double> make_motion(const ModalBody& body, std::size_t modes, double amplitude_m) {
  std::vector<double> q;
  for (std::size_t i = 0; i < modes; ++i)
    q.push_back((i % 2 == 0 ? 1.0 : -0.7) * amplitude_m / body.peak(static_cast<int>(i)) / static_cast<double>(i + 1));
  return q;
}

TEST(CondensedEnergy, is_curved_only_by_fields_that_hold_energy) {
  la::Matrix linear(2, 1), small(2, 3), large(2, 3);
  linear << 0, 3;
  small << 1, 2, 3, 1e-3, -1e-3, 1e-3;
  large << 1, 2, 3, 2, -2, 2;
  EXPECT_NEAR(calc_curvature(linear, small, {3.0}, 5e-3), 0, 2e-3) << "all of the mode's strain is in a field next to nothing";
  EXPECT_NEAR(calc_curvature(linear, small, {3.0}, 0), 1, 1e-6);
  EXPECT_NEAR(calc_curvature(linear, large, {3.0}, 5e-3), 1, 1e-6);
}

TEST(CondensedEnergy, is_the_least_energy_of_a_flat_strip) {
  if (tests::get_rank() != 0) return;
  const Oracle oracle = make_oracle(0, 3);
  const Condensed result = condense_modes(PETSC_COMM_SELF, oracle.body.solved(), {.modes = 3, .below_hz = 1e6, .energy_error = 1e-8});
  ASSERT_EQ(result.energy.modes, (std::vector<std::int32_t>{0, 1, 2}));
  const std::vector<double> q = make_motion(oracle.body, 3, 2e-5);  // a fiftieth of the thickness: terms beyond the quartic one are 1e-4
  EXPECT_TRUE(result.energy.linear.empty()) << "the mesh makes a cubic part, which is left out";
  const auto [plus, minus] = calc_full(oracle, q);
  EXPECT_NEAR(0.5 * (plus + minus) / tests::calc_energy(PETSC_COMM_SELF, result.energy, q), 1, 2e-3);
}

TEST(CondensedEnergy, has_the_cubic_part_of_an_arch) {
  if (tests::get_rank() != 0) return;
  const Oracle oracle = make_oracle(0.002, 3);
  const Condensed result = condense_modes(PETSC_COMM_SELF, oracle.body.solved(), {.modes = 3, .below_hz = 1e6, .energy_error = 1e-8});
  ASSERT_FALSE(result.energy.linear.empty()) << "it is curved";
  const std::vector<double> q = make_motion(oracle.body, 3, 1e-5);
  const auto [plus, minus] = calc_full(oracle, q);
  const double odd = tests::calc_energy(PETSC_COMM_SELF, result.energy, q) - tests::calc_energy(PETSC_COMM_SELF, result.energy, negate(q));
  EXPECT_NEAR((plus - minus) / odd, 1, 1e-4);
  const double even = tests::calc_energy(PETSC_COMM_SELF, result.energy, q) + tests::calc_energy(PETSC_COMM_SELF, result.energy, negate(q));
  EXPECT_NEAR((plus + minus) / even, 1, 0.02) << "what a stress of the modes does on condensed rotations is left out";
}

/// A rectangular plate held at one edge, without degenerate modes.
ModalBody make_plate(MPI_Comm comm, int modes, const tests::IsFixed& is_fixed) {
  return solve_body(comm, make_box({8, 6, 1}, {0.2, 0.13, 0.001}, 2), is_fixed, kSteel, modes);
}
bool is_left(const Vec3& x) { return x[0] < 1e-9; }

TEST(CondensedEnergy, is_the_same_on_any_number_of_ranks) {
  for (const bool is_free : {false, true}) {
    const tests::IsFixed fixed = is_free ? tests::IsFixed() : tests::IsFixed(is_left);
    const ModalBody all = make_plate(PETSC_COMM_WORLD, 8, fixed), one = make_plate(PETSC_COMM_SELF, 8, fixed);
    const CondenseOptions options{.modes = 6, .below_hz = 1e6, .energy_error = 1e-7};
    const Condensed of_all = condense_modes(all.comm, all.solved(), options), of_one = condense_modes(one.comm, one.solved(), options);
    const std::vector<double> q = make_motion(one, 6, 1e-3);
    const double expected = tests::calc_energy(one.comm, of_one.energy, q);
    EXPECT_GT(expected, 0);
    EXPECT_NEAR(tests::calc_energy(all.comm, of_all.energy, q) / expected, 1, 1e-6) << (is_free ? "free" : "held");
    EXPECT_NEAR(of_all.energy.membrane_ratio / of_one.energy.membrane_ratio, 1, 1e-6);
  }
}

TEST(CondensedEnergy, does_not_change_when_modes_are_turned_among_themselves) {
  const ModalBody body = make_plate(PETSC_COMM_WORLD, 6, {});
  const CondenseOptions options{.modes = 6, .below_hz = 1e6, .energy_error = 1e-7};
  const Condensed before = condense_modes(body.comm, body.solved(), options);
  const std::vector<double> q = make_motion(body, 6, 1e-3);
  const double c = std::cos(0.7), s = std::sin(0.7);
  {
    const la::LocalColumns shapes(body.modes.shapes);
    for (PetscInt row = 0; row < shapes.rows; ++row) {
      double &a = shapes.column(1)[row], &b = shapes.column(2)[row];
      const double turned = c * a + s * b;
      b = c * b - s * a;
      a = turned;
    }
  }
  std::vector<double> turned = q;
  turned[1] = c * q[1] + s * q[2];
  turned[2] = c * q[2] - s * q[1];
  const Condensed after = condense_modes(body.comm, body.solved(), options);
  EXPECT_NEAR(tests::calc_energy(body.comm, after.energy, turned) / tests::calc_energy(body.comm, before.energy, q), 1, 1e-5);
}

/// Input of both methods for the fields.
struct Coupled {
  explicit Coupled(const ModalBody& given, int count)
      : modal(given),
        strains(given.pieces.local, given.materials),
        shapes(given.modes.shapes),
        answer(given.comm, given.pieces.local, given.system.stiffness, given.system.mass, shapes.view().part(0, count),
               given.modes.lambda[0]),
        nodal(answer.spread(shapes.view().part(0, count))) {
    for (int i = 0; i < count; ++i) omega.push_back(std::sqrt(given.modes.lambda[i]));
  }
  CoupledBody body() {
    return {modal.comm, strains, answer, nodal, omega, Pairs{static_cast<std::ptrdiff_t>(omega.size())}, [](double) {}};
  }

  const ModalBody& modal;
  Strains strains;
  la::LocalColumns shapes;
  StaticAnswer answer;
  Nodal nodal;
  std::vector<double> omega;
};

TEST(Gram, of_a_free_plate_is_symmetric_and_not_negative) {
  const ModalBody modal = make_plate(PETSC_COMM_WORLD, 6, {});
  Coupled coupled(modal, 6);
  const Gram gram = calc_gram(coupled.body());
  EXPECT_EQ((gram.values - gram.values.transpose()).norm(), 0);
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(gram.values).eigenvalues();
  EXPECT_GT(values.minCoeff(), -1e-12 * values.maxCoeff());
  EXPECT_GT(values.minCoeff(), 0);
}

TEST(Fields, of_sampled_motions_give_the_energy_of_all_pairs) {
  const ModalBody modal = make_plate(PETSC_COMM_WORLD, 10, is_left);
  Coupled coupled(modal, 10);
  const StressFields pairs = calc_fields_of_pairs(coupled.body(), 1e-5, true), samples = calc_fields_of_samples(coupled.body(), 1e-5);
  const Samples motions = make_samples(coupled.omega, 20, 99);
  const auto calc = [&](const StressFields& fields) { return (fields.form * motions.products).colwise().squaredNorm().eval(); };
  EXPECT_LT((calc(samples).cwiseQuotient(calc(pairs)).array() - 1).abs().maxCoeff(), 1e-4);
  // Both sets of fields are orthonormal
  for (const StressFields* fields : {&pairs, &samples}) {
    la::Matrix values = fields->values;
    const la::Columns columns{values.data(), values.rows(), values.rows(), static_cast<int>(values.cols())};
    const la::Matrix products = la::multiply_transposed(modal.comm, columns, columns);
    EXPECT_LT((products - la::Matrix::Identity(products.rows(), products.cols())).cwiseAbs().maxCoeff(), 1e-6);
  }
}

TEST(Points, give_the_energy_within_the_error_that_they_state) {
  const ModalBody modal = make_plate(PETSC_COMM_WORLD, 12, is_left);
  Coupled coupled(modal, 12);
  const StressFields fields = calc_fields_of_samples(coupled.body(), 5e-3);
  const CouplingPoints points = choose_points(coupled.body(), modal.pieces.local, fields, 1e-2, 200);
  if (!modal.comm.is_root()) return;
  EXPECT_LE(points.error, 1e-2);
  EXPECT_GT(points.weight.minCoeff(), 0);
  EXPECT_LT(points.weight.size(), 60);
  const Samples motions = make_samples(coupled.omega, 30, 99);
  for (Eigen::Index k = 0; k < 30; ++k) {
    la::Vector eta = la::Vector::Zero(points.stress.cols());
    for (Eigen::Index p = 0; p < points.weight.size(); ++p) {
      const la::Vector h = points.gradient.middleRows(9 * p, 9) * motions.q.col(k);
      const Eigen::Matrix3d gradient = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data());
      const Eigen::Matrix3d e = 0.5 * gradient.transpose() * gradient;
      Eigen::Matrix<double, 6, 1> strain;
      strain << e(0, 0), e(1, 1), e(2, 2), 2 * e(1, 2), 2 * e(0, 2), 2 * e(0, 1);
      eta += points.weight[p] * points.stress.middleRows(6 * p, 6).transpose() * strain;
    }
    EXPECT_NEAR(eta.squaredNorm() / (fields.form * motions.products.col(k)).squaredNorm(), 1, 2e-2) << k;
  }
}

TEST(CondenseModes, says_in_words_what_it_cannot_do) {
  const ModalBody body = make_plate(PETSC_COMM_WORLD, 4, {});
  EXPECT_NE(tests::catch_message<InputError>([&] {
              condense_modes(body.comm, body.solved(), {.modes = 30});
            }).find("asks for 30 coupled modes, and the body has 4"),
            std::string::npos);
  SolvedModes two = body.solved();
  two.components = 2;
  EXPECT_NE(tests::catch_message<InputError>([&] { condense_modes(body.comm, two, {.modes = 2}); }).find("this one has 2 parts"),
            std::string::npos);
}

TEST(CondenseModes, finds_nothing_to_couple_in_a_block) {
  const ModalBody body = solve_body(PETSC_COMM_WORLD, make_box({3, 3, 3}, {0.1, 0.11, 0.12}, 2), {}, kSteel, 6);
  const Condensed result = condense_modes(body.comm, body.solved(), {.modes = 6, .below_hz = 1e6});
  EXPECT_TRUE(result.energy.is_empty());
  EXPECT_GT(result.membrane_hz, 0);
}

}  // namespace
}  // namespace carillon::coupling
