// Bent bodies against closed-form beams, and against their own motion.
#include "precompute/simulation/transient/bend.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "precompute/simulation/transient/motion.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/precompute/simulation/transient/bodies.hpp"

namespace carillon::transient::bending {
namespace {

using namespace testing;

std::vector<SolidBody> make_bar(int order, const std::array<double, 3>& edges_m, const std::array<int, 3>& cells, const Law& law) {
  return {{"bar", make_box(edges_m, cells, order), law}};
}

constexpr double kYoung = 70e9, kDensity = 2700.0, kLength = 0.2, kWidth = 0.02, kThickness = 0.01, kFirst = 1.875104068711961;

/// A bar without lateral contraction, like a beam, clamped at -x.
struct Clamped {
  World world{make_bar(2, {kLength, kWidth, kThickness}, {20, 2, 1}, make_law(kYoung, 0.0, kDensity)), MPI_COMM_SELF};
  std::vector<HeldNode> held;
  std::vector<std::int32_t> clamp, end;
  Clamped() : clamp(world.list_set("x-min")), end(world.list_set("x-max")) {
    for (const std::int32_t node : clamp) held.push_back({node, {}});
  }
  double calc_energy(const std::vector<Quad>& u) const {
    double sum = 0.0;
    for (const double one : world.domain.calc_state(u.data()).energy_j) sum += one;
    return sum;
  }
  double find_tip(const std::vector<Quad>& u) const {
    double sum = 0.0;
    for (const std::int32_t node : end) sum += u[node].z / static_cast<double>(end.size());
    return sum;
  }
};

TEST(Bend, BarUnderEndForce) {
  Clamped bar;
  const auto pull = [&](double force_n) {
    std::vector<PulledNode> pulled;
    for (const NodeShare& share : find_shares(*bar.world.assembly, 0, {0.5 * kLength, 0, 0}))
      pulled.push_back({share.node, {0, 0, share.share * force_n}});
    return calc_equilibrium(bar.world.domain, bar.held, pulled);
  };
  const double inertia = kWidth * std::pow(kThickness, 3) / 12.0;
  const double bent = std::pow(kLength, 3) / (3.0 * kYoung * inertia), sheared = 1.2 * kLength / (0.5 * kYoung * kWidth * kThickness);
  const std::vector<Quad> u = pull(1.0);
  EXPECT_NEAR(bar.find_tip(u), bent + sheared, 5e-3 * bent);
  // Clapeyron: half of force times displacement.
  EXPECT_NEAR(bar.calc_energy(u), 0.5 * bar.find_tip(u), 5e-3 * bent);
  // Large displacement: the elastica (Bisshopp and Drucker 1945: 0.302 L, and 0.056 L back, under F L^2 / E I = 1).
  const std::vector<Quad> far = pull(kYoung * inertia / (kLength * kLength));
  double back = 0.0;
  for (const std::int32_t node : bar.end) back -= far[node].x / static_cast<double>(bar.end.size());
  EXPECT_NEAR(bar.find_tip(far) / kLength, 0.3017, 0.004);
  EXPECT_NEAR(back / kLength, 0.0564, 0.002);
}

TEST(Bend, HeldNodesAndEquilibrium) {
  Clamped bar;
  for (const std::int32_t node : bar.end) bar.held.push_back({node, {0.0, 0.0, -0.02}});
  const std::vector<Quad> u = calc_equilibrium(bar.world.domain, bar.held, {});
  std::vector<Quad> force(bar.world.domain.force_count());
  bar.world.domain.set_elastic_forces(u.data(), force.data());
  double held = 0.0, free = 0.0;
  for (std::size_t n = 0; n < u.size(); ++n) {
    const auto node = static_cast<std::int32_t>(n);
    const bool is_held = std::any_of(bar.held.begin(), bar.held.end(), [&](const HeldNode& one) { return one.node == node; });
    const double size = std::hypot(force[n].x, force[n].y, force[n].z);
    (is_held ? held : free) = std::max(is_held ? held : free, size);
  }
  for (const std::int32_t node : bar.end) EXPECT_EQ(u[node].z, -0.02);
  EXPECT_LT(free, 1e-6 * held);
}

TEST(Bend, FirstModeOfABeam) {
  Clamped bar;
  const ElasticMode first = calc_mode(bar.world.domain, bar.held, 1);
  const double beam = kFirst * kFirst * kThickness / (kLength * kLength) * std::sqrt(kYoung / (12.0 * kDensity));
  EXPECT_NEAR(first.omega_rad_s / beam, 1.0, 5e-3);
  EXPECT_GT(bar.find_tip(first.shape), 0.0);
  constexpr double kAmplitude = 1e-5;
  // Modal mass of the clamped beam's first mode, for unit displacement of its end: a quarter of its mass.
  std::vector<Quad> u = first.shape;
  for (Quad& q : u) q = {kAmplitude * q.x, kAmplitude * q.y, kAmplitude * q.z, 0.0};
  const double mass = kDensity * kLength * kWidth * kThickness, energy = bar.calc_energy(u);
  EXPECT_NEAR(energy, 0.125 * mass * std::pow(first.omega_rad_s * kAmplitude, 2), 0.01 * energy);
  // Two and a half periods: a cosine in time, with constant energy.
  Motion motion(bar.world.domain, {}, {{bar.clamp, {}, false}});
  motion.set_start([&](std::int32_t node, const Vec3&) {
    const Quad& at = u[node];
    return Motion::Start{{at.x, at.y, at.z}, {}};
  });
  motion.prepare();
  const EnergyBook start = motion.calc_book();
  EXPECT_NEAR(start.elastic_j, energy, 1e-12 * energy);
  EXPECT_LT(std::abs(start.kinetic_j), 1e-5 * energy);
  const double tip = bar.find_tip(u);
  while (first.omega_rad_s * motion.get_time_s() < 5.0 * std::numbers::pi) {
    motion.advance_sample();
    EXPECT_NEAR(bar.find_tip(motion.get_u()), tip * std::cos(first.omega_rad_s * motion.get_time_s()), 1e-3 * tip) << motion.get_time_s();
  }
  EXPECT_LT(std::abs(motion.calc_book().relative_error), 1e-9);
}

TEST(Bend, HigherAndFreeModes) {
  Clamped bar;
  const double unit = kThickness / (kLength * kLength) * std::sqrt(kYoung / (12.0 * kDensity));
  // In order: flat 1, upright 1 (twice as wide, so twice as high), flat 2.
  EXPECT_NEAR(calc_mode(bar.world.domain, bar.held, 2).omega_rad_s / (2.0 * unit * kFirst * kFirst), 1.0, 0.02);
  EXPECT_NEAR(calc_mode(bar.world.domain, bar.held, 3).omega_rad_s / (unit * 22.0345), 1.0, 0.02);
  EXPECT_NEAR(calc_mode(bar.world.domain, {}, 1).omega_rad_s / (unit * 22.3733), 1.0, 0.02);
}

TEST(Bend, Refusals) {
  Clamped bar;
  std::vector<PulledNode> pulled{{bar.end[0], {0, 0, 1.0}}};
  EXPECT_THROW(calc_equilibrium(bar.world.domain, {}, pulled), InputError);
  pulled[0].force_n[2] = 1e9;
  EXPECT_THROW(calc_equilibrium(bar.world.domain, bar.held, pulled), InputError);
  World small(make_bar(1, {0.01, 0.01, 0.01}, {1, 1, 1}, make_law(kYoung, 0.0, kDensity)), MPI_COMM_SELF);
  EXPECT_THROW(calc_mode(small.domain, {}, 20), InputError);
}

// A strip as a sheet, with angles of edges.
TEST(Bend, SheetStrip) {
  constexpr double kThin = 5e-4;
  SheetBody sheet;
  sheet.mesh = make_rectangle(kLength, kWidth, 40);
  sheet.clamped.assign(sheet.mesh.vertices_m.size(), false);
  for (const std::int32_t node : sheet.mesh.node_sets.at("x-min")) sheet.clamped[node] = true;
  sheet.law = {0.0, 0.5 * kYoung, kDensity, kThin, 0.0};
  const SheetElements elements = make_elements(sheet.mesh, sheet.clamped);
  const auto assembly = std::make_shared<const Assembly>(make_assembly(comm::Communicator(MPI_COMM_SELF), std::vector<AnyBody>{sheet}));
  Domain domain(MPI_COMM_SELF, assembly);
  std::vector<HeldNode> held;
  for (std::int32_t v = 0; v < elements.vertices; ++v)
    if (sheet.clamped[v]) held.push_back({v, {}});
  for (std::int32_t e = 0; e < elements.edges; ++e) {
    const auto& edge = elements.edge[e];
    if (sheet.clamped[edge[0]] && sheet.clamped[edge[1]]) held.push_back({elements.vertices + e, {}});
  }
  std::vector<PulledNode> pulled;
  const std::vector<std::int32_t>& end = sheet.mesh.node_sets.at("x-max");
  for (const std::int32_t node : end) pulled.push_back({node, {0, 0, 1e-4 / static_cast<double>(end.size())}});
  const std::vector<Quad> u = calc_equilibrium(domain, held, pulled);
  double tip = 0.0;
  for (const std::int32_t node : end) tip += u[node].z / static_cast<double>(end.size());
  EXPECT_NEAR(tip / (1e-4 * 4.0 * std::pow(kLength / kThin, 3) / (kYoung * kWidth)), 1.0, 0.02);
  const double beam = kFirst * kFirst * kThin / (kLength * kLength) * std::sqrt(kYoung / (12.0 * kDensity));
  EXPECT_NEAR(calc_mode(domain, held, 1).omega_rad_s / beam, 1.0, 0.02);
}

}  // namespace
}  // namespace carillon::transient::bending
