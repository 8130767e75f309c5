// A head in a scene, against the field around a rigid sphere in a plane wave by the special functions of the C++ library.
#include "runtime/synth/head_ears.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <numbers>
#include <vector>

#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/base/error.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/acoustics/head/oracle.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"
#include "tests/unit/runtime/synth/multipole_cube.hpp"

namespace carillon::synth {
namespace {

using Complex = std::complex<double>;
using std::numbers::pi;
constexpr double kRate = 48000.0, kRadius = 0.0875, kEarAngle = 100.0 * pi / 180.0;
constexpr int kStruck = 480;  // sample
const std::vector<Vec3> kEars{{-kRadius, 0.0, 0.0}, {kRadius, 0.0, 0.0}};
constexpr EffectSet kByHead = kDefaultEffects.with(Effect::kHead);
using Sound = std::vector<std::vector<float>>;

std::shared_ptr<const head::Head> get_sphere() {
  static const auto sphere = head::make_sphere(kRate);
  return sphere;
}

/// Looks along +y.
ListeningHead make_head() { return {get_sphere(), calc_level_head_rotation(kEars[0], kEars[1])}; }

struct Scene {
  bank::Bank bank;
  Vec3 position_m{0.0, 2.0, 0.0};
  EffectSet effects = kByHead;
  std::optional<Floor> floor = std::nullopt;
  std::optional<ListeningHead> head = make_head();
  std::vector<events::Event> events{};
  int frames = 9600, block = 128;
  std::function<void(Synthesiser&, int)> meddle = nullptr;  // before each block, with its number
};

/// Undamped mode after a strike, cos(omega t) at 1 m.
Scene make_tone(double freq_hz) { return {.bank = testing::make_cube_bank({{freq_hz, 0.0}})}; }

Sound play(const Scene& scene, EffectCounters* counters = nullptr) {
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = kEars, .floor = scene.floor, .head = scene.head});
  const int body =
      synthesiser.add_body(Model::make(scene.bank, {.rate_hz = kRate}), {.position_m = scene.position_m, .effects = scene.effects});
  synthesiser.push(events::Impulse{.time_s = kStruck / kRate, .body = body, .impulse_n_s = {0.0, 0.0, 1.0}});
  for (const events::Event& event : scene.events) synthesiser.push(event);
  Sound out(2, std::vector<float>(scene.frames));
  for (int done = 0, number = 0; done < scene.frames; ++number) {
    if (scene.meddle) scene.meddle(synthesiser, number);
    const int count = std::min(scene.block, scene.frames - done);
    const std::array<float*, 2> at{out[0].data() + done, out[1].data() + done};
    synthesiser.process(at.data(), 2, count);
    done += count;
  }
  // Samples before the latency have no time.
  for (auto& channel : out) channel.erase(channel.begin(), channel.begin() + synthesiser.get_latency());
  if (counters != nullptr) *counters = synthesiser.get_effect_counters(body);
  return out;
}

/// Amplitude of a steady tone, times e^{i phase} of its cosine since the strike, by least squares.
Complex measure(const std::vector<float>& sound, double freq_hz, std::size_t from = 2400) {
  double cc = 0.0, cs = 0.0, ss = 0.0, pc = 0.0, ps = 0.0;
  for (std::size_t n = from; n < sound.size(); ++n) {
    const double angle = 2.0 * pi * freq_hz * (static_cast<double>(n) - kStruck) / kRate;
    const double c = std::cos(angle), s = std::sin(angle), p = static_cast<double>(sound[n]);
    cc += c * c, cs += c * s, ss += s * s, pc += p * c, ps += p * s;
  }
  const double det = cc * ss - cs * cs;
  return {(pc * ss - ps * cs) / det, -(ps * cc - pc * cs) / det};
}

double to_db(double x) { return 20.0 * std::log10(x + 1e-30); }

/// Pressure at an ear on the sphere for 1 Pa at its centre; the head looks along `forward`, tilted by `left`.
Complex calc_expected(double freq_hz, const Vec3& to_source, const Vec3& forward, const Vec3& left, std::size_t ear) {
  const Vec3 at = std::cos(kEarAngle) * forward + (ear == 0 ? std::sin(kEarAngle) : -std::sin(kEarAngle)) * left;
  const double angle = std::acos(std::clamp(dot(at, to_source) / norm(to_source), -1.0, 1.0));
  return head::testing::calc_rigid_sphere(2.0 * pi * freq_hz * kRadius / kSoundSpeedMs, angle);
}

Complex calc_expected(double freq_hz, const Vec3& to_source, std::size_t ear) {
  return calc_expected(freq_hz, to_source, {0, 1, 0}, {-1, 0, 0}, ear);
}

double calc_rms(std::span<const float> x) {
  double sum = 0.0;
  for (const float p : x) sum += static_cast<double>(p) * static_cast<double>(p);
  return std::sqrt(sum / static_cast<double>(x.size()));
}

/// Residual of a steady tone beyond `near_hz`, Blackman window, relative [dB].
double calc_rest_db(std::span<const float> sound, double freq_hz, double near_hz) {
  const auto size = static_cast<double>(sound.size());
  double rest = 0.0, all = 0.0;
  for (double freq = 50.0; freq < 23000.0; freq += kRate / size) {
    Complex sum = 0.0, turn = 1.0;
    const Complex step = std::polar(1.0, -2.0 * pi * freq / kRate);
    for (std::size_t n = 0; n < sound.size(); ++n, turn *= step) {
      const double u = 2.0 * pi * (static_cast<double>(n) + 0.5) / size;
      sum += static_cast<double>(sound[n]) * (0.42 - 0.5 * std::cos(u) + 0.08 * std::cos(2.0 * u)) * turn;
    }
    all += std::norm(sum);
    if (std::abs(freq - freq_hz) > near_hz) rest += std::norm(sum);
  }
  return 10.0 * std::log10(rest / all);
}

// Level and time at both ears as one complex number per frequency and direction. The delay to the centre and 1 / r are those without a
// head.
TEST(HeadEars, HearTheFieldOfARigidSphere) {
  for (const double freq : {150.0, 700.0, 2100.0, 6300.0}) {
    for (const double azimuth : {0.0, 35.0, 100.0, -150.0}) {
      for (const double elevation : {0.0, 40.0}) {
        const Vec3 unit = head::testing::make_direction(azimuth + 90.0, elevation);  // +y is straight ahead
        constexpr double kDistance = 1.7;
        Scene scene = make_tone(freq);
        scene.position_m = kDistance * unit;
        const Sound heard = play(scene);
        const Complex middle = std::polar(1.0 / kDistance, -2.0 * pi * freq * kDistance / kSoundSpeedMs);
        for (std::size_t ear = 0; ear < 2; ++ear) {
          const Complex expected = middle * calc_expected(freq, unit, ear);
          EXPECT_LT(std::abs(measure(heard[ear], freq) - expected), 0.01 * std::abs(middle))
              << freq << " Hz from " << azimuth << ", " << elevation << " at ear " << ear;
        }
      }
    }
  }
}

// Woodworth: straight or around the sphere; arrival of a click at a tenth of its peak.
TEST(HeadEars, HearAClickAsMuchLaterAsItsWayAround) {
  for (const double azimuth : {0.0, 25.0, 60.0}) {
    Scene scene = make_tone(18000.0);
    scene.bank = testing::make_cube_bank({{16000.0, 4e4}});
    scene.position_m = 3.0 * head::testing::make_direction(azimuth + 90.0, 0.0);
    const Sound heard = play(scene);
    std::array<double, 2> begin{};
    for (std::size_t ear = 0; ear < 2; ++ear) {
      double peak = 0.0;
      for (const float p : heard[ear]) peak = std::max(peak, std::abs(static_cast<double>(p)));
      std::size_t n = 0;
      while (std::abs(static_cast<double>(heard[ear][n])) < 0.1 * peak) ++n;
      begin[ear] = static_cast<double>(n) / kRate;
    }
    // Ears at 100 degrees: the left one is seen, the right one is around the front.
    const double near = std::cos(kEarAngle - azimuth * pi / 180.0), past = kEarAngle + azimuth * pi / 180.0 - pi / 2;
    const double expected = azimuth == 0.0 ? 0.0 : kRadius / kSoundSpeedMs * (past + near);
    EXPECT_NEAR(begin[1] - begin[0], expected, 2.0 / kRate) << azimuth;
  }
}

TEST(HeadEars, FrontIsEqualAndMirroringSwapsTheEars) {
  for (const double freq : {400.0, 3000.0}) {
    Scene scene = make_tone(freq);
    const Sound front = play(scene);
    scene.position_m = {-0.8, 1.1, 0.4};
    const Sound left = play(scene);
    scene.position_m[0] *= -1.0;
    const Sound right = play(scene);
    const double level = calc_rms(front[0]);
    for (std::size_t n = 0; n < front[0].size(); ++n) {
      ASSERT_NEAR(front[0][n], front[1][n], 1e-6 * level) << n;
      ASSERT_NEAR(left[0][n], right[1][n], 1e-6 * level) << n;
      ASSERT_NEAR(left[1][n], right[0][n], 1e-6 * level) << n;
    }
    EXPECT_GT(to_db(calc_rms(left[0]) / calc_rms(left[1])), freq < 1000.0 ? 0.3 : 3.0);
  }
}

TEST(HeadEars, AgreeWithFreeEarsAtLowFrequencies) {
  constexpr double kFreq = 200.0;
  for (const double azimuth : {0.0, 60.0, -120.0}) {
    Scene scene = make_tone(kFreq);
    scene.position_m = 10.0 * head::testing::make_direction(azimuth + 90.0, 10.0);
    const Sound by_head = play(scene);
    scene.effects = kDefaultEffects;
    const Sound free = play(scene);
    scene.head.reset();
    const Sound alone = play(scene);
    for (std::size_t ear = 0; ear < 2; ++ear) {
      const Complex a = measure(by_head[ear], kFreq, 4800), b = measure(free[ear], kFreq, 4800);
      EXPECT_LT(std::abs(to_db(std::abs(a / b))), 0.5) << azimuth;
      EXPECT_LT(std::abs(std::arg(a / b)), 2.0 * pi * kFreq * 2.5e-4) << "later or earlier by a sphere's way around";
      // Free ears of a listener with a head have the head's latency, and else the same sound as without it.
      for (std::size_t n = 0; n < free[ear].size(); ++n) ASSERT_NEAR(free[ear][n], alone[ear][n], 1e-6) << n;
    }
  }
}

// The floor's reflection is that of a body beyond it: it comes from below, which a tilted head hears differently.
TEST(HeadEars, HearTheFloorFromBelow) {
  constexpr double kFreq = 1900.0, kDown = 0.9, kReflection = 0.8, kLean = 0.6;
  const Vec3 body{0.4, 1.2, 0.1}, image{0.4, 1.2, -2.0 * kDown - 0.1};
  const Vec3 left{-std::cos(kLean), 0.0, -std::sin(kLean)};
  for (const bool directed : {false, true}) {
    Scene scene = make_tone(kFreq);
    scene.position_m = body;
    scene.floor = Floor{.point_m = {0.0, 0.0, -kDown}, .reflection = kReflection};
    scene.effects = kByHead.with(Effect::kGroundReflection);
    if (directed) {
      testing::give_multipoles(scene.bank, {testing::make_monopole(1.0, kFreq, 0.01)}, 0.01);
      scene.effects = scene.effects.with(Effect::kDirectivity);
    }
    scene.events = {events::Listener{.time_s = 0.0, .rotation = {std::cos(0.5 * kLean), 0.0, -std::sin(0.5 * kLean), 0.0}}};
    EffectCounters counters;
    const Sound heard = play(scene, &counters);
    for (std::size_t ear = 0; ear < 2; ++ear) {
      Complex expected = 0.0;
      for (const bool mirrored : {false, true}) {
        const Vec3& from = mirrored ? image : body;
        expected += (mirrored ? kReflection : 1.0) * std::polar(1.0 / norm(from), -2.0 * pi * kFreq * norm(from) / kSoundSpeedMs) *
                    calc_expected(kFreq, from, {0, 1, 0}, left, ear);
      }
      EXPECT_LT(std::abs(measure(heard[ear], kFreq) - expected), 0.01) << ear << directed;
    }
    EXPECT_EQ(counters.units[Effect::kHead], counters.units[Effect::kAirDelay] + counters.units[Effect::kGroundReflection]);
  }
}

// Dipole field at the centre of the head, and one set of transfers instead of two.
TEST(HeadEars, TakeTheDirectionalSoundInTheMiddle) {
  constexpr double kFreq = 1200.0, kSphere = 0.06, k = 2.0 * pi * kFreq / kSoundSpeedMs;
  Scene scene = make_tone(kFreq);
  testing::give_multipoles(scene.bank, {testing::make_dipole(1.0)}, kSphere);
  scene.position_m = {-0.5, 0.9, 0.7};
  scene.effects = kByHead.with(Effect::kDirectivity);
  EffectCounters counters;
  const Sound heard = play(scene, &counters);
  const double r = norm(scene.position_m);
  const Complex middle = std::conj(testing::calc_dipole_fall(k * r, k * kSphere)) * (-scene.position_m[2] / r);
  for (std::size_t ear = 0; ear < 2; ++ear)
    EXPECT_LT(std::abs(measure(heard[ear], kFreq) - middle * calc_expected(kFreq, scene.position_m, ear)), 0.01 * std::abs(middle));
  EXPECT_EQ(counters.units[Effect::kDirectivity], 1);
}

// A rotating head hears at any time as a head at rest in that attitude, without additional tones.
TEST(HeadEars, HearNoClickWhileTheHeadTurns) {
  constexpr double kSpeed = 2.0;
  for (const double freq : {1000.0, 5000.0}) {
    Scene scene = make_tone(freq);
    scene.position_m = {0.0, 3.0, 0.0};
    for (int i = 0; i <= 25; ++i) {
      const double half = 0.5 * kSpeed * 0.01 * i;
      scene.events.emplace_back(events::Listener{.time_s = 0.01 * i, .rotation = {std::cos(half), 0.0, 0.0, std::sin(half)}});
    }
    scene.frames = 12000;
    const Sound heard = play(scene);
    for (std::size_t ear = 0; ear < 2; ++ear) {
      EXPECT_LT(calc_rest_db(std::span(heard[ear]).subspan(2400, 8192), freq, 100.0), -80.0) << freq << " Hz, ear " << ear;
      constexpr std::size_t kAt = 8000, kWidth = 240;  // the middle of 10 ms
      const double angle = kSpeed * (kAt + 0.5 * kWidth) / kRate;
      const Vec3 forward{-std::sin(angle), std::cos(angle), 0.0}, left{-std::cos(angle), -std::sin(angle), 0.0};
      const std::vector<float> piece(heard[ear].begin(), heard[ear].begin() + kAt + kWidth);
      EXPECT_NEAR(std::abs(measure(piece, freq, kAt)) * 3.0, std::abs(calc_expected(freq, scene.position_m, forward, left, ear)), 0.03);
    }
  }
}

TEST(HeadEars, HearNoClickWhenABodyPasses) {
  constexpr double kFreq = 1000.0, kSpeed = 4.0;
  Scene scene = make_tone(kFreq);
  scene.position_m = {-0.5, 1.0, 0.0};
  scene.events = {events::BodyMotion{0.0, 0, {-0.5, 1.0, 0.0}, {kSpeed, 0.0, 0.0}},
                  events::BodyMotion{0.25, 0, {-0.5 + 0.25 * kSpeed, 1.0, 0.0}, {kSpeed, 0.0, 0.0}}};
  scene.frames = 12000;
  EffectCounters counters;
  const Sound heard = play(scene, &counters);
  for (std::size_t ear = 0; ear < 2; ++ear) EXPECT_LT(calc_rest_db(std::span(heard[ear]).subspan(2400, 8192), kFreq, 120.0), -80.0) << ear;
  EXPECT_GT(counters.units[Effect::kDoppler], 0);
}

TEST(HeadEars, SizesOfCallsChangeNoBit) {
  Scene scene = make_tone(900.0);
  scene.bank = testing::make_cube_bank(testing::make_many_modes(20));
  scene.floor = Floor{.point_m = {0.0, 0.0, -1.0}};
  scene.effects = kByHead.with({Effect::kGroundReflection, Effect::kAccelerationNoise});
  scene.events = {events::BodyMotion{0.05, 0, {0.0, 2.0, 0.0}, {1.0, 0.0, 0.0}}, events::Listener{.time_s = 0.02},
                  events::Listener{.time_s = 0.12, .position_m = {0.1, 0.0, 0.0}, .rotation = {std::cos(0.4), 0.0, 0.0, std::sin(0.4)}},
                  events::BodyMotion{0.15, 0, {0.1, 2.0, 0.0}, {1.0, 0.0, 0.0}}};
  const Sound whole = play(scene);
  EXPECT_GT(calc_rms(whole[0]), 0.0);
  for (const int block : {32, 96, 131, 1000}) {
    scene.block = block;
    EXPECT_EQ(play(scene), whole) << block;
  }
}

// A passing body struck just before and after its filters become silent: their begin and end must not depend on the number of sub-blocks
// per call.
TEST(HeadEars, SizesOfCallsChangeNoBitWhereSoundsBeginAndEnd) {
  Scene scene = make_tone(900.0);
  scene.bank = testing::make_cube_bank({{900.0, 3000.0}});
  scene.position_m = {-3.0, 0.4, 0.0};
  scene.frames = 24000;
  scene.events = {events::BodyMotion{0.0, 0, {-3.0, 0.4, 0.0}, {12.0, 0.0, 0.0}},
                  events::BodyMotion{0.5, 0, {3.0, 0.4, 0.0}, {12.0, 0.0, 0.0}}};
  for (int n = 1200, step = 1; n < 22000; n += 700 + 37 * (step++ % 29))
    scene.events.emplace_back(
        events::Impulse{.time_s = n / kRate, .body = 0, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = 1e-4 * (step % 5)});
  for (const EffectSet effects : {kByHead, kByHead.without({Effect::kAirDelay, Effect::kDoppler}),
                                  EffectSet{Effect::kModal, Effect::kTwoEars, Effect::kHead, Effect::kDoppler, Effect::kAirDelay}}) {
    scene.effects = effects;
    scene.block = 128;
    const Sound whole = play(scene);
    for (const int block : {32, 64, 96, 7, 160, 1000}) {
      scene.block = block;
      EXPECT_EQ(play(scene) == whole, true) << block;
    }
  }
}

// After a sound the filters ring out, then the body sleeps; the next strike equals the first.
TEST(HeadEars, EndWithTheSoundAndBeginAgain) {
  Scene scene = make_tone(800.0);
  scene.bank = testing::make_cube_bank({{800.0, 400.0}});
  scene.effects = EffectSet{Effect::kModal, Effect::kTwoEars, Effect::kHead};  // with lines that end with the sound
  scene.position_m = {1.0, 0.5, 0.0};
  scene.frames = 48000;
  constexpr int kAgain = kStruck + 160 * 128;
  scene.events = {events::Impulse{.time_s = kAgain / kRate, .body = 0, .impulse_n_s = {0.0, 0.0, 1.0}}};
  EffectCounters counters;
  const Sound heard = play(scene, &counters);
  double peak = 0.0;
  for (std::size_t n = 0; n < 6000; ++n) {
    peak = std::max(peak, std::abs(static_cast<double>(heard[1][n])));
    ASSERT_EQ(heard[1][n], heard[1][n + kAgain - kStruck]) << n;
  }
  EXPECT_GT(peak, 0.1);
  EXPECT_LT(counters.units[Effect::kHead], 30000) << "asleep for the rest";
}

TEST(HeadEars, DoNoWorkWhenOff) {
  Scene scene = make_tone(800.0);
  EffectCounters off, on, alone;
  play(scene, &on);
  scene.effects = kDefaultEffects;
  play(scene, &off);
  scene.head.reset();
  play(scene, &alone);
  EXPECT_EQ(off.units[Effect::kHead], 0);
  EXPECT_EQ(off.units, alone.units);
  EXPECT_GT(on.units[Effect::kHead], 0);
  EXPECT_EQ(on.units[Effect::kTwoEars], 0) << "the head has one receiver, in its middle";
}

TEST(HeadEars, ImpossibleHeadsAreRefused) {
  const auto model = Model::make(testing::make_cube_bank({{400.0, 5.0}}), {.rate_hz = kRate});
  Synthesiser without({.rate_hz = kRate});
  EXPECT_THROW(without.add_body(model, {.effects = kByHead}), InputError);
  EXPECT_THROW(Synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}, .head = make_head()}), InputError);
  EXPECT_THROW(Synthesiser({.rate_hz = 44100.0, .head = make_head()}), InputError);
  EXPECT_THROW(Synthesiser({.rate_hz = kRate, .head = ListeningHead{}}), InputError);
}

// Any rotation that maps the axes.
TEST(HeadEars, AHeadIsTurnedAsItLooks) {
  for (const Vec3& forward : {Vec3{1, 0, 0}, Vec3{-1, 0, 0}, Vec3{0, -2, 0}, Vec3{0, 0, 3}, Vec3{0.3, -0.4, -0.8}, Vec3{0, 1, 0}}) {
    for (const Vec3& to_left : {Vec3{0.1, 0.9, 0.2}, Vec3{-0.7, -0.2, 0.3}, Vec3{0.2, 0.1, -1.0}}) {
      const Vec3 x = (1.0 / norm(forward)) * forward, across = to_left - dot(to_left, x) * x, y = (1.0 / norm(across)) * across;
      const events::Quaternion rotation = calc_head_rotation(forward, to_left);
      EXPECT_LT(norm(turn(rotation, {1, 0, 0}) - x), 1e-12);
      EXPECT_LT(norm(turn(rotation, {0, 1, 0}) - y), 1e-12);
      EXPECT_LT(norm(turn(rotation, {0, 0, 1}) - cross(x, y)), 1e-12);
    }
  }
  EXPECT_EQ(calc_head_rotation({0, 0, 0}, {0, 1, 0}), (events::Quaternion{1.0, 0.0, 0.0, 0.0}));
  EXPECT_EQ(calc_head_rotation({1, 0, 0}, {2, 0, 0}), (events::Quaternion{1.0, 0.0, 0.0, 0.0}));
}

}  // namespace
}  // namespace carillon::synth
