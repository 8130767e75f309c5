// EarFilter::process does not allocate. A separate program, see tests/support/heap_counter.hpp.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "runtime/acoustics/head/ear_filter.hpp"
#include "runtime/acoustics/head/sphere.hpp"
#include "tests/support/heap_counter.hpp"

namespace carillon::head {
namespace {

using tests::g_allocations;

/// Head by direction with six directions along the axes, without a file.
std::shared_ptr<const Head> make_cross() {
  Head::Content head{.sample_rate_hz = 48000.0, .taps = 32, .responses = {}, .delays = {}, .lookup = ByAngle{}};
  std::vector<Vec3> unit;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const double side : {1.0, -1.0}) {
      unit.emplace_back();
      unit.back()[axis] = side;
    }
  for (std::size_t i = 0; i < 2 * unit.size(); ++i) {
    head.delays.push_back(3.0 * static_cast<double>(i));
    for (int n = 0; n < head.taps; ++n) head.responses.push_back(n == kOnset ? 1.0F + static_cast<float>(i) : 0.0F);
  }
  head.lookup = ByDirection{Directions(unit, "cross")};
  return std::make_shared<const Head>(std::move(head));
}

TEST(HeadWithoutHeap, TheCounterSeesAllocations) {
  const long before = g_allocations;
  auto* memory = new std::vector<double>(1000);
  EXPECT_GE(g_allocations - before, 2);
  delete memory;
}

TEST(HeadWithoutHeap, ProcessingTakesNoMemory) {
  for (const auto& head : {make_sphere(48000.0), make_cross()}) {
    EarFilter filter(head);
    std::vector<double> input(200, 1.0), left(200), right(200);
    const long before = g_allocations;
    for (int i = 0; i < 500; ++i) {
      const std::size_t size = 1 + i % 200;
      const Vec3 direction{std::cos(0.1 * i), std::sin(0.1 * i), std::cos(0.37 * i)};
      filter.process(direction, std::span(input).first(size), std::span(left).first(size), std::span(right).first(size));
      if (i == 300) filter.reset();
    }
    EXPECT_EQ(g_allocations - before, 0);
    EXPECT_NE(left[0], 0.0);
  }
}

}  // namespace
}  // namespace carillon::head
