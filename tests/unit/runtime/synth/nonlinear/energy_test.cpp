// Invariants under any strikes: energy, its bound, silence.
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/synth/nonlinear/blows.hpp"

namespace carillon::nonlinear {
namespace {

using bodies::Body;
using bodies::decay_as_steel;
using bodies::Plate;

constexpr double kRateHz = 48000.0;

double have_no_decay(double) { return 0.0; }

/// Energy of the states by sums in double precision; between samples psi stands for V.
double calc_linear_j(const CoupledModes& modes, const Body& body) {
  double energy = 0.0;
  for (std::size_t i = 0; i < body.modes.size(); ++i) {
    const double q = modes.get_amplitude(static_cast<int>(i)), v = modes.get_velocity(static_cast<int>(i));
    energy += 0.5 * (v * v + body.modes[i].eigenvalue_rad2_s2 * q * q);
  }
  return energy;
}

double calc_potential_j(const CoupledModes& modes, const Body& body) {
  std::vector<double> q, gradient(body.modes.size());
  for (std::size_t i = 0; i < body.modes.size(); ++i) q.push_back(modes.get_amplitude(static_cast<int>(i)));
  return bank::calc_energy_j(body.energy, q, gradient);
}

TEST(Energy, IsKeptToRoundingOverAMillionSamplesByTheAuxiliaryVariable) {
  const Body body = Plate{}.make(12, have_no_decay);
  CoupledModes modes(body.energy, body.modes, kRateHz, {.integrator = Integrator::kAuxiliary, .relaxation_s = 0.0});
  for (int i = 0; i < 12; ++i) modes.set_state(i, 0.0, 0.6 / (1.0 + i));
  const double start = modes.get_energy_j();
  double drift = 0.0, strong = 0.0;
  for (int n = 0; n < 1000000; ++n) {
    modes.step();
    drift = std::max(drift, std::abs(modes.get_energy_j() / start - 1.0));
    strong = std::max(strong, 1.0 - calc_linear_j(modes, body) / start);
  }
  EXPECT_LE(drift, 1e-11);
  EXPECT_GT(strong, 0.1);  // that much of it was nonlinear
  EXPECT_EQ(modes.get_counters().guarded, 1000000);
}

TEST(Energy, IsThatOfVerletToAPercentWithoutTheGuard) {
  const Body body = Plate{}.make(20, have_no_decay);
  CoupledModes modes(body.energy, body.modes, kRateHz);
  for (int i = 0; i < 20; ++i) modes.set_state(i, 0.0, 0.3 / (1.0 + i));
  const double start = modes.get_energy_j();
  for (int n = 0; n < 96000; ++n) {
    modes.step();
    ASSERT_NEAR(modes.get_energy_j() / start, 1.0, 0.01);
    if (n % 1000 == 0) {
      EXPECT_NEAR((calc_linear_j(modes, body) + calc_potential_j(modes, body)) / start, 1.0, 0.03) << n;
    }
  }
  EXPECT_EQ(modes.get_counters().guarded, 0);
}

TEST(Energy, FallsWithLossesAndByNothingElse) {
  const Body body = Plate{}.make(20, decay_as_steel);
  CoupledModes modes(body.energy, body.modes, kRateHz);
  std::vector<double> re(20), im(20);
  for (std::size_t i = 0; i < 20; ++i) re[i] = 0.3 / (1.0 + static_cast<double>(i));
  modes.step(re, im);
  double before = modes.get_energy_j();
  EXPECT_NEAR(before, modes.get_work_j(), 1e-9 * before);
  for (int block = 0; block < 300; ++block) {
    for (int n = 0; n < 480; ++n) modes.step();
    const double now = modes.get_energy_j();
    EXPECT_LE(now, before * 1.002) << block;
    EXPECT_LE(now, 1.0201 * modes.get_bound_j() + 1e-300) << block;
    EXPECT_GE(now, 0.9 * modes.get_bound_j()) << block;  // not stale
    before = now;
  }
  EXPECT_LT(before, 1e-12 * modes.get_work_j());
}

Body make_random(std::mt19937& chance, bool is_curved) {
  const auto draw = [&](double from, double to) { return std::uniform_real_distribution<double>(from, to)(chance); };
  Body body;
  const std::size_t n = 1 + chance() % 12, rows = 1 + chance() % 6;
  const double size = std::pow(10.0, draw(2.0, 9.0));
  for (std::size_t i = 0; i < n; ++i) {
    body.energy.modes.push_back(static_cast<std::int32_t>(i));
    body.modes.push_back({bodies::to_eigenvalue(std::pow(10.0, draw(1.5, 3.9))), chance() % 3 == 0 ? 0.0 : draw(0.0, 60.0)});
  }
  for (std::size_t i = 0; i < rows * bank::count_pairs(n); ++i) body.energy.rows.push_back(static_cast<float>(size * draw(-1.0, 1.0)));
  if (!is_curved) return body;
  for (std::size_t r = 0; r < rows; ++r)
    for (std::size_t i = 0; i < n; ++i)
      body.energy.linear.push_back(std::sqrt(0.9 * body.modes[i].eigenvalue_rad2_s2 / static_cast<double>(n * rows)) * draw(-1.0, 1.0));
  return body;
}

TEST(Energy, IsNeverMoreThanTheWorkOfForces) {
  std::mt19937 chance(11);
  std::int64_t guarded = 0, accepted = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const bool is_curved = trial % 4 == 3;
    const Body body = make_random(chance, is_curved);
    const std::size_t n = body.modes.size();
    CoupledModes modes(body.energy, body.modes, kRateHz);
    // Strength at which the nonlinear force of the first mode equals the linear one; every other strike is 10^4 times that.
    const double self = std::max(1e-3, bank::calc_self_coupling(body.energy)[0]);
    const double sane = body.modes[0].eigenvalue_rad2_s2 / std::sqrt(2.0 * self);
    std::vector<double> re(n), im(n, 0.0);
    double work = 0.0, put_in = 0.0;  // a blow may also take energy
    for (int sample = 0; sample < 400; ++sample) {
      if (sample % 80 == 3) {
        for (double& x : re) x = sane * (trial % 2 == 0 ? 1e4 : 1.0) * std::uniform_real_distribution<double>(-1.0, 1.0)(chance);
        modes.step(re, im);
      } else {
        modes.step();
      }
      put_in += std::max(0.0, modes.get_work_j() - work);
      work = modes.get_work_j();
      const double energy = modes.get_energy_j();
      ASSERT_TRUE(std::isfinite(energy)) << trial << ", " << sample;
      ASSERT_LE(energy, 1.03 * put_in) << trial << ", " << sample;
      const double linear = calc_linear_j(modes, body);
      ASSERT_TRUE(std::isfinite(linear)) << trial << ", " << sample;
    }
    guarded += modes.get_counters().guarded;
    accepted += modes.get_counters().steps - modes.get_counters().guarded;
  }
  EXPECT_GT(guarded, 10000);  // both ways were gone
  EXPECT_GT(accepted, 10000);
}

TEST(Energy, WithoutTheGuardBlowsUpUnderTheSameBlow) {
  const Body body = Plate{}.make(10, have_no_decay);
  for (const Integrator integrator : {Integrator::kVerlet, Integrator::kGuarded}) {
    CoupledModes modes(body.energy, body.modes, kRateHz, {.integrator = integrator});
    const std::vector<double> re(10, 1000.0), im(10, 0.0);
    modes.step(re, im);
    double most = 0.0;
    for (int n = 0; n < 2000; ++n) {
      modes.step();
      most = std::max(most, calc_linear_j(modes, body));
    }
    EXPECT_EQ(most > 2.0 * modes.get_work_j(), integrator == Integrator::kVerlet);
  }
}

TEST(Motion, SoftlyIsTheLinearModeToMinus100Db) {
  const Plate plate;
  const Body body = plate.make(30, decay_as_steel);
  CoupledModes modes(body.energy, body.modes, kRateHz);
  // A thousandth of a thickness.
  std::vector<double> re(30), im(30, 0.0);
  for (std::size_t i = 0; i < 30; ++i)
    re[i] = 1e-3 * plate.thickness_m * std::sqrt(body.modes[0].eigenvalue_rad2_s2) / plate.calc_amplitude() / 6.0;
  modes.step(re, im);
  double error = 0.0, sound = 0.0;
  for (int n = 1; n < 48000; ++n) {
    modes.step();
    double found = 0.0, wanted = 0.0;
    for (std::size_t i = 0; i < 30; ++i) {
      const double d = body.modes[i].decay_per_s, omega = std::sqrt(body.modes[i].eigenvalue_rad2_s2 - d * d), t = n / kRateHz;
      wanted += re[i] * std::exp(-d * t) * (std::cos(omega * t) - d / omega * std::sin(omega * t));
      found += modes.get_velocity(static_cast<int>(i));
    }
    error += (found - wanted) * (found - wanted);
    sound += wanted * wanted;
  }
  EXPECT_LE(10.0 * std::log10(error / sound), -100.0);
  EXPECT_EQ(modes.get_counters().guarded, 0);
}

TEST(Motion, EndsInSilenceWithoutAMemoryOfIt) {
  const Body body = Plate{}.make(8, decay_as_steel);
  CoupledModes struck(body.energy, body.modes, kRateHz), fresh(body.energy, body.modes, kRateHz);
  const std::vector<double> re(8, 0.2), im(8, 1e-3);
  struck.step(re, im);
  for (int n = 0; n < 5000; ++n) struck.step();
  struck.reset();
  EXPECT_EQ(struck.get_energy_j(), 0.0);
  EXPECT_FALSE(struck.is_moving());
  for (int n = 0; n < 2000; ++n) {
    if (n == 10) {
      struck.step(re, im);
      fresh.step(re, im);
    } else {
      struck.step();
      fresh.step();
    }
    for (int i = 0; i < 8; ++i) ASSERT_EQ(struck.get_velocity(i), fresh.get_velocity(i)) << n;
  }
}

TEST(Limit, LetsModesContinueWithoutAJump) {
  const Body body = Plate{}.make(30, decay_as_steel);
  CoupledModes modes(body.energy, body.modes, kRateHz), full(body.energy, body.modes, kRateHz);
  std::vector<double> re(30), im(30, 0.0);
  for (std::size_t i = 0; i < 30; ++i) re[i] = 0.3 / (1.0 + static_cast<double>(i));
  modes.step(re, im);
  full.step(re, im);
  for (int n = 1; n < 2400; ++n) {
    modes.step();
    full.step();
  }
  modes.set_limit(12);
  EXPECT_EQ(modes.get_limit(), 12);
  // The first sample after it differs by no more than half a kick does.
  modes.step();
  full.step();
  double most = 0.0, apart = 0.0;
  for (int i = 0; i < 30; ++i) {
    most = std::max(most, std::abs(full.get_velocity(i)));
    apart = std::max(apart, std::abs(full.get_velocity(i) - modes.get_velocity(i)));
  }
  EXPECT_LT(apart, 0.02 * most);
  EXPECT_GT(apart, 0.0);
  // Modes that are linear now ring down by themselves.
  const double before = std::hypot(modes.get_re(20), modes.get_im(20));
  for (int n = 0; n < 4800; ++n) modes.step();
  EXPECT_NEAR(std::hypot(modes.get_re(20), modes.get_im(20)) / before, std::exp(-body.modes[20].decay_per_s * 0.1), 1e-9);
  EXPECT_LE(modes.get_energy_j(), 1.03 * modes.get_work_j());
  modes.set_limit(0);
  const double alone = std::hypot(modes.get_re(0), modes.get_im(0));
  for (int n = 0; n < 4800; ++n) modes.step();
  EXPECT_NEAR(std::hypot(modes.get_re(0), modes.get_im(0)) / alone, std::exp(-body.modes[0].decay_per_s * 0.1), 1e-2);
  modes.set_limit(99);
  EXPECT_EQ(modes.get_limit(), 30);
}

TEST(CoupledModes, RefuseModesThatDoNotOscillate) {
  Body body = bodies::make_duffing(100.0, 1.0);
  EXPECT_THROW(CoupledModes(body.energy, body.modes, 150.0), InputError);
  EXPECT_THROW(CoupledModes(body.energy, body.modes, 0.0), InputError);
  EXPECT_THROW(CoupledModes(body.energy, {}, kRateHz), InputError);
  body.modes[0].decay_per_s = 1e4;
  EXPECT_THROW(CoupledModes(body.energy, body.modes, kRateHz), InputError);
  body.modes[0].decay_per_s = -1.0;
  EXPECT_THROW(CoupledModes(body.energy, body.modes, kRateHz), InputError);
  body = bodies::make_duffing(100.0, 1.0);
  body.energy.rows[0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(CoupledModes(body.energy, body.modes, kRateHz), InputError);
  body.energy.rows.clear();
  EXPECT_THROW(CoupledModes(body.energy, body.modes, kRateHz), InputError);
  EXPECT_THROW(CoupledModes({}, {}, kRateHz), InputError);
}

}  // namespace
}  // namespace carillon::nonlinear
