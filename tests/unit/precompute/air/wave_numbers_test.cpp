// Wave numbers and interpolation between them.
#include "precompute/air/wave_numbers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace carillon::air {
namespace {

std::vector<double> make_modes(std::size_t count, double low, double high) {
  std::vector<double> modes;
  for (std::size_t i = 0; i < count; ++i)
    modes.push_back(low + (high - low) * std::pow(static_cast<double>(i) / static_cast<double>(count - 1), 0.8));
  return modes;
}

bool has(const WaveNumbers& waves, double k) { return std::find(waves.get().begin(), waves.get().end(), k) != waves.get().end(); }

TEST(wave_numbers, reach_around_all_modes_with_the_step_that_is_asked) {
  const std::vector<double> modes = make_modes(500, 2.0, 60.0);
  const double radius = 0.3, step = 0.5;
  const WaveNumbers waves(modes, radius, step);
  const std::vector<double>& k = waves.get();
  ASSERT_TRUE(std::is_sorted(k.begin(), k.end()));
  EXPECT_LT(k.front(), modes.front());
  EXPECT_GT(k.back(), modes.back());
  EXPECT_LT(k.size(), modes.size());
  const double mean = (k.back() - k.front()) * radius / static_cast<double>(k.size() - 1);
  EXPECT_LE(mean, step);
  EXPECT_GT(mean, 0.9 * step);
  EXPECT_NEAR((k[1] - k[0]) * radius / mean, 0.6, 0.07);  // finer at the lower end
  for (std::size_t i = 2; i < k.size(); ++i) EXPECT_GT(k[i] - k[i - 1], k[i - 1] - k[i - 2]);
}

TEST(wave_numbers, are_those_of_the_modes_where_they_are_few) {
  const WaveNumbers waves(std::vector{9.0, 3.0, 3.0, 5.5}, 1.0, 0.1);
  EXPECT_EQ(waves.get(), (std::vector{3.0, 5.5, 9.0}));
  const Stencil stencil = waves.find_stencil(5.5);
  EXPECT_EQ(stencil.nodes, std::vector<std::int32_t>{1});
  EXPECT_EQ(stencil.weights, std::vector<double>{1.0});
  EXPECT_TRUE(WaveNumbers({}, 1.0, 0.1).get().empty());
}

TEST(wave_numbers, stencils_reproduce_cubic_polynomials) {
  const std::vector<double> modes = make_modes(300, 1.0, 40.0);
  const WaveNumbers waves(modes, 0.5, 0.75);
  const auto cubic = [](double k) { return 3.0 - 2.0 * k + 0.5 * k * k - 0.04 * k * k * k; };
  const auto parabola = [](double k) { return 3.0 - 2.0 * k + 0.5 * k * k; };
  for (const double k : modes) {
    const Stencil stencil = waves.find_stencil(k);
    ASSERT_EQ(stencil.nodes.size(), 4U);
    ASSERT_EQ(stencil.weights.size(), 4U);
    ASSERT_EQ(stencil.weights_without_farthest.size(), 4U);
    double of_cubic = 0.0, of_parabola = 0.0, farthest = 0.0, dropped = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      if (i > 0) {
        EXPECT_EQ(stencil.nodes[i], stencil.nodes[i - 1] + 1);
      }
      const double node = waves.get()[stencil.nodes[i]];
      of_cubic += stencil.weights[i] * cubic(node);
      of_parabola += stencil.weights_without_farthest[i] * parabola(node);
      farthest = std::max(farthest, std::abs(node - k));
      if (stencil.weights_without_farthest[i] == 0.0) dropped = std::abs(node - k);
    }
    EXPECT_NEAR(of_cubic, cubic(k), 1e-11 * 2000.0);
    EXPECT_NEAR(of_parabola, parabola(k), 1e-11 * 2000.0);
    EXPECT_EQ(dropped, farthest);
    EXPECT_NEAR(std::accumulate(stencil.weights.begin(), stencil.weights.end(), 0.0), 1.0, 1e-13);
    EXPECT_NEAR(std::accumulate(stencil.weights_without_farthest.begin(), stencil.weights_without_farthest.end(), 0.0), 1.0, 1e-13);
  }
}

TEST(wave_numbers, stencils_lie_around_the_mode_and_at_the_ends_inside) {
  const WaveNumbers waves(make_modes(300, 1.0, 40.0), 0.5, 0.75);
  const std::vector<double>& k = waves.get();
  const Stencil middle = waves.find_stencil(0.5 * (k[7] + k[8]));
  EXPECT_EQ(middle.nodes, (std::vector<std::int32_t>{6, 7, 8, 9}));
  const auto last = static_cast<std::int32_t>(k.size()) - 1;
  EXPECT_EQ(waves.find_stencil(0.5 * (k[0] + k[1])).nodes, (std::vector<std::int32_t>{0, 1, 2, 3}));
  for (const double outside : {0.5 * k.front(), 1.2 * k.back()}) {
    const Stencil stencil = waves.find_stencil(outside);
    EXPECT_EQ(stencil.nodes.front(), outside < k.front() ? 0 : last - 3);
    double sum = 0.0;
    for (std::size_t i = 0; i < 4; ++i) sum += stencil.weights[i] * std::pow(k[stencil.nodes[i]], 3);
    EXPECT_NEAR(sum / std::pow(outside, 3), 1.0, 1e-9);
  }
}

TEST(wave_numbers, with_few_wave_numbers_take_what_there_is) {
  WaveNumbers waves(std::vector{3.0, 5.0}, 1.0, 0.1);
  const Stencil stencil = waves.find_stencil(4.5);
  ASSERT_EQ(stencil.nodes.size(), 2U);
  EXPECT_NEAR(stencil.weights[0], 0.25, 1e-15);
  EXPECT_NEAR(stencil.weights[1], 0.75, 1e-15);
  EXPECT_EQ(stencil.weights_without_farthest, (std::vector{0.0, 1.0}));
  const Stencil single = WaveNumbers(std::vector{3.0}, 1.0, 0.1).find_stencil(4.0);
  ASSERT_EQ(single.nodes.size(), 1U);
  EXPECT_EQ(single.weights[0], 1.0);
}

TEST(wave_numbers, refine_puts_one_at_a_mode_that_fails_in_each_step) {
  const std::vector<double> modes = make_modes(300, 1.0, 40.0);
  WaveNumbers waves(modes, 0.5, 0.75);
  const std::vector<double> before = waves.get();
  std::vector<bool> is_wrong(modes.size());
  for (std::size_t m = 0; m < modes.size(); ++m) is_wrong[m] = modes[m] > before[4] && modes[m] < before[6];
  EXPECT_TRUE(waves.refine(modes, is_wrong));
  EXPECT_EQ(waves.get().size(), before.size() + 2);
  ASSERT_TRUE(std::is_sorted(waves.get().begin(), waves.get().end()));
  for (const std::size_t step : {4U, 5U}) {
    // The inserted one is the mode nearest to the middle of the step.
    const double middle = 0.5 * (before[step] + before[step + 1]);
    const double nearest =
        *std::min_element(modes.begin(), modes.end(), [&](double a, double b) { return std::abs(a - middle) < std::abs(b - middle); });
    EXPECT_TRUE(has(waves, nearest));
    EXPECT_EQ(waves.find_stencil(nearest).nodes.size(), 1U);
  }
  EXPECT_FALSE(waves.refine(modes, std::vector<bool>(modes.size())));
  EXPECT_EQ(waves.get().size(), before.size() + 2);
}

TEST(wave_numbers, refine_continues_until_every_failing_mode_has_its_own) {
  const std::vector<double> modes = make_modes(50, 1.0, 9.0);
  WaveNumbers waves(modes, 1.0, 2.0);
  const std::size_t before = waves.get().size();
  int rounds = 0;
  while (waves.refine(modes, std::vector<bool>(modes.size(), true))) ++rounds;
  for (const double k : modes) EXPECT_TRUE(has(waves, k));
  EXPECT_EQ(waves.get().size(), before + modes.size());
  EXPECT_LE(rounds, 8);  // halving: 50 modes in about eight steps
}

TEST(wave_numbers, refine_reaches_modes_beyond_the_ends) {
  const std::vector<double> modes = make_modes(300, 1.0, 40.0);
  WaveNumbers waves(modes, 0.5, 0.75);
  const std::vector<double> shifted{0.5, 0.7, 47.0};
  EXPECT_TRUE(waves.refine(shifted, {true, true, true}));
  EXPECT_TRUE(has(waves, 47.0));
  EXPECT_TRUE(has(waves, 0.5) || has(waves, 0.7));
  waves.refine(shifted, {true, true, true});
  for (const double k : shifted) EXPECT_TRUE(has(waves, k));
}

}  // namespace
}  // namespace carillon::air
