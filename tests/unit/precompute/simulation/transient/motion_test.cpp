// Moving bodies: conservation laws, waves in bars, supports, energy book, termination. Oracles: closed forms.
#include "precompute/simulation/transient/motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/ranks.hpp"
#include "tests/unit/precompute/simulation/transient/bodies.hpp"
#include "tests/unit/precompute/simulation/transient/spin.hpp"

namespace carillon::transient {
namespace {

using std::numbers::pi;
using testing::find_node;
using testing::find_value;
using testing::make_box;
using testing::make_law;
using testing::World;

std::vector<SolidBody> make_body(int order, const std::array<double, 3>& edges, const std::array<int, 3>& cells, const Law& law,
                                 double mass_damping = 0.0) {
  return {{"body", make_box(edges, cells, order), law, mass_damping}};
}

// ---- conservation ----

class Spin : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Orders, Spin, ::testing::Values(1, 2));

TEST_P(Spin, momentum_and_energy) {
  if (tests::get_ranks() > 1) GTEST_SKIP() << "tens of thousands of steps";
  const testing::Turned turned = testing::turn_fifteen_times(GetParam());
  EXPECT_LE(turned.step_s, 5e-7);
  EXPECT_LT(turned.book_error, 1e-6);
  EXPECT_GT(turned.stretch, 1e-3);
  EXPECT_LT(turned.angular_error, 1e-13);
  EXPECT_LT(turned.linear_error, 1e-13);
}

TEST(Motion, free_fall) {
  World world(make_body(1, {0.06, 0.02, 0.02}, {3, 1, 1}, make_law(1e9, 0.3, 1100)));
  MotionOptions options;
  options.gravity_m_s2 = {1.0, 0.0, -9.81};
  Motion motion(world.domain, options);
  for (int i = 0; i < 48; ++i) motion.advance_sample();
  const double t = motion.get_time_s();
  EXPECT_NEAR(t, 1e-3, 1e-15);
  for (std::int32_t i = 0; i < world.domain.own_count(); ++i) {
    const Quad& u = motion.get_u()[i];
    // The first half step is from rest at -h/2: h^2 n (n + 1) / 2 instead of t^2 / 2.
    const double h = motion.get_step_s(), half_square = 0.5 * (t * t + t * h);
    EXPECT_NEAR(u.z, -9.81 * half_square, 1e-16);
    EXPECT_NEAR(u.x, half_square, 1e-16);
    EXPECT_NEAR(u.y, 0.0, 1e-16);
  }
  EXPECT_LT(std::abs(motion.calc_book().relative_error), 1e-12);
}

TEST(Motion, impulse) {
  World world(make_body(2, {0.06, 0.02, 0.02}, {3, 1, 1}, make_law(70e9, 0.3, 2700, 1e-8)));
  const Vec3 place{0.02, 0.004, 0.01}, blow{1e-4, 2e-5, -3e-4};
  Motion motion(world.domain, {}, {}, {{1e-4, 5e-4, blow, find_shares(*world.assembly, 0, place)}});
  for (int i = 0; i < 40; ++i) motion.advance_sample();
  const Motion::Momentum momentum = motion.calc_momentum();
  EXPECT_LT(norm(momentum.linear - blow), 1e-9 * norm(blow));
  // Small displacement during the impulse.
  EXPECT_LT(norm(momentum.angular - cross(place, blow)), 1e-4 * norm(cross(place, blow)));
  const EnergyBook book = motion.calc_book();
  EXPECT_LT(std::abs(book.relative_error), 1e-6);
  EXPECT_GT(book.dissipated_j, 0.0);
  EXPECT_GT(book.work_j, 0.5 * dot(blow, blow) / world.calc_mass());
}

// ---- bars ----

/// Frequency [Hz] of a sampled oscillation about 0 from its first and last rising crossing.
double find_frequency(const std::vector<double>& q, double step_s) {
  double first = -1.0, last = -1.0;
  int count = -1;
  for (std::size_t i = 1; i < q.size(); ++i)
    if (q[i - 1] < 0.0 && q[i] >= 0.0) {
      last = (static_cast<double>(i) - q[i] / (q[i] - q[i - 1])) * step_s;
      if (++count == 0) first = last;
    }
  return count / (last - first);
}

double to_cents(double f, double truth) { return 1200.0 * std::log2(f / truth); }

struct Wave {
  int order;
  std::array<int, 3> cells;
  double side_m;
  double stretch = 1.0;
  bool is_constrained = false;  // both ends
  std::size_t axis = 0;
  double seconds = 0.02;
};

/// Frequency of the standing wave with initial velocity shape(x) of a prestretched bar.
double find_wave(const Wave& wave, double (*shape)(double)) {
  // E / rho = (1,000 m/s)^2, no lateral contraction.
  World world(make_body(wave.order, {0.5, wave.side_m, wave.side_m}, wave.cells, make_law(1e9, 0.0, 1000)));
  std::vector<Constraint> constraints;
  if (wave.is_constrained) constraints = {{world.list_set("x-min"), {}, false}, {world.list_set("x-max"), {}, false}};
  MotionOptions options;
  options.sample_rate_hz = 100000;
  options.longest_step_s = wave.order == 1 ? 2e-6 : 1e-6;
  Motion motion(world.domain, options, constraints);
  motion.set_start([&](std::int32_t, const Vec3& x) {
    Motion::Start start{{(wave.stretch - 1.0) * x[0], 0.0, 0.0}, {}};
    start.velocity_m_s[wave.axis] = 1e-3 * shape(x[0] / 0.5 + 0.5);
    return start;
  });
  std::vector<double> q;
  while (motion.get_time_s() < wave.seconds) {
    motion.advance_sample();
    double sum = 0.0;
    for (std::int32_t i = 0; i < world.domain.own_count(); ++i) {
      const std::size_t at = i;
      const Quad& u = motion.get_u()[at];
      const double x = world.domain.get_rest_m()[at][0];
      sum += world.domain.get_masses_kg()[at] * shape(x / 0.5 + 0.5) * (wave.axis == 0 ? u.x - (wave.stretch - 1.0) * x : u.z);
    }
    q.push_back(world.comm.sum(sum));
  }
  return find_frequency(q, 1e-5);
}

TEST(Bar, free_bar_frequency) {
  if (tests::get_ranks() > 1) GTEST_SKIP() << "tens of thousands of steps";
  const auto shape = [](double x) { return std::cos(pi * x); };
  EXPECT_NEAR(to_cents(find_wave({1, {50, 1, 1}, 0.01}, shape), 1000.0), 0.0, 1.0);
  EXPECT_NEAR(to_cents(find_wave({2, {25, 1, 1}, 0.02}, shape), 1000.0), 0.0, 1.0);
}

// In coordinates of the rest shape a stretched bar has the speed c sqrt((3 l^2 - 1) / 2) along it, and as a string c sqrt((l^2 - 1) / 2)
// across it. A string with stiff, clamped ends is higher by 1 + 2 e + (4 + pi^2 / 2) e^2, e^2 = bending stiffness / (tension length^2)
// (Morse 1948); the bending stiffness is that of the stretched bar.
TEST(Bar, stretched_bar_frequency) {
  if (tests::get_ranks() > 1) GTEST_SKIP() << "tens of thousands of steps";
  const auto shape = [](double x) { return std::sin(pi * x); };
  for (const double stretch : {1.01, 1.1, 1.5}) {
    const double along = 1000.0 * std::sqrt((3 * stretch * stretch - 1) / 2);
    EXPECT_NEAR(find_wave({1, {50, 1, 1}, 0.01, stretch, true, 0, 0.02}, shape) / along, 1.0, 5e-3) << stretch;
    EXPECT_NEAR(find_wave({2, {25, 1, 1}, 0.02, stretch, true, 0, 0.02}, shape) / along, 1.0, 5e-3) << stretch;
  }
  for (const double stretch : {1.2, 1.5}) {
    const double side = 0.005, tension = (stretch * stretch - 1) / 2;
    const double stiffness = (3 * stretch * stretch - 1) / 2 / (stretch * stretch) * side * side / 12;
    const double e = std::sqrt(stiffness / tension) / 0.5;
    const double across = 1000.0 * std::sqrt(tension) * (1 + 2 * e + (4 + pi * pi / 2) * e * e);
    EXPECT_NEAR(find_wave({2, {40, 1, 1}, side, stretch, true, 2, 0.02}, shape) / across, 1.0, 5e-3) << stretch;
  }
}

// ---- supports ----

/// A bar bent at its end within 1 ms, held, and released at 1.25 ms.
struct Plucked {
  World world{make_body(1, {0.06, 0.02, 0.02}, {6, 2, 2}, make_law(1e8, 0.3, 1100))};
  Motion motion;
  static MotionOptions make_options() {
    MotionOptions options;
    options.longest_step_s = 1e-6;
    return options;
  }
  explicit Plucked(double release_s, bool is_clamped = true)
      : motion(world.domain, make_options(),
               {{is_clamped ? world.list_set("x-min") : std::vector<std::int32_t>{}, {}, false},
                {world.list_set("x-max"), Path({{0.0, {0, 0, 0}}, {1e-3, {0, 0, -2e-4}}}), false, release_s}}) {}
  double find_end() {
    double most = 0.0;
    for (const std::int32_t node : world.list_set("x-max")) {
      const Vec3 u = find_value(world.domain, motion.get_u(), node);
      most = std::max(most, norm(u - Vec3{0, 0, -2e-4}));
    }
    return most;
  }
};

TEST(Constraint, release_conserves_energy) {
  Plucked bar(1.25e-3);
  while (bar.motion.get_time_s() < 1.25e-3 - 1e-9) bar.motion.advance_sample();
  EXPECT_LT(bar.find_end(), 1e-17);
  const EnergyBook held = bar.motion.calc_book();
  EXPECT_GT(held.work_j, 0.0);
  double far = 0.0;
  while (bar.motion.get_time_s() < 4e-3) {
    bar.motion.advance_sample();
    far = std::max(far, bar.find_end());
    const EnergyBook book = bar.motion.calc_book();
    EXPECT_NEAR(book.work_j, held.work_j, 1e-12 * held.work_j);  // no work by the release
    EXPECT_LT(std::abs(book.relative_error), 1e-6);
  }
  EXPECT_GT(far, 2e-4);
  EXPECT_EQ(norm(bar.motion.calc_reaction(1)), 0.0);
}

TEST(Constraint, resumption_around_release) {
  for (const double stop_s : {1e-3, 2e-3}) {
    Plucked whole(1.25e-3), first(1.25e-3), second(1.25e-3);
    while (first.motion.get_time_s() < stop_s) first.motion.advance_sample();
    second.motion.load(first.motion.save());
    while (whole.motion.get_time_s() < 3e-3) whole.motion.advance_sample();
    while (second.motion.get_time_s() < 3e-3) second.motion.advance_sample();
    EXPECT_EQ(whole.find_end(), second.find_end()) << stop_s;
  }
}

TEST(Constraint, release_of_a_free_body) {
  // Released in the middle of its path, it keeps its momentum.
  Plucked bar(5e-4, false);
  while (bar.motion.get_time_s() < 6e-4) bar.motion.advance_sample();
  const Vec3 thrown = bar.motion.calc_momentum().linear;
  EXPECT_LT(thrown[2], -0.01 * bar.world.calc_mass());
  while (bar.motion.get_time_s() < 3e-3) bar.motion.advance_sample();
  EXPECT_LT(norm(bar.motion.calc_momentum().linear - thrown), 1e-9 * norm(thrown));
}

TEST(Constraint, driven_and_fixed_nodes) {
  World world(make_body(1, {0.06, 0.02, 0.02}, {6, 2, 2}, make_law(1e8, 0.3, 1100, 1e-6)));
  const Path path({{0.0, {0, 0, 0}}, {5e-4, {2e-3, 1e-3, 0}}, {1e-3, {0, 0, -1e-3}}});
  // In large motion the energy error is that of the steps: a quarter with half the step.
  double error[2] = {};
  for (const int divisor : {1, 2}) {
    MotionOptions options;
    options.longest_step_s = 1e-6 / divisor;
    Motion motion(world.domain, options, {{world.list_set("x-min"), {}, false}, {world.list_set("x-max"), path, false}});
    while (motion.get_time_s() < 1.2e-3) {
      motion.advance_sample();
      for (const std::int32_t node : world.list_set("x-min")) EXPECT_EQ(norm(find_value(world.domain, motion.get_u(), node)), 0.0);
      for (const std::int32_t node : world.list_set("x-max"))
        EXPECT_LT(norm(find_value(world.domain, motion.get_u(), node) - path.calc(motion.get_time_s())), 1e-17);
      const double relative = std::abs(motion.calc_book().relative_error);
      EXPECT_LT(relative, 1e-6);
      error[divisor - 1] = std::max(error[divisor - 1], relative);
    }
    EXPECT_GT(motion.calc_book().work_j, 1e-3);
    EXPECT_GT(motion.calc_book().dissipated_j, 1e-3);
  }
  EXPECT_NEAR(error[0] / error[1], 4.0, 0.5);
}

// Slowly applied weight: support reaction, apart from the bar's own oscillation, which is damped out.
TEST(Constraint, support_reaction) {
  World world(make_body(1, {0.02, 0.02, 0.06}, {2, 2, 6}, make_law(1e6, 0.3, 1100), 300.0));
  MotionOptions options;
  options.gravity_m_s2 = {0, 0, -9.81};
  options.settle_s = 0.05;
  Motion motion(world.domain, options, {{world.list_set("z-max"), {}, false}});
  while (motion.get_time_s() < 0.1) motion.advance_sample();
  const double weight = 9.81 * world.calc_mass();
  EXPECT_NEAR(motion.calc_reaction(0)[2] / weight, 1.0, 0.01);
  EXPECT_NEAR(motion.calc_reaction(0)[0] / weight, 0.0, 0.01);
  // The stretch under the own weight: rho g L^2 / 2 E, less a little where the top face is held from contracting.
  const Vec3 end = find_value(world.domain, motion.get_u(), find_node(*world.assembly, {0, 0, -0.03}));
  EXPECT_NEAR(end[2] / (-1100 * 9.81 * 0.06 * 0.06 / 2e6), 1.0, 0.1);
  const EnergyBook book = motion.calc_book();
  EXPECT_LT(std::abs(book.relative_error), 1e-6);
  EXPECT_GT(book.dissipated_j, 0.0);
}

// Mass damping acts on vibration only, not on flight and spin.
TEST(Motion, mass_damping_of_free_flight) {
  World world(make_body(2, {0.06, 0.02, 0.02}, {3, 1, 1}, make_law(1e8, 0.3, 1100), 2000.0));
  Motion motion(world.domain, {});
  motion.set_start([&](std::int32_t, const Vec3& x) {
    return Motion::Start{{}, Vec3{0.03 - 0.2 * x[1] + 0.05 * std::sin(50 * x[0]), 0.2 * x[0], 0.03 * std::cos(60.0 * x[0])}};
  });
  const Motion::Momentum before = motion.calc_momentum();
  const double kinetic = motion.calc_book().kinetic_j;
  while (motion.get_time_s() < 5e-3) motion.advance_sample();
  const Motion::Momentum after = motion.calc_momentum();
  EXPECT_LT(norm(after.linear - before.linear), 1e-4 * norm(before.linear));
  EXPECT_LT(norm(after.angular - before.angular), 1e-3 * norm(before.angular));
  const EnergyBook book = motion.calc_book();
  EXPECT_LT(std::abs(book.relative_error), 1e-6);
  EXPECT_GT(book.dissipated_j, 0.05 * kinetic);
  // The remaining motion is nearly rigid.
  const double flight = 0.5 * dot(after.linear, after.linear) / world.calc_mass();
  EXPECT_LT(book.kinetic_j + book.elastic_j, 1.1 * flight);
  EXPECT_GT(book.kinetic_j, flight);
}

// A hinged rod falling from the horizontal: at the lowest point omega^2 = 3 g / L.
TEST(Constraint, hinged_rod_swing) {
  if (tests::get_ranks() > 1) GTEST_SKIP() << "tens of thousands of steps";
  World world(make_body(1, {0.1, 0.01, 0.01}, {8, 2, 2}, make_law(5e7, 0.3, 1000), 5.0));
  Constraint hinge;
  hinge.is_hinge = true;
  for (const std::int32_t node : world.list_set("x-min"))
    if (std::abs(world.assembly->nodes_m[node][2]) < 1e-9) hinge.nodes.push_back(node);
  ASSERT_EQ(hinge.nodes.size(), 3U);
  MotionOptions options;
  options.gravity_m_s2 = {0, 0, -9.81};
  Motion motion(world.domain, options, {hinge});
  const std::int32_t tip = find_node(*world.assembly, {0.05, 0, 0});
  double lowest = 0.0;
  while (motion.get_time_s() < 0.3) {
    for (int i = 0; i < 48; ++i) motion.advance_sample();
    lowest = std::min(lowest, find_value(world.domain, motion.get_u(), tip)[2]);
  }
  EXPECT_NEAR(lowest, -0.1, 2e-3);
  const EnergyBook book = motion.calc_book();
  EXPECT_LT(std::abs(book.relative_error), 1e-6);
  EXPECT_LT(book.dissipated_j, 0.02 * 9.81 * 0.05 * world.calc_mass());
}

// A hinged rod vibrating without swing: without angular momentum about the hinge, mass damping acts on the whole velocity, and the loss is
// alpha2 times the integral of twice the kinetic energy.
TEST(Constraint, hinged_rod_mass_damping) {
  const double alpha2 = 20.0;
  World world(make_body(1, {0.1, 0.01, 0.01}, {8, 2, 2}, make_law(5e7, 0.3, 1000), alpha2));
  Constraint hinge;
  hinge.is_hinge = true;
  for (const std::int32_t node : world.list_set("x-min"))
    if (std::abs(world.assembly->nodes_m[node][2]) < 1e-9) hinge.nodes.push_back(node);
  MotionOptions options;
  Motion motion(world.domain, options, {hinge});
  // v_z = s^3 - c s of the distance s to the hinge, with c from the masses.
  double second = 0.0, fourth = 0.0;
  for (std::int32_t i = 0; i < world.domain.own_count(); ++i) {
    const double mass = world.domain.get_masses_kg()[i];
    const double s = world.domain.get_rest_m()[i][0] + 0.05;
    second += mass * s * s;
    fourth += mass * s * s * s * s;
  }
  const double c = world.comm.sum(fourth) / world.comm.sum(second);
  motion.set_start([&](std::int32_t, const Vec3& x) {
    const double s = x[0] + 0.05;
    return Motion::Start{{}, {0, 0, 10.0 * (s * s * s - c * s)}};
  });
  double twice_kinetic = motion.calc_book().kinetic_j, lost = 0.0;
  for (int i = 0; i < 200; ++i) {
    motion.advance_sample();
    const EnergyBook book = motion.calc_book();
    twice_kinetic += (i + 1 < 200 ? 2.0 : 1.0) * book.kinetic_j;
    lost = book.dissipated_j;
  }
  EXPECT_NEAR(lost / (alpha2 * twice_kinetic / options.sample_rate_hz), 1.0, 0.02);
}

// ---- external forces ----

/// Springs from some nodes to their rest positions, with their energy.
class Spring : public ExternalForces {
 public:
  Spring(Domain& domain, double stiffness_n_m) : domain_(domain), stiffness_(stiffness_n_m) {}
  void add_forces(const StepTime& time, const Quad* u, const Quad* v, Quad* f) override {
    time_ = time;
    u_.assign(u, u + domain_.own_count());
    static_cast<void>(v);
    for (std::int32_t i = 0; i < domain_.own_count(); ++i) {
      const std::size_t at = i;
      f[at].x -= stiffness_ * u[at].x;
      f[at].y -= stiffness_ * u[at].y;
      f[at].z -= stiffness_ * u[at].z;
    }
  }
  Energy calc_energy() override {
    double stored = 0.0;
    for (const Quad& u : u_) stored += 0.5 * stiffness_ * (u.x * u.x + u.y * u.y + u.z * u.z);
    return {domain_.get_comm().sum(stored), 0.0, 0.0};
  }
  StepTime time_;

 private:
  Domain& domain_;
  double stiffness_;
  std::vector<Quad> u_;
};

TEST(ExternalForces, work_in_energy_book) {
  World world(make_body(1, {0.06, 0.02, 0.02}, {3, 1, 1}, make_law(1e9, 0.3, 1100)));
  Motion motion(world.domain, {});
  Spring spring(world.domain, 200.0);
  motion.add(spring);
  motion.set_start([](std::int32_t, const Vec3&) { return Motion::Start{{}, {0, 0, 2.0}}; });
  double most = 0.0;
  for (int i = 0; i < 200; ++i) {
    motion.advance_sample();
    const EnergyBook book = motion.calc_book();
    EXPECT_NEAR(spring.time_.time_s, motion.get_time_s(), 1e-15);
    EXPECT_EQ(spring.time_.step, motion.get_step_count());
    EXPECT_LT(std::abs(book.relative_error), 1e-6);
    EXPECT_NEAR(spring.calc_energy().stored_j, -book.work_j, 1e-9 * 2.0 * world.calc_mass());
    most = std::max(most, spring.calc_energy().stored_j);
  }
  EXPECT_GT(most, 0.1 * 2.0 * world.calc_mass());
}

// ---- steps ----

TEST(Step, stability_and_sample_division) {
  World world(make_body(1, {0.2, 0.02, 0.01}, {20, 2, 1}, make_law(70e9, 0.33, 2700)));
  Motion motion(world.domain, {});
  motion.advance();
  EXPECT_NEAR(1.0 / (48000.0 * motion.get_steps_per_sample()), motion.get_step_s(), 1e-20);
  // 2 / omega_max of this mesh is 1.08e-6 s by a separate code, T4, lumped; that one is clamped at an end, which changes nothing.
  EXPECT_NEAR(motion.get_longest_step_s(), 1.08e-6, 0.03e-6);
  EXPECT_LE(motion.get_step_s(), 0.9 * motion.get_longest_step_s());
  EXPECT_GT(1.0 / (48000.0 * (motion.get_steps_per_sample() - 1)), 0.9 * motion.get_longest_step_s());
}

TEST(Step, lagged_damping) {
  // omega = 2e6, alpha1 = 1e-6: xi = 1.
  EXPECT_NEAR(calc_longest_step(2e6, 1e-6, 0.0), 1e-6 * (std::sqrt(2.0) - 1.0), 1e-20);
  EXPECT_EQ(calc_longest_step(0.0, 1e-6, 0.0), std::numeric_limits<double>::infinity());
  // v+ = v - h (omega^2 u + 2 xi omega v), u+ = u + h v+: decays just below that step, grows just above.
  for (const double xi : {0.01, 0.5, 3.0}) {
    const double longest = calc_longest_step(1.0, 2.0 * xi, 0.0);
    for (const double factor : {0.99, 1.01}) {
      const double h = factor * longest;
      double u = 1.0, v = 0.0;
      for (int i = 0; i < 20000 && std::abs(u) < 1e6; ++i) {
        v -= h * (u + 2.0 * xi * v);
        u += h * v;
      }
      EXPECT_EQ(std::abs(u) < 2.0, factor < 1.0) << xi << ' ' << factor;
    }
  }
  const Law law = make_law(70e9, 0.33, 2700, 3e-8);
  EXPECT_NEAR(calc_alpha1(law), 3e-8, 1e-20);
}

TEST(Step, refinement_of_stiffening_body) {
  World world(make_body(1, {0.06, 0.02, 0.02}, {6, 2, 2}, make_law(1e8, 0.3, 1100, 2e-7), 1.0));
  const Path pull({{0.0, {0, 0, 0}}, {5e-3, {0.05, 0, 0}}});
  Motion motion(world.domain, {}, {{world.list_set("x-min"), {}, false}, {world.list_set("x-max"), pull, false}});
  motion.advance();
  const int parts = motion.get_steps_per_sample();
  while (motion.get_time_s() < 6e-3) motion.advance_sample();
  EXPECT_GT(motion.get_steps_per_sample(), parts);
  EXPECT_LE(motion.get_step_s(), 0.95 * motion.get_longest_step_s());
  EXPECT_NEAR(motion.get_time_s(), 6e-3, 2.1e-5);
  EXPECT_LT(std::abs(motion.calc_book().relative_error), 1e-6);
}

TEST(Step, refinement_limit) {
  World world(make_body(1, {0.06, 0.02, 0.02}, {3, 1, 1}, make_law(1e8, 0.3, 1100)));
  MotionOptions options;
  options.step_check_s = 2e-5;
  const Path pull({{0.0, {0, 0, 0}}, {1e-2, {4.0, 0, 0}}});
  Motion motion(world.domain, options, {{world.list_set("x-min"), {}, false}, {world.list_set("x-max"), pull, false}});
  const std::string message = tests::catch_message<SolveError>([&] {
    while (motion.get_time_s() < 1e-2) motion.advance_sample();
  });
  EXPECT_NE(message.find("steps a sample are needed, over 8 times as many as at the start"), std::string::npos) << message;
}

TEST(Motion, inverted_element) {
  World world(make_body(1, {0.06, 0.02, 0.02}, {3, 1, 1}, make_law(1e8, 0.3, 1100)));
  const Path push({{0.0, {0, 0, 0}}, {2e-3, {-0.07, 0, 0}}});
  Motion motion(world.domain, {}, {{world.list_set("x-min"), {}, false}, {world.list_set("x-max"), push, false}});
  const std::string message = tests::catch_message<SolveError>([&] {
    while (motion.get_time_s() < 3e-3) motion.advance_sample();
  });
  EXPECT_EQ(message.find("body 'body', element "), 0U) << message;
  EXPECT_NE(message.find(" is turned inside out at 0.00"), std::string::npos) << message;
  EXPECT_NE(message.find(", step "), std::string::npos) << message;
}

TEST(Motion, invalid_input) {
  World world(make_body(1, {0.06, 0.02, 0.02}, {3, 1, 1}, make_law(1e8, 0.3, 1100)));
  const auto nodes = world.list_set("x-min");
  EXPECT_EQ(tests::catch_message<InputError>([&] {
              Motion(world.domain, {}, {{nodes, {}, false}, {{nodes[0]}, {}, false}});
            }).find("body 'body': the node at (-0.03, "),
            0U);
  EXPECT_EQ(tests::catch_message<InputError>([&] {
              Motion(world.domain, {}, {{{1000}, {}, false}});
            }),
            "node 1000 is constrained or struck, and there are 16 nodes");
  EXPECT_EQ(tests::catch_message<InputError>([&] {
              Motion(world.domain, {}, {}, {{0.1, 0.0, {}, {}}});
            }),
            "impulse 1: its duration must be positive, its time not negative, its vector finite");
  MotionOptions options;
  options.sample_rate_hz = 0.0;
  EXPECT_THROW(Motion(world.domain, options), InputError);
}

}  // namespace
}  // namespace carillon::transient
