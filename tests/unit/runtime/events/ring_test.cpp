#include "runtime/events/ring.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <thread>
#include <vector>

namespace carillon::events {
namespace {

Event make_event(int producer, std::int64_t number) {
  return Impulse{.time_s = static_cast<double>(number), .body = producer, .impulse_n_s = {static_cast<double>(number), 0.0, -1.0}};
}

TEST(EventRing, KeepsTheOrder) {
  EventRing ring(5);
  EXPECT_EQ(ring.get_room(), 8U);
  Event event;
  EXPECT_FALSE(ring.pop(event));
  for (int round = 0; round < 100; ++round) {
    for (int i = 0; i < 8; ++i) EXPECT_TRUE(ring.push(make_event(0, 8 * round + i)));
    EXPECT_FALSE(ring.push(make_event(0, -1)));
    for (int i = 0; i < 8; ++i) {
      ASSERT_TRUE(ring.pop(event));
      EXPECT_EQ(get_time_s(event), 8 * round + i);
    }
    EXPECT_FALSE(ring.pop(event));
  }
  EXPECT_EQ(ring.get_overflows(), 100);
}

TEST(EventRing, RejectsAndCountsInvalidEvents) {
  EventRing ring(4);
  EXPECT_FALSE(ring.push(TimeWatermark{std::numeric_limits<double>::quiet_NaN()}));
  EXPECT_FALSE(ring.push(Impulse{.body = -1}));
  EXPECT_TRUE(ring.push(TimeWatermark{1.0}));
  EXPECT_EQ(ring.get_faults(), 2);
  EXPECT_EQ(ring.get_overflows(), 0);
  Event event;
  ASSERT_TRUE(ring.pop(event));
  EXPECT_EQ(get_time_s(event), 1.0);
}

// No event is lost, duplicated, torn or out of its producer's order under concurrent pushes.
TEST(EventRing, TakesFromManyThreadsAtOnce) {
  constexpr int kProducers = 4;
  constexpr std::int64_t kEach = 100000;
  EventRing ring(256);
  std::vector<std::thread> producers;
  for (int p = 0; p < kProducers; ++p) {
    producers.emplace_back([&ring, p] {
      for (std::int64_t i = 0; i < kEach; ++i) {
        while (!ring.push(make_event(p, i))) std::this_thread::yield();
      }
    });
  }
  std::array<std::int64_t, kProducers> next{};
  Event event;
  for (std::int64_t total = 0; total < kProducers * kEach;) {
    if (!ring.pop(event)) {
      std::this_thread::yield();
      continue;
    }
    ++total;
    const auto& impulse = std::get<Impulse>(event);
    ASSERT_EQ(impulse.time_s, static_cast<double>(next[impulse.body]++));
    ASSERT_EQ(impulse.impulse_n_s[0], impulse.time_s);
  }
  for (std::thread& producer : producers) producer.join();
  EXPECT_FALSE(ring.pop(event));
}

}  // namespace
}  // namespace carillon::events
