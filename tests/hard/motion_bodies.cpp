// Hard cases of bodies that deform and move: steps at the limit of stability, snapping through, volumes that hardly change, a million
// contacts, many turns. Oracles: dense eigenvalues of an assembly of the test's own, closed forms, a standard of testing, conservation.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "precompute/simulation/transient/contact.hpp"
#include "runtime/base/error.hpp"
#include "tests/hard/figure.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/simulation/transient/bodies.hpp"
#include "tests/unit/precompute/simulation/transient/spin.hpp"

namespace carillon::hard {
namespace {

using std::numbers::pi;
using transient::Assembly;
using transient::Constraint;
using transient::Contacts;
using transient::EnergyBook;
using transient::Impulse;
using transient::Motion;
using transient::MotionOptions;
using transient::Quad;
using transient::testing::find_node;
using transient::testing::find_value;
using transient::testing::make_box;
using transient::testing::make_law;
using transient::testing::World;

// ---- the step ----

/// The fastest free motion of a body of linear tetrahedra: omega [rad/s], and its shape (3 nodes).
struct Fastest {
  double omega = 0.0;
  Eigen::VectorXd shape;
};

Fastest find_fastest(const Assembly& assembly, double young_pa, double poisson, double density) {
  const Eigen::Index size = 3 * assembly.node_count();
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(size);
  const double mu = young_pa / (2 * (1 + poisson)), lambda = young_pa * poisson / ((1 + poisson) * (1 - 2 * poisson));
  Eigen::Matrix<double, 6, 6> law = Eigen::Matrix<double, 6, 6>::Zero();
  law.topLeftCorner<3, 3>().setConstant(lambda);
  law.diagonal() += Eigen::Matrix<double, 6, 1>(2 * mu, 2 * mu, 2 * mu, mu, mu, mu);
  for (std::int32_t e = 0; e < assembly.element_count(); ++e) {
    const auto nodes = assembly.find_nodes(e);
    Eigen::Matrix4d x;
    for (int a = 0; a < 4; ++a) {
      const Vec3& at = assembly.nodes_m[nodes[a]];
      x.row(a) << 1, at[0], at[1], at[2];
    }
    const Eigen::Matrix4d inverse = x.inverse();  // column a: the coefficients of node a's shape function
    const double volume = std::abs(x.determinant()) / 6;
    Eigen::Matrix<double, 6, 12> strain = Eigen::Matrix<double, 6, 12>::Zero();
    for (int a = 0; a < 4; ++a) {
      const Eigen::Vector3d g = inverse.block<3, 1>(1, a);
      strain.block<3, 3>(0, 3 * a) = g.asDiagonal();
      strain.block<3, 3>(3, 3 * a) << 0, g(2), g(1), g(2), 0, g(0), g(1), g(0), 0;
    }
    const Eigen::Matrix<double, 12, 12> k = volume * strain.transpose() * law * strain;
    for (Eigen::Index a = 0; a < 4; ++a)
      for (Eigen::Index i = 0; i < 3; ++i) {
        const Eigen::Index row = 3 * nodes[a] + i;
        mass(row) += density * volume / 4;
        for (Eigen::Index b = 0; b < 4; ++b)
          for (Eigen::Index j = 0; j < 3; ++j) stiffness(row, 3 * nodes[b] + j) += k(3 * a + i, 3 * b + j);
      }
  }
  const Eigen::VectorXd root = mass.cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(root.asDiagonal() * stiffness * root.asDiagonal());
  return {std::sqrt(solver.eigenvalues()(size - 1)), root.asDiagonal() * solver.eigenvectors().col(size - 1)};
}

/// A step of `share` of the limit, whatever the program would choose, and the fastest motion at the start.
std::unique_ptr<Motion> start_at(World& world, const Fastest& fastest, double share, double speed_m_s) {
  MotionOptions options;
  options.sample_rate_hz = fastest.omega / (2 * share);
  options.round_steps = [](int) { return 1; };
  options.step_check_s = 1.0;  // never: a broken shape has no step
  auto motion = std::make_unique<Motion>(world.domain, options);
  const double size = speed_m_s / fastest.shape.cwiseAbs().maxCoeff();
  motion->set_start([&fastest, size](std::int32_t node, const Vec3&) {
    const Eigen::Vector3d v = size * fastest.shape.segment<3>(3 * node);
    return Motion::Start{{}, Vec3{v(0), v(1), v(2)}};
  });
  return motion;
}

double calc_speed(const Motion& motion) {
  double square = 0.0;
  for (const Quad& v : motion.get_v()) square += v.x * v.x + v.y * v.y + v.z * v.z;
  return std::sqrt(square);
}

TEST(motion, step_limit) {
  World world({{"body", make_box({0.06, 0.02, 0.02}, {3, 1, 1}, 1), make_law(1e9, 0.3, 1100), 0.0}});
  const Fastest fastest = find_fastest(*world.assembly, 1e9, 0.3, 1100);
  {
    Motion motion(world.domain, {});
    motion.prepare();
    hold("step_limit", motion.get_step_s() * fastest.omega / 2, 0.95, "the program's own step, over the limit");
  }
  const auto stable = start_at(world, fastest, 0.99, 1e-3);
  double error = 0.0;
  for (int step = 0; step < 20000; ++step) {
    stable->advance();
    if (step % 500 == 0) error = std::max(error, std::abs(stable->calc_book().relative_error));
  }
  hold("step_limit", error, 1e-6, "0.99 of the limit, energy book");
  // u grows by mu in a step: mu + 1 / mu = (omega h)^2 - 2.
  const double half_sum = 2 * 1.02 * 1.02 - 1, growth = half_sum + std::sqrt(half_sum * half_sum - 1);
  const auto unstable = start_at(world, fastest, 1.02, 1e-9);
  for (int step = 0; step < 20; ++step) unstable->advance();
  const double before = calc_speed(*unstable);
  for (int step = 0; step < 10; ++step) unstable->advance();
  hold("step_limit", std::abs(std::pow(calc_speed(*unstable) / before, 0.1) / growth - 1), 1e-3, "1.02 of it, growth in a step, relative");
  const std::string message = tests::catch_message<SolveError>([&] {
    for (int step = 0; step < 1000; ++step) unstable->advance();
  });
  hold_refusal("step_limit", message,
               {"body 'body', element ", " is turned inside out at ", ", step ", "the longest stable one", "the motion is unstable"},
               "1.02 of it");
}

// ---- snapping through ----

/// Where the middle of a shallow arch of hinged ends rests on the other side: w = sum of a_n sin(n pi x / L), a_n = e_n / (1 - p / n^2),
/// p = P / (EI pi^2 / L^2), and P = EA pi^2 / (4 L^2) sum of n^2 (e_n^2 - a_n^2); a parabola has e_n = 32 e / (pi n)^3 (Timoshenko,
/// Theory of Elastic Stability, 1961, 7.8).
double calc_snapped(double rise_m, double thickness_m) {
  const auto add_up = [&](double p, double& middle) {
    double sum = 0.0;
    middle = 0.0;
    for (int n = 1; n < 60; n += 2) {
      const double e = 32 * rise_m / std::pow(pi * n, 3), a = e / (1 - p / (n * n));
      sum += n * n * (e * e - a * a);
      middle += n % 4 == 1 ? a : -a;
    }
    return p - 12 * sum / (4 * thickness_m * thickness_m);
  };
  double low = 2.0, high = 4.0, middle = 0.0;
  for (int i = 0; i < 100; ++i) (add_up((low + high) / 2, middle) > 0 ? low : high) = (low + high) / 2;
  return middle;
}

TEST(motion, snap_through) {
  const double rise = 0.006, thickness = 0.001, young = 2e9, density = 1000;
  const comm::Communicator comm(MPI_COMM_WORLD);
  transient::SheetBody sheet{"arch", transient::make_rectangle(0.2, 0.04, 20, rise), {}, {0.0, young / 2, density, thickness, 0.0}, 400.0};
  sheet.clamped.assign(sheet.mesh.vertices_m.size(), false);
  const auto assembly = std::make_shared<const Assembly>(make_assembly(comm, std::vector<transient::AnyBody>{sheet}));
  transient::Domain domain(comm, assembly);
  std::vector<Constraint> hinges;
  for (const char* end : {"x-min", "x-max"}) {
    hinges.push_back({});
    for (const std::int32_t vertex : sheet.mesh.node_sets.at(end)) hinges.back().nodes.push_back(assembly->bodies[0].node_of_mesh[vertex]);
  }
  // Across the middle, a little to one side, so that nothing keeps it symmetric.
  std::vector<Impulse> blows;
  for (const double y : {-0.01, 0.01})
    blows.push_back({0.002, 0.004, {0, 0, -0.011}, transient::find_shares(*assembly, 0, Vec3{0.004, y, rise})});
  Motion motion(domain, {}, hinges, blows);
  const std::int32_t middle = find_node(*assembly, {0, 0, rise});
  double error = 0.0, work = 0.0, lowest = 0.0;
  while (motion.get_time_s() < 0.12) {
    for (int i = 0; i < 24; ++i) motion.advance_sample();
    const EnergyBook book = motion.calc_book();
    error = std::max(error, std::abs(book.error_j));
    work = std::max(work, book.work_j);
    lowest = std::min(lowest, rise + find_value(domain, motion.get_u(), middle)[2]);
  }
  const double end = rise + find_value(domain, motion.get_u(), middle)[2];
  EXPECT_LT(lowest, 1.01 * end);  // it swung beyond
  hold("snap_through", error / work, 1e-5, "energy book, over what the blow put in");
  hold("snap_through", std::abs(end / calc_snapped(rise, thickness) - 1), 0.02, "where it ends against a shallow arch, relative");
}

// ---- volume ----

/// First bending of a free bar of square section: ASTM E1876, which has the part of Poisson's ratio.
double calc_free_bar_hz(double length_m, double side_m, double young_pa, double nu, double density) {
  const double r = side_m * side_m / (length_m * length_m), mass = density * length_m * side_m * side_m;
  const double t1 = 1 + 6.585 * (1 + 0.0752 * nu + 0.8109 * nu * nu) * r - 0.868 * r * r -
                    8.340 * (1 + 0.2023 * nu + 2.173 * nu * nu) * r * r / (1 + 6.338 * (1 + 0.1408 * nu + 1.536 * nu * nu) * r);
  return std::sqrt(young_pa * std::pow(side_m, 4) / (0.9465 * mass * std::pow(length_m, 3) * t1));
}

TEST(motion, near_incompressible) {
  const double length = 0.2, side = 0.02, young = 1e8, density = 1000;
  for (const double nu : {0.3, 0.49, 0.499}) {
    World world({{"bar", make_box({length, side, side}, {8, 1, 1}, 2), make_law(young, nu, density), 0.0}});
    MotionOptions options;
    options.sample_rate_hz = 96000;
    Motion motion(world.domain, options);
    // cosh + cos - sigma (sinh + sin), of the beam.
    motion.set_start([&](std::int32_t, const Vec3& x) {
      const double b = 4.730040744862704, s = b * (x[0] / length + 0.5), sigma = 0.982502214576238;
      return Motion::Start{{}, Vec3{0, 0, 1e-3 * (std::cosh(s) + std::cos(s) - sigma * (std::sinh(s) + std::sin(s)))}};
    });
    const double wanted_hz = calc_free_bar_hz(length, side, young, nu, density);
    const std::int32_t middle = find_node(*world.assembly, {0, 0, 0});
    double before = 0.0, first = -1.0, last = -1.0, error = 0.0;
    int count = -1;
    std::int64_t bad = 0;
    while (motion.get_time_s() < 4.6 / wanted_hz) {
      motion.advance_sample();
      const double z = find_value(world.domain, motion.get_u(), middle)[2];
      bad += !std::isfinite(z);
      if (before < 0.0 && z >= 0.0) {
        last = motion.get_time_s() - z / (z - before) / options.sample_rate_hz;
        if (++count == 0) first = last;
      }
      before = z;
    }
    error = std::abs(motion.calc_book().relative_error);
    const std::string part = "nu " + std::to_string(nu).substr(0, 5) + ", ";
    hold("near_incompressible", static_cast<double>(bad), 0, part + "values that are no numbers");
    ASSERT_GE(count, 3);
    hold("near_incompressible", std::abs(count / (last - first) / wanted_hz - 1), 0.02,
         part + "first bending against ASTM E1876, relative");
    hold("near_incompressible", error, 1e-6, part + "energy book");
  }
}

// ---- contacts ----

/// A box whose middle cell is empty.
mesh::TetMesh make_hollow_box(double edge_m) {
  mesh::TetMesh mesh = make_box({edge_m, edge_m, edge_m}, {3, 3, 3}, 1);
  mesh::TetMesh hollow = mesh;
  hollow.tets.clear();
  hollow.regions.clear();
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    Vec3 middle{};
    for (std::size_t a = 0; a < 4; ++a) middle = middle + 0.25 * mesh.nodes_m[mesh.tet(e)[a]];
    if (std::max({std::abs(middle[0]), std::abs(middle[1]), std::abs(middle[2])}) < edge_m / 6) continue;
    hollow.tets.insert(hollow.tets.end(), mesh.tet(e).begin(), mesh.tet(e).end());
    hollow.regions.push_back(0);
  }
  return hollow;
}

TEST(motion, million_contacts) {
  const double edge = 0.03, young = 2e7, density = 1000;
  World world({{"box", make_hollow_box(edge), make_law(young, 0.3, density), 0.0}});
  MotionOptions options;
  options.sample_rate_hz = 10000;
  options.longest_step_s = 5e-6;  // twice as long: thirty times the error of the book
  Motion motion(world.domain, options);
  std::vector<std::array<std::int32_t, 3>> triangles;
  for (const auto& facet : list_skin(*world.assembly, 0)) triangles.push_back({facet[0], facet[1], facet[2]});
  const std::vector<std::int32_t> bodies(triangles.size(), 0);
  const std::vector<double> modulus{young}, reach{0.0};
  std::mt19937 chance(5);
  std::uniform_real_distribution<double> draw(-1.0, 1.0);
  std::vector<transient::BallStriker> balls(100);
  for (auto& ball : balls) {
    ball.radius_m = 0.001;
    ball.mass_kg = 2e-5;
    for (std::size_t k = 0; k < 3; ++k) ball.position_m[k] = 0.003 * draw(chance), ball.velocity_m_s[k] = draw(chance);
  }
  const auto surface = transient::make_touch_surface(world.assembly->nodes_m, triangles, bodies, modulus, reach, 0.002);
  Contacts contacts(world.domain, surface, balls, {}, {1.0, 0.0, {}});
  motion.add(contacts);
  const auto calc_momentum = [&] {
    Motion::Momentum sum = motion.calc_momentum();
    for (const auto& ball : contacts.get_strikers()) sum.linear = sum.linear + ball.mass_kg * ball.velocity_m_s;
    return sum;
  };
  const auto calc_energy = [&] {
    const EnergyBook book = motion.calc_book();
    const auto touch = contacts.calc_energy();
    return book.kinetic_j + book.elastic_j + book.dissipated_j + touch.stored_j + touch.dissipated_j - touch.put_in_j;
  };
  const Vec3 start = calc_momentum().linear;
  const double energy = calc_energy();
  double scale = 0.0;  // of one ball after another
  for (const auto& ball : balls) scale += ball.mass_kg * norm(ball.velocity_m_s);
  double shift = 0.0, gain = 0.0, book = 0.0;
  std::size_t touches = 0;
  for (int sample = 0; touches < 1'000'000 && sample < 20000; ++sample) {
    do {
      motion.advance();
      touches += contacts.count_touching();
    } while (!motion.is_at_sample());
    if (sample % 20 != 0) continue;
    shift = std::max(shift, norm(calc_momentum().linear - start) / scale);
    gain = std::max(gain, std::abs(calc_energy() / energy - 1.0));
    book = std::max(book, std::abs(motion.calc_book().relative_error));
  }
  EXPECT_GE(touches, 1'000'000U);
  for (const auto& ball : contacts.get_strikers()) EXPECT_TRUE(std::isfinite(norm(ball.position_m)));
  hold("million_contacts", shift, 1e-9, "momentum of box and balls, over that of the balls");
  hold("million_contacts", gain, 1e-2, "energy of box, balls and contacts, relative");
  hold("million_contacts", book, 1e-5, "energy book of the box");
}

// ---- turns ----

TEST(motion, free_spin) {
  for (const int order : {1, 2}) {
    const transient::testing::Turned turned = transient::testing::turn_fifteen_times(order);
    const std::string part = order == 1 ? "T4, " : "T10, ";
    EXPECT_GT(turned.stretch, 1e-3);
    hold("free_spin", turned.angular_error, 1e-13, part + "angular momentum, relative");
    hold("free_spin", turned.linear_error, 1e-13, part + "momentum, relative");
    hold("free_spin", turned.book_error, 1e-6, part + "energy book");
  }
}

}  // namespace
}  // namespace carillon::hard
