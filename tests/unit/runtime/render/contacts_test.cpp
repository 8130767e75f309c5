// Lasting contacts in whole scenes: omissions by a plan, and independence of bodies that never meet.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "runtime/physics/world.hpp"
#include "runtime/render/render.hpp"
#include "tests/unit/runtime/physics/bodies.hpp"
#include "tests/unit/runtime/render/heard.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::render {
namespace {

constexpr double kReferencePa = 20e-6;

events::LastingContact make_contact(double time_s, std::uint64_t id, double slip_m_s, double force_n) {
  events::LastingContact c{.time_s = time_s, .id = id, .triangle = 3, .barycentric = {0.2, 0.3, 0.5}, .normal = {0, 0, 1}};
  c.slip_m_s = {slip_m_s, 0, 0};
  c.other_sweep_m_s = slip_m_s;
  c.force_n = force_n;
  c.patch_radius_m = 0.1e-3;
  return c;
}

struct Stage {
  // Between 1 and 4 kHz, where A-weighting is within 1.3 dB of 0; decays of metal.
  bank::Bank bank = testing::make_cube_bank({{1010.0, 3.0, 1.8}, {1730.0, 4.5, 1.2}, {2620.0, 7.0, -1.2}, {3900.0, 14.0, 0.6}});
  scene::Scene scene;

  explicit Stage(std::vector<std::string> names = {"bar"}) {
    scene.file = "contacts.json";
    scene.duration_s = 6.0;
    scene.ground.emplace();
    for (const std::string& name : names) {
      scene::SceneBody body;
      body.name = name;
      body.spec.name = name;
      body.spec.bank = &bank;
      body.spec.initial.position_m = {0.4 * static_cast<double>(scene.bodies.size()), 0.0, 0.05};
      scene.bodies.push_back(body);
    }
  }
  std::vector<const bank::Bank*> list_banks() const { return std::vector<const bank::Bank*>(scene.bodies.size(), &bank); }
  Heard play_all(const std::vector<events::Event>& events) const {
    scene::Scene all = scene;
    all.effects = synth::EffectSet::all();
    return calc_sound(all, list_banks(), events, {});
  }
};

/// Exposures of the difference and of the whole, and the largest RMS of the difference over 50 ms.
struct Difference {
  double share_db = 0.0, loudest_pa = 0.0, whole_pa2_s = 0.0;
};

Difference compare(const Heard& a, const Heard& b) {
  double difference = 0.0, whole = 0.0, loudest = 0.0, window = 0.0;
  for (std::size_t c = 0; c < b.pressure_pa.size(); ++c) {
    for (std::size_t n = 0; n < b.pressure_pa[c].size(); ++n) {
      const double d = a.pressure_pa[c][n] - b.pressure_pa[c][n];
      if (n % 2400 == 0) window = 0.0;
      window += d * d;
      loudest = std::max(loudest, window / 2400.0);
      difference += d * d;
      whole += b.pressure_pa[c][n] * b.pressure_pa[c][n];
    }
  }
  return {10.0 * std::log10(std::max(difference, 1e-300) / whole), std::sqrt(loudest), whole / 48000.0};
}

/// Contacts of a body without strikes.
struct Contacts {
  const char* name;
  std::function<std::vector<events::Event>()> list_events;
};

const std::vector<Contacts> kCases{{"a slide that stops and lies",
                                    [] {
                                      std::vector<events::Event> events;
                                      for (int i = 0; i <= 400; ++i) {
                                        const double t = 0.1 + 2e-3 * i;
                                        events.emplace_back(make_contact(t, 1, std::max(0.0, 0.8 * (1.0 - (t - 0.1) / 0.7)), 2.0));
                                      }
                                      return events;
                                    }},
                                   {"a scrape that is lifted",
                                    [] {
                                      std::vector<events::Event> events;
                                      for (int i = 0; i <= 200; ++i)
                                        events.emplace_back(make_contact(0.1 + 2e-3 * i, 1, 0.3 + 0.2 * std::sin(0.1 * i), 10.0));
                                      events::LastingContact end = make_contact(0.502, 1, 0.3, 0.0);
                                      end.state = events::ContactState::kEnd;
                                      events.emplace_back(end);
                                      return events;
                                    }},
                                   {"a roll of two contacts, of which one ends early",
                                    [] {
                                      std::vector<events::Event> events;
                                      for (int i = 0; i <= 300; ++i) {
                                        for (const std::uint64_t id : {1, 2}) {
                                          if (id == 2 && i > 100) continue;
                                          events::LastingContact c = make_contact(0.1 + 2e-3 * i, id, 0.0, 3.0);
                                          c.sweep_m_s = c.other_sweep_m_s = 0.5;
                                          c.patch_radius_m = 10e-6;
                                          if (i == 300 || (id == 2 && i == 100)) c.state = events::ContactState::kEnd;
                                          events.emplace_back(c);
                                        }
                                      }
                                      return events;
                                    }},
                                   {"rare records of a slow scrape", [] {
                                      std::vector<events::Event> events;
                                      for (int i = 0; i <= 4; ++i) events.emplace_back(make_contact(0.1 + 0.3 * i, 1, 0.05, 5.0));
                                      for (const double t : {1.34, 1.6}) events.emplace_back(make_contact(t, 1, 0.0, 5.0));
                                      return events;
                                    }}};

TEST(PlannedContacts, SoundAsWithAllEffects) {
  for (const Contacts& of : kCases) {
    const Stage stage;
    const std::vector<events::Event> events = of.list_events();
    const scene::Plan plan =
        scene::make_plan(scene::make_facts(stage.scene, scene::make_microphones(stage.scene), true), scene::make_events(events));
    const Heard all = stage.play_all(events), planned = calc_sound(stage.scene, stage.list_banks(), events, {.plan = &plan});
    const Difference difference = compare(planned, all);
    EXPECT_GT(difference.whole_pa2_s, 0.2 * std::pow(10.0, 4.0) * kReferencePa * kReferencePa) << of.name << ": 40 dB are not to be heard";
    EXPECT_LT(difference.share_db, -50.0) << of.name;
    EXPECT_LT(difference.loudest_pa, kReferencePa) << of.name;
    RecordProperty("difference_db", std::to_string(difference.share_db));
  }
}

TEST(Superposition, HoldsForBodiesThatNeverMeet) {
  const auto list_events = [](std::int32_t body, std::uint64_t id, double speed) {
    std::vector<events::Event> events;
    for (int i = 0; i <= 150; ++i) {
      events::LastingContact c = make_contact(0.1 + 2e-3 * i, id, speed, 2.0);
      c.body = body;
      events.emplace_back(c);
    }
    return events;
  };
  Stage both({"bar", "plate"}), turned({"plate", "bar"}), bar({"bar"}), plate({"plate"});
  for (Stage* stage : {&both, &turned, &bar, &plate}) {
    stage->scene.duration_s = 0.6;
    for (scene::SceneBody& body : stage->scene.bodies) body.spec.initial.position_m = {body.name == "bar" ? 0.0 : 0.8, 0.0, 0.0};
  }
  const auto join = [](std::vector<events::Event> a, const std::vector<events::Event>& b) {
    a.insert(a.end(), b.begin(), b.end());
    std::stable_sort(a.begin(), a.end(), [](const auto& x, const auto& y) { return events::get_time_s(x) < events::get_time_s(y); });
    return a;
  };
  const Heard one = bar.play_all(list_events(0, 41, 0.3)), two = plate.play_all(list_events(0, 42, 0.4));
  Heard sum = one;
  for (std::size_t c = 0; c < 2; ++c)
    for (std::size_t n = 0; n < sum.pressure_pa[c].size(); ++n) sum.pressure_pa[c][n] += two.pressure_pa[c][n];
  const Heard together = both.play_all(join(list_events(0, 41, 0.3), list_events(1, 42, 0.4)));
  EXPECT_LT(compare(together, sum).share_db, -130.0);
  EXPECT_LT(compare(turned.play_all(join(list_events(1, 41, 0.3), list_events(0, 42, 0.4))), together).share_db, -130.0);
  EXPECT_GT(compare(two, one).share_db, -20.0);
  // Even with equal contacts each body has a surface of its own.
  EXPECT_GT(compare(plate.play_all(list_events(0, 41, 0.3)), one).share_db, -20.0);
}

/// A stack of three at rest, struck from the side: silent before the hit, and its load adds no sound below 200 Hz.
TEST(RestingContacts, AreSilentBeforeTheHit) {
  const bank::Bank box = physics::tests::add_modes(physics::tests::make_box({0.06, 0.05, 0.04}), 24),
                   ball = physics::tests::make_ball(0.03, 3);
  scene::Scene scene;
  scene.file = "stack.json";
  scene.duration_s = 0.7;
  scene.ground.emplace();
  scene.effects = synth::EffectSet::all().without(synth::Effect::kContactDamping);  // damps both bands
  std::vector<const bank::Bank*> banks;
  physics::WorldSpec world_spec;
  world_spec.ground = physics::GroundSpec{};
  const auto add = [&](const std::string& name, const bank::Bank& bank, const Vec3& position) -> physics::BodySpec& {
    scene::SceneBody body;
    body.name = name;
    body.spec = physics::tests::make_body(name, bank, position);
    scene.bodies.push_back(body);
    banks.push_back(&bank);
    world_spec.bodies.push_back(body.spec);
    return world_spec.bodies.back();
  };
  for (int i = 0; i < 3; ++i) add("box " + std::to_string(i), box, {0, 0, 0.02 + 0.04 * i});
  add("ball", ball, {-0.8, 0.003, 0.1}).velocity_m_s = {1.6, 0, 2.4};
  std::vector<events::Event> events, hits;
  double struck_s = 0.0;
  physics::World world(world_spec, {.end_s = scene.duration_s});
  world.advance(scene.duration_s, std::numeric_limits<double>::infinity(), [&](const events::Event& e) {
    events.push_back(e);
    if (!std::holds_alternative<events::LastingContact>(e)) hits.push_back(e);
    const bool is_hit = std::holds_alternative<events::Impulse>(e) || std::holds_alternative<events::Force>(e);
    if (is_hit && struck_s == 0.0 && events::get_time_s(e) > 0.3) struck_s = events::get_time_s(e);
  });
  ASSERT_GT(struck_s, 0.3);
  const Heard heard = calc_sound(scene, banks, events, {}), alone = calc_sound(scene, banks, hits, {});
  const auto calc_power = [](const Heard& of, double from_s, double to_s, double above_hz, double below_hz) {
    double sum = 0.0;
    for (const std::vector<double>& channel : of.pressure_pa) {
      // First-order poles separate a thump from a ring.
      const double high = std::exp(-2.0 * M_PI * above_hz / of.rate_hz), low = 1.0 - std::exp(-2.0 * M_PI * below_hz / of.rate_hz);
      double mean = 0.0, once = 0.0, twice = 0.0;
      for (std::size_t n = 0; n < channel.size(); ++n) {
        mean = high * mean + (1.0 - high) * channel[n];
        once += low * (channel[n] - mean - once);
        twice += low * (once - twice);
        const double t = static_cast<double>(n) / of.rate_hz;
        if (t > from_s && t < to_s) sum += twice * twice;
      }
    }
    return 10.0 * std::log10(std::max(sum, 1e-300) / (to_s - from_s));
  };
  const double hit_db = calc_power(heard, struck_s, struck_s + 0.02, 200.0, 8000.0);
  EXPECT_LT(calc_power(heard, struck_s - 0.045, struck_s - 0.003, 200.0, 8000.0), hit_db - 100.0) << "it lay still";
  EXPECT_NEAR(calc_power(heard, struck_s, struck_s + 0.1, 10.0, 200.0), calc_power(alone, struck_s, struck_s + 0.1, 10.0, 200.0), 1.0);
}

}  // namespace
}  // namespace carillon::render
