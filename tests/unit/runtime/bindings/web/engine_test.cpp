// The engine of pages: models sent in pieces, interactive motion and contacts, recordings.
#include "runtime/bindings/web/engine.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::web {
namespace {

constexpr double kRate = 48000.0;

bank::Bank make_bank() {
  return testing::make_cube_bank(
      {{600.0, 4.0, 1.0, {0, 0, 1}, 0.1}, {1310.0, 6.0, 0.5, {0, 1, 0}, 0.2}, {2890.0, 9.0, 0.7, {1, 0, 0}, 0.3}});
}

synth::SynthesiserOptions make_options() {
  return {
      .rate_hz = kRate, .microphones_m = {{-0.1, 0, 0}, {0.1, 0, 0}}, .max_strikes = 256, .max_waypoints = 1024, .ring_events = 1 << 14};
}

/// Sends a model in pieces, like a worker.
void send(Engine& engine, int model, int surface, const synth::Model& from, std::size_t piece) {
  const synth::ModelSurface& s = *from.get_surface();
  engine.begin_surface(surface, {s.triangles.size(), s.columns, s.largest.size(), s.shape.size()});
  const auto add = [&](auto bytes) {
    const std::size_t step = piece / 12 * 12;  // whole triangles and numbers
    for (std::size_t at = 0; at < bytes.size(); at += step)
      engine.add_to_surface(surface, bytes.subspan(at, std::min(step, bytes.size() - at)));
  };
  add(std::as_bytes(std::span(s.triangles)));
  add(std::as_bytes(std::span(s.largest)));
  add(std::as_bytes(std::span(s.shape)));
  const std::vector<std::byte> tables = from.write_tables();
  engine.add_model(model, surface, tables);
}

std::vector<float> play(Engine& engine, int blocks) {
  std::vector<float> left(static_cast<std::size_t>(blocks) * 128), right(left.size());
  for (int b = 0; b < blocks; ++b) {
    float* out[2]{left.data() + b * 128, right.data() + b * 128};
    engine.process(out, 2, 128);
  }
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

void push(Engine& engine, const events::Event& event, Timing timing = Timing::kExact, int refused = 0) {
  std::vector<double> words;
  append_words(words, event, timing);
  EXPECT_EQ(engine.push(words), refused);
}

events::Impulse make_strike(int body, double time_s) {
  return {
      .time_s = time_s, .body = body, .triangle = 4, .barycentric = {0.2, 0.3, 0.5}, .impulse_n_s = {0.01, 0.02, 0.03}, .duration_s = 2e-4};
}

TEST(Engine, a_model_sent_in_pieces_sounds_the_same) {
  const bank::Bank bank = make_bank();
  const auto model = synth::Model::make(bank, {.rate_hz = kRate});
  synth::Synthesiser direct(make_options());
  const int own = direct.add_body(model, {.position_m = {0.3, 1.0, 0.2}});
  ASSERT_TRUE(direct.push(make_strike(own, 0.01)));
  std::vector<float> left(64 * 128), right(left.size());
  for (int b = 0; b < 64; ++b) {
    float* out[2]{left.data() + b * 128, right.data() + b * 128};
    direct.process(out, 2, 128);
  }
  left.insert(left.end(), right.begin(), right.end());
  for (const std::size_t piece : {12UL, 100UL, 1UL << 20}) {
    Engine engine(make_options());
    send(engine, 5, 9, *model, piece);
    const int body = engine.add_body(5, {.position_m = {0.3, 1.0, 0.2}});
    engine.release_model(5), engine.release_surface(9);  // the body keeps them
    push(engine, make_strike(body, 0.01));
    EXPECT_EQ(play(engine, 64), left) << piece;
  }
}

TEST(Engine, refuses_truncated_or_mismatched_models) {
  const auto model = synth::Model::make(make_bank(), {.rate_hz = kRate});
  const synth::ModelSurface& s = *model->get_surface();
  const std::vector<std::byte> tables = model->write_tables();
  Engine engine(make_options());
  EXPECT_THROW(engine.add_to_surface(1, {}), InputError);
  EXPECT_THROW(engine.add_model(1, 1, tables), InputError);
  engine.begin_surface(1, {s.triangles.size(), s.columns, s.largest.size(), s.shape.size()});
  EXPECT_THROW(engine.add_model(1, 1, tables), InputError) << "the surface is not there yet";
  send(engine, 2, 1, *model, 1 << 20);
  EXPECT_THROW(engine.add_to_surface(1, std::as_bytes(std::span(s.largest))), InputError) << "more than there should be";
  for (std::size_t cut = 0; cut < tables.size(); cut += 1 + cut / 16)
    EXPECT_THROW(engine.add_model(3, 1, std::span(tables).first(cut)), InputError) << cut;
  for (std::size_t at = 0; at < 8; ++at) {
    std::vector<std::byte> changed = tables;
    changed[at] ^= std::byte{0x20};
    EXPECT_THROW(engine.add_model(3, 1, changed), InputError) << at;
  }
  engine.begin_surface(4, {s.triangles.size(), s.columns + 16, s.largest.size(), s.shape.size()});
  EXPECT_THROW(engine.add_model(3, 4, tables), InputError);
  EXPECT_THROW(engine.begin_surface(5, {static_cast<std::size_t>(-1), 1, 1, 1}), InputError);
  EXPECT_THROW(engine.add_body(77, {}), InputError);
  EXPECT_THROW(engine.swap_model(0, 2), InputError);
  EXPECT_THROW(engine.set_solo(3, 0), InputError);
  EXPECT_NO_THROW(engine.add_body(2, {}));
}

TEST(Engine, events_as_soon_as_possible_are_never_late) {
  Engine engine(make_options());
  send(engine, 1, 1, *synth::Model::make(make_bank(), {.rate_hz = kRate}), 1 << 20);
  const int body = engine.add_body(1, {.position_m = {0, 1, 0}});
  for (int k = 0; k < 50; ++k) {
    push(engine, make_strike(body, 0.0), Timing::kSoon);
    (void)play(engine, 1 + k % 3);
  }
  const synth::SynthesiserCounters counters = engine.get_synthesiser().get_counters();
  EXPECT_EQ(counters.strikes, 50);
  EXPECT_EQ(counters.late, 0);
  EXPECT_EQ(counters.underruns, 0);
}

TEST(Engine, faults_are_counted_and_reported) {
  Engine engine(make_options());
  send(engine, 1, 1, *synth::Model::make(make_bank(), {.rate_hz = kRate}), 1 << 20);
  const int body = engine.add_body(1, {.position_m = {0, 1, 0}});
  events::Impulse bad = make_strike(body, 0.01);
  bad.impulse_n_s[1] = std::nan("");
  push(engine, bad, Timing::kSoon, 1);
  EXPECT_EQ(engine.find_fault(), "the impulse is not finite");
  push(engine, events::Listener{.position_m = {1, std::nan(""), 0}}, Timing::kSoon, 1);
  push(engine, make_strike(body, std::nan("")), Timing::kSoon, 1);
  EXPECT_EQ(engine.get_synthesiser().get_counters().faults, 3);
}

/// Largest step between samples.
double find_step(const std::vector<float>& sound) {
  double step = 0.0;
  for (std::size_t n = 1; n < sound.size() / 2; ++n) step = std::max(step, std::abs(static_cast<double>(sound[n]) - sound[n - 1]));
  return step;
}

TEST(Engine, a_jump_of_the_listener_makes_no_click) {
  const auto model = synth::Model::make(testing::make_cube_bank({{600.0, 0.0}}), {.rate_hz = kRate});
  Engine engine(make_options());
  send(engine, 1, 1, *model, 1 << 20);
  const int body = engine.add_body(1, {.position_m = {0, 3, 0}});
  push(engine, events::Listener{.rotation = {1, 0, 0, 0}});
  events::Impulse strike = make_strike(body, 0.001);
  strike.impulse_n_s = {0, 0, 1};
  push(engine, strike);
  (void)play(engine, 100);
  const double usual = find_step(play(engine, 40));
  push(engine, events::Listener{.position_m = {0.0, -9.0, 0.0}}, Timing::kSoon);
  const double during = find_step(play(engine, 200));
  // At 60 m/s away the sound gets lower and weaker; there is no step beyond its own.
  EXPECT_LT(during, 1.05 * usual);
  const double after = find_step(play(engine, 40));
  EXPECT_NEAR(after / usual, 3.0 / 12.0, 0.02);  // 1/r
}

TEST(Engine, rotating_the_listener_rotates_the_ears) {
  const auto model = synth::Model::make(testing::make_cube_bank({{600.0, 0.0}}), {.rate_hz = kRate});
  Engine engine(make_options());
  send(engine, 1, 1, *model, 1 << 20);
  const int body = engine.add_body(1, {.position_m = {0.6, 0, 0}});  // to the right
  events::Impulse strike = make_strike(body, 0.001);
  strike.impulse_n_s = {0, 0, 1};
  push(engine, strike);
  (void)play(engine, 50);
  const auto measure = [&] {
    const std::vector<float> sound = play(engine, 40);
    const auto middle = sound.begin() + static_cast<std::ptrdiff_t>(sound.size() / 2);
    return std::pair{*std::max_element(sound.begin(), middle), *std::max_element(middle, sound.end())};
  };
  const auto [left, right] = measure();
  EXPECT_NEAR(right / left, 0.7 / 0.5, 0.01);
  push(engine, events::Listener{.rotation = {0, 0, 0, 1}}, Timing::kSoon);  // half a turn: looks back
  (void)play(engine, 50);
  const auto [left_back, right_back] = measure();
  EXPECT_NEAR(left_back / right_back, 0.7 / 0.5, 0.01);
}

TEST(Engine, a_contact_sounds_while_it_slides_and_ends) {
  Engine engine(make_options());
  send(engine, 1, 1, *synth::Model::make(make_bank(), {.rate_hz = kRate}), 1 << 20);
  const synth::EffectSet effects = synth::kDefaultEffects.with(synth::kContactEffects);
  const int body = engine.add_body(1, {.position_m = {0, 1, 0}, .effects = effects});
  (void)play(engine, 10);
  events::LastingContact touch{.id = 7, .body = body, .triangle = 4, .state = events::ContactState::kBegin, .normal = {0, 0, 1}};
  touch.slip_m_s = {0.3, 0, 0}, touch.sweep_m_s = 0.3, touch.force_n = 10.0, touch.patch_radius_m = 1e-4;
  const auto find_power = [](const std::vector<float>& sound) {
    double sum = 0.0;
    for (const float p : sound) sum += static_cast<double>(p) * p;
    return sum / static_cast<double>(sound.size());
  };
  push(engine, touch, Timing::kSoon);
  touch.state = events::ContactState::kHold;
  for (int k = 0; k < 20; ++k) {
    push(engine, touch, Timing::kSoon);
    (void)play(engine, 6);
  }
  const double sliding = find_power(play(engine, 12));
  EXPECT_GT(sliding, 0.0);
  // Without updates the contact rests, and the ringing decays.
  (void)play(engine, 2000);
  EXPECT_LT(find_power(play(engine, 12)), 1e-4 * sliding);
  touch.state = events::ContactState::kEnd;
  push(engine, touch, Timing::kSoon);
  push(engine, touch, Timing::kSoon);  // no effect the second time
  (void)play(engine, 20);
  EXPECT_EQ(engine.get_synthesiser().get_counters().faults, 0);
  EXPECT_EQ(engine.get_synthesiser().get_counters().refused, 0);
}

TEST(Engine, a_recording_plays_like_its_events_and_can_start_in_the_middle) {
  const auto model = synth::Model::make(make_bank(), {.rate_hz = kRate});
  std::vector<events::Event> happened;
  for (int k = 0; k <= 40; ++k) {
    const double t = 0.01 * k;
    happened.emplace_back(events::BodyMotion{.time_s = t, .body = 1, .position_m = {t, 1.0, 0.0}, .velocity_m_s = {1.0, 0.0, 0.0}});
    if (k % 10 == 5) happened.emplace_back(make_strike(1, t + 1e-3));
  }
  std::vector<double> words;
  for (const events::Event& event : happened) append_words(words, event);
  const auto begin = [&](Engine& engine, double at_s, double from_s) {
    send(engine, 1, 1, *model, 1 << 20);
    const int body = engine.add_body(1, {.position_m = {0, 1, 0}});
    engine.begin_playback(3, {.bodies = {-1, body}, .at_s = at_s, .from_s = from_s});
    engine.add_to_playback(3, words);
    return body;
  };
  Engine by_file(make_options());
  (void)begin(by_file, 0.0, 0.0);
  Engine by_hand(make_options());
  send(by_hand, 1, 1, *model, 1 << 20);
  const int body = by_hand.add_body(1, {.position_m = {0, 1, 0}});
  for (events::Event event : happened) {
    if (auto* motion = std::get_if<events::BodyMotion>(&event)) motion->body = body;
    if (auto* impulse = std::get_if<events::Impulse>(&event)) impulse->body = body;
    push(by_hand, event);
  }
  const std::vector<float> file = play(by_file, 200), hand = play(by_hand, 200);
  double power = 0.0, off = 0.0;
  for (std::size_t n = 0; n < file.size(); ++n) {
    power += static_cast<double>(hand[n]) * hand[n];
    off += std::pow(static_cast<double>(file[n]) - hand[n], 2);
  }
  EXPECT_GT(power, 0.0);
  EXPECT_LT(off, 1e-12 * power);

  Engine from_middle(make_options());
  const int late = begin(from_middle, 0.2, 0.2);
  (void)play(from_middle, 200);
  EXPECT_EQ(from_middle.get_synthesiser().get_counters().strikes, 2) << "those at 0.251 and 0.351 s";
  EXPECT_EQ(from_middle.get_synthesiser().get_counters().late, 0);
  from_middle.end_playback(3);
  from_middle.end_playback(3);
  from_middle.add_to_playback(3, words);  // ended: no effect
  (void)late;
  EXPECT_THROW(from_middle.begin_playback(4, {.bodies = {99}}), InputError);
}

}  // namespace
}  // namespace carillon::web
