// Kirchhoff-Carrier strings: one row of mean stress, both planes.
#include <gtest/gtest.h>

#include "tests/unit/runtime/synth/nonlinear/bodies.hpp"

namespace carillon::nonlinear {
namespace {

using bodies::Body;
using bodies::kPi;

struct String {
  double length_m = 0.65, radius_m = 5e-4, young_pa = 2e11, density_kg_m3 = 7850.0;
  double tension_n = 0.0;  // 0: a bar with hinged ends

  double calc_area() const { return kPi * radius_m * radius_m; }
  double calc_gyration_m() const { return 0.5 * radius_m; }
  /// Modes 1 to count in each plane, one plane after the other.
  Body make(int count, int planes) const {
    Body body;
    const double mu = density_kg_m3 * calc_area(), stiffness = young_pa * calc_area() * calc_gyration_m() * calc_gyration_m();
    std::vector<double> diagonal;
    for (int plane = 0; plane < planes; ++plane)
      for (int n = 1; n <= count; ++n) {
        const double k = n * kPi / length_m;
        body.energy.modes.push_back(static_cast<std::int32_t>(body.modes.size()));
        body.modes.push_back({(tension_n * k * k + stiffness * std::pow(k, 4)) / mu, 0.0});
        diagonal.push_back(std::sqrt(young_pa * calc_area() / (4.0 * length_m)) * k * k / mu);
      }
    body.energy.rows.assign(bank::count_pairs(diagonal.size()), 0.0F);
    for (std::size_t i = 0; i < diagonal.size(); ++i) body.energy.rows[bank::find_pair(i, i)] = static_cast<float>(diagonal[i]);
    return body;
  }
  double to_q(double deflection_m) const { return deflection_m / std::sqrt(2.0 / (density_kg_m3 * calc_area() * length_m)); }
};

TEST(String, HardensByAQuarterOfDeflectionOverGyrationSquared) {
  const String bar;
  const Body body = bar.make(1, 1);
  const double soft_hz = std::sqrt(body.modes[0].eigenvalue_rad2_s2) / (2.0 * kPi);
  for (const double ratio : {0.2, 1.0, 3.0}) {
    CoupledModes modes(body.energy, body.modes, 48000.0);
    modes.set_state(0, bar.to_q(ratio * bar.calc_gyration_m()), 0.0);
    const double hz = bodies::measure_hz(modes, 0, 48000.0, 96000);
    EXPECT_NEAR(1200.0 * std::log2(hz / (soft_hz * bodies::calc_duffing_ratio(0.25 * ratio * ratio))), 0.0, 0.05) << ratio;
  }
}

TEST(String, WhirlsWithItsEnergyAndItsAngularMomentum) {
  String string;
  string.tension_n = 60.0;
  constexpr int kCount = 8;
  const Body body = string.make(kCount, 2);
  for (const Integrator integrator : {Integrator::kAuxiliary, Integrator::kGuarded}) {
    CoupledModes modes(body.energy, body.modes, 48000.0, {.integrator = integrator, .relaxation_s = 0.0});
    for (int n = 0; n < kCount; ++n) {
      modes.set_state(n, string.to_q(4e-3 / (1.0 + n * n)), 0.0);
      modes.set_state(n + kCount, 0.0, 0.7 * string.to_q(4e-3 / (1.0 + n)) * std::sqrt(body.modes[n].eigenvalue_rad2_s2));
    }
    const auto calc_momentum = [&] {
      double sum = 0.0;
      for (int n = 0; n < kCount; ++n)
        sum += modes.get_amplitude(n) * modes.get_velocity(n + kCount) - modes.get_amplitude(n + kCount) * modes.get_velocity(n);
      return sum;
    };
    const double momentum = calc_momentum(), energy = modes.get_energy_j();
    for (int n = 0; n < 200000; ++n) {
      modes.step();
      ASSERT_NEAR(calc_momentum() / momentum, 1.0, 1e-11) << n;
      ASSERT_NEAR(modes.get_energy_j() / energy, 1.0, integrator == Integrator::kAuxiliary ? 1e-11 : 0.01) << n;
    }
  }
}

}  // namespace
}  // namespace carillon::nonlinear
