// process() and strike() do not allocate and make no system call. A separate program, see tests/support/heap_counter.hpp.
#include <gtest/gtest.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/synth/acceleration_noise.hpp"
#include "runtime/synth/contact_forces.hpp"
#include "runtime/synth/receiver.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/support/heap_counter.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"
#include "tests/unit/runtime/synth/multipole_cube.hpp"

namespace carillon::synth {
namespace {

using tests::g_allocations;
using tests::g_bytes;

TEST(NoHeap, TheCounterSeesAllocations) {
  const long before = g_allocations;
  auto* memory = new std::vector<double>(1000);
  EXPECT_GE(g_allocations - before, 2);
  delete memory;
}

TEST(NoHeap, CoupledModesTakeNoMemory) {
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 30; ++m) modes.push_back({100.0 + 90.0 * m, 5.0});
  bank::Bank bank = testing::make_cube_bank(modes);
  for (int m = 0; m < 20; ++m) bank.quartic.modes.push_back(m);
  for (std::size_t i = 0; i < 2 * bank::count_pairs(20); ++i) bank.quartic.rows.push_back(i % 3 == 0 ? 1e6F : -3e5F);
  const auto model = Model::make(bank);
  ResonatorBank body(model, {.is_nonlinear = true});
  std::vector<float> sent(128);
  const long before = g_allocations;
  for (int i = 0; i < 300; ++i) {
    if (i % 10 == 0)
      body.strike(
          {.time_s = (static_cast<double>(body.get_position()) + 30.3) / 48000.0, .impulse_n_s = {0.0, 0.0, 0.3}, .duration_s = 2e-3});
    body.set_max_modes(i % 50 == 0 ? 16 : 1000);
    body.process(sent);
  }
  EXPECT_EQ(g_allocations - before, 0);
  EXPECT_GT(body.get_counters().coupled_samples, 1000);
}

TEST(NoHeap, StrikingAndProcessingTakeNoMemory) {
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 50; ++m) modes.push_back({100.0 + 300.0 * m, 5.0 + (m % 7 == 0 ? 1e5 : 0.0)});
  const bank::Bank bank = testing::make_cube_bank(modes);
  ResonatorBank body(Model::make(bank), {.max_strikes = 8});
  Trajectory path(4), listener(4);
  listener.push({0.0, {0.0, 0.0, 0.0}, {}});
  DelayLine delay_line(10.0, 48000.0, 128);
  Receiver ear({0.1, 0.0, 0.0}, 48000.0);
  std::vector<double> out(128);
  std::vector<float> sent(128), x(128), y(128), z(128);
  AccelerationNoise click(0.06, 1.0, 48000.0, 8);
  ContactForces contacts(Model::make(bank), {.max_contacts = 2, .max_records = 8});
  ResonatorBank touched(Model::make(bank));
  touched.attach(&contacts);
  const long before = g_allocations;
  for (int i = 0; i < 300; ++i) {
    for (int k = 0; k < (i % 10 == 0 ? 20 : 0); ++k) {  // more than there is room for
      body.strike({.time_s = (static_cast<double>(body.get_position()) + 30.3) / 48000.0,
                   .shape = k % 2 == 0 ? PulseShape::kHertz : PulseShape::kGaussian,
                   .impulse_n_s = {0.0, 0.0, 1.0},
                   .duration_s = k % 3 == 0 ? 2e-3 : 2e-4});
    }
    body.set_max_modes(i % 50 == 0 ? 16 : 1000);
    body.process(sent);
    path.push({i * 128 / 48000.0, {1.0 + 0.001 * i, 0.0, 0.0}, {0.375, 0.0, 0.0}});
    delay_line.push(sent);
    click.strike({.time_s = 1e-3 * i, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = 1e-3}, {1.0, 0.0, 0.0, 0.0});
    click.process({x, y, z});
    for (std::uint64_t k = 0; k < 5; ++k) {  // more than there is room for
      contacts.take({.time_s = static_cast<double>(touched.get_position()) / 48000.0 + 1e-3,
                     .id = k + static_cast<std::uint64_t>(i / 50),
                     .state = i % 50 == 49 ? events::ContactState::kEnd : events::ContactState::kHold,
                     .normal = {0.0, 0.0, 1.0},
                     .force_n = 1.0,
                     .sweep_m_s = 0.1,
                     .other_sweep_m_s = 0.2,
                     .patch_radius_m = 1e-5,
                     .impedance_n_s_m = 1.0});
    }
    contacts.reach(static_cast<double>(touched.get_position()) / 48000.0);
    touched.process(sent);
    ear.process({.track = &path, .monopole = &delay_line}, listener, 128 * i, out);
  }
  EXPECT_EQ(g_allocations - before, 0);
  EXPECT_GT(body.get_counters().accepted, 0);
  EXPECT_GT(body.get_counters().refused, 0);
  EXPECT_GT(contacts.get_counters().samples, 0);
  EXPECT_GT(contacts.get_counters().dropped, 0);
}

TEST(NoHeap, SensorsTakeNoMemoryWhileTheyRead) {
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 50; ++m) modes.push_back({100.0 + 300.0 * m, 5.0 + (m % 7 == 0 ? 1e5 : 0.0)});
  const bank::Bank bank = testing::make_cube_bank(modes);
  Synthesiser synthesiser({.rate_hz = 48000.0});
  const int body = synthesiser.add_body(Model::make(bank));
  for (const double rate_hz : {0.0, 3200.0, 44100.0}) synthesiser.add_sensor(body, bank, {.triangle = 3, .rate_hz = rate_hz});
  std::vector<float> left(128), right(128);
  std::vector<double> samples(256);
  float* const out[] = {left.data(), right.data()};
  std::size_t count = 0;
  const long before = g_allocations;
  for (int i = 0; i < 300; ++i) {
    if (i % 10 == 0)
      synthesiser.push(events::Impulse{.time_s = synthesiser.get_horizon_s() + 1e-3,
                                       .body = body,
                                       .impulse_n_s = {0.0, 0.0, 1.0},
                                       .duration_s = i % 20 == 0 ? 1e-3 : 0.0});
    synthesiser.process(out, 2, 128);
    for (int sensor = 0; sensor < 3; ++sensor) count += synthesiser.find_sensor(sensor)->read(samples);
  }
  EXPECT_EQ(g_allocations - before, 0);
  EXPECT_GT(count, 70000U);
}

/// Heap bytes that a body of these effects takes.
long measure_bytes(Synthesiser& synthesiser, const std::shared_ptr<const Model>& model, EffectSet effects) {
  const long before = g_bytes;
  synthesiser.add_body(model, {.effects = effects});
  return g_bytes - before;
}

TEST(NoHeap, DisabledEffectsTakeNoMemory) {
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 300; ++m) modes.push_back({100.0 + 60.0 * m, 30.0});
  bank::Bank bank = testing::make_cube_bank(modes);
  testing::give_multipoles(bank, std::vector<testing::ModeMultipoles>(modes.size(), testing::make_dipole(1.0)), 0.09);
  for (int m = 0; m < 20; ++m) bank.quartic.modes.push_back(m);
  bank.quartic.rows.assign(2 * bank::count_pairs(20), 1e6F);
  bank.quartic.thickness_m = 1e-3;
  const auto model = Model::make(bank);
  Synthesiser synthesiser({.max_waypoints = 2, .floor = Floor{}, .head = ListeningHead{head::make_sphere(48000.0)}});
  synthesiser.add_body(model, {.effects = EffectSet::all()});  // with the shared tables
  EXPECT_LT(measure_bytes(synthesiser, model, {}), 2500);
  constexpr EffectSet kBase{Effect::kModal, Effect::kTwoEars, Effect::kNonlinear};
  const long base = measure_bytes(synthesiser, model, kBase);
  for (const Effect effect : EffectSet::all().without(kBase)) {
    const long more = measure_bytes(synthesiser, model, kBase.with(effect)) - base;
    // A head has one receiver in place of two, and delays the others.
    if (effect == Effect::kHertzPulse || effect == Effect::kDoppler)
      EXPECT_EQ(more, 0) << get_name(effect);
    else
      EXPECT_GT(more, 100) << get_name(effect);
  }
  EXPECT_LT(measure_bytes(synthesiser, model, kBase.without(Effect::kNonlinear)), base - 1000);
  EXPECT_LT(measure_bytes(synthesiser, model, kBase.without(Effect::kTwoEars)), base);
}

TEST(NoHeap, AWholeSceneTakesNoMemoryWhileItPlays) {
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 30; ++m) modes.push_back({150.0 + 250.0 * m, 30.0});
  const auto model = Model::make(testing::make_cube_bank(modes));
  Synthesiser synthesiser({.max_bodies = 4, .max_strikes = 8, .ring_events = 64});
  for (const EffectSet effects :
       {kDefaultEffects.with(Effect::kAccelerationNoise), EffectSet{Effect::kModal}, EffectSet{}, kDefaultEffects})
    synthesiser.add_body(model, {.position_m = {1.0, 2.0, 0.0}, .effects = effects});
  synthesiser.remove_body(3);
  const auto other = Model::make(testing::make_cube_bank(modes, 500.0));
  std::vector<float> left(300), right(300);
  const std::array<float*, 2> out{left.data(), right.data()};
  synthesiser.process(out.data(), 2, 128);
  long before = g_allocations;
  for (int i = 0; i < 300; ++i) {
    if (i % 30 == 0) {  // the main thread may
      const long until_now = g_allocations;
      synthesiser.swap_model(i % 3, i % 60 == 0 ? other : model);
      before += g_allocations - until_now;
    }
    for (int k = 0; k < 10; ++k) {
      synthesiser.push(events::Impulse{.time_s = synthesiser.get_horizon_s() + 1e-4 * k, .body = k % 5, .impulse_n_s = {0.0, 0.0, 1.0}});
      synthesiser.push(events::BodyMotion{synthesiser.get_horizon_s(), k % 4, {1.0, 2.0, 0.001 * i}, {}});
      events::Force force{.time_s = synthesiser.get_horizon_s() + 1e-4 * k, .step_s = 7e-6, .body = k % 5, .count = events::kMaxForceSteps};
      force.impulse_n_s.fill({0.1F, -0.01F * static_cast<float>(k), 1.0F});
      synthesiser.push(force);
    }
    synthesiser.set_budget(i % 60 < 30 ? 20.0 * 48000.0 : 1e12);
    synthesiser.process(out.data(), 2, 1 + i);
    (void)synthesiser.get_counters();
  }
  EXPECT_EQ(g_allocations - before, 0);
  EXPECT_GT(synthesiser.get_counters().strikes, 0);
  EXPECT_GT(synthesiser.get_counters().faded, 0);
}

// A body rotates above a floor, sliding and struck, heard by a rotating head, with model swaps.
TEST(NoHeap, DirectivityTakesNoMemoryWhileItPlays) {
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 50; ++m) modes.push_back({150.0 + 250.0 * m, 30.0 + (m % 7 == 0 ? 1e5 : 0.0)});
  bank::Bank bank = testing::make_cube_bank(modes);
  std::array<std::shared_ptr<const Model>, 2> models;
  for (std::size_t i = 0; i < 2; ++i) {
    testing::give_multipoles(bank, std::vector<testing::ModeMultipoles>(modes.size(), testing::make_dipole(1.0)), 0.09 + 0.01 * i);
    models[i] = Model::make(bank);
  }
  constexpr EffectSet kAll = kDefaultEffects.with({Effect::kDirectivity, Effect::kGroundReflection, Effect::kRoughness, Effect::kHead});
  Synthesiser synthesiser({.max_strikes = 8,
                           .ring_events = 64,
                           .floor = Floor{.point_m = {0.0, 0.0, -1.0}},
                           .head = ListeningHead{head::make_sphere(48000.0)}});
  const int body = synthesiser.add_body(models[0], {.position_m = {1.0, 2.0, 0.0}, .effects = kAll});
  std::vector<float> left(300), right(300);
  const std::array<float*, 2> out{left.data(), right.data()};
  synthesiser.process(out.data(), 2, 128);
  long before = g_allocations;
  for (int i = 0; i < 300; ++i) {
    if (i % 40 == 0) {  // the main thread may
      const long until_now = g_allocations;
      synthesiser.swap_model(body, models[i / 40 % 2]);
      before += g_allocations - until_now;
    }
    const double time_s = synthesiser.get_horizon_s(), half = 0.01 * i;
    synthesiser.push(events::Impulse{.time_s = time_s, .body = body, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = 1e-3});
    synthesiser.push(events::LastingContact{.time_s = time_s,
                                            .id = 7,
                                            .body = body,
                                            .normal = {0.0, 0.0, 1.0},
                                            .slip_m_s = {0.2, 0.0, 0.0},
                                            .force_n = 1.0,
                                            .sweep_m_s = 0.2,
                                            .other_sweep_m_s = 0.2,
                                            .patch_radius_m = 1e-5,
                                            .impedance_n_s_m = 1.0});
    synthesiser.push(events::BodyMotion{time_s, body, {1.0, 2.0, 0.001 * i}, {}, {std::cos(half), 0.0, std::sin(half), 0.0}});
    synthesiser.push(events::Listener{.time_s = time_s, .rotation = {std::cos(half), 0.0, 0.0, std::sin(half)}});
    synthesiser.set_budget(i % 60 < 30 ? 20.0 * 48000.0 : 1e12);
    synthesiser.process(out.data(), 2, 1 + i);
  }
  EXPECT_EQ(g_allocations - before, 0);
  EXPECT_GT(synthesiser.get_effect_counters(body).units[Effect::kDirectivity], 1000);
  EXPECT_GT(synthesiser.get_effect_counters(body).units[Effect::kHead], 1000);
  EXPECT_GT(synthesiser.get_effect_counters(body).units[Effect::kRoughness], 0);
}

// In a child killed by the kernel at the first system call except read, write and exit.
TEST(NoHeap, AWholeSceneMakesNoSystemCallWhileItPlays) {
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 30; ++m) modes.push_back({150.0 + 250.0 * m, 30.0 + (m % 9 == 0 ? 1e5 : 0.0)});
  Synthesiser synthesiser({.max_bodies = 4, .budget = 50.0 * 48000.0, .head = ListeningHead{head::make_sphere(48000.0)}});
  for (int b = 0; b < 4; ++b) {
    const EffectSet effects = b < 2 ? kDefaultEffects : kDefaultEffects.with(Effect::kHead);
    synthesiser.add_body(Model::make(testing::make_cube_bank(modes)), {.position_m = {1.0, 2.0, 0.0}, .effects = effects});
  }
  std::array<float, 256> left{}, right{};
  const std::array<float*, 2> out{left.data(), right.data()};
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) _exit(2);
    float peak = 0.0F;
    for (int i = 0; i < 400; ++i) {
      const double time_s = synthesiser.get_horizon_s();
      synthesiser.push(events::Impulse{.time_s = time_s, .body = i % 4, .impulse_n_s = {0.0, 0.0, 1e-3}, .duration_s = 1e-4});
      synthesiser.push(events::BodyMotion{time_s, i % 4, {1.0, 2.0, 0.001 * i}, {}});
      synthesiser.push(events::Listener{.time_s = time_s, .position_m = {0.001 * i, 0.0, 0.0}});
      synthesiser.process(out.data(), 2, 1 + i % 256);
      for (const float p : left) peak = std::max(peak, std::abs(p));
    }
    syscall(SYS_exit, peak > 0.0F ? 0 : 3);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status)) << "killed by signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace carillon::synth
