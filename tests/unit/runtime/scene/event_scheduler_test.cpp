#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "runtime/events/ring.hpp"
#include "runtime/render/event_playback.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::scene {
namespace {

constexpr double kRate = 48000.0;

events::Impulse make_impulse(std::int32_t body, double time_s, double duration_s = 1e-3) {
  return {.time_s = time_s, .body = body, .impulse_n_s = {0.0, 0.0, 1e-3}, .duration_s = duration_s};
}

void play(synth::Synthesiser& synthesiser, render::EventPlayback& playback, double until_s) {
  std::array<float, synth::kBlock> left{}, right{};
  const std::array<float*, 2> out{left.data(), right.data()};
  for (int period = 0; period * synth::kBlock < until_s * kRate; ++period) {
    playback.push_until((period + 1) * synth::kBlock / kRate, synthesiser);
    synthesiser.process(out.data(), 2, synth::kBlock);
  }
}

// Thousands of simultaneous events pass a ring of four; no strike is late, no moving body is refused.
TEST(EventPlayback, PushesMoreThanTheRingHolds) {
  const auto model = synth::Model::make(testing::make_cube_bank({{500.0, 20.0}}), {.rate_hz = kRate});
  synth::Synthesiser synthesiser({.rate_hz = kRate, .max_strikes = 3000, .ring_events = 4});
  std::vector<events::Event> events;
  for (int b = 0; b < 3; ++b) {
    synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}});
    for (int i = 0; i < 50; ++i) events.emplace_back(events::BodyMotion{2e-3 * i, b, {1e-3 * i, 1.0, 0.0}, {0.5, 0.0, 0.0}});
    for (int i = 0; i < 700; ++i) events.emplace_back(make_impulse(b, 0.03));
    for (int i = 0; i < 100; ++i) events.emplace_back(make_impulse(b, 0.01 + 5e-4 * i, 0.01));
  }
  events.emplace_back(make_impulse(3, 0.01));  // unknown body
  events.emplace_back(make_impulse(-1, 0.01));
  events.emplace_back(make_impulse(1, std::numeric_limits<double>::quiet_NaN()));
  const Events kept = make_events(events);
  render::EventPlayback playback(kept, {{.number = 0, .moves = true}, {.number = 1, .moves = true}, {.number = 2, .moves = true}}, {});
  play(synthesiser, playback, 0.2);
  const synth::SynthesiserCounters counters = synthesiser.get_counters();
  EXPECT_EQ(counters.overflows, 0);
  EXPECT_EQ(counters.strikes, 3 * 800);
  EXPECT_EQ(counters.late, 0);
  EXPECT_EQ(counters.refused, 0);
  EXPECT_EQ(counters.faults, 0);
  EXPECT_EQ(playback.get_faults(), 2) << "body -1, and a time that is no number";
}

// A pulse of 13 ms in 82 pieces, and single steps: all is played and none is late, also with the lead of clicks.
TEST(EventPlayback, PushesForcesInTime) {
  const auto model = synth::Model::make(testing::make_cube_bank({{500.0, 20.0}}), {.rate_hz = kRate});
  synth::Synthesiser synthesiser({.rate_hz = kRate, .ring_events = 16});
  const int body = synthesiser.add_body(
      model, {.position_m = {0.0, 1.0, 0.0}, .effects = synth::kDefaultEffects.with(synth::Effect::kAccelerationNoise)});
  std::vector<events::Event> events;
  const std::vector<Vec3> steps(1300, {1e-6, 0.0, 1e-5});
  events::split_force({.time_s = 0.02, .step_s = 1e-5}, steps, [&](const events::Force& piece) { events.emplace_back(piece); });
  for (int i = 0; i < 200; ++i) events.emplace_back(events::Force{.time_s = 0.05 + 5e-4 * i, .step_s = 1e-4, .count = 1});
  events.emplace_back(events::Force{.time_s = 0.2, .step_s = 1e-4, .body = 3, .count = 1});
  const Events kept = make_events(events);
  render::EventPlayback playback(kept, {{.number = body, .moves = true, .lead_s = model->get_sphere_radius_m() / synth::kSoundSpeedMs}},
                                 {});
  play(synthesiser, playback, 0.2);
  const synth::SynthesiserCounters counters = synthesiser.get_counters();
  EXPECT_EQ(counters.strikes, 1 + 200);
  EXPECT_EQ(synthesiser.get_effect_counters(body).units[synth::Effect::kHertzPulse], 82 + 200) << "all its pieces";
  EXPECT_EQ(counters.late + counters.refused + counters.faults + counters.overflows, 0);
  const Tally tally = count_impulses(kept, 1);
  EXPECT_EQ(tally.impulses, 201) << "pieces of one pulse are one";
  EXPECT_EQ(tally.body_impulses[0], 201);
  EXPECT_EQ(tally.contacts, 201);
}

// A travel time of one second with a waypoint per millisecond: the synthesiser must store one second of them, not more.
TEST(EventPlayback, CountsTheWaypointsToStore) {
  std::vector<events::Event> events;
  for (int i = 0; i < 5000; ++i) events.emplace_back(events::BodyMotion{1e-3 * i, 0, {0.0, 343.0, 0.0}, {}});
  events.emplace_back(events::BodyMotion{0.5, 1, {}, {}});
  const std::vector<events::Listener> walk{{.time_s = 0.0}, {.time_s = 1.0}, {.time_s = 2.0}};
  const Events kept = make_events(events);
  const render::EventPlayback playback(kept, {{.number = 0, .moves = true}, {.number = 1, .moves = true}}, walk);
  const std::vector<int> far = playback.count_waypoints(std::array{1.0, 1.0}), near = playback.count_waypoints(std::array{0.0, 0.0});
  ASSERT_EQ(far.size(), 3U);
  EXPECT_GE(far[0], 1002);
  EXPECT_LE(far[0], 1200);
  EXPECT_LE(near[0], 200);
  EXPECT_LE(far[1], 5);
  EXPECT_LE(far[2], 6);
}

// With this number of waypoints a body that circles far away sounds as with all of them.
TEST(EventPlayback, CountedWaypointsSuffice) {
  const auto model = synth::Model::make(testing::make_cube_bank({{500.0, 0.5}}), {.rate_hz = kRate});
  std::vector<events::Event> events;
  for (int i = 0; i < 1500; ++i) {
    const double t = 1e-3 * i;
    events.emplace_back(
        events::BodyMotion{t, 0, {3.0 * std::cos(t), 100.0 + 3.0 * std::sin(t), 0.0}, {-3.0 * std::sin(t), 3.0 * std::cos(t), 0.0}});
  }
  for (int i = 0; i < 20; ++i) events.emplace_back(make_impulse(0, 0.05 + 0.06 * i));
  const auto render = [&](int waypoints) {
    const Events kept = make_events(events);
    render::EventPlayback playback(kept, {{.number = 0, .moves = true}}, {});
    synth::Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{}}});
    synthesiser.add_body(model, {.position_m = {3.0, 100.0, 0.0},
                                 .longest_m = 110.0,
                                 .max_waypoints = waypoints > 0 ? waypoints : playback.count_waypoints(std::array{110.0 / 343.0})[0]});
    std::vector<float> sound(72000);
    for (std::size_t at = 0; at + synth::kBlock <= sound.size(); at += synth::kBlock) {
      playback.push_until(static_cast<double>(at + synth::kBlock) / kRate, synthesiser);
      float* out = sound.data() + at;
      synthesiser.process(&out, 1, synth::kBlock);
    }
    return sound;
  };
  const std::vector<float> all = render(10000);
  EXPECT_EQ(render(0), all);
  EXPECT_NE(render(300), all);
}

// Live: a ring that refuses every third event, and physics known to 0.05 s. Each event is pushed once, in order of due times, a first
// waypoint also at rest; a watermark gives the time of the physics.
TEST(EventScheduler, RetriesRefusedEventsAndPushesWatermarks) {
  EventScheduler scheduler({{.number = 4, .moves = true, .lead_s = 0.01}, {.number = -1}}, 0.0);
  scheduler.add(make_impulse(1, 0.01));  // unplayed body
  scheduler.add(events::BodyMotion{0.02, 0, {1.0, 0.0, 0.0}, {0.5, 0.0, 0.0}});
  scheduler.add(make_impulse(0, 0.04, 0.0));
  scheduler.add(events::BodyMotion{0.06, 0, {2.0, 0.0, 0.0}, {0.5, 0.0, 0.0}});
  scheduler.add(make_impulse(0, 0.2, 0.0));
  std::vector<events::Event> pushed;
  int calls = 0;
  const auto push = [&](const events::Event& event) {
    if (++calls % 3 == 0) return false;
    pushed.push_back(event);
    return true;
  };
  while (!scheduler.push_until(0.1, 0.05, push)) {
  }
  ASSERT_EQ(pushed.size(), 5U);
  const auto& rests = std::get<events::BodyMotion>(pushed[0]);
  EXPECT_EQ(rests.body, 4);
  EXPECT_EQ(rests.velocity_m_s, Vec3{});
  EXPECT_EQ(std::get<events::BodyMotion>(pushed[1]).velocity_m_s[0], 0.5);
  EXPECT_EQ(std::get<events::BodyMotion>(pushed[2]).time_s, 0.06) << "due at the time of the waypoint before it, 0.02";
  EXPECT_EQ(std::get<events::Impulse>(pushed[3]).time_s, 0.04) << "due 0.01 before";
  EXPECT_EQ(std::get<events::TimeWatermark>(pushed[4]).time_s, 0.05);
  EXPECT_TRUE(scheduler.push_until(0.1, 0.05, push)) << "no mark twice";
  EXPECT_EQ(pushed.size(), 5U);
}

// A ring refuses invalid events forever: they are counted and do not block others. Each event is pushed, dropped or queued.
TEST(EventScheduler, InvalidEventsDoNotBlockOthers) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EventScheduler scheduler({{.number = 0, .moves = true}}, 0.0);
  events::EventRing ring(4);
  scheduler.add(make_impulse(0, kNan));
  scheduler.add(events::BodyMotion{kNan, 0, {1.0, 0.0, 0.0}, {0.5, 0.0, 0.0}});
  scheduler.add(events::LastingContact{.time_s = kNan, .body = 0});
  for (int i = 0; i < 10; ++i) scheduler.add(make_impulse(0, 0.01 * (i + 1), 0.0));
  const auto push = [&](const events::Event& event) { return ring.push(event); };
  int taken = 0, rounds = 0;
  for (; taken < 8 && rounds < 10; ++rounds) {
    scheduler.push_until(0.085, -1.0, push);
    for (events::Event event; ring.pop(event); ++taken) EXPECT_EQ(std::get<events::Impulse>(event).time_s, 0.01 * (taken + 1));
  }
  EXPECT_EQ(taken, 8);
  EXPECT_EQ(rounds, 2) << "four at a time";
  EXPECT_EQ(scheduler.get_faults(), 3);
  EXPECT_EQ(ring.get_faults(), 0);
  EXPECT_TRUE(scheduler.push_until(1.0, -1.0, push)) << "the two that are due later";
}

/// All events must be in time by the counters of a synthesiser.
TEST(EventPlayback, EventsDueLongBeforeTheirTimeAreInTime) {
  // A body with a waypoint every twenty seconds, a contact with a pause as long, a pulse of six seconds: the body must move at once, not
  // jump at its next waypoint.
  const auto model = synth::Model::make(testing::make_cube_bank({{500.0, 0.5}}), {.rate_hz = kRate});
  const auto render = [&](const std::vector<double>& at) {
    std::vector<events::Event> events;
    for (const double t : at) events.emplace_back(events::BodyMotion{t, 0, {t, 5.0, 0.0}, {1.0, 0.0, 0.0}});
    events.emplace_back(make_impulse(0, 30.0, 6.0));
    events.emplace_back(make_impulse(0, 10.0));
    std::stable_sort(events.begin(), events.end(),
                     [](const auto& a, const auto& b) { return events::get_time_s(a) < events::get_time_s(b); });
    const Events kept = make_events(events);
    render::EventPlayback playback(kept, {{.number = 0, .moves = true}}, {});
    synth::Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{}}});
    synthesiser.add_body(model, {.position_m = {0.0, 5.0, 0.0}, .longest_m = 60.0, .max_waypoints = 5000});
    std::vector<float> sound(static_cast<std::size_t>(35 * kRate) / synth::kBlock * synth::kBlock);
    for (std::size_t n = 0; n < sound.size(); n += synth::kBlock) {
      playback.push_until(static_cast<double>(n + synth::kBlock) / kRate, synthesiser);
      float* out = sound.data() + n;
      synthesiser.process(&out, 1, synth::kBlock);
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
}  // namespace carillon::scene
