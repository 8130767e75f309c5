#include "runtime/host/feed.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/synth/cube_bank.hpp"

namespace carillon::host {
namespace {

constexpr double kRate = 48000.0;

stream::Impulse make_impulse(std::int32_t body, double time_s, double duration_s = 1e-3) {
  return {.time_s = time_s, .body = body, .impulse_n_s = {0.0, 0.0, 1e-3}, .duration_s = duration_s};
}

void play(synth::Synthesiser& synthesiser, Feed& feed, double until_s) {
  std::array<float, synth::kPeriod> left{}, right{};
  const std::array<float*, 2> out{left.data(), right.data()};
  for (int period = 0; period * synth::kPeriod < until_s * kRate; ++period) {
    feed.hand_on((period + 1) * synth::kPeriod / kRate, synthesiser);
    synthesiser.process(out.data(), 2, synth::kPeriod);
  }
}

// Thousands of events at once go through a ring of four; a strike is never late, a body that moves is never refused.
TEST(Feed, HandsOnMoreThanTheRingHolds) {
  const auto model = synth::Model::make(testing::make_cube_bank({{500.0, 20.0}}), {.rate_hz = kRate});
  synth::Synthesiser synthesiser({.rate_hz = kRate, .max_strikes = 3000, .ring_events = 4});
  std::vector<stream::Event> events;
  for (int b = 0; b < 3; ++b) {
    synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}});
    for (int i = 0; i < 50; ++i) events.emplace_back(stream::Motion{2e-3 * i, b, {1e-3 * i, 1.0, 0.0}, {0.5, 0.0, 0.0}});
    for (int i = 0; i < 700; ++i) events.emplace_back(make_impulse(b, 0.03));
    for (int i = 0; i < 100; ++i) events.emplace_back(make_impulse(b, 0.01 + 5e-4 * i, 0.01));
  }
  events.emplace_back(make_impulse(3, 0.01));  // of no body
  events.emplace_back(make_impulse(-1, 0.01));
  events.emplace_back(make_impulse(1, std::numeric_limits<double>::quiet_NaN()));
  const Events kept = make_events(events);
  Feed feed(kept, {{.number = 0, .moves = true}, {.number = 1, .moves = true}, {.number = 2, .moves = true}}, {});
  play(synthesiser, feed, 0.2);
  const synth::SynthesiserCounters counters = synthesiser.get_counters();
  EXPECT_EQ(counters.overflows, 0);
  EXPECT_EQ(counters.strikes, 3 * 800);
  EXPECT_EQ(counters.late, 0);
  EXPECT_EQ(counters.refused, 0);
  EXPECT_EQ(counters.faults, 1);
}

// A pulse of 13 ms in 82 pieces, and single steps: all of it is played, and none of it late, also by a click that must know it earlier.
TEST(Feed, HandsOnForcesBeforeTheyBegin) {
  const auto model = synth::Model::make(testing::make_cube_bank({{500.0, 20.0}}), {.rate_hz = kRate});
  synth::Synthesiser synthesiser({.rate_hz = kRate, .ring_events = 16});
  const int body =
      synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}, .effects = synth::kUsualEffects.with(synth::Effect::kAccelerationNoise)});
  std::vector<stream::Event> events;
  const std::vector<Vec3> steps(1300, {1e-6, 0.0, 1e-5});
  stream::split_force({.time_s = 0.02, .step_s = 1e-5}, steps, [&](const stream::Force& piece) { events.emplace_back(piece); });
  for (int i = 0; i < 200; ++i) events.emplace_back(stream::Force{.time_s = 0.05 + 5e-4 * i, .step_s = 1e-4, .count = 1});
  events.emplace_back(stream::Force{.time_s = 0.2, .step_s = 1e-4, .body = 3, .count = 1});
  const Events kept = make_events(events);
  Feed feed(kept, {{.number = body, .moves = true, .lead_s = model->get_sphere_radius_m() / synth::kSoundSpeedMs}}, {});
  play(synthesiser, feed, 0.2);
  const synth::SynthesiserCounters counters = synthesiser.get_counters();
  EXPECT_EQ(counters.strikes, 1 + 200);
  EXPECT_EQ(synthesiser.get_effect_counters(body).units[synth::Effect::kHertzPulse], 82 + 200) << "all its pieces";
  EXPECT_EQ(counters.late + counters.refused + counters.faults + counters.overflows, 0);
  const Tally tally = count_impulses(kept, 1);
  EXPECT_EQ(tally.impulses, 201) << "pieces of one pulse are one";
  EXPECT_EQ(tally.body_impulses[0], 201);
  EXPECT_EQ(tally.contacts, 201);
}

// A body whose sound needs a second to arrive, with a waypoint a millisecond: the synthesiser must remember a second of them, and no more.
TEST(Feed, KnowsHowManyWaypointsAreUnderWay) {
  std::vector<stream::Event> events;
  for (int i = 0; i < 5000; ++i) events.emplace_back(stream::Motion{1e-3 * i, 0, {0.0, 343.0, 0.0}, {}});
  events.emplace_back(stream::Motion{0.5, 1, {}, {}});
  const std::vector<stream::Listener> walk{{.time_s = 0.0}, {.time_s = 1.0}, {.time_s = 2.0}};
  const Events kept = make_events(events);
  const Feed feed(kept, {{.number = 0, .moves = true}, {.number = 1, .moves = true}}, walk);
  const std::vector<int> far = feed.count_waypoints(std::array{1.0, 1.0}), near = feed.count_waypoints(std::array{0.0, 0.0});
  ASSERT_EQ(far.size(), 3U);
  EXPECT_GE(far[0], 1002);
  EXPECT_LE(far[0], 1200);
  EXPECT_LE(near[0], 200);
  EXPECT_LE(far[1], 5);
  EXPECT_LE(far[2], 6);
}

// With as many waypoints as the feed says, a body that circles far away sounds as with all of them.
TEST(Feed, SoManyWaypointsAreEnough) {
  const auto model = synth::Model::make(testing::make_cube_bank({{500.0, 0.5}}), {.rate_hz = kRate});
  std::vector<stream::Event> events;
  for (int i = 0; i < 1500; ++i) {
    const double t = 1e-3 * i;
    events.emplace_back(
        stream::Motion{t, 0, {3.0 * std::cos(t), 100.0 + 3.0 * std::sin(t), 0.0}, {-3.0 * std::sin(t), 3.0 * std::cos(t), 0.0}});
  }
  for (int i = 0; i < 20; ++i) events.emplace_back(make_impulse(0, 0.05 + 0.06 * i));
  const auto render = [&](int waypoints) {
    const Events kept = make_events(events);
    Feed feed(kept, {{.number = 0, .moves = true}}, {});
    synth::Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{}}});
    synthesiser.add_body(model, {.position_m = {3.0, 100.0, 0.0},
                                 .longest_m = 110.0,
                                 .max_waypoints = waypoints > 0 ? waypoints : feed.count_waypoints(std::array{110.0 / 343.0})[0]});
    std::vector<float> sound(72000);
    for (std::size_t at = 0; at + synth::kPeriod <= sound.size(); at += synth::kPeriod) {
      feed.hand_on(static_cast<double>(at + synth::kPeriod) / kRate, synthesiser);
      float* out = sound.data() + at;
      synthesiser.process(&out, 1, synth::kPeriod);
    }
    return sound;
  };
  const std::vector<float> all = render(10000);
  EXPECT_EQ(render(0), all);
  EXPECT_NE(render(300), all);
}

/// What a feed pushes, by the counters of a synthesiser: all of it must come in time.
TEST(Feed, WhatIsDueLongBeforeItHappensComesInTime) {
  // A body that is told of every twenty seconds, a contact that pauses as long, a pulse that lasts for six: the body must be on its way at
  // once, not jump when its next place comes.
  const auto model = synth::Model::make(testing::make_cube_bank({{500.0, 0.5}}), {.rate_hz = kRate});
  const auto render = [&](const std::vector<double>& at) {
    std::vector<stream::Event> events;
    for (const double t : at) events.emplace_back(stream::Motion{t, 0, {t, 5.0, 0.0}, {1.0, 0.0, 0.0}});
    events.emplace_back(make_impulse(0, 30.0, 6.0));
    events.emplace_back(make_impulse(0, 10.0));
    std::stable_sort(events.begin(), events.end(),
                     [](const auto& a, const auto& b) { return stream::get_time_s(a) < stream::get_time_s(b); });
    const Events kept = make_events(events);
    Feed feed(kept, {{.number = 0, .moves = true}}, {});
    synth::Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{}}});
    synthesiser.add_body(model, {.position_m = {0.0, 5.0, 0.0}, .longest_m = 60.0, .max_waypoints = 5000});
    std::vector<float> sound(static_cast<std::size_t>(35 * kRate) / synth::kPeriod * synth::kPeriod);
    for (std::size_t n = 0; n < sound.size(); n += synth::kPeriod) {
      feed.hand_on(static_cast<double>(n + synth::kPeriod) / kRate, synthesiser);
      float* out = sound.data() + n;
      synthesiser.process(&out, 1, synth::kPeriod);
    }
    EXPECT_EQ(synthesiser.get_counters().late, 0);
    EXPECT_EQ(synthesiser.get_counters().strikes, 2);
    return sound;
  };
  std::vector<double> often;
  for (int i = 0; i <= 80; ++i) often.push_back(0.5 * i);
  const std::vector<float> sparse = render({0.0, 20.0, 40.0}), dense = render(often);
  float peak = 0.0F, difference = 0.0F;
  for (std::size_t n = 0; n < sparse.size(); ++n) {
    peak = std::max(peak, std::abs(dense[n]));
    difference = std::max(difference, std::abs(dense[n] - sparse[n]));
  }
  EXPECT_GT(peak, 0.0F);
  EXPECT_LT(difference, 1e-3F * peak);
}

}  // namespace
}  // namespace carillon::host
