// Forces of lasting contacts: against quadrature and measured laws; streams of records.
#include "runtime/synth/contact_forces.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "tests/unit/runtime/synth/contact_bench.hpp"
#include "tests/unit/runtime/synth/quadrature.hpp"
#include "tests/unit/runtime/synth/reference.hpp"

namespace carillon::synth {
namespace {

using namespace testing;

TEST(ContactForces, DriveTheModesAsQuadrature) {
  // Force along e = n - mu s; the shape is the same at all corners but for the third mode's slope.
  std::vector<InventedMode> modes = make_modes();
  modes.push_back({300.0, 3000.0, 0.5, {0.2, 0.0, 1.0}});  // over-damped, too
  const bank::Bank bank = make_cube_bank(modes);
  const auto model = Model::make(bank);
  for (const Isa isa : base::list_instructions()) {
    const auto make = [](double t) { return make_sliding(t, 0.3 + 2.0 * t); };
    ContactForces traced(model, {.effects = kNoise}), contacts(model, {.effects = kNoise});
    ResonatorBank voice(model, {.isa = isa});
    const std::vector<LastingContact> records = make_records(0.06, make);
    const std::vector<double> force = trace(traced, records, 0.06);
    const std::vector<float> heard = play(voice, contacts, records, 0.06);
    const double mu = std::sqrt(0.4 * 0.5);
    std::vector<double> expected(heard.size());
    for (int m = 0; m < model->get_mode_count(); ++m) {
      const double lambda = model->get_eigenvalue_rad2_s2(m), d = model->get_decay_per_s(m);
      // Response to a force linear from 1 to 0 or 0 to 1 within a sample, by double-exponential quadrature; then the exact step.
      const double h = 1.0 / kRate, s2 = d * d - lambda;
      const auto velocity = [&](double t) {
        if (s2 < 0.0) return testing::calc_velocity(std::sqrt(lambda) / (2.0 * pi), d, t);
        const double s = std::sqrt(s2);
        return std::exp(-d * t) * (std::cosh(s * t) - d / s * std::sinh(s * t));
      };
      const auto place = [&](double t) {
        const double w = std::sqrt(std::abs(s2));
        return std::exp(-d * t) * (s2 < 0.0 ? std::sin(w * t) : std::sinh(w * t)) / w;
      };
      double q = 0.0, v = 0.0;
      std::array<double, 2> to_q{}, to_v{};
      for (int end = 0; end < 2; ++end) {
        const auto share = [&](double u) { return end == 0 ? 1.0 - u : u; };
        to_q[end] = h * testing::integrate([&](double u) { return share(u) * place((1.0 - u) * h); }, 0.0, 1.0);
        to_v[end] = h * testing::integrate([&](double u) { return share(u) * velocity((1.0 - u) * h); }, 0.0, 1.0);
      }
      const Vec3 along{0.2, 0.3, 0.5};
      for (std::size_t n = 1; n < force.size(); ++n) {
        const auto amplitude = [&](std::size_t k) {
          const double speed = 0.3 + 2.0 * static_cast<double>(k) / kRate;
          return force[k] * model->calc_projection(m, 0, along, {-mu * speed / (speed + 1e-3), 0.0, 1.0});
        };
        const double a = amplitude(n - 1), b = amplitude(n), q0 = q, v0 = v;
        const double vq = -lambda * place(h), vv = velocity(h), qq = velocity(h) + 2.0 * d * place(h), qv = place(h);
        q = qq * q0 + qv * v0 + a * to_q[0] + b * to_q[1];
        v = vq * q0 + vv * v0 + a * to_v[0] + b * to_v[1];
        expected[n] += model->get_gain(m) * v;
      }
    }
    double peak = 0.0;
    for (const double x : expected) peak = std::max(peak, std::abs(x));
    ASSERT_GT(peak, 0.0);
    for (std::size_t n = 0; n < heard.size(); ++n) ASSERT_NEAR(heard[n], expected[n], 2e-5 * peak) << n << ", " << get_name(isa);
  }
}

TEST(ContactForces, NeverPullAndLeaveTheLoadItselfOut) {
  const auto model = Model::make(make_cube_bank(make_modes()));
  for (const double load : {1e-4, 0.1, 10.0, 1e4}) {
    for (const double roughness : {1e-8, 1e-6, 1e-4}) {
      ContactForces contacts(model, {.surface = {.roughness_m = roughness, .modulus_pa = 200e9}});
      std::vector<LastingContact> records = make_records(1.0, [&](double t) {
        LastingContact c = make_sliding(t, 0.5 * std::abs(std::sin(20.0 * t)), load * (1.0 + 0.9 * std::cos(170.0 * t)));
        c.sweep_m_s = 0.2;
        c.patch_radius_m = 1e-5 * (1.2 + std::sin(300.0 * t));
        return c;
      });
      // RMS heights, up to waves of 6.4 mm, over the skin: beyond 1 the shocks exceed the load.
      const double max = std::max(1.0, std::sqrt(2.0) * 5.3 * roughness / 10e-6);
      double sum = 0.0, square = 0.0;
      const std::vector<double> force = trace(contacts, records, 1.0, {.roughness_m = roughness, .friction = 0.5, .modulus_pa = 200e9});
      for (std::size_t n = 0; n < force.size(); ++n) {
        const double t = static_cast<double>(n) / kRate;
        // Values at the border of two sub-blocks are on the line between records 2 ms apart; in between, on the line between borders.
        const double slack = load * 0.9 * 170.0 * 170.0 * (2e-3 * 2e-3 + 1e-3 * 1e-3) / 8.0;
        ASSERT_GT(force[n], -max * load * (1.0 + 0.9 * std::cos(170.0 * t)) - slack) << t;
        sum += force[n], square += force[n] * force[n];
      }
      EXPECT_LT(std::abs(sum) / static_cast<double>(force.size()), (roughness > 1e-5 ? 0.6 : 0.15) * max * load) << "the mean is left out";
      EXPECT_LT(square / static_cast<double>(force.size()), 10.0 * max * max * load * load);
      EXPECT_GT(square, 0.0);
    }
  }
}

TEST(ContactForces, OfARestingBodyAreBitExactSilence) {
  const auto model = Model::make(make_cube_bank(make_modes()));
  for (const double slow : {0.0, 1.9e-4}) {
    ContactForces contacts(model);
    ResonatorBank voice(model);
    const std::vector<float> heard = play(voice, contacts,
                                          make_records(1.0,
                                                       [&](double t) {
                                                         LastingContact c = make_sliding(t, slow, 1.0 + 0.5 * std::sin(900.0 * t));
                                                         c.sweep_m_s = slow;
                                                         c.impedance_n_s_m = 3.0;
                                                         return c;
                                                       }),
                                          1.2);
    for (const float p : heard) ASSERT_EQ(std::signbit(p) ? 1.0F : p, 0.0F);
    EXPECT_FALSE(voice.is_awake());
    EXPECT_GT(contacts.get_counters().accepted, 400);
    EXPECT_TRUE(voice.is_idle());
    EXPECT_EQ(contacts.get_counters().samples, 0) << "no noise is worked out";
  }
}

TEST(ContactForces, FollowTheirEffects) {
  const auto model = Model::make(make_cube_bank(make_modes()));
  const auto hear = [&](EffectSet effects, bool rolls) {
    ContactForces contacts(model, {.effects = effects});
    ResonatorBank voice(model);
    return calc_peak(play(voice, contacts,
                          make_records(0.2,
                                       [&](double t) {
                                         LastingContact c = make_sliding(t, 0.4);
                                         c.sweep_m_s = 0.4;
                                         if (rolls) c.slip_m_s = {};
                                         return c;
                                       }),
                          0.2));
  };
  EXPECT_GT(hear({Effect::kRoughness}, false), 0.0F);
  EXPECT_EQ(hear({Effect::kRoughness}, true), 0.0F);
  EXPECT_EQ(hear({Effect::kRolling}, false), 0.0F);
  EXPECT_GT(hear({Effect::kRolling}, true), 0.0F);
  EXPECT_EQ(hear(kBrake, false), 0.0F);
}

/// Output of the modes under a force of this spectrum: power at each mode by its bandwidth.
TEST(ContactForces, SoundInABandThatFollowsTheSpeed) {
  // Many modes of equal shape; each hears the force's spectrum at its own frequency: power ~ S(f) gain^2 / (2 d) for a narrow mode.
  std::vector<InventedMode> modes;
  for (int m = 0; m < 12; ++m) modes.push_back({250.0 * std::pow(2.0, 0.5 * m), 60.0, 1.0});
  const auto spectrum = [](double freq_hz, double speed_m_s) {  // of the heights, m^2 / Hz; cut-off 0.8 mm, waves up to 6.4 mm
    const double low = speed_m_s / 0.8e-3;
    return freq_hz < low / 8.0 ? 0.0 : 1.6 / low * std::pow(freq_hz / low, -2.6);
  };
  for (const double speed : {0.15, 0.3, 0.6}) {
    for (std::size_t m = 0; m < modes.size(); ++m) {
      const double freq = modes[m].freq_hz, lowest = speed / 6.4e-3;
      if (freq < 1.5 * lowest || freq > 0.19 * kRate) continue;
      const auto model = Model::make(make_cube_bank({modes[m]}));
      ContactForces contacts(model, {.effects = {Effect::kRolling}});
      ResonatorBank voice(model);
      const std::vector<float> heard = play(voice, contacts,
                                            make_records(2.0,
                                                         [&](double t) {
                                                           LastingContact c = make_sliding(t, speed);
                                                           c.slip_m_s = {};
                                                           c.patch_radius_m = 1e-7;  // blunts nothing
                                                           c.force_n = 1e3;          // limited by the spring, not the load
                                                           return c;
                                                         }),
                                            2.0);
      // E[q'^2] = pi S_omega / (2 d) two-sided = S_f / (8 d) with S_f one-sided (Crandall and TimeWatermark 1963, 2.2).
      const double modulus = 1.0 / (1.0 / 70e9 + 1.0 / model->get_plane_strain_modulus_pa());
      const double stiffness = 2.0 * modulus * 1e-7;
      const double expected = stiffness * 2e-6 * std::sqrt(spectrum(freq, speed) / (8.0 * 60.0));
      EXPECT_NEAR(20.0 * std::log10(calc_rms(heard, 0.2, 1.9) / expected), 0.0, 2.0) << freq << " Hz, " << speed << " m/s";
    }
  }
}

struct Slide {
  double own_m = 0.0, floor_m = 2e-6, speed_m_s = 0.1, load_n = 2.0, patch_m = 0.2e-3, modulus_pa = 38e9;
};

/// Body with modes from 300 Hz to 9 kHz, sliding flat for 3 s.
std::vector<float> hear_slide(const Slide& of) {
  std::vector<InventedMode> modes;
  for (int m = 0; m < 11; ++m) modes.push_back({300.0 * std::pow(2.0, 0.49 * m), 40.0, 1.0 / (1.0 + m)});
  const auto model = Model::make(make_cube_bank(modes));
  ContactForces contacts(model, {.surface = {.roughness_m = of.own_m, .modulus_pa = of.modulus_pa}});
  ResonatorBank voice(model);
  const std::vector<LastingContact> records = make_records(3.0, [&](double t) {
    LastingContact c = make_sliding(t, of.speed_m_s, of.load_n);
    c.patch_radius_m = of.patch_m;
    return c;
  });
  return play(voice, contacts, records, 3.0, 480, {.roughness_m = of.floor_m, .friction = 0.5, .modulus_pa = of.modulus_pa});
}

double calc_slide_db(const Slide& of) { return 20.0 * std::log10(calc_rms(hear_slide(of), 0.1, 2.9)); }

// Measured: levels of sliding flat bodies grow linearly with the logarithms of roughness and speed, with exponents of 0.8 to 1.16 and 0.7
// to 0.96 (Ben Abdelounis et al. 2010 and those listed by Dang et al. 2013).
TEST(ContactForces, OfSlidingGrowWithRoughnessAndSpeed) {
  const std::vector<double> floors{0.02e-6, 0.1e-6, 0.5e-6, 2e-6, 10e-6, 20e-6, 50e-6}, speeds{0.02, 0.05, 0.1, 0.2, 0.4, 1.0};
  const auto calc_exponent = [](double from_db, double to_db, double from, double to) {
    return (to_db - from_db) / (20.0 * std::log10(to / from));
  };
  for (const Slide& of : {Slide{}, Slide{.load_n = 0.02, .patch_m = 20e-6, .modulus_pa = 100e9},
                          Slide{.load_n = 50.0, .patch_m = 0.5e-3, .modulus_pa = 5e9}}) {
    std::vector<std::vector<double>> level;
    for (const double speed : speeds) {
      level.emplace_back();
      for (const double floor : floors) {
        Slide at = of;
        at.speed_m_s = speed, at.floor_m = floor;
        level.back().push_back(calc_slide_db(at));
      }
    }
    for (std::size_t v = 0; v < speeds.size(); ++v) {
      for (std::size_t h = 0; h < floors.size(); ++h) {
        if (h > 0) {
          const double step = calc_exponent(level[v][h - 1], level[v][h], floors[h - 1], floors[h]);
          EXPECT_GT(step, 0.75) << floors[h] << " m, " << speeds[v] << " m/s";
          EXPECT_LT(step, 1.4) << floors[h] << " m, " << speeds[v] << " m/s";
        }
        if (v > 0) {
          const double step = calc_exponent(level[v - 1][h], level[v][h], speeds[v - 1], speeds[v]);
          EXPECT_GT(step, 0.55) << floors[h] << " m, " << speeds[v] << " m/s";
          EXPECT_LT(step, 1.1) << floors[h] << " m, " << speeds[v] << " m/s";
        }
      }
      const double exponent = calc_exponent(level[v].front(), level[v].back(), floors.front(), floors.back());
      EXPECT_GT(exponent, 0.8) << speeds[v];
      EXPECT_LT(exponent, 1.16) << speeds[v];
    }
    for (std::size_t h = 0; h < floors.size(); ++h) {
      const double exponent = calc_exponent(level.front()[h], level.back()[h], speeds.front(), speeds.back());
      EXPECT_GT(exponent, 0.7) << floors[h];
      EXPECT_LT(exponent, 0.96) << floors[h];
    }
  }
}

TEST(ContactForces, OfABoxThatSlidesFlatAreTheRoughnessOfBothSurfaces) {
  const auto hear = [](double own_m, double floor_m) { return calc_slide_db({.own_m = own_m, .floor_m = floor_m}); };
  const double floor = hear(0.0, 3e-6);
  EXPECT_NEAR(hear(3e-6, 0.0), floor, 1.0) << "whichever of the two is rough";
  EXPECT_NEAR(hear(4e-6, 3e-6), floor + 20.0 * std::log10(5.0 / 3.0), 1.0) << "the root of the sum of squares";
  EXPECT_NEAR(hear(20e-6, 2e-6), hear(20e-6, 20e-6) - 10.0 * std::log10(2.0), 1.5);
  EXPECT_EQ(calc_peak(hear_slide({.own_m = 0.0, .floor_m = 0.0})), 0.0F) << "two smooth surfaces make no sound";
}

TEST(ContactForces, OfSlidingStayFiniteAtTheExtremes) {
  double last = -1e9;
  for (const double floor : {1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 5e-4, 1.0, 1e300}) {
    const std::vector<float> heard = hear_slide({.floor_m = floor, .speed_m_s = 1.0});
    for (const float p : heard) ASSERT_TRUE(std::isfinite(p)) << floor;
    const double level = 20.0 * std::log10(calc_rms(heard, 0.1, 2.9));
    if (floor < 1e-3) {
      EXPECT_GT(level, last) << "louder with roughness, " << floor;
    }
    last = level;
  }
  for (const double speed : {1e-3, 10.0, 300.0, 1e9}) {
    for (const double load : {1e-12, 1e9}) {
      for (const float p : hear_slide({.floor_m = 5e-4, .speed_m_s = speed, .load_n = load})) ASSERT_TRUE(std::isfinite(p)) << speed;
    }
  }
  const double heavy = calc_slide_db({.load_n = 2.0}), light = calc_slide_db({.load_n = 2e-3});
  EXPECT_NEAR(light, heavy - 60.0, 0.5) << "light contacts are soft";
}

TEST(ContactForces, GiveTheSameBitsForAnyBlocks) {
  std::vector<InventedMode> modes = testing::make_many_modes(70);
  modes.push_back({23500.0, 200000.0});
  const auto model = Model::make(make_cube_bank(modes));
  const std::vector<LastingContact> records = make_records(0.4, [](double t) {
    LastingContact c = make_sliding(t, 1.0 - 2.4 * t > 0.0 ? 1.0 - 2.4 * t : 0.0);
    c.sweep_m_s = 0.3 * c.other_sweep_m_s;
    c.triangle = static_cast<std::int32_t>(30.0 * t);
    c.impedance_n_s_m = 2.0;
    return c;
  });
  std::vector<std::vector<float>> heard;
  for (const std::size_t block : {1, 31, 32, 100, 128, 511, 4096}) {
    ContactForces contacts(model);
    ResonatorBank voice(model);
    for (const LastingContact& record : records) contacts.take(record, kOther);
    contacts.reach(1.0);
    voice.strike({.time_s = 0.0501, .triangle = 3, .impulse_n_s = {0.0, 0.0, 1e-2}, .duration_s = 1e-3});
    voice.attach(&contacts);
    std::vector<float> out(24000, 0.0F);
    for (std::size_t n = 0; n < out.size(); n += block) voice.process(std::span(out).subspan(n, std::min(block, out.size() - n)));
    heard.push_back(out);
  }
  for (const std::vector<float>& out : heard) ASSERT_EQ(std::memcmp(out.data(), heard[0].data(), out.size() * sizeof(float)), 0);
  EXPECT_GT(calc_peak(heard[0]), 0.0F);
}

TEST(ContactForces, FadeWhenTheStreamStopsAndComeBackWhenItContinues) {
  const auto model = Model::make(make_cube_bank(make_modes()));
  ContactForces contacts(model, {.effects = kNoise});
  const auto peak_of = [&](std::int64_t sample) {
    const ContactBlock* drive = contacts.begin_sub_block(sample);
    float peak = 0.0F;
    for (int n = 0; drive != nullptr && n <= kSubBlock; ++n) {
      peak = std::max(peak, std::abs(drive->push[0][0].signal[n] + drive->push[0][1].signal[n]));
    }
    return peak;
  };
  LastingContact c = make_sliding(0.0, 0.4);
  c.state = ContactState::kBegin;
  contacts.take(c, kOther);
  c.state = ContactState::kHold;
  std::int64_t sample = 0;
  contacts.reach(0.5);  // physics runs, and has nothing new to say
  for (; sample < 0.5 * kRate; sample += kSubBlock) peak_of(sample);
  EXPECT_GT(peak_of(sample), 0.0F);
  EXPECT_EQ(contacts.get_counters().underruns, 0);
  for (sample += kSubBlock; sample < 0.53 * kRate; sample += kSubBlock) peak_of(sample);
  EXPECT_EQ(contacts.get_counters().underruns, 1);
  EXPECT_TRUE(contacts.is_idle());
  c.time_s = 0.6;
  contacts.take(c, kOther);
  contacts.reach(0.7);
  for (; sample < 0.65 * kRate; sample += kSubBlock) peak_of(sample);
  EXPECT_GT(peak_of(sample), 0.0F);
}

TEST(ContactForces, KeepTheStrongestWhenThereAreTooMany) {
  const auto model = Model::make(make_cube_bank(make_modes()));
  ContactForces contacts(model, {.max_contacts = 2, .max_records = 4});
  for (std::uint64_t id = 0; id < 3; ++id) {
    LastingContact c = make_sliding(0.0, 0.3, 1.0 + static_cast<double>(id));
    c.id = id;
    EXPECT_EQ(contacts.take(c, kOther), id < 2);
  }
  EXPECT_EQ(contacts.get_counters().dropped, 1);
  LastingContact strong = make_sliding(0.001, 0.3, 50.0);
  strong.id = 9;
  EXPECT_FALSE(contacts.take(strong, kOther)) << "the weakest has to go first";
  std::int64_t sample = 0;
  for (; sample < 480; sample += kSubBlock) contacts.begin_sub_block(sample);
  strong.time_s = 0.011;
  EXPECT_TRUE(contacts.take(strong, kOther));
  // Four records at most wait; the newest takes the place of the one before.
  for (int i = 0; i < 10; ++i) {
    strong.time_s += 0.001;
    EXPECT_TRUE(contacts.take(strong, kOther));
  }
  EXPECT_GT(contacts.get_counters().thinned, 3);
  LastingContact bad = strong;
  bad.triangle = 12;
  EXPECT_FALSE(contacts.take(bad, kOther));
  bad = strong;
  bad.force_n = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(contacts.take(bad, kOther));
  EXPECT_EQ(contacts.get_counters().refused, 2);
  EXPECT_THROW(ContactForces(model, {.max_contacts = kMaxContacts + 1}), InputError);
  EXPECT_THROW(ContactForces(model, {.surface = {.roughness_m = -1.0}}), InputError);
}

TEST(ContactForces, OfBothBodiesReadTheSameTwoSurfaces) {
  // SoundingBody 4 on body 6: each hears its own surface and the other's, and both are the same two.
  const auto model = Model::make(make_cube_bank(make_modes()));
  const auto hear = [&](bool first, const std::array<std::uint64_t, 2>& seeds) {
    const ContactSurface a{.roughness_m = 1e-6, .modulus_pa = 70e9, .seed = seeds[0]},
        b{.roughness_m = 3e-6, .modulus_pa = 200e9, .seed = seeds[1]};
    ContactForces contacts(model, {.surface = first ? a : b, .effects = {Effect::kRolling}});
    return trace(contacts,
                 make_records(0.1,
                              [&](double t) {
                                LastingContact c = make_sliding(t, 0.0);
                                c.body = first ? 4 : 6;
                                c.other = first ? 6 : 4;
                                c.sweep_m_s = first ? 0.3 : 0.5;
                                c.other_sweep_m_s = first ? 0.5 : 0.3;
                                return c;
                              }),
                 0.1, first ? b : a);
  };
  for (const std::array<std::uint64_t, 2>& seeds : {std::array<std::uint64_t, 2>{0, 0}, {5, 9}, {9, 5}}) {
    const std::vector<double> x = hear(true, seeds), y = hear(false, seeds);
    ASSERT_EQ(x.size(), y.size());
    for (std::size_t n = 0; n < x.size(); ++n) ASSERT_NEAR(x[n], y[n], 1e-6) << "action is reaction";
  }
  EXPECT_NE(hear(true, {5, 9}), hear(true, {5, 8})) << "another body has another surface";
}

TEST(ContactForces, DoNotDependOnTheNumbersOfBodies) {
  const auto model = Model::make(make_cube_bank(make_modes()));
  const auto hear = [&](std::int32_t body, std::int32_t other, std::uint64_t id) {
    ContactForces contacts(model, {.surface = {.seed = 11}});
    return trace(contacts,
                 make_records(0.1,
                              [&](double t) {
                                LastingContact c = make_sliding(t, 0.3);
                                c.body = body, c.other = other, c.id = id;
                                return c;
                              }),
                 0.1, {.modulus_pa = 70e9, .seed = 12});
  };
  const std::vector<double> alone = hear(0, 1, 77);
  EXPECT_EQ(hear(5, 9, 77), alone);
  EXPECT_EQ(hear(9, 5, 77), alone) << "in whatever order";
  EXPECT_NE(hear(0, 1, 78), alone) << "another touch";
}

}  // namespace
}  // namespace carillon::synth
