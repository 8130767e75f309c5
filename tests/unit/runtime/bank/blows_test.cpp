#include "runtime/bank/blows.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::bank {
namespace {

/// Modes at rest except at a few vertices of one mode, along the normal of the upper side of the box.
Bank make_still(const std::vector<std::pair<std::size_t, double>>& moving) {
  Bank bank = example::make_bank(4, 3);
  std::vector<double> shapes(bank.vertex_count() * 9, 0.0);
  for (const auto& [vertex, motion] : moving) shapes[vertex * 9 + 3 + 2] = motion;  // mode 1, along z
  quantise_shapes(bank, shapes);
  return bank;
}

/// Central vertex of a side of the box, and the farthest vertex inside the same side.
std::vector<std::size_t> list_upper(const Bank& bank) {
  std::vector<std::size_t> found;
  for (std::size_t v = 0; v < bank.vertex_count(); ++v) {
    bool is_inside = std::abs(bank.vertices_m[v][2] - example::kCornerM[2] - example::kSidesM[2]) < 1e-9;
    for (int k = 0; k < 2; ++k) {
      const double at = (bank.vertices_m[v][k] - example::kCornerM[k]) / example::kSidesM[k];
      is_inside = is_inside && at > 0.1 && at < 0.9;
    }
    if (is_inside) found.push_back(v);
  }
  return found;
}

TEST(Strikes, TheFirstIsTheLoudest) {
  const std::vector<std::size_t> upper = list_upper(make_still({}));
  ASSERT_EQ(upper.size(), 9u);
  const Bank bank = make_still({{upper[2], 0.5}, {upper[6], -1.0}});
  EXPECT_EQ(find_strikes(bank, 1), std::vector<std::size_t>{upper[6]});
}

TEST(Strikes, OthersAreDistantAndAudible) {
  const std::vector<std::size_t> upper = list_upper(make_still({}));
  // A tenth of the power is 0.32 of the motion: the vertex with 0.3 is excluded, although it is farthest.
  const Bank bank = make_still({{upper[0], 1.0}, {upper[1], 0.6}, {upper[4], 0.5}, {upper[8], 0.3}});
  EXPECT_EQ(find_strikes(bank, 4), (std::vector<std::size_t>{upper[0], upper[4], upper[1]}));
}

TEST(Strikes, LevelsAreGainTimesMotionAlongTheNormal) {
  const Bank bank = example::make_bank(4, 6);
  const std::size_t vertex = list_upper(bank)[4];
  const std::vector<double> levels = calc_blow_amplitudes(bank, vertex, calc_vertex_normals(bank)[vertex]);
  ASSERT_EQ(levels.size(), 6u);
  for (std::size_t m = 0; m < 6; ++m) {
    // IEC 61672-1, E.4.2.
    const double f2 = std::pow(bank.freq_hz(m), 2);
    const double weight = std::pow(10.0, 0.1) * 148.693636e6 * f2 * f2 /
                          ((f2 + 424.36) * (f2 + 148.693636e6) * std::sqrt((f2 + 11599.29) * (f2 + 544496.41)));
    const double expected = weight * bank.radiation_gain[m] * std::abs(example::calc_shape(m, bank.vertices_m[vertex])[2]);
    EXPECT_NEAR(levels[m], expected, 0.01 * expected + bank.radiation_gain[m] * bank.shape_scale[m]) << m;
  }
}

}  // namespace
}  // namespace carillon::bank
