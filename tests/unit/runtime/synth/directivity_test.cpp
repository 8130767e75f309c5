// Directivity against closed forms of monopoles and dipoles, and against gains.
#include "runtime/synth/directivity.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numeric>
#include <string>
#include <variant>
#include <vector>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/synth/directed_scene.hpp"

namespace carillon::synth {
namespace {

using namespace testing;

void expect_as_by_gains(Scene scene, double bound_db) {
  const Sound directed = play(scene);
  scene.effects = scene.effects.without(Effect::kDirectivity);
  const Sound plain = play(scene);
  for (std::size_t e = 0; e < directed.size(); ++e) {
    ASSERT_GT(calc_rms(plain[e]), 0.0);
    EXPECT_LT(calc_difference_db(directed[e], plain[e]), bound_db) << e;
  }
}

// A pulsating sphere sounds as its gain, at the same time.
TEST(Directivity, AMonopoleIsHeardAsItsGain) {
  constexpr double kFreq = 1500.0, kRadius = 0.1;
  Scene scene = make_tone(kFreq, make_monopole(1.0, kFreq, kRadius), kRadius, {{0.0, 0.5, 0.0}, {2.0, 0.3, -1.0}});
  const Sound directed = play(scene);
  scene.effects = kDefaultEffects;
  const Sound plain = play(scene);
  for (std::size_t e = 0; e < 2; ++e) EXPECT_LT(calc_difference_db(directed[e], plain[e], 1200), -80.0) << e;
}

// The velocity of the sphere is that of its mode over sqrt(4 pi) a; the pressure on it leads by 45 degrees at ka = 1.
TEST(Directivity, PressureOfAPulsatingSphereLeadsItsVelocityByFortyFiveDegrees) {
  constexpr double kRadius = 0.2, kFreq = kC / (2.0 * pi * kRadius);
  // p / v = rho c (k^2 a^2 - i k a) / (1 + k^2 a^2), signs of e^{-i omega t} (research of the sphere: Morse & Ingard 7.1).
  const Complex pressure = kAirDensity * kC * Complex(0.5, -0.5);
  const double distance = 4.0;
  Scene scene = make_tone(kFreq, {pressure * std::sqrt(4.0 * pi)}, kRadius, {{0.0, distance, 0.0}});
  const Complex heard = measure(play(scene)[0], kFreq);
  const double on_the_way = 2.0 * pi * kFreq * (distance - kRadius) / kC;
  const Complex at_the_sphere = heard * std::polar(distance / kRadius, on_the_way);
  EXPECT_NEAR(std::arg(at_the_sphere) * 180.0 / pi, 45.0, 0.5);
  EXPECT_NEAR(std::abs(at_the_sphere), std::abs(pressure), 1e-3 * std::abs(pressure));
}

TEST(Directivity, ADipoleHasItsCosineAndItsNearField) {
  constexpr double kRadius = 0.1, kFreq = 900.0, k = 2.0 * pi * kFreq / kC;
  const Complex pressure(0.7, -0.4);
  std::vector<Vec3> microphones;
  std::vector<double> cosines, distances;
  for (const double r : {1.1 * kRadius, 10.0 * kRadius}) {
    for (const double angle : {0.0, 60.0, 90.0, 180.0}) {
      const double a = angle * pi / 180.0;
      microphones.push_back({r * std::sin(a), 0.0, r * std::cos(a)});
      cosines.push_back(std::cos(a));
      distances.push_back(r);
    }
  }
  const Sound heard = play(make_tone(kFreq, make_dipole(pressure), kRadius, microphones));
  for (std::size_t e = 0; e < microphones.size(); ++e) {
    const Complex fall = calc_dipole_fall(k * distances[e], k * kRadius);
    const Complex expected = std::conj(pressure * cosines[e] * fall);
    EXPECT_LT(to_db(std::abs(measure(heard[e], kFreq) - expected) / std::abs(pressure * fall)), -60.0) << e;
  }
}

// Rotated body frame, and a centre of the multipoles away from the centre of mass.
TEST(Directivity, ATurnedBodyAndACentreAside) {
  constexpr double kRadius = 0.05, kFreq = 1200.0, k = 2.0 * pi * kFreq / kC;
  const Vec3 centre{0.02, -0.01, 0.03}, position{0.4, 1.0, -0.2};
  const events::Quaternion rotation = turn_about(normalise(Vec3{1.0, 2.0, -0.5}), 1.1);
  Scene scene{.bank = make_cube_bank({{kFreq, 0.0}}),
              .microphones_m = {{0.0, 0.0, 0.0}, {2.0, 1.0, 0.7}},
              .position_m = position,
              .rotation = rotation,
              .events = {make_blow()}};
  scene.bank.rigid.centre_m = {0.005, 0.004, -0.003};
  give_multipoles(scene.bank, {make_dipole(1.0)}, kRadius, centre);
  const Vec3 from = position + turn(rotation, centre - scene.bank.rigid.centre_m), axis = turn(rotation, {0.0, 0.0, 1.0});
  const Sound heard = play(scene);
  for (std::size_t e = 0; e < 2; ++e) {
    const Vec3 way = scene.microphones_m[e] - from;
    const double r = norm(way);
    const Complex fall = calc_dipole_fall(k * r, k * kRadius);
    EXPECT_LT(to_db(std::abs(measure(heard[e], kFreq) - std::conj(fall) * (dot(way, axis) / r)) / std::abs(fall)), -60.0) << e;
  }
}

/// Body at the origin rotating about x, with a waypoint every 10 ms.
std::vector<events::Event> make_turn(double rad_s, double length_s) {
  std::vector<events::Event> events{};
  for (int i = 0; i * 0.01 <= length_s; ++i)
    events.push_back(events::BodyMotion{i * 0.01, 0, {}, {}, turn_about({1.0, 0.0, 0.0}, rad_s * i * 0.01)});
  return events;
}

// Lobes cos(L phi) about the axis z, about which the body rotates: the emission varies as cos(L angle). The difference is a tone without
// steps, found from two samples a quarter of a period apart. At L = 30 a lobe passes in five blocks.
TEST(Directivity, ATurningBodyIsHeardAsItTurns) {
  struct Case {
    int order;
    double radius_m, freq_hz, bound_db, step_db;
  };
  constexpr double kTurn = 10.0, kDistance = 1.5;
  for (const auto& [order, kRadius, kFreq, bound_db, step_db] :
       {Case{1, 0.05, 2000.0, -45.0, -60.0}, Case{4, 0.05, 2000.0, -45.0, -60.0}, Case{12, 0.05, 2000.0, -45.0, -60.0},
        Case{30, 0.3, 6000.0, -30.0, -45.0}}) {
    ModeMultipoles multipoles(static_cast<std::size_t>((order + 1) * (order + 1)));
    multipoles.back() = 1.0;  // m = L: cos(L phi) sin^L(theta)
    Scene scene = make_tone(kFreq, multipoles, kRadius, {{kDistance, 0.0, 0.0}});
    scene.frames = 24000;
    for (int i = 0; i * 0.01 <= 0.6; ++i)
      scene.events.push_back(events::BodyMotion{i * 0.01, 0, {}, {}, turn_about({0.0, 0.0, 1.0}, kTurn * i * 0.01)});
    const Sound heard = play(scene);
    // The tone of the body that stands still at its loudest, and the lobes that go by when the sound leaves.
    Scene still = make_tone(kFreq, multipoles, kRadius, {{kDistance, 0.0, 0.0}});
    const Complex loudest = measure(play(still)[0], kFreq);
    double error = 0.0, power = 0.0, step = 0.0;
    const std::size_t quarter = std::lround(0.25 * kRate / kFreq);
    std::vector<Complex> off;
    for (std::size_t n = 0; n < heard[0].size(); ++n) {
      const double t = (static_cast<double>(n) - Synthesiser::kLatency) / kRate, left = t - (kDistance - kRadius) / kC;
      const Complex turned = std::polar(1.0, 2.0 * pi * kFreq * (t - kStruck / kRate));
      const double expected = std::real(loudest * turned) * std::cos(order * kTurn * left);
      const double rest = static_cast<double>(heard[0][n]) - expected;
      off.emplace_back(rest, n < quarter ? 0.0 : off[n - quarter].real());
      if (n < 1200) continue;
      error += rest * rest;
      power += expected * expected;
      const Complex unturned = off[n] * std::conj(turned),
                    before = off[n - 1] * std::conj(turned) * std::polar(1.0, 0.5 * pi / static_cast<double>(quarter));
      step = std::max(step, std::abs(unturned - before));
    }
    RecordProperty("error_db_" + std::to_string(order), std::to_string(10.0 * std::log10(error / power)));
    RecordProperty("step_db_" + std::to_string(order), std::to_string(to_db(step / std::abs(loudest))));
    EXPECT_LT(10.0 * std::log10(error / power), bound_db) << order;
    EXPECT_LT(to_db(step / std::abs(loudest)), step_db) << order;
  }
}

// A rotating body passes a microphone: the second difference of a low tone stays that of a smooth sound.
TEST(Directivity, ABodyThatPassesDoesNotClick) {
  constexpr double kRadius = 0.05, kFreq = 200.0;
  Scene scene = make_tone(kFreq, make_dipole(1.0), kRadius, {{0.0, 0.3, 0.1}});
  scene.frames = 48000;
  for (int i = 0; i <= 100; ++i) {
    const double t = 0.01 * i;
    scene.events.push_back(
        events::BodyMotion{t, 0, {4.0 * (t - 0.5), 0.0, 0.0}, {4.0, 0.0, 0.0}, turn_about(normalise(Vec3{1.0, 1.0, 0.3}), 12.0 * t)});
  }
  const Sound heard = play(scene);
  double peak = 0.0, bend = 0.0;
  for (std::size_t n = 1300; n + 1 < heard[0].size(); ++n) {
    peak = std::max(peak, std::abs(static_cast<double>(heard[0][n])));
    bend = std::max(bend, std::abs(static_cast<double>(heard[0][n + 1]) - 2.0 * static_cast<double>(heard[0][n]) +
                                   static_cast<double>(heard[0][n - 1])));
  }
  const double omega = 2.0 * pi * kFreq / kRate;
  EXPECT_LT(bend, 1.5 * omega * omega * peak);  // of the tone alone: once; -63 dB of the peak
}

// With transfers equal to the gains, delay, spreading and Doppler shift of a passing, rotating body are those without directivity; the
// neglected movement of a walking listener during the travel time is 10 mm of 0.5 m here.
TEST(Directivity, MovingBodiesSoundAsByGains) {
  for (const bool walks : {false, true}) {
    Scene scene{.bank = make_cube_bank({{1000.0, 0.0}, {2300.0, 1.0}}), .microphones_m = {{0.0, 0.5, 0.1}, {1.0, 0.7, 0.0}}};
    std::vector<ModeMultipoles> multipoles;
    for (std::size_t m = 0; m < 2; ++m) multipoles.push_back({1.0 / 1e-6 * std::sqrt(4.0 * pi)});
    give_multipoles(scene.bank, multipoles, 1e-6);
    scene.frames = 48000;
    scene.events = {make_blow()};
    for (int i = 0; i <= 100; ++i) {
      const double t = 0.01 * i;
      if (walks) {
        scene.events.emplace_back(events::Listener{
            .time_s = t, .position_m = {2.0 * (t - 0.5), 0.0, 0.0}, .velocity_m_s = {2.0, 0.0, 0.0}, .rotation = {1, 0, 0, 0}});
      } else {
        scene.events.emplace_back(
            events::BodyMotion{t, 0, {4.0 * (t - 0.5), 0.0, 0.0}, {4.0, 0.0, 0.0}, turn_about(normalise(Vec3{1.0, 1.0, 0.3}), 12.0 * t)});
      }
    }
    expect_as_by_gains(scene, walks ? -40.0 : -50.0);
  }
}

// Energy through a sphere of microphones = radiated energy: all energy of modes without other losses.
TEST(Directivity, RadiatedEnergyIsThatOfTheStrike) {
  constexpr double kRadius = 0.1, kDistance = 5.0;
  const std::array<double, 2> freq{1500.0, 2300.0};
  std::vector<ModeMultipoles> multipoles{{0.3, Complex(0.1, 0.2), 1.0, -0.4, 0.2, Complex(0.0, 0.5), 0.3, 0.1, -0.6},
                                         {0.1, 0.6, Complex(-0.2, 0.9), 0.3}};
  std::vector<InventedMode> modes;
  for (std::size_t m = 0; m < 2; ++m) {
    // P = sum of |c_lm|^2 / (2 rho c k^2), c_lm = a_lm / h_l(kR), by the orthonormal Y_lm of the far field (Williams 1999, 6.81); the
    // energy at unit velocity is 1/2, so that P is the decay.
    const double k = 2.0 * pi * freq[m] / kC, x = k * kRadius;
    double sum = 0.0;
    for (std::size_t i = 0; i < multipoles[m].size(); ++i) {
      const int l = i == 0 ? 0 : i < 4 ? 1 : 2;
      const double h2 = l == 0   ? 1.0 / (x * x)
                        : l == 1 ? (1.0 + 1.0 / (x * x)) / (x * x)
                                 : (1.0 + 3.0 / (x * x) + 9.0 / (x * x * x * x)) / (x * x);  // |h_l|^2, DLMF 10.49.18
      sum += std::norm(multipoles[m][i]) / h2;
    }
    const double decay = sum / (2.0 * kAirDensity * kC * k * k), wanted = 20.0 + 10.0 * static_cast<double>(m);
    for (auto& a : multipoles[m]) a *= std::sqrt(wanted / decay);
    modes.push_back({freq[m], wanted});
  }
  Scene scene{.bank = make_cube_bank(modes), .microphones_m = {}, .events = {make_blow()}, .frames = 24000};
  give_multipoles(scene.bank, multipoles, kRadius);
  // Gauss-Legendre of four, exact to degree 7, times eight around.
  const std::array<double, 4> z{-0.8611363115940526, -0.3399810435848563, 0.3399810435848563, 0.8611363115940526};
  const std::array<double, 4> w{0.3478548451374538, 0.6521451548625461, 0.6521451548625461, 0.3478548451374538};
  std::vector<double> weights;
  for (std::size_t i = 0; i < 4; ++i) {
    for (int j = 0; j < 8; ++j) {
      const double s = std::sqrt(1.0 - z[i] * z[i]), phi = 2.0 * pi * j / 8.0;
      scene.microphones_m.push_back(kDistance * Vec3{s * std::cos(phi), s * std::sin(phi), z[i]});
      weights.push_back(w[i] * 2.0 * pi / 8.0);
    }
  }
  const Sound heard = play(scene);
  double energy = 0.0;
  for (std::size_t e = 0; e < heard.size(); ++e)
    for (const float p : heard[e])
      energy += weights[e] * static_cast<double>(p) * static_cast<double>(p) * kDistance * kDistance / (kAirDensity * kC * kRate);
  EXPECT_NEAR(energy, 2 * 0.5, 0.02);
}
// Equal except for the 16-bit rounding of the multipoles: -90 dB.
TEST(Directivity, StrikesSoundAsByGains) { expect_as_by_gains(make_gains_scene(), -85.0); }

TEST(Directivity, EveryInstructionSetSoundsTheSame) {
  for (const Isa isa : base::list_instructions()) {
    Scene scene = make_gains_scene();
    scene.isa = isa;
    expect_as_by_gains(scene, -85.0);
  }
}

TEST(Directivity, ForcesAndLastingContactsSoundAsByGains) {
  Scene scene = make_gains_scene();
  scene.effects = kDirected.with(kContactEffects);
  scene.frames = 19200;
  for (int i = 0; i < 20; ++i) {
    events::LastingContact contact{.time_s = 0.02 + 0.01 * i, .id = 7, .body = 0, .triangle = 2};
    contact.state = i == 0 ? events::ContactState::kBegin : i == 19 ? events::ContactState::kEnd : events::ContactState::kHold;
    contact.barycentric = {0.3, 0.3, 0.4};
    contact.normal = {0.0, 0.0, 1.0};
    contact.slip_m_s = {0.4, 0.0, 0.0};
    contact.force_n = 5.0;
    contact.sweep_m_s = 0.4;
    contact.patch_radius_m = 1e-4;
    contact.impedance_n_s_m = 40.0;
    scene.events.emplace_back(contact);
  }
  events::Force force{.time_s = 0.1, .body = 0, .triangle = 3};
  force.barycentric = {0.2, 0.5, 0.3};
  force.step_s = 1e-4;
  force.count = 5;
  for (int k = 0; k < 5; ++k) force.impulse_n_s[k] = {0.01F * static_cast<float>(k), 0.02F, -0.03F};
  scene.events.emplace_back(force);
  std::stable_sort(scene.events.begin(), scene.events.end(), [](const events::Event& a, const events::Event& b) {
    const auto time = [](const events::Event& event) { return std::visit([](const auto& e) { return e.time_s; }, event); };
    return time(a) < time(b);
  });
  expect_as_by_gains(scene, -80.0);
}

// Groups removed by the budget fade out at the ears, too.
TEST(Directivity, ABudgetSoundsAsByGains) {
  Scene scene = make_gains_scene();
  scene.meddle = [](Synthesiser& synthesiser, int) { synthesiser.set_budget(16.0 * kRate); };
  // Which modes go is not the same: with directivity the loudest direction counts. With one group left it is.
  expect_as_by_gains(scene, -60.0);
}

TEST(Directivity, AnotherModelContinuesAtTheEars) {
  Scene scene = make_gains_scene();
  scene.meddle = [&](Synthesiser& synthesiser, int body) {
    bank::Bank other = scene.bank;
    for (double& lambda : other.eigenvalue_rad2_s2) lambda *= 1.1;
    for (double& decay : other.decay_per_s) decay *= 2.0;
    synthesiser.swap_model(body, Model::make(other, {.rate_hz = kRate}));
  };
  expect_as_by_gains(scene, -60.0);
}

// The sphere of the multipoles changes with the size of the body: the emission point moves, with a cross-fade.
TEST(Directivity, AnotherSizeIsHeardFromAnotherSphere) {
  Scene scene = make_gains_scene();
  scene.meddle = [&](Synthesiser& synthesiser, int body) {
    bank::Bank other = scene.bank;
    std::vector<ModeMultipoles> multipoles;
    constexpr double kRadius = 2e-6;
    for (const double gain : other.radiation_gain) multipoles.push_back({gain / kRadius * std::sqrt(4.0 * pi)});
    give_multipoles(other, multipoles, kRadius);
    synthesiser.swap_model(body, Model::make(other, {.rate_hz = kRate}));
  };
  expect_as_by_gains(scene, -60.0);
}

TEST(Directivity, RefusesAModelWithoutMultipoles) {
  Scene scene = make_gains_scene();
  Synthesiser synthesiser({.rate_hz = kRate});
  const int body = synthesiser.add_body(Model::make(scene.bank, {.rate_hz = kRate}), {.effects = kDirected});
  scene.bank.multipoles = {};
  EXPECT_THROW(synthesiser.swap_model(body, Model::make(scene.bank, {.rate_hz = kRate})), InputError);
}

// A body rotates while silent: a new strike is heard from its new side at once.
TEST(Directivity, ABodyRotatedWhileAsleepIsHeardAsItLies) {
  constexpr double kFreq = 1000.0, kRadius = 0.05;
  Scene scene = make_tone(kFreq, make_dipole(1.0), kRadius, {{0.0, 0.0, 1.0}});
  scene.bank.decay_per_s[0] = 2000.0;
  scene.frames = 14400;
  scene.events.emplace_back(events::BodyMotion{0.10, 0, {}, {}, {1.0, 0.0, 0.0, 0.0}});
  scene.events.emplace_back(events::BodyMotion{0.15, 0, {}, {}, turn_about({0.0, 1.0, 0.0}, 0.5 * pi)});
  scene.events.emplace_back(make_blow(0.0, 9633));  // in the middle of a block
  const std::vector<float> heard = play(scene)[0];
  double first = 0.0, second = 0.0;
  for (std::size_t n = 0; n < heard.size(); ++n)
    (n < 4800 ? first : second) = std::max(n < 4800 ? first : second, static_cast<double>(std::abs(heard[n])));
  EXPECT_GT(first, 0.0);
  EXPECT_LT(second, 1e-3 * first);
}

// Non-finite states are silenced at the ears as well.
TEST(Directivity, NonFiniteStatesAreSilenced) {
  Scene scene = make_gains_scene();
  scene.events[4] = events::Impulse{.time_s = 0.05, .body = 0, .impulse_n_s = {0.0, 0.0, 1e42}};
  // The strike clears waiting strikes, too; earlier sound is heard.
  for (const auto& channel : play(scene)) {
    double loudest = 0.0;
    for (const float p : channel) loudest = std::max(loudest, std::isfinite(p) ? static_cast<double>(std::abs(p)) : 1e30);
    EXPECT_GT(loudest, 0.01);
    EXPECT_LT(loudest, 1.0);
    EXPECT_EQ(channel.back(), 0.0F);
  }
}

TEST(Directivity, BlocksOfAnySizeGiveTheSameBits) {
  Scene scene = make_gains_scene();
  give_multipoles(scene.bank, std::vector<ModeMultipoles>(60, ModeMultipoles{0.1, 0.5, Complex(1.0, -0.2), 0.3}), 0.06);
  scene.effects = kDirected.with(Effect::kGroundReflection);
  scene.floor = Floor{.point_m = {0.0, 0.0, -1.0}};
  for (const auto& event : make_turn(7.0, 0.2)) scene.events.push_back(event);
  const Sound whole = play(scene);
  for (const int block : {1, 37, 96, 480, 4800}) {
    scene.block = block;
    EXPECT_EQ(play(scene), whole) << block;
  }
}

// A resting body looks up each mode once per ear; a rotating one repeatedly, up to the bound.
TEST(Directivity, RestingBodiesAreLookedUpOnce) {
  Scene scene = make_gains_scene();
  EffectCounters counters;
  play(scene, &counters);
  const int ringing = Model::make(scene.bank, {.rate_hz = kRate})->get_ringing_mode_count();
  EXPECT_EQ(counters.units[Effect::kDirectivity], 2 * ringing);
  EXPECT_EQ(counters.units[Effect::kGroundReflection], 0);
  give_multipoles(scene.bank, std::vector<ModeMultipoles>(60, make_dipole(1.0)), 0.06);
  for (const auto& event : make_turn(5.0, 0.2)) scene.events.push_back(event);
  play(scene, &counters);
  const std::int64_t blocks = scene.frames / kBlock;
  EXPECT_GT(counters.units[Effect::kDirectivity], 4 * ringing);
  EXPECT_LT(counters.units[Effect::kDirectivity], 2 * ringing * blocks / 4);  // 0.25 rad are 18 blocks at 5 rad/s
}

/// Twelve fast rotating bodies of 60 modes with 30 lobes each, two ears, block by block.
struct Crowd {
  static constexpr int kBodies = 12, kModes = 60, kBlocks = 60;
  std::vector<std::int64_t> most, all;  // transfers of all bodies in a block, at most; of each body
  std::vector<float> sound;
};

Crowd play_crowd(double transfers_per_s, int frames = kBlock) {
  Scene of = make_gains_scene();
  ModeMultipoles multipoles(31 * 31);
  multipoles.back() = 1.0;
  give_multipoles(of.bank, std::vector<ModeMultipoles>(Crowd::kModes, multipoles), 0.3);
  Synthesiser synthesiser({.rate_hz = kRate, .transfers_per_s = transfers_per_s});
  const auto model = Model::make(of.bank, {.rate_hz = kRate});
  for (int b = 0; b < Crowd::kBodies; ++b) {
    synthesiser.add_body(model, {.position_m = {2.0 * std::cos(0.5 * b), 2.0 * std::sin(0.5 * b), 0.3}, .effects = kDirected});
    synthesiser.push(events::Impulse{.time_s = 0.0, .body = b, .impulse_n_s = {0.0, 0.0, 1.0}});
    for (int i = 0; i <= 20; ++i)
      synthesiser.push(events::BodyMotion{
          0.01 * i, b, {2.0 * std::cos(0.5 * b), 2.0 * std::sin(0.5 * b), 0.3}, {}, turn_about({0.0, 0.0, 1.0}, (6.0 + b) * 0.01 * i)});
  }
  Crowd crowd{.most = {0}, .all = std::vector<std::int64_t>(Crowd::kBodies), .sound = {}};
  std::int64_t before = 0;
  for (int done = 0; done < Crowd::kBlocks * kBlock; done += frames) {
    std::vector<float> left(frames), right = left;
    const std::array<float*, 2> out{left.data(), right.data()};
    synthesiser.process(out.data(), 2, frames);
    crowd.sound.insert(crowd.sound.end(), left.begin(), left.end());
    std::int64_t now = 0;
    for (int b = 0; b < Crowd::kBodies; ++b) now += crowd.all[b] = synthesiser.get_effect_counters(b).units[Effect::kDirectivity];
    crowd.most[0] = std::max(crowd.most[0], now - before);
    before = now;
  }
  return crowd;
}

// One bound holds for all bodies together in every block, and each has its share of it.
TEST(Directivity, LookingUpIsBoundedForAllBodiesTogether) {
  const Crowd free = play_crowd(1e9);
  EXPECT_GT(free.most[0], 1200);  // twelve bodies, 60 modes, two ears: 1440
  for (const int per_block : {600, 240, 100}) {
    const Crowd crowd = play_crowd(per_block * kRate / kBlock);
    EXPECT_LE(crowd.most[0], 1.25 * per_block) << per_block;
    EXPECT_GT(std::accumulate(crowd.all.begin(), crowd.all.end(), std::int64_t{0}), 0.4 * per_block * Crowd::kBlocks) << per_block;
    const auto [least, most] = std::minmax_element(crowd.all.begin(), crowd.all.end());
    EXPECT_GT(*least, 0.6 * static_cast<double>(*most)) << per_block;
  }
}

// Waiting modes, and those that begin with their mean, keep the level without clicks: the sound stays within that of bodies without
// waiting.
TEST(Directivity, WaitingModesKeepTheirLevel) {
  const Crowd free = play_crowd(1e9), bound = play_crowd(100 * kRate / kBlock);
  const double level_db = 20.0 * std::log10(calc_rms(bound.sound, 1280) / calc_rms(free.sound, 1280));
  EXPECT_NEAR(level_db, 0.0, 3.0);
  const auto find_bend = [](const std::vector<float>& x) {
    double most = 0.0;
    for (std::size_t n = 1281; n + 1 < x.size(); ++n)
      most = std::max(most, std::abs(static_cast<double>(x[n + 1]) - 2.0 * static_cast<double>(x[n]) + static_cast<double>(x[n - 1])));
    return most;
  };
  EXPECT_LT(find_bend(bound.sound), 2.0 * find_bend(free.sound));
}

TEST(Directivity, TheBoundIsTheSameForBlocksOfAnySize) {
  const Crowd whole = play_crowd(240 * kRate / kBlock);
  for (const int frames : {32, 96, 3840}) EXPECT_EQ(play_crowd(240 * kRate / kBlock, frames).sound, whole.sound) << frames;
}

TEST(Directivity, RefusesAnInvalidBound) {
  for (const double bound : {0.0, -1.0, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(Synthesiser({.transfers_per_s = bound}), InputError) << bound;
}

// A mode without a gain, silent at the ear when struck, is heard once the body has rotated: it is not culled before.
TEST(Directivity, ModesLoudElsewhereAreNotCulled) {
  constexpr double kFreq = 1000.0, kRadius = 0.05;
  Scene scene = make_tone(kFreq, make_dipole(1.0), kRadius, {{1.0, 0.0, 0.0}});
  scene.bank.radiation_gain[0] = 0.0;
  scene.frames = 24000;
  scene.events.emplace_back(events::BodyMotion{0.2, 0, {}, {}, {1.0, 0.0, 0.0, 0.0}});
  scene.events.emplace_back(events::BodyMotion{0.4, 0, {}, {}, turn_about({0.0, 1.0, 0.0}, 0.5 * pi)});
  const std::vector<float> heard = play(scene)[0];
  const double k = 2.0 * pi * kFreq / kC, loudest = std::abs(calc_dipole_fall(k, k * kRadius));
  EXPECT_LT(std::abs(measure({heard.begin(), heard.begin() + 9000}, kFreq)), 1e-3 * loudest);
  EXPECT_NEAR(std::abs(measure(heard, kFreq, 20000)), loudest, 1e-3 * loudest);
}

TEST(Directivity, NeedsABankWithMultipoles) {
  const auto model = Model::make(make_cube_bank({{400.0, 5.0}}), {.rate_hz = kRate});
  Synthesiser synthesiser({.rate_hz = kRate});
  EXPECT_THROW(synthesiser.add_body(model, {.effects = kDirected}), InputError);
  EXPECT_NO_THROW(synthesiser.add_body(model, {.effects = kDefaultEffects}));
}

// Solo of a mode at 20 cm from each ear.
TEST(Directivity, ASoloIsOneMode) {
  Scene scene = make_gains_scene();
  const auto model = Model::make(scene.bank, {.rate_hz = kRate});
  const auto solo = Model::make_solo(*model, 25);
  bank::Bank alone = scene.bank;
  for (std::size_t m = 0; m < alone.mode_count(); ++m)
    if (m != 25) alone.radiation_gain[m] = 0.0;
  scene.meddle = [&](Synthesiser& synthesiser, int body) { synthesiser.swap_model(body, solo); };
  const Sound directed = play(scene);
  scene.effects = kDefaultEffects;
  const Sound plain = play(scene);
  EXPECT_LT(calc_difference_db(directed[0], plain[0], 6000), -60.0);
}

}  // namespace
}  // namespace carillon::synth
