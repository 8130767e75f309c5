// Hard case of coupled modes of one frequency: any two with the same span must give the same energy and the same sound.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "precompute/mesh/shapes/shapes.hpp"
#include "runtime/synth/nonlinear/coupled_modes.hpp"
#include "tests/hard/figure.hpp"
#include "tests/unit/precompute/coupling/bodies.hpp"

namespace carillon::hard {
namespace {

using std::numbers::pi;

constexpr int kModes = 6;
constexpr double kAngle = 0.6435;  // [rad] whose cosine and sine are about 0.8 and 0.6

/// Pairs of one frequency among the modes, by their first; meshes part those of a round plate by some thousandths.
std::vector<std::size_t> find_pairs(const tests::ModalBody& body) {
  std::vector<std::size_t> pairs;
  for (std::size_t i = 0; i + 1 < kModes; ++i)
    if (body.modes.lambda[i + 1] / body.modes.lambda[i] - 1.0 < 1e-2) pairs.push_back(i++);
  return pairs;
}

/// x in the axes that are turned by kAngle within each pair.
std::vector<double> turn(std::vector<double> x, const std::vector<std::size_t>& pairs) {
  const double c = std::cos(kAngle), s = std::sin(kAngle);
  for (const std::size_t i : pairs) {
    const double a = x[i], b = x[i + 1];
    x[i] = c * a + s * b;
    x[i + 1] = c * b - s * a;
  }
  return x;
}

void turn_shapes(const tests::ModalBody& body, const std::vector<std::size_t>& pairs) {
  const la::LocalColumns shapes(body.modes.shapes);
  for (PetscInt row = 0; row < shapes.rows; ++row) {
    std::vector<double> x(kModes);
    for (std::size_t i = 0; i < kModes; ++i) x[i] = shapes.column(static_cast<PetscInt>(i))[row];
    x = turn(x, pairs);
    for (std::size_t i = 0; i < kModes; ++i) shapes.column(static_cast<PetscInt>(i))[row] = x[i];
  }
}

std::vector<double> make_blow(std::mt19937& chance, double size) {
  std::vector<double> x(kModes);
  for (double& one : x) one = size * std::uniform_real_distribution<double>(-1.0, 1.0)(chance);
  return x;
}

void check(const std::string& name, const tests::ModalBody& body, double thickness_m) {
  const std::vector<std::size_t> pairs = find_pairs(body);
  ASSERT_FALSE(pairs.empty()) << name;
  const coupling::CondenseOptions options{.modes = kModes, .below_hz = 1e6, .energy_error = 1e-4};
  const coupling::Condensed first = coupling::condense_modes(body.comm, body.solved(), options);
  turn_shapes(body, pairs);
  const coupling::Condensed second = coupling::condense_modes(body.comm, body.solved(), options);
  ASSERT_EQ(first.energy.modes.size(), static_cast<std::size_t>(kModes)) << name;
  ASSERT_EQ(first.energy.modes, second.energy.modes) << name;
  std::mt19937 chance(3);
  const double thick = thickness_m / body.peak(0);
  double apart = 0.0;
  for (int trial = 0; trial < 50; ++trial) {
    const std::vector<double> q = make_blow(chance, thick);
    const double v = tests::calc_energy(body.comm, first.energy, q);
    apart = std::max(apart, std::abs(tests::calc_energy(body.comm, second.energy, turn(q, pairs)) / v - 1.0));
  }
  hold("degenerate_pairs", apart, 1e-5, name + ", energy, relative");
  // Both play the same blow for a fifth of a second; the output is the velocity of all modes along one direction.
  std::vector<nonlinear::ModeConstants> constants;
  for (std::size_t i = 0; i < kModes; ++i) constants.push_back({body.modes.lambda[i], 3.0});
  for (const std::size_t i : pairs) constants[i + 1] = constants[i];
  nonlinear::CoupledModes one(first.energy, constants, 48000.0), other(second.energy, constants, 48000.0);
  const std::vector<double> blow = make_blow(chance, 0.5 * thick * std::sqrt(body.modes.lambda[0])), ear = make_blow(chance, 1.0);
  const std::vector<double> turned_blow = turn(blow, pairs), turned_ear = turn(ear, pairs), nothing(kModes, 0.0);
  double difference = 0.0, sound = 0.0, nonlinear_share = 0.0;
  for (int n = 0; n < 9600; ++n) {
    if (n == 0) {
      one.step(blow, nothing);
      other.step(turned_blow, nothing);
    } else {
      one.step();
      other.step();
    }
    double a = 0.0, b = 0.0, linear = 0.0;
    for (int i = 0; i < kModes; ++i) {
      const std::size_t m = i;
      a += ear[m] * one.get_velocity(i);
      b += turned_ear[m] * other.get_velocity(i);
      linear += 0.5 * (std::pow(one.get_velocity(i), 2) + constants[m].eigenvalue_rad2_s2 * std::pow(one.get_amplitude(i), 2));
    }
    difference += (a - b) * (a - b);
    sound += a * a;
    nonlinear_share = std::max(nonlinear_share, 1.0 - linear / one.get_energy_j());
  }
  EXPECT_GT(nonlinear_share, 0.02) << name;  // it was no linear motion
  hold("degenerate_pairs", std::sqrt(difference / sound), 1e-3, name + ", sound, relative");
}

TEST(motion, degenerate_pairs) {
  const material::Material steel = tests::make_solid(200e9, 0.3, 7800);
  const double side = 0.3, thickness = 0.003;
  const auto on_edge = [&](double x) { return std::abs(x) > side / 2 - 1e-9; };
  check("square plate, hinged",
        tests::solve_body(
            PETSC_COMM_WORLD, shapes::make_box({side, side, thickness}, {8, 8, 1}, 2),
            [&](const Vec3& x) { return (on_edge(x[0]) || on_edge(x[1])) && std::abs(x[2]) < 1e-9; }, steel, kModes),
        thickness);
  shapes::ShapeOptions options{.shape = "disc", .dimensions = {{"radius", 0.2}, {"thickness", 0.003}}};
  options.order = 2;
  options.target_nodes = 2500;
  check(
      "round plate, clamped",
      tests::solve_body(
          PETSC_COMM_WORLD, shapes::make_shape(options), [](const Vec3& x) { return std::hypot(x[0], x[1]) > 0.2 - 1e-6; }, steel, kModes),
      thickness);
}

}  // namespace
}  // namespace carillon::hard
