// Hard cases of sensors: at the struck point, on bodies that cannot move or have no mass, at and beyond the end of the band, at rates that
// do not divide that of the sound. Closed forms in long double.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/synth/sensor.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/hard/closed_form.hpp"
#include "tests/hard/figure.hpp"

namespace carillon::hard {
namespace {

constexpr double kOutputRateHz = 48000.0, kLength = 1e-3, kBegin = 0.01;
const Vec3 kDirection{0.0, 0.0, 1.0}, kCorner{1.0, 0.0, 0.0};
constexpr int kStruck = 2, kAway = 9;  // triangles of the cube; their first corners are struck and read

std::vector<double> read(const bank::Bank& bank, const synth::SensorSettings& settings) {
  synth::Synthesiser synthesiser(synth::SynthesiserOptions{.rate_hz = kOutputRateHz});
  const int body = synthesiser.add_body(synth::Model::make(bank, {.rate_hz = kOutputRateHz}));
  const int sensor = synthesiser.add_sensor(body, bank, settings);
  synthesiser.push(events::Impulse{.time_s = kBegin + 0.5 * kLength,
                                   .body = body,
                                   .triangle = kStruck,
                                   .barycentric = kCorner,
                                   .impulse_n_s = kDirection,
                                   .duration_s = kLength});
  std::array<float, 128> left, right;
  const std::array<float*, 2> out{left.data(), right.data()};
  for (int block = 0; block < 60; ++block) synthesiser.process(out.data(), 2, 128);
  std::vector<double> samples(synthesiser.find_sensor(sensor)->count_ready());
  synthesiser.find_sensor(sensor)->read(samples);
  return samples;
}

/// Velocity along z at a corner by the modes below `below_hz` and the rigid body, for a unit blow along z.
Real calc_reading(const bank::Bank& bank, int triangle, bool is_rigid, double below_hz, Real time) {
  const auto corner_of = [&](int of) { return static_cast<std::size_t>(bank.triangles[of][0]); };
  const Real since = time - static_cast<Real>(kBegin);
  Real sum = 0;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    if (bank.freq_hz(m) >= below_hz) continue;
    sum += bank.shape_at(corner_of(triangle), m)[2] * bank.shape_at(corner_of(kStruck), m)[2] *
           calc_pushed(bank.eigenvalue_rad2_s2[m], bank.decay_per_s[m], since, kLength);
  }
  if (!is_rigid) return sum;
  const Vec3 &at = bank.vertices_m[corner_of(triangle)], &struck = bank.vertices_m[corner_of(kStruck)];
  const Vec3 turn = (1.0 / bank.rigid.inertia_kg_m2[0]) * cross(struck, kDirection);
  return sum + (1.0 / bank.rigid.mass_kg + cross(turn, at)[2]) * calc_pushed(0, 0, since, kLength);
}

void check(const std::string& part, const bank::Bank& bank, synth::SensorSettings settings, bool is_rigid, double bound) {
  settings.barycentric = kCorner;
  settings.direction = kDirection;
  settings.quantity = synth::Quantity::kVelocity;
  const std::vector<double> samples = read(bank, settings);
  const double rate = settings.rate_hz > 0.0 ? settings.rate_hz : kOutputRateHz;
  Real largest = 0, off = 0;
  for (std::size_t n = samples.size() / 31; n < samples.size(); n += samples.size() / 61) {
    const Real known = calc_reading(bank, settings.triangle, is_rigid, 0.5 * kOutputRateHz, static_cast<Real>(n) / static_cast<Real>(rate));
    largest = std::max(largest, std::abs(known));
    off = std::max(off, std::abs(static_cast<Real>(samples[n]) - known));
  }
  hold("sensors", static_cast<double>(off / largest), bound, part);
}

TEST(time, sensors) {
  const std::vector<testing::InventedMode> modes{{400.0, 30.0, 1e-2, {0.3, -0.2, 1.0}, 0.1}, {2100.0, 5e5, 0.0, {0.5, 0.4, -0.7}, -0.2}};
  const bank::Bank bank = testing::make_cube_bank(modes);
  check("at the struck point", bank, {.triangle = kStruck}, true, 1e-5);
  check("elsewhere", bank, {.triangle = kAway}, true, 1e-5);
  check("held", bank, {.triangle = kAway, .is_held = true}, false, 1e-5);
  bank::Bank clamped = bank;
  clamped.supports.area_m2 = {1e-4};
  check("clamped", clamped, {.triangle = kAway}, false, 1e-5);
  bank::Bank light = bank;
  light.rigid = {};
  check("no mass", light, {.triangle = kAway}, false, 1e-5);
  check("0.499 fs", testing::make_cube_bank({modes[0], {0.499 * kOutputRateHz, 3.0, 1e-2, {0.3, -0.2, 1.0}, 0.1}}), {.triangle = kAway},
        true, 1e-5);
  check("beyond the band", testing::make_cube_bank({modes[0], {0.501 * kOutputRateHz, 3.0, 1e-2, {0.3, -0.2, 1.0}, 0.1}}),
        {.triangle = kAway}, true, 1e-5);
  for (const double rate : {6400.0 * std::numbers::phi, 44100.0, 96000.0 / 7.0, 192000.0})
    check(std::to_string(rate) + " Hz", testing::make_cube_bank({modes[0]}), {.triangle = kAway, .rate_hz = rate}, true, 2e-3);
}

}  // namespace
}  // namespace carillon::hard
