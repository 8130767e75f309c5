// Hard cases of depth: random drops of one body (tests/unit/runtime/physics/rigid/drops.hpp), looked at after every step.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <string>

#include "tests/hard/figure.hpp"
#include "tests/unit/runtime/physics/rigid/drops.hpp"

namespace carillon::hard {
namespace {

using namespace rigid::tests;

constexpr double kSeconds = 2.0;

Drop make_drop(int body, int number) {
  std::mt19937 random(1000U * static_cast<unsigned>(body) + static_cast<unsigned>(number));
  std::array<std::uint8_t, 16> bytes{};
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random() & 255U);
  bytes[0] = static_cast<std::uint8_t>(body);
  return decode_drop(bytes);
}

void drop_many(int body, int max_rattling = 0) {
  constexpr int kDrops = 25;
  constexpr int kMaxLateHits = 50;  // in the last 0.5 s
  const std::string id = std::string("drops_") + kDropBodies.at(body);
  double rests_m = 0.0, ever = 0.0, gained = 0.0, lifted = 0.0;
  int rattling = 0;
  for (int number = 0; number < kDrops; ++number) {
    const DropOutcome o = run_drop(make_drop(body, number), kSeconds);
    rests_m = std::max(rests_m, o.rests_m);
    ever = std::max(ever, o.deepest_m / calc_allowed_depth(o));
    gained = std::max(gained, o.gained);
    lifted = std::max(lifted, o.lifted);
    if (o.late_hits > kMaxLateHits) ++rattling;
  }
  hold(id, rests_m, kWanted.rests_m, "deepest in the last 0.2 s [m]");
  hold(id, ever, kWanted.ever, "deepest ever over 50 um or 1 % of the thickness");
  hold(id, gained, kWanted.gained, "energy gained over the largest of motion");
  hold(id, lifted, kWanted.lifted, "energy lifted over the largest of motion");
  hold(id, rattling, max_rattling, "drops with more than 50 hits in the last 0.5 s");
}

TEST(depth, drops_disc) { drop_many(0); }
TEST(depth, drops_coin) { drop_many(1); }
TEST(depth, drops_ring) { drop_many(2); }
TEST(depth, drops_rod) { drop_many(3); }
TEST(depth, drops_pen) { drop_many(4, 1); }  // one rolls downhill on the corners of its skin
TEST(depth, drops_cup) { drop_many(5); }
TEST(depth, drops_bowl) { drop_many(6); }
TEST(depth, drops_sheet) { drop_many(7); }
TEST(depth, drops_plate) { drop_many(8); }
TEST(depth, drops_slab) { drop_many(9); }
TEST(depth, drops_bar) { drop_many(10); }
TEST(depth, drops_box) { drop_many(11); }

TEST(depth, ground_against_slab) {
  for (const bool is_slab : {false, true}) {
    double rests_m = 0.0, ever = 0.0;
    for (int body = 0; body < static_cast<int>(kDropBodies.size()); ++body)
      for (const int number : {100, 101}) {
        Drop drop = make_drop(body, number);
        drop.floor = is_slab ? DropFloor::slab : DropFloor::ground;
        drop.slope_deg = drop.speed_m_s = 0.0;
        const DropOutcome o = run_drop(drop, 1.0);
        rests_m = std::max(rests_m, o.rests_m);
        ever = std::max(ever, o.deepest_m / calc_allowed_depth(o));
      }
    const std::string floor = is_slab ? "slab" : "ground";
    hold("ground_against_slab", rests_m, 25e-6, floor + ", deepest in the last 0.2 s [m]");
    hold("ground_against_slab", ever, 1.0, floor + ", deepest ever over 50 um or 1 % of the thickness");
  }
}

}  // namespace
}  // namespace carillon::hard
