// Sensors against the equations of motion of modes and rigid body, stepped finely in double precision; their rate, place and limits.
#include "runtime/synth/sensor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

#include "runtime/bank/select.hpp"
#include "runtime/base/error.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"
#include "tests/unit/runtime/synth/multipole_cube.hpp"

namespace carillon::synth {
namespace {

using testing::InventedMode;
using testing::make_cube_bank;
constexpr double kRate = 48000.0;
const Vec3 kCorner{1.0, 0.0, 0.0};

events::Impulse make_blow(double duration_s) {
  return {.time_s = 0.01, .triangle = 2, .barycentric = kCorner, .impulse_n_s = {0.0, 0.02, -0.03}, .duration_s = duration_s};
}

/// Plays and reads a sensor.
std::vector<double> play(Synthesiser& synthesiser, int sensor, int frames, int block = 128) {
  std::vector<float> left(block), right(block);
  const std::array<float*, 2> out{left.data(), right.data()};
  std::vector<double> samples, more(8192);
  for (int n = 0; n < frames; n += block) {
    synthesiser.process(out.data(), 2, std::min(block, frames - n));
    const std::size_t count = synthesiser.find_sensor(sensor)->read(more);
    samples.insert(samples.end(), more.begin(), more.begin() + static_cast<std::ptrdiff_t>(count));
  }
  return samples;
}

std::vector<double> play(const bank::Bank& bank, const SensorSettings& settings, const std::vector<events::Event>& events, int frames,
                         int block = 128, EffectSet effects = kDefaultEffects) {
  Synthesiser synthesiser(SynthesiserOptions{.rate_hz = kRate});
  const int body = synthesiser.add_body(Model::make(bank, {.rate_hz = kRate}), {.effects = effects});
  const int sensor = synthesiser.add_sensor(body, bank, settings);
  for (const events::Event& event : events) synthesiser.push(event);
  return play(synthesiser, sensor, frames, block);
}

/// Readings at the sound's rate: every mode and the rigid body by small steps (Störmer-Verlet). Modes by shape_at, so quantised alike.
std::vector<double> solve(const bank::Bank& bank, const SensorSettings& settings, const events::Impulse& blow, int frames,
                          bool moves_freely) {
  constexpr int kSteps = 400;
  const double h = 1.0 / kRate / kSteps;
  const auto place = [&](const events::Impulse& at) {
    Vec3 x{};
    for (std::size_t c = 0; c < 3; ++c) x = x + at.barycentric[c] * bank.vertices_m[bank.triangles[at.triangle][c]];
    return x;
  };
  const events::Impulse seen{.triangle = settings.triangle, .barycentric = settings.barycentric};
  const Vec3 n = normalise(settings.direction), struck = place(blow), point = place(seen);
  const auto project = [&](const events::Impulse& at, const Vec3& along, std::size_t mode) {
    double sum = 0.0;
    for (std::size_t c = 0; c < 3; ++c) sum += at.barycentric[c] * dot(along, bank.shape_at(bank.triangles[at.triangle][c], mode));
    return sum;
  };
  const auto pulse = [&](double t) {
    const double x = (t - blow.time_s) / blow.duration_s + 0.5;
    return x > 0.0 && x < 1.0 ? std::pow(std::sin(std::numbers::pi * x), 1.5) : 0.0;
  };
  double area = 0.0;
  for (int k = 0; k < 100000; ++k) area += std::pow(std::sin(std::numbers::pi * (k + 0.5) / 100000.0), 1.5) / 100000.0;
  const double peak = 1.0 / (area * blow.duration_s);
  double rigid = 0.0;
  if (moves_freely) {
    const double moment = bank.rigid.inertia_kg_m2[0];
    const Vec3 turn = (1.0 / moment) * cross(struck, blow.impulse_n_s);
    rigid = dot(n, (1.0 / bank.rigid.mass_kg) * blow.impulse_n_s + cross(turn, point));
  }
  std::vector<double> q(bank.mode_count()), v(bank.mode_count()), samples;
  double rigid_v = 0.0, rigid_x = 0.0;
  for (int frame = 0; frame < frames; ++frame) {
    double reading = 0.0;
    const double now = pulse(frame / kRate) * peak;
    for (std::size_t m = 0; m < q.size(); ++m) {
      const double a = project(blow, blow.impulse_n_s, m) * now - bank.eigenvalue_rad2_s2[m] * q[m] - 2.0 * bank.decay_per_s[m] * v[m];
      reading += project(seen, n, m) * (settings.quantity == Quantity::kAcceleration ? a
                                        : settings.quantity == Quantity::kVelocity   ? v[m]
                                                                                     : q[m]);
    }
    reading += settings.quantity == Quantity::kAcceleration ? rigid * now : settings.quantity == Quantity::kVelocity ? rigid_v : rigid_x;
    samples.push_back(reading);
    for (int k = 0; k < kSteps; ++k) {
      const double t = frame / kRate + k * h, middle = pulse(t + 0.5 * h) * peak;
      for (std::size_t m = 0; m < q.size(); ++m) {
        const double d = bank.decay_per_s[m], force = project(blow, blow.impulse_n_s, m) * middle;
        q[m] += 0.5 * h * v[m];
        v[m] = (v[m] * (1.0 - d * h) + h * (force - bank.eigenvalue_rad2_s2[m] * q[m])) / (1.0 + d * h);
        q[m] += 0.5 * h * v[m];
      }
      rigid_x += h * (rigid_v + 0.5 * h * rigid * middle);
      rigid_v += h * rigid * middle;
    }
  }
  return samples;
}

/// Largest difference, over the largest reading.
double compare(const std::vector<double>& read, const std::vector<double>& solved) {
  double largest = 0.0, off = 0.0;
  for (std::size_t n = 0; n < std::min(read.size(), solved.size()); ++n) {
    largest = std::max(largest, std::abs(solved[n]));
    off = std::max(off, std::abs(read[n] - solved[n]));
  }
  return off / largest;
}

bank::Bank make_bank() {
  return make_cube_bank(
      {{400.0, 30.0, 1e-2, {0.3, -0.2, 1.0}, 0.1}, {2100.0, 80.0, 0.0, {0.5, 0.4, -0.7}, -0.2}, {50.0, 700.0, 1e-3, {0.1, 0.6, 0.2}, 0.3}});
}

class SensorQuantity : public ::testing::TestWithParam<Quantity> {};

TEST_P(SensorQuantity, ReadsTheEquationsOfMotion) {
  const bank::Bank bank = make_bank();
  for (const int triangle : {2, 9}) {  // one of them is the struck one
    const SensorSettings settings{.triangle = triangle, .barycentric = kCorner, .direction = {1.0, -2.0, 2.0}, .quantity = GetParam()};
    const events::Impulse blow = make_blow(0.8e-3);
    const auto read = play(bank, settings, {blow}, 1600);
    ASSERT_GE(read.size(), 1580U);
    EXPECT_LT(compare(read, solve(bank, settings, blow, 1500, true)), 2e-3) << "triangle " << triangle;
  }
}

INSTANTIATE_TEST_SUITE_P(All, SensorQuantity, ::testing::Values(Quantity::kAcceleration, Quantity::kVelocity, Quantity::kDisplacement));

TEST(Sensor, ABodyHeldOrWithoutMassHasNoRigidPart) {
  bank::Bank bank = make_bank();
  const events::Impulse blow = make_blow(0.8e-3);
  SensorSettings settings{.triangle = 9, .barycentric = kCorner, .is_held = true};
  EXPECT_LT(compare(play(bank, settings, {blow}, 1600), solve(bank, settings, blow, 1500, false)), 2e-3);
  bank.rigid.mass_kg = 0.0;
  settings.is_held = false;
  EXPECT_LT(compare(play(bank, settings, {blow}, 1600), solve(bank, settings, blow, 1500, false)), 2e-3);
}

TEST(Sensor, VelocityIsTheIntegralOfAccelerationAlsoOfIdealImpulses) {
  const bank::Bank bank = make_bank();
  for (const double duration_s : {0.0, 1e-5, 2e-3}) {
    SensorSettings settings{.triangle = 9};
    const auto a = play(bank, settings, {make_blow(duration_s)}, 4800);
    settings.quantity = Quantity::kVelocity;
    const auto v = play(bank, settings, {make_blow(duration_s)}, 4800);
    double sum = 0.0, largest = 0.0, off = 0.0;
    for (std::size_t n = 1; n < v.size(); ++n) {
      sum += 0.5 * (a[n - 1] + a[n]) / kRate;
      largest = std::max(largest, std::abs(v[n]));
      if (n > 700) off = std::max(off, std::abs(sum - v[n]));  // 4 ms after the blow
    }
    EXPECT_LT(off / largest, 0.01) << duration_s;
  }
}

TEST(Sensor, AForceInPiecesReadsAsItsPulse) {
  const bank::Bank bank = make_bank();
  events::Force force{.time_s = 0.01, .step_s = 5e-5, .triangle = 2, .count = 16, .barycentric = kCorner};
  for (int k = 0; k < force.count; ++k) {
    const auto share = static_cast<float>(std::pow(std::sin(std::numbers::pi * (k + 0.5) / force.count), 1.5));
    force.impulse_n_s[k] = {0.0F, 0.02F * share, -0.03F * share};
  }
  double total = 0.0;
  for (int k = 0; k < force.count; ++k) total += static_cast<double>(force.impulse_n_s[k][1]) / 0.02;
  events::Impulse blow = make_blow(0.8e-3);
  blow.time_s = 0.0104;
  for (double& x : blow.impulse_n_s) x *= total;
  for (const Quantity quantity : {Quantity::kAcceleration, Quantity::kVelocity, Quantity::kDisplacement}) {
    const SensorSettings settings{.triangle = 9, .quantity = quantity};
    const bool is_rough = quantity == Quantity::kAcceleration;  // steps of the force itself
    EXPECT_LT(compare(play(bank, settings, {force}, 1600), play(bank, settings, {blow}, 1600)), is_rough ? 0.1 : 5e-3);
  }
}

TEST(Sensor, TheBitsDoNotDependOnBlockSizesOrOtherSensors) {
  const bank::Bank bank = make_bank();
  const SensorSettings settings{.triangle = 9};
  const auto whole = play(bank, settings, {make_blow(1e-3)}, 2048);
  const auto small = play(bank, settings, {make_blow(1e-3)}, 2048, 37);
  for (std::size_t n = 0; n < std::min(whole.size(), small.size()); ++n) ASSERT_EQ(whole[n], small[n]) << n;
}

TEST(Sensor, TheSoundIsTheSameWithAndWithoutSensors) {
  const bank::Bank bank = make_bank();
  std::array<std::vector<float>, 2> heard;
  for (const bool has_sensor : {false, true}) {
    Synthesiser synthesiser(SynthesiserOptions{.rate_hz = kRate, .microphones_m = {{0.0, 1.0, 0.0}}});
    const int body = synthesiser.add_body(Model::make(bank, {.rate_hz = kRate}));
    if (has_sensor) synthesiser.add_sensor(body, bank, {.triangle = 9});
    synthesiser.push(make_blow(1e-3));
    heard[has_sensor].resize(4096);
    float* out = heard[has_sensor].data();
    synthesiser.process(&out, 1, 4096);
  }
  EXPECT_EQ(heard[0], heard[1]);
}

TEST(Sensor, ItsRateNeedNotDivideThatOfTheSound) {
  const bank::Bank bank = make_cube_bank({{400.0, 5.0, 1e-2, {0.3, -0.2, 1.0}, 0.1}});
  for (const double rate_hz : {2000.0, 6667.0, 44100.0, 96000.0}) {
    SensorSettings settings{.triangle = 9, .quantity = Quantity::kDisplacement, .rate_hz = rate_hz, .is_held = true};
    const auto read = play(bank, settings, {make_blow(4e-3)}, 9600);
    settings.rate_hz = 0.0;
    const auto fine = play(bank, settings, {make_blow(4e-3)}, 9600);
    double largest = 0.0, off = 0.0;
    for (std::size_t n = 0; n < read.size(); ++n) {  // cubic interpolation between the fine samples
      const double at = static_cast<double>(n) * kRate / rate_hz;
      const auto k = static_cast<std::size_t>(at);
      if (k < 1 || k + 2 >= fine.size()) continue;
      const double u = at - static_cast<double>(k);
      const double between = fine[k - 1] * (-u * (u - 1) * (u - 2) / 6) + fine[k] * ((u + 1) * (u - 1) * (u - 2) / 2) +
                             fine[k + 1] * (-(u + 1) * u * (u - 2) / 2) + fine[k + 2] * ((u + 1) * u * (u - 1) / 6);
      largest = std::max(largest, std::abs(between));
      off = std::max(off, std::abs(read[n] - between));
    }
    EXPECT_GT(static_cast<double>(read.size()), 0.15 * rate_hz) << rate_hz;
    EXPECT_LT(off / largest, 4e-3) << rate_hz;
  }
}

TEST(Sensor, AModeThatIsNotHeardIsStillRead) {
  const bank::Bank bank = make_cube_bank({{400.0, 2.0, 0.0, {0.3, -0.2, 1.0}, 0.1}});  // radiates nothing
  const auto read = play(bank, {.triangle = 9, .is_held = true}, {make_blow(1e-3)}, 48000);
  double late = 0.0;
  for (std::size_t n = 40000; n < 47000; ++n) late = std::max(late, std::abs(read[n]));
  EXPECT_GT(late, 1.0);
}

TEST(Sensor, SamplesKeepTheirTimeWhileTheBodySleeps) {
  const bank::Bank bank = make_cube_bank({{400.0, 400.0, 1e-2, {0.3, -0.2, 1.0}, 0.1}});
  events::Impulse late = make_blow(1e-3);
  late.time_s = 0.51;
  const auto read = play(bank, {.triangle = 9}, {make_blow(1e-3), late}, 48000);
  for (std::size_t n = 450; n < 600; ++n) EXPECT_NEAR(read[n], read[n + 24000], 1e-3 * std::abs(read[480])) << n;
}

TEST(Sensor, DirectivityDoesNotChangeWhatIsRead) {
  bank::Bank bank = make_bank();
  const std::vector<testing::ModeMultipoles> multipoles(bank.mode_count(), testing::make_dipole(1.0));
  testing::give_multipoles(bank, multipoles, 0.09);
  const SensorSettings settings{.triangle = 9};
  const auto plain = play(bank, settings, {make_blow(1e-3)}, 2048);
  const auto directed = play(bank, settings, {make_blow(1e-3)}, 2048, 128, kDefaultEffects.with(Effect::kDirectivity));
  EXPECT_LT(compare(directed, plain), 1e-6);
}

TEST(Sensor, CoupledModesAreReadAsLinearOnesWhileTheyMoveSoftly) {
  bank::Bank bank = make_cube_bank({{400.0, 5.0, 1e-2, {0.3, -0.2, 1.0}, 0.1}, {900.0, 5.0, 1e-2, {0.1, 0.3, 0.7}, 0.2}});
  bank.quartic.modes = {0, 1};
  bank.quartic.rows.assign(2 * bank::count_pairs(2), 1e-3F);
  const SensorSettings settings{.triangle = 9, .quantity = Quantity::kVelocity};
  const auto linear = play(bank, settings, {make_blow(1e-3)}, 4096);
  try {
    const auto coupled = play(bank, settings, {make_blow(1e-3)}, 4096, 128, kDefaultEffects.with(Effect::kNonlinear));
    EXPECT_LT(compare(coupled, linear), 1e-3);
    EXPECT_THROW(play(bank, {.triangle = 9}, {}, 128, 128, kDefaultEffects.with(Effect::kNonlinear)), InputError);
  } catch (const InputError&) {
    GTEST_SKIP() << "built without nonlinear";
  }
}

TEST(Sensor, RollingNoiseIsReadAsForceAndMotion) {
  const bank::Bank bank = make_cube_bank({{400.0, 30.0, 1e-2, {0.3, -0.2, 1.0}, 0.1}});
  std::vector<events::Event> events;
  for (int k = 0; k < 40; ++k)
    events.emplace_back(events::LastingContact{.time_s = 0.005 * k,
                                               .id = 7,
                                               .triangle = 2,
                                               .barycentric = kCorner,
                                               .normal = {0.0, 0.0, 1.0},
                                               .slip_m_s = {0.1, 0.0, 0.0},
                                               .force_n = 2.0,
                                               .sweep_m_s = 0.1,
                                               .other_sweep_m_s = 0.1,
                                               .patch_radius_m = 1e-5,
                                               .impedance_n_s_m = 0.0});
  const EffectSet effects = kDefaultEffects.with(Effect::kRoughness);
  SensorSettings settings{.triangle = 9};
  const auto a = play(bank, settings, events, 7200, 128, effects);
  settings.quantity = Quantity::kVelocity;
  const auto v = play(bank, settings, events, 7200, 128, effects);
  double sum = 0.0, largest = 0.0, off = 0.0;
  for (std::size_t n = 1; n < v.size(); ++n) {
    sum += 0.5 * (a[n - 1] + a[n]) / kRate;
    largest = std::max(largest, std::abs(v[n]));
    off = std::max(off, std::abs(sum - v[n]));
  }
  EXPECT_GT(largest, 1e-6);
  EXPECT_LT(off / largest, 0.05);
}

TEST(Sensor, ItRefusesWhatCannotBeRead) {
  const bank::Bank bank = make_bank();
  Synthesiser synthesiser(SynthesiserOptions{.rate_hz = kRate});
  const auto model = Model::make(bank, {.rate_hz = kRate});
  const int body = synthesiser.add_body(model), mute = synthesiser.add_body(model, {.effects = EffectSet{}});
  const auto add = [&](int to, const SensorSettings& settings) { synthesiser.add_sensor(to, bank, settings); };
  EXPECT_THROW(add(body, {.triangle = 99}), InputError);
  EXPECT_THROW(add(body, {.direction = {}}), InputError);
  EXPECT_THROW(add(body, {.rate_hz = 1.0}), InputError);
  EXPECT_THROW(add(body, {.barycentric = {NAN, 0.0, 0.0}}), InputError);
  EXPECT_THROW(add(body, {.barycentric = {2.0, -1.0, 0.0}}), InputError) << "outside its triangle";
  bank::Bank other = bank;
  other.triangles.front() = {0, 1, std::numeric_limits<std::int32_t>::max() / 4};
  EXPECT_THROW(synthesiser.add_sensor(body, other, {}), InputError) << "the surface of another bank";
  EXPECT_THROW(add(body, {.triangle = 0, .direction = {0.0, 0.0, 1.0}, .quantity = Quantity::kStrain}), InputError);
  EXPECT_THROW(add(mute, {}), InputError);
  EXPECT_THROW(add(7, {}), InputError);
  EXPECT_NO_THROW(add(body, {.triangle = 0, .direction = {1.0, 0.0, 1.0}, .quantity = Quantity::kStrain}));
  EXPECT_THROW(synthesiser.swap_model(body, model), InputError);
  EXPECT_EQ(synthesiser.find_sensor(1), nullptr);
}

TEST(Sensor, NumbersOfRemovedBodiesAreUsedAgain) {
  const bank::Bank bank = make_bank();
  Synthesiser synthesiser(SynthesiserOptions{.rate_hz = kRate, .max_bodies = 4});
  const auto model = Model::make(bank, {.rate_hz = kRate});
  std::array<float, 512> left, right;
  const std::array<float*, 2> out{left.data(), right.data()};
  const int stays = synthesiser.add_sensor(synthesiser.add_body(model), bank, {});
  for (int round = 0; round < Synthesiser::kMaxSensors + 10; ++round) {
    const int body = synthesiser.add_body(model), sensor = synthesiser.add_sensor(body, bank, {.buffer_s = 0.0});
    synthesiser.process(out.data(), 2, 256);
    EXPECT_NE(sensor, stays);
    synthesiser.remove_body(body);
    synthesiser.process(out.data(), 2, 512);
    synthesiser.collect();
    std::array<double, 1024> samples;
    ASSERT_GT(synthesiser.find_sensor(sensor)->read(samples), 200U) << "what is left when its body is gone";
  }
  EXPECT_EQ(synthesiser.find_sensor(4), nullptr);
  EXPECT_GT(synthesiser.find_sensor(stays)->count_ready(), 10000U);
}

TEST(Sensor, ADirectionHasAnyLength) {
  const auto wanted = play(make_bank(), {.direction = {0.0, 0.0, 1.0}}, {make_blow(1e-3)}, 500);
  for (const double length : {1e-300, 3.0, 1e300})
    EXPECT_EQ(play(make_bank(), {.direction = {0.0, 0.0, length}}, {make_blow(1e-3)}, 500), wanted) << length;
}

TEST(Sensor, ABodyWithoutModesMovesAsAWhole) {
  const bank::Bank bank = make_cube_bank({{0.9 * kRate, 5.0, 1e-2, {0.3, -0.2, 1.0}, 0.1}});  // above half of the rate
  for (const Quantity quantity : {Quantity::kAcceleration, Quantity::kVelocity, Quantity::kDisplacement}) {
    const SensorSettings settings{.triangle = 2, .barycentric = kCorner, .direction = {0.0, 0.0, 1.0}, .quantity = quantity};
    bank::Bank rigid = bank;
    bank::keep_lowest(rigid, 0);
    const std::vector<double> found = play(bank, settings, {make_blow(1e-3)}, 2000),
                              wanted = solve(rigid, settings, make_blow(1e-3), 2000, true);
    double largest = 0.0;
    for (const double x : wanted) largest = std::max(largest, std::abs(x));
    ASSERT_GT(largest, 0.0);
    for (std::size_t n = 0; n < 1900; ++n) EXPECT_NEAR(found[n], wanted[n], 2e-2 * largest) << n;
  }
}

TEST(Sensor, StrainWithoutMotionInTheSurfaceIsRefused) {
  const bank::Bank bank = make_cube_bank({{400.0, 5.0, 1e-2, {0.0, 0.0, 1.0}, 0.1}});
  const SensorSettings settings{.triangle = 2, .direction = {1.0, 0.0, 0.0}, .quantity = Quantity::kStrain};
  EXPECT_THROW(Sensor(Model::make(bank, {.rate_hz = kRate}), bank, settings), InputError);
}

TEST(Sensor, StrainOfALinearFieldIsItsGradient) {
  // u = direction (1 + slope corner): corner is 1 for x, 2 for y, 4 for z, over 0.1 m each.
  const bank::Bank bank = make_cube_bank({{400.0, 5.0, 1e-2, {0.3, -0.2, 1.0}, 0.1}});
  const auto strain = play(bank, {.triangle = 2, .direction = {1.0, 0.0, 0.0}, .quantity = Quantity::kStrain}, {make_blow(1e-3)}, 2000);
  const auto way = play(
      bank, {.triangle = 2, .barycentric = kCorner, .direction = {1.0, 0.0, 0.0}, .quantity = Quantity::kDisplacement, .is_held = true},
      {make_blow(1e-3)}, 2000);
  // At corner 4 the displacement along x is 0.3 * 1.4 q, its gradient 0.3 * 0.1 / 0.1 q.
  for (std::size_t n = 600; n < 1900; n += 7) EXPECT_NEAR(strain[n], way[n] / 1.4, 1e-3 * std::abs(way[n]) + 1e-12);
}

}  // namespace
}  // namespace carillon::synth
