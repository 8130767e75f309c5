// Arbitrary streams of contact records: bounded forces, and sound no louder than under a push.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "tests/unit/runtime/synth/contact_bench.hpp"

namespace carillon::synth {
namespace {

using namespace testing;

/// Peak of a body under a sudden push of 1 N for 50 ms at the place of make_sliding().
float find_push_peak(const std::shared_ptr<const Model>& model) {
  const LastingContact at = make_sliding(0.0, 0.0);
  const std::vector<Vec3> steps(500, Vec3{0.0, 0.0, 1e-4});
  ResonatorBank voice(model);
  events::split_force({.time_s = 0.0, .step_s = 1e-4, .triangle = at.triangle, .barycentric = at.barycentric}, steps,
                      [&](const events::Force& piece) { voice.push(piece); });
  std::vector<float> out(4800);
  voice.process(out);
  return calc_peak(out);
}

/// Records of an unreliable sender: states in any order, zero loads, zero speeds, equal times.
std::vector<LastingContact> make_random_stream(std::mt19937_64& random) {
  const auto chance = [&] { return std::uniform_real_distribution(0.0, 1.0)(random); };
  const auto amount = [&](double low, double high) { return chance() < 0.25 ? 0.0 : low * std::pow(high / low, chance()); };
  std::vector<LastingContact> records;
  const int count = 2 + static_cast<int>(6 * chance());
  double time_s = 0.0;
  for (int i = 0; i < count; ++i) {
    LastingContact c = make_sliding(time_s, 0.0, amount(1e-4, 1e3));
    const double turn = 2.0 * pi * chance(), slip = amount(1e-5, 10.0);
    c.slip_m_s = {slip * std::cos(turn), slip * std::sin(turn), 0.0};
    c.sweep_m_s = amount(1e-5, 10.0), c.other_sweep_m_s = amount(1e-5, 10.0);
    c.patch_radius_m = 1e-12 * std::pow(1e10, chance());
    c.impedance_n_s_m = amount(1e-3, 1e5);
    c.state = static_cast<ContactState>(static_cast<int>(3 * chance()));
    records.push_back(c);
    time_s += amount(1e-5, 10e-3);
  }
  return records;
}

TEST(ContactStreams, OfAnyStreamAreBoundedAndNoLouderThanAPlainPushByThem) {
  const auto model = Model::make(make_cube_bank(make_modes()));
  const double push = static_cast<double>(find_push_peak(model));
  ASSERT_GT(push, 0.0);
  for (std::uint64_t stream = 0; stream < 100000; ++stream) {
    std::mt19937_64 random(stream);
    const std::vector<LastingContact> records = make_random_stream(random);
    const auto draw_roughness_m = [&] { return std::pow(10.0, std::uniform_real_distribution(-7.0, -4.0)(random)); };
    const ContactSurface own{.roughness_m = draw_roughness_m(), .modulus_pa = 10e9},
        other{.roughness_m = draw_roughness_m(), .modulus_pa = 30e9};
    // R of the heights (with waves of 6.4 mm) over the skin; above 1 shocks exceed the load.
    const double shocks = std::max(1.0, 5.3 * std::hypot(own.roughness_m, other.roughness_m) / 10e-6);
    double load = 0.0, lowest = 0.0, highest = 0.0;
    for (const LastingContact& record : records) load = std::max(load, record.force_n);
    ContactForces traced(model, {.surface = own}), contacts(model, {.surface = own});
    ResonatorBank voice(model);
    const double seconds = records.back().time_s + 6e-3;
    for (const double force : trace(traced, records, seconds, other)) lowest = std::min(lowest, force), highest = std::max(highest, force);
    ASSERT_GE(lowest, -shocks * load * (1.0 + 1e-6)) << stream;
    ASSERT_LE(highest, std::expm1(3.0) * shocks * load) << stream;
    const std::vector<float> heard = play(voice, contacts, records, seconds, 1 << 20, other);
    const ContactCounters& counters = contacts.get_counters();
    ASSERT_EQ(counters.accepted + counters.dropped + counters.refused, static_cast<std::int64_t>(records.size())) << stream;
    ASSERT_LE(static_cast<double>(calc_peak(heard)), 2.0 * (highest - lowest) * push) << stream;
  }
}

/// The usual last record: id, state and time alone.
TEST(ContactStreams, OfATouchThatEndsWithZerosDoNotBurst) {
  const auto model = Model::make(make_cube_bank(make_modes()));
  std::array<float, 2> loudest{};
  for (std::uint64_t id = 1; id <= 200; ++id) {
    for (const bool has_zeros : {false, true}) {
      std::vector<LastingContact> records;
      for (int i = 0; i < 5; ++i) {
        LastingContact c = make_sliding(1e-3 * i + (i == 4 ? 2e-3 : 0.0), 0.41, i == 4 ? 0.0 : 0.66);
        c.id = id;
        c.sweep_m_s = 0.005, c.other_sweep_m_s = 0.415, c.patch_radius_m = 7e-5;
        if (i == 4 && has_zeros) c.slip_m_s = {}, c.sweep_m_s = c.other_sweep_m_s = 0.0, c.patch_radius_m = 1e-12;
        c.state = i == 0 ? ContactState::kBegin : i < 4 ? ContactState::kHold : ContactState::kEnd;
        records.push_back(c);
      }
      ContactForces contacts(model, {.surface = {.roughness_m = 2e-6, .modulus_pa = 10e9}});
      ResonatorBank voice(model);
      float& peak = loudest[has_zeros ? 1 : 0];
      peak = std::max(peak, calc_peak(play(voice, contacts, records, 0.02, 480, kGroundSurface)));
    }
  }
  EXPECT_GT(loudest[0], 0.0F);
  EXPECT_LT(loudest[1], 1.2F * loudest[0]);
}

}  // namespace
}  // namespace carillon::synth
