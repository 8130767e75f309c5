// EarFilter against its definition, and artefacts of moving sources.
#include "runtime/acoustics/head/ear_filter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/base/instructions.hpp"
#include "tests/unit/runtime/acoustics/head/oracle.hpp"

namespace carillon::head {
namespace {

using std::numbers::pi;
using testing::make_direction;

constexpr double kRate = 48000.0;

std::vector<double> make_noise(std::size_t length) {
  std::mt19937 chance(11);
  std::normal_distribution<double> normal;
  std::vector<double> noise(length);
  for (double& value : noise) value = normal(chance);
  return noise;
}

struct Sound {
  std::vector<double> left, right;
  bool operator==(const Sound&) const = default;
};

/// Cycles through these block sizes; `direct`: direction at a sample.
template <class Direct>
Sound play(EarFilter& filter, const std::vector<double>& input, const std::vector<std::size_t>& sizes, const Direct& direct) {
  Sound sound{std::vector<double>(input.size()), std::vector<double>(input.size())};
  for (std::size_t at = 0, i = 0; at < input.size(); ++i) {
    const std::size_t size = std::min(sizes[i % sizes.size()], input.size() - at);
    filter.process(direct(at + size), std::span(input).subspan(at, size), std::span(sound.left).subspan(at, size),
                   std::span(sound.right).subspan(at, size));
    at += size;
  }
  return sound;
}

TEST(EarFilter, BlocksOfAnySizeGiveTheSameBits) {
  const auto head = make_sphere(kRate);
  const std::vector<double> noise = make_noise(5000);
  const auto stay = [](std::size_t) { return make_direction(50.0, 20.0); };
  EarFilter first(head);
  const Sound whole = play(first, noise, {5000}, stay);
  for (const std::vector<std::size_t>& sizes : {std::vector<std::size_t>{1}, {7, 33, 1, 64}, {32}, {128}, {511}}) {
    EarFilter filter(head);
    EXPECT_EQ(play(filter, noise, sizes, stay), whole);
    filter.reset();
    EXPECT_EQ(play(filter, noise, sizes, stay), whole);
  }
}

// Definition in double precision; the delay as a phase per frequency of a period.
TEST(EarFilter, IsTheResponseAndTheDelay) {
  const auto head = make_sphere(kRate);
  const Vec3 direction = make_direction(-63.0, 11.0);
  const auto blend = head->find(direction);
  const testing::Heard heard = testing::hear_pulse(head, direction);
  for (std::size_t ear = 0; ear < 2; ++ear) {
    double delay = base::kSincHalf - 1.0;
    std::vector<double> response(head->get_taps());
    for (std::size_t i = 0; i < 3; ++i) {
      const double weight = static_cast<double>(blend[ear].weight[i]);
      delay += weight * head->get_delay(blend[ear].response[i]);
      for (std::size_t n = 0; n < response.size(); ++n)
        response[n] += weight * static_cast<double>(head->get_response(blend[ear].response[i])[n]);
    }
    for (double freq = 100.0; freq < 19000.0; freq += 377.0) {
      const auto wanted = testing::calc_spectrum(response, freq, kRate, -delay);
      const auto found = testing::calc_spectrum(ear == 0 ? heard.left : heard.right, freq, kRate, 0.0);
      EXPECT_LT(std::abs(found - wanted), 2e-3 * std::abs(wanted) + 1e-4) << ear << " " << freq;
    }
  }
}

TEST(EarFilter, AddsToTheOutput) {
  const auto head = make_sphere(kRate);
  const std::vector<double> noise = make_noise(300);
  EarFilter one(head), other(head);
  std::vector<double> left(300, 3.0), right(300, -2.0), left_alone(300), right_alone(300);
  one.process({0.0, 1.0, 0.0}, noise, left, right);
  other.process({0.0, 1.0, 0.0}, noise, left_alone, right_alone);
  for (std::size_t n = 0; n < 300; ++n) {
    EXPECT_NEAR(left[n], left_alone[n] + 3.0, 1e-12);
    EXPECT_NEAR(right[n], right_alone[n] - 2.0, 1e-12);
  }
}

/// Largest deviation from a tone, y[n] - 2 cos(omega) y[n - 1] + y[n - 2], after `from`, over its amplitude: steps and clicks appear fully,
/// slow changes are attenuated.
double find_step(const std::vector<double>& y, double omega, std::size_t from) {
  double most = 0.0, peak = 0.0;
  for (std::size_t n = from; n < y.size(); ++n) {
    most = std::max(most, std::abs(y[n] - 2.0 * std::cos(omega) * y[n - 1] + y[n - 2]));
    peak = std::max(peak, std::abs(y[n]));
  }
  return most / peak;
}

TEST(EarFilter, ACirclingSourceMakesNoSteps) {
  const auto head = make_sphere(kRate);
  for (const double freq : {250.0, 1000.0, 3000.0}) {
    const double omega = 2.0 * pi * freq / kRate;
    std::vector<double> tone(96000);
    for (std::size_t n = 0; n < tone.size(); ++n) tone[n] = std::sin(omega * static_cast<double>(n));
    for (const std::size_t size : {32U, 128U}) {
      EarFilter filter(head);
      const Sound sound =
          play(filter, tone, {size}, [](std::size_t n) { return make_direction(360.0 * static_cast<double>(n) / 96000.0, 10.0); });
      EXPECT_LT(find_step(sound.left, omega, 400), 1e-3) << freq << " " << size;
      EXPECT_LT(find_step(sound.right, omega, 400), 1e-3) << freq << " " << size;
    }
  }
}

// From one side to the other within a block: the fade lasts a block; a jump between two constant filters is a step of the level.
TEST(EarFilter, AJumpFades) {
  const auto head = make_sphere(kRate);
  const double omega = 2.0 * pi * 500.0 / kRate;
  std::vector<double> tone(4096);
  for (std::size_t n = 0; n < tone.size(); ++n) tone[n] = std::sin(omega * static_cast<double>(n));
  EarFilter filter(head), at_left(head), at_right(head);
  const Vec3 left{0.0, 1.0, 0.0}, right{0.0, -1.0, 0.0};
  const Sound jump = play(filter, tone, {128}, [&](std::size_t n) { return n <= 2048 ? left : right; });
  Sound hard = play(at_left, tone, {128}, [&](std::size_t) { return left; });
  const Sound after = play(at_right, tone, {128}, [&](std::size_t) { return right; });
  for (std::size_t n = 2048; n < tone.size(); ++n) hard.left[n] = after.left[n];
  EXPECT_GT(find_step(hard.left, omega, 400), 0.1);
  EXPECT_LT(find_step(jump.left, omega, 400), 0.02);
  for (std::size_t n = 2176 + 300; n < tone.size(); ++n) EXPECT_NEAR(jump.left[n], after.left[n], 1e-5);  // and then it is there
}

TEST(EarFilter, ASecondOfSilenceEndsInSilence) {
  EarFilter filter(make_sphere(kRate));
  std::vector<double> noise = make_noise(1000);
  noise[500] = std::numeric_limits<double>::quiet_NaN();
  noise.resize(4000);
  const Sound sound = play(filter, noise, {32}, [](std::size_t n) { return make_direction(static_cast<double>(n) / 50.0, 0.0); });
  EXPECT_TRUE(std::isnan(sound.left[600]));
  for (std::size_t n = 2000; n < 4000; ++n) ASSERT_EQ(sound.left[n], 0.0);  // non-finite numbers are gone, too
}

TEST(EarFilter, AllInstructionSetsAgree) {
  const std::vector<double> noise = make_noise(300);
  std::vector<float> x(300), h(128);
  for (std::size_t n = 0; n < x.size(); ++n) x[n] = static_cast<float>(noise[n]);
  for (std::size_t n = 0; n < h.size(); ++n) h[n] = static_cast<float>(noise[299 - n]);
  for (const base::Instructions instructions : base::list_instructions()) {
    const Loops& loops = get_loops(instructions);
    std::array<float, kChunk> one{}, a{}, b{};
    loops.convolve(h.data(), 128, x.data() + 200, one.data());
    loops.convolve_pair(h.data(), h.data() + 16, 112, x.data() + 200, a.data(), b.data());
    for (std::size_t n = 0; n < kChunk; ++n) {
      double sum = 0.0, sum_a = 0.0, sum_b = 0.0;
      for (std::size_t k = 0; k < 128; ++k) sum += static_cast<double>(h[k]) * static_cast<double>(x[200 + n - k]);
      for (std::size_t k = 0; k < 112; ++k) sum_a += static_cast<double>(h[k]) * static_cast<double>(x[200 + n - k]);
      for (std::size_t k = 0; k < 112; ++k) sum_b += static_cast<double>(h[k + 16]) * static_cast<double>(x[200 + n - k]);
      EXPECT_NEAR(static_cast<double>(one[n]), sum, 2e-5);
      EXPECT_NEAR(static_cast<double>(a[n]), sum_a, 2e-5);
      EXPECT_NEAR(static_cast<double>(b[n]), sum_b, 2e-5);
    }
    const float* rows[3] = {x.data(), x.data() + 20, x.data() + 50};
    const float weight[3] = {0.2F, 0.5F, 0.3F};
    std::array<float, 48> blend{};
    loops.blend(rows, weight, 48, blend.data());
    for (std::size_t n = 0; n < 48; ++n)
      EXPECT_NEAR(static_cast<double>(blend[n]), 0.2 * noise[n] + 0.5 * noise[n + 20] + 0.3 * noise[n + 50], 1e-6);
  }
}

}  // namespace
}  // namespace carillon::head
