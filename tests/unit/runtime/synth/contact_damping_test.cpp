// Damping of modes by lasting contacts, against the dense equation of motion.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <tuple>
#include <vector>

#include "runtime/synth/contact_forces.hpp"
#include "tests/unit/runtime/synth/contact_bench.hpp"

namespace carillon::synth {
namespace {

using namespace testing;

/// q'' + 2 D q' + Lambda q + Z(t) phi phi^T q' = 0, by fourth-order Runge-Kutta.
double calc_dense_energy(const std::vector<InventedMode>& modes, const std::vector<double>& phi, double impulse,
                         const std::function<double(double)>& impedance, double seconds) {
  const std::size_t n = modes.size();
  std::vector<double> state(2 * n);
  for (std::size_t m = 0; m < n; ++m) state[n + m] = impulse * phi[m];
  const auto slope = [&](const std::vector<double>& s, double t) {
    std::vector<double> out(2 * n);
    double along = 0.0;
    for (std::size_t m = 0; m < n; ++m) along += phi[m] * s[n + m];
    for (std::size_t m = 0; m < n; ++m) {
      const double omega = 2.0 * pi * modes[m].freq_hz;
      out[m] = s[n + m];
      out[n + m] = -omega * omega * s[m] - 2.0 * modes[m].decay_per_s * s[n + m] - impedance(t) * phi[m] * along;
    }
    return out;
  };
  const int steps = static_cast<int>(seconds * 400000.0);
  const double h = seconds / steps;
  std::vector<double> other(2 * n);
  for (int i = 0; i < steps; ++i) {
    const double t = i * h;
    const auto go = [&](const std::vector<double>& k, double share) {
      for (std::size_t j = 0; j < state.size(); ++j) other[j] = state[j] + share * h * k[j];
      return other;
    };
    const auto k1 = slope(state, t), k2 = slope(go(k1, 0.5), t + 0.5 * h), k3 = slope(go(k2, 0.5), t + 0.5 * h),
               k4 = slope(go(k3, 1.0), t + h);
    for (std::size_t j = 0; j < state.size(); ++j) state[j] += h / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
  }
  double energy = 0.0;
  for (std::size_t m = 0; m < n; ++m) {
    const double omega = 2.0 * pi * modes[m].freq_hz;
    energy += 0.5 * (state[n + m] * state[n + m] + omega * omega * state[m] * state[m]);
  }
  return energy;
}

TEST(ContactForces, TakeTheImpedanceOfTheOthersMaterialWhereTheRecordHasNone) {
  LastingContact contact = make_sliding(0.0, 0.0);
  contact.patch_radius_m = 1e-3;
  // Concrete: 33.3 GPa along a wave, 2,400 kg/m^3.
  const double concrete = std::sqrt(30e9 * 0.8 / (1.2 * 0.6) * 2400.0);
  EXPECT_NEAR(find_impedance(contact, kGroundSurface), concrete * pi * 1e-6, 1e-3 * concrete * pi * 1e-6);
  contact.impedance_n_s_m = 3.0;
  EXPECT_EQ(find_impedance(contact, kGroundSurface), 3.0);
  contact.impedance_n_s_m = 0.0;
  EXPECT_EQ(find_impedance(contact, kGroundSurface), 0.0);
}

TEST(ContactForces, TakeTheEnergyOfTheDenseEquations) {
  const std::vector<InventedMode> modes{{310.0, 1.0, 1.0, {0.0, 0.0, 0.9}},
                                        {870.0, 2.0, 1.0, {0.0, 0.0, -0.6}},
                                        {2100.0, 3.0, 1.0, {0.0, 0.0, 1.1}},
                                        {6300.0, 5.0, 1.0, {0.0, 0.0, 0.4}}};
  const auto model = Model::make(make_cube_bank(modes));
  for (const double impedance : {0.5, 5.0, 40.0}) {
    ContactForces contacts(model, {.effects = kBrake});
    ResonatorBank voice(model);
    voice.strike({.time_s = 1e-9, .impulse_n_s = {0.0, 0.0, 1e-3}});
    play(voice, contacts,
         make_records(0.2,
                      [&](double t) {
                        LastingContact c = make_sliding(t, 0.0);
                        c.impedance_n_s_m = impedance * (1.0 + 0.5 * std::sin(40.0 * t));
                        return c;
                      }),
         0.064, 480, kRigidOther);
    const double exact = calc_dense_energy(
        modes, {0.9, -0.6, 1.1, 0.4}, 1e-3,
        [&](double t) { return impedance * (1.0 + 0.5 * std::sin(40.0 * t)) * std::min(1.0, t / 5e-3); }, 0.064);
    const double free = calc_dense_energy(
        modes, {0.9, -0.6, 1.1, 0.4}, 1e-3, [](double) { return 0.0; }, 0.064);
    EXPECT_LT(exact, 0.98 * free) << "it matters";
    // The loss in nepers agrees to 2 %: modes far apart do not hear of each other.
    EXPECT_NEAR(std::log(free / voice.calc_energy_j()), std::log(free / exact), 0.02 * std::log(free / exact)) << impedance;
  }
}

TEST(ContactForces, TakeTheLossOfTheContactSpring) {
  // A spring k (1 + i eta) at the point, weak against the mode: omega'^2 = omega^2 + k (1 + i eta) phi^2, so d = eta k phi^2 / (2 omega).
  // Steel on steel loses 0.01; wood and plastics ten times that, by the part of the give that is theirs.
  const double freq = 1000.0, phi = 0.9, omega = 2.0 * pi * freq;
  const auto model = Model::make(make_cube_bank({{freq, 1e-3, 1.0, {0.0, 0.0, phi}}}));
  const auto play_at = [&](double impulse, double own_pa, double other_pa, double patch_m, double seconds) {
    ContactForces contacts(model, {.surface = {.modulus_pa = own_pa}, .effects = kBrake});
    ResonatorBank voice(model);
    voice.strike({.time_s = 1e-9, .impulse_n_s = {0.0, 0.0, impulse}});
    const auto rest = [&](double t) {
      LastingContact c = make_sliding(t, 0.0);
      c.patch_radius_m = patch_m;
      c.impedance_n_s_m = 1e-6;
      return c;
    };
    play(voice, contacts, make_records(0.4, rest), 0.02, 480, {.modulus_pa = other_pa});
    const double before = voice.calc_energy_j();
    play(voice, contacts, {}, seconds, 480, {.modulus_pa = other_pa});
    return std::log(before / voice.calc_energy_j()) / (2.0 * seconds);
  };
  for (const double impulse : {1.0, 1e-6}) {
    for (const auto& [own, other, loss] :
         {std::tuple{200e9, 200e9, 0.01}, {10e9, 10e9, 0.1}, {10e9, 200e9, (0.1 / 10 + 0.01 / 200) / (1.0 / 10 + 1.0 / 200)}}) {
      const double patch = 1e-6, stiffness = 2.0 / (1.0 / own + 1.0 / other) * patch;
      const double expected = 1e-3 + 0.5 * 1e-6 * phi * phi + loss * stiffness * phi * phi / (2.0 * omega);
      EXPECT_NEAR(play_at(impulse, own, other, patch, 0.3) / expected, 1.0, 0.01) << impulse << " " << own << " " << other;
    }
    // A spring that pins the mode takes no more than all of it loses by itself: D = eta omega / 2, kept below omega as D omega / (D +
    // omega).
    EXPECT_NEAR(play_at(impulse, 10e9, 10e9, 1.0, 0.02) / (0.05 * omega / 1.05), 1.0, 0.02);
  }
}

TEST(ContactForces, NeverAddEnergyByDamping) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> any(0.0, 1.0);
  for (int trial = 0; trial < 40; ++trial) {
    std::vector<InventedMode> modes;
    const int count = 1 + static_cast<int>(40.0 * any(random));
    for (int m = 0; m < count; ++m) {
      modes.push_back(
          {30.0 * std::pow(780.0, any(random)), 0.1 + 3.0 * any(random), 1.0, {any(random) - 0.5, any(random) - 0.5, any(random)}, 0.3});
    }
    std::sort(modes.begin(), modes.end(), [](const auto& a, const auto& b) { return a.freq_hz < b.freq_hz; });
    const auto model = Model::make(make_cube_bank(modes));
    ContactForces contacts(model, {.effects = kBrake});
    ResonatorBank voice(model, {.isa = trial % 2 == 0 ? Isa::kBest : Isa::kPlain});
    voice.attach(&contacts);
    voice.strike({.time_s = 1e-9, .triangle = trial % 12, .impulse_n_s = {0.3, 0.2, 1.0}});
    const double size = std::pow(10.0, 8.0 * any(random) - 3.0);
    for (std::uint64_t id = 0; id < 1 + static_cast<std::uint64_t>(trial % 4); ++id) {
      const double begin = 0.1 * any(random), end = begin + 0.3 * any(random);
      for (double t = begin; t <= end; t += 1e-3) {
        LastingContact c = make_sliding(t, 0.0);
        c.id = id;
        c.triangle = static_cast<std::int32_t>(12.0 * any(random));
        c.state = t == begin ? ContactState::kBegin : t + 1e-3 > end ? ContactState::kEnd : ContactState::kHold;
        c.impedance_n_s_m = size * any(random);
        const double angle = 6.28 * any(random);
        c.normal = {std::cos(angle), 0.0, std::sin(angle)};
        contacts.take(c, kOther);
      }
    }
    std::vector<float> out(kBlock, 0.0F);
    voice.process(out);
    double energy = voice.calc_energy_j();
    for (int period = 1; period < 250; ++period) {
      std::fill(out.begin(), out.end(), 0.0F);
      voice.process(out);
      const double now = voice.calc_energy_j();
      ASSERT_LE(now, energy) << "trial " << trial << ", period " << period;
      energy = now;
    }
    EXPECT_TRUE(contacts.is_idle());
  }
}

TEST(ContactForces, LeaveTheRingingExactAfterwards) {
  const double freq = 987.6, decay = 1.5, gain = 2.0;
  const auto model = Model::make(make_cube_bank({{freq, decay, gain}}));
  ContactForces contacts(model, {.effects = kBrake});
  ResonatorBank voice(model);
  voice.strike({.time_s = 1e-3, .impulse_n_s = {0.0, 0.0, 1e-2}});
  const std::vector<float> heard = play(voice, contacts,
                                        make_records(0.5,
                                                     [](double t) {
                                                       LastingContact c = make_sliding(t, 0.0);
                                                       c.impedance_n_s_m = 5.0 + 3.0 * std::sin(50.0 * t);
                                                       return c;
                                                     }),
                                        4.0);
  EXPECT_LT(calc_rms(heard, 0.55, 0.65), 0.6 * calc_rms(heard, 0.01, 0.02));
  // a cos + b sin of the damped frequency, fitted in one place, holds in all others; pitch 1 and pitch while damped are the same.
  const double omega = std::sqrt(std::pow(2.0 * pi * freq, 2.0) - decay * decay);
  const auto fit = [&](double at_s) {
    double cc = 0.0, cs = 0.0, ss = 0.0, yc = 0.0, ys = 0.0;
    for (auto n = static_cast<std::size_t>(at_s * kRate); static_cast<double>(n) < (at_s + 0.05) * kRate; ++n) {
      const double t = static_cast<double>(n) / kRate, e = std::exp(-decay * t), c = e * std::cos(omega * t), s = e * std::sin(omega * t);
      cc += c * c, cs += c * s, ss += s * s, yc += c * static_cast<double>(heard[n]), ys += s * static_cast<double>(heard[n]);
    }
    const double det = cc * ss - cs * cs;
    return std::array<double, 2>{(yc * ss - ys * cs) / det, (ys * cc - yc * cs) / det};
  };
  const auto first = fit(0.52), last = fit(3.9), before = fit(1e-3);
  const double size = std::hypot(first[0], first[1]);
  EXPECT_NEAR(last[0], first[0], 1e-5 * size);
  EXPECT_NEAR(last[1], first[1], 1e-5 * size);
  EXPECT_NEAR(std::remainder(std::atan2(first[1], first[0]) - std::atan2(before[1], before[0]), 2.0 * pi), 0.0, 2e-2)
      << "the damping turns nothing";
}

TEST(ContactForces, DampWithoutZipperNoise) {
  // A pure tone under a contact that comes, changes at every record, and goes: the rest of the spectrum stays far below it.
  const auto model = Model::make(make_cube_bank({{500.0, 0.5, 1.0}}));
  ContactForces contacts(model, {.effects = kBrake});
  ResonatorBank voice(model);
  voice.strike({.time_s = 1e-3, .impulse_n_s = {0.0, 0.0, 1e-2}});
  std::mt19937 random(3);
  const std::vector<float> heard =
      play(voice, contacts,
           make_records(0.6,
                        [&](double t) {
                          LastingContact c = make_sliding(t, 0.0);
                          c.impedance_n_s_m = 20.0 + 10.0 * std::sin(60.0 * t) + 4.0 * static_cast<double>(random()) / 4294967296.0;
                          return c;
                        }),
           0.8);
  // Second differences take the tone down by (omega / rate)^2 each; four of them leave a step of 1 at its full size.
  double worst = 0.0, tone = 0.0;
  for (std::size_t n = 2000; n + 4 < heard.size(); ++n) {
    const double fourth = static_cast<double>(heard[n]) - 4.0 * heard[n + 1] + 6.0 * heard[n + 2] - 4.0 * heard[n + 3] + heard[n + 4];
    worst = std::max(worst, std::abs(fourth) / calc_rms(heard, 0.04, 0.05));
    tone = std::max(tone, std::abs(static_cast<double>(heard[n])) / calc_rms(heard, 0.04, 0.05));
  }
  const double smooth = std::pow(2.0 * std::sin(0.5 * 2.0 * pi * 500.0 / kRate), 4.0) * tone;
  EXPECT_LT(worst, 1.5 * smooth + 1e-5) << "steps are below -100 dB of the tone";
}

}  // namespace
}  // namespace carillon::synth
