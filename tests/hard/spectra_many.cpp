// Very many modes, up to eighteen of them degenerate, of which every one is known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "precompute/eigen/solve_modes.hpp"
#include "tests/hard/figure.hpp"
#include "tests/unit/precompute/eigen/spring_network.hpp"

namespace carillon::hard {
namespace {

/// side^3 masses between fixed walls, coupled to their neighbours alike in x, y and z: lambda = 4 k/m sum_d sin^2(pi j_d / (2 (side + 1))),
/// each three times and for every order of j: up to eighteen degenerate.
eigen::test::Network make_lattice(int side) {
  eigen::test::Network network;
  const int width = side + 2;
  const auto index = [&](int x, int y, int z) { return (z * width + y) * width + x; };
  const auto is_wall = [&](int i) { return i == 0 || i == width - 1; };
  for (int z = 0; z < width; ++z)
    for (int y = 0; y < width; ++y)
      for (int x = 0; x < width; ++x) {
        network.nodes.push_back({0.1 * x, 0.1 * y, 0.1 * z});
        network.mass_kg.push_back(0.5);
        network.component.push_back(0);
        if (is_wall(x) || is_wall(y) || is_wall(z)) network.fixed.push_back(index(x, y, z));
        if (x + 1 < width) network.springs.push_back({index(x, y, z), index(x + 1, y, z), 4e6, true});
        if (y + 1 < width) network.springs.push_back({index(x, y, z), index(x, y + 1, z), 4e6, true});
        if (z + 1 < width) network.springs.push_back({index(x, y, z), index(x, y, z + 1), 4e6, true});
      }
  return network;
}

TEST(spectra, two_thousand_modes) {
  const std::string id = "two_thousand_modes";
  constexpr int kSide = 11;  // 3993 unknowns
  const eigen::test::System system = eigen::test::make_system(make_lattice(kSide));
  std::vector<double> exact;
  const auto square = [](int j) { return std::pow(std::sin(std::numbers::pi * j / (2.0 * (kSide + 1))), 2); };
  for (int a = 1; a <= kSide; ++a)
    for (int b = 1; b <= kSide; ++b)
      for (int c = 1; c <= kSide; ++c)
        exact.insert(exact.end(), 3, std::sqrt(3.2e7 * (square(a) + square(b) + square(c))) / (2 * std::numbers::pi));
  std::sort(exact.begin(), exact.end());
  std::size_t count = 2000;
  while (exact[count] < exact[count - 1] * (1 + 1e-6)) ++count;  // to the end of a group
  exact.resize(count);
  eigen::Options options;
  options.low_hz = 10;
  options.high_hz = exact.back() * (1 + 1e-5);
  const eigen::Modes modes = eigen::solve_modes(system.problem, options);
  double largest = modes.lambda.size() == count ? 0 : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < std::min(count, modes.lambda.size()); ++i)
    largest = std::max(largest, std::abs(std::sqrt(modes.lambda[i]) / (2 * std::numbers::pi) / exact[i] - 1));
  hold(id, largest, 1e-9, std::to_string(count) + " modes");
  hold(id, std::abs(static_cast<double>(modes.proof.counts.back().below) - static_cast<double>(count)), 0, "count");
  hold(id, modes.orthonormality_error, 1e-10, "orthonormality");
  hold(id, *std::max_element(modes.residual.begin(), modes.residual.end()), options.tolerance, "residual");
}

}  // namespace
}  // namespace carillon::hard
