// The touches of a body and the floor against all its vertices, after every step of random drops.
#include "tests/unit/runtime/rigid/drops.hpp"

#include <gtest/gtest.h>

#include <random>

namespace carillon::rigid::tests {
namespace {

TEST(drops, touches_with_the_floor_are_complete_at_the_end_of_every_step) {
  std::mt19937 random(3);
  for (int n = 0; n < 24; ++n) {
    std::array<std::uint8_t, 16> bytes{};
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random() & 255U);
    bytes[0] = static_cast<std::uint8_t>(n);  // each body twice
    const Drop drop = decode_drop(bytes);
    SCOPED_TRACE(kDropBodies.at(static_cast<std::size_t>(drop.body)));
    EXPECT_LE(run_drop(drop, 0.5).missed_m, 2e-6 + 1e-9);
  }
}

}  // namespace
}  // namespace carillon::rigid::tests
