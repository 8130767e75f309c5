// The contact tracker by the C interface: a body that falls on the ground, to a sink and to a synthesiser; wrong calls.
#include <carillon.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "tests/support/paths.hpp"

namespace {

const std::string kTouchedBank = carillon::tests::get_source_dir() + "/tests/unit/runtime/bank/pinned/version_1_5.hdf";
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Events received by a sink.
struct Received {
  std::array<int, 5> counts{};
  double impulse_n_s[3] = {0, 0, 0}, mark_s = -1.0;

  static void take(void* user, int32_t kind, const void* event) {
    auto& own = *static_cast<Received*>(user);
    ++own.counts.at(kind);
    if (kind == CARILLON_EVENT_MARK) own.mark_s = *static_cast<const double*>(event);
    if (kind == CARILLON_EVENT_IMPULSE)
      for (int k = 0; k < 3; ++k) own.impulse_n_s[k] += static_cast<const carillon_impulse*>(event)->impulse_n_s[k];
    if (kind != CARILLON_EVENT_FORCE) return;
    const auto& force = *static_cast<const carillon_force*>(event);
    for (int step = 0; step < force.count; ++step)
      for (int k = 0; k < 3; ++k) own.impulse_n_s[k] += force.impulse_n_s[step][k];
  }
};

/// A body above the ground, which its lowest vertex touches at time 0.
class Fall {
 public:
  explicit Fall(carillon_synth* synth = nullptr, int32_t body = 0) {
    EXPECT_EQ(carillon_bank_open(kTouchedBank.c_str(), &bank, nullptr, 0), CARILLON_OK);
    carillon_body_facts_init(&facts);
    EXPECT_EQ(carillon_bank_get_facts(bank, &facts), CARILLON_OK);
    carillon_touches_options options;
    carillon_touches_options_init(&options);
    if (synth == nullptr) options.sink = Received::take;
    options.user = &received;
    EXPECT_EQ(carillon_touches_create(synth, &options, &touches, nullptr, 0), CARILLON_OK);
    carillon_touches_body given;
    carillon_touches_body_init(&given);
    given.body = body;
    given.bank = bank;
    given.name_seed = carillon_name_seed("body");
    EXPECT_EQ(carillon_touches_add(touches, &given, &index, nullptr, 0), CARILLON_OK);
    const double* x = carillon_bank_vertices_m(bank);
    int lowest = 0;
    for (int v = 0; v < carillon_bank_vertex_count(bank); ++v)
      if (x[3 * v + 2] < x[3 * lowest + 2]) lowest = v;
    double centre[3];
    carillon_bank_centre_m(bank, centre);
    for (int k = 0; k < 3; ++k) pose.position_m[k] = centre[k] - x[3 * lowest + k];
    pose.rotation[0] = 1.0;
    pose.velocity_m_s[2] = -1.0;
    point.b = -1;
    point.normal[2] = 1.0;
    point.curvature_per_m = kNan;
    point.impulse_n_s = (1.0 + 9.81 / 240.0) * facts.mass_kg;  // stops it, and carries its weight
  }
  ~Fall() {
    carillon_touches_destroy(touches);
    carillon_bank_close(bank);
  }
  Fall(const Fall&) = delete;
  Fall& operator=(const Fall&) = delete;

  carillon_status start() { return carillon_touches_start(touches, 0.0, &pose, 1, nullptr, 0); }
  carillon_status step(double time_s, int count) { return carillon_touches_step(touches, time_s, &pose, 1, &point, count, nullptr, 0); }

  carillon_bank* bank = nullptr;
  carillon_body_facts facts{};
  carillon_touches* touches = nullptr;
  int32_t index = -1;
  carillon_pose pose{};
  carillon_point point{};
  Received received;
};

TEST(CTouches, AHitReachesTheSink) {
  Fall fall;
  EXPECT_EQ(fall.index, 0);
  ASSERT_EQ(fall.start(), CARILLON_OK);
  fall.pose.velocity_m_s[2] = 0.0;
  ASSERT_EQ(fall.step(1.0 / 240.0, 1), CARILLON_OK);
  for (int n = 2; n < 20; ++n) ASSERT_EQ(fall.step(n / 240.0, 0), CARILLON_OK);
  EXPECT_GT(fall.received.counts[CARILLON_EVENT_IMPULSE] + fall.received.counts[CARILLON_EVENT_FORCE], 0);
  EXPECT_GT(fall.received.counts[CARILLON_EVENT_MOTION], 1);
  EXPECT_EQ(fall.received.mark_s, 19.0 / 240.0);
  EXPECT_EQ(carillon_touches_mark_s(fall.touches), 19.0 / 240.0);
  EXPECT_GT(fall.received.impulse_n_s[2], 0.0);
  EXPECT_LE(fall.received.impulse_n_s[2], 1.01 * fall.point.impulse_n_s);
  carillon_touches_counters counters;
  carillon_touches_counters_init(&counters);
  ASSERT_EQ(carillon_touches_get_counters(fall.touches, &counters), CARILLON_OK);
  EXPECT_EQ(counters.steps, 19);
  EXPECT_EQ(counters.points, 1);
  EXPECT_EQ(counters.hits, 1);
  EXPECT_EQ(carillon_touches_remove(fall.touches, 0), CARILLON_OK);
  EXPECT_EQ(carillon_touches_remove(fall.touches, 0), CARILLON_BAD_INPUT);
}

TEST(CTouches, ASynthesiserSoundsAndItsRingMayBeFull) {
  carillon_bank* bank = nullptr;
  carillon_model* model = nullptr;
  carillon_synth* synth = nullptr;
  carillon_model_options model_options;
  carillon_model_options_init(&model_options);
  carillon_options options;
  carillon_options_init(&options);
  options.ring_events = 4;
  ASSERT_EQ(carillon_bank_open(kTouchedBank.c_str(), &bank, nullptr, 0), CARILLON_OK);
  ASSERT_EQ(carillon_model_make(bank, &model_options, &model, nullptr, 0), CARILLON_OK);
  ASSERT_EQ(carillon_create(&options, &synth, nullptr, 0), CARILLON_OK);
  const double place[3] = {0.0, 1.0, 0.0};
  int32_t body = -1;
  ASSERT_EQ(carillon_add_body(synth, model, place, &body, nullptr, 0), CARILLON_OK);
  {
    Fall fall(synth, body);
    ASSERT_EQ(fall.start(), CARILLON_OK);
    fall.pose.velocity_m_s[2] = 0.0;
    carillon_status status = fall.step(1.0 / 240.0, 1);
    for (int n = 2; n < 10; ++n) status = fall.step(n / 240.0, 0);
    EXPECT_EQ(status, CARILLON_FULL);
    std::array<float, 512> left, right;
    float* const out[] = {left.data(), right.data()};
    float peak = 0.0F;
    for (int n = 10; n < 200; ++n) {
      carillon_process(synth, out, 2, 200);
      for (int i = 0; i < 200; ++i) peak = std::max(peak, std::abs(left[i]));
      status = fall.step(n / 240.0, 0);
    }
    EXPECT_EQ(status, CARILLON_OK) << "the waiting events were taken";
    EXPECT_GT(peak, 0.0F);
  }
  carillon_destroy(synth);
  carillon_model_release(model);
  carillon_bank_close(bank);
}

TEST(CTouches, WrongCallsAreRefused) {
  carillon_touches_options options;
  carillon_touches_options_init(&options);
  carillon_touches* touches = nullptr;
  char message[200] = "";
  EXPECT_EQ(carillon_touches_create(nullptr, &options, &touches, message, sizeof message), CARILLON_BAD_ARGUMENT);
  EXPECT_NE(std::strstr(message, "sink"), nullptr) << message;
  options.sink = Received::take;
  Received received;
  options.user = &received;
  EXPECT_EQ(carillon_touches_create(nullptr, &options, nullptr, nullptr, 0), CARILLON_BAD_ARGUMENT);
  options.longest_hit_s = -1.0;
  EXPECT_EQ(carillon_touches_create(nullptr, &options, &touches, message, sizeof message), CARILLON_BAD_INPUT);
  EXPECT_EQ(touches, nullptr);
  options.longest_hit_s = 0.1;
  options.size = 0;
  EXPECT_EQ(carillon_touches_create(nullptr, &options, &touches, nullptr, 0), CARILLON_BAD_ARGUMENT) << "not initialised";
  Fall fall;
  carillon_touches_body silent;
  carillon_touches_body_init(&silent);
  int32_t index = 7;
  EXPECT_EQ(carillon_touches_add(fall.touches, &silent, &index, message, sizeof message), CARILLON_BAD_INPUT) << "no mass";
  EXPECT_EQ(index, -1);
  silent.mass_kg = 1.0;
  silent.size_m = 0.1;
  silent.young_pa = 1e9;
  silent.density_kg_m3 = 1000.0;
  EXPECT_EQ(carillon_touches_add(fall.touches, &silent, &index, message, sizeof message), CARILLON_OK) << message;
  EXPECT_EQ(index, 1);
  silent.body = 3;
  EXPECT_EQ(carillon_touches_add(fall.touches, &silent, &index, nullptr, 0), CARILLON_BAD_INPUT) << "sounds without a bank";
  EXPECT_EQ(fall.start(), CARILLON_BAD_INPUT) << "a pose is missing";
  EXPECT_EQ(carillon_touches_remove(fall.touches, 1), CARILLON_OK);
  EXPECT_EQ(carillon_touches_step(nullptr, 0.0, nullptr, 0, nullptr, 0, nullptr, 0), CARILLON_BAD_ARGUMENT);
  EXPECT_EQ(carillon_touches_step(fall.touches, 1.0, nullptr, 2, nullptr, 0, nullptr, 0), CARILLON_BAD_ARGUMENT);
  EXPECT_EQ(carillon_touches_step(fall.touches, 1.0, &fall.pose, 1, nullptr, 0, message, sizeof message), CARILLON_BAD_INPUT);
  EXPECT_NE(std::strstr(message, "poses"), nullptr) << message;
  EXPECT_EQ(carillon_touches_get_counters(fall.touches, nullptr), CARILLON_BAD_ARGUMENT);
  EXPECT_EQ(carillon_touches_mark_s(nullptr), 0.0);
  carillon_touches_destroy(nullptr);
}

/// A wrong count is refused before anything is read, and nothing changes.
TEST(CTouches, CountsAndOrderAreChecked) {
  Fall fall;
  char message[200] = "";
  EXPECT_EQ(carillon_touches_step(fall.touches, 0.1, &fall.pose, 1, nullptr, 0, message, sizeof message), CARILLON_BAD_INPUT);
  EXPECT_NE(std::strstr(message, "start"), nullptr) << message;
  for (const int32_t bodies : {-1, 0, 2, std::numeric_limits<int32_t>::max()}) {
    EXPECT_EQ(carillon_touches_start(fall.touches, 0.0, &fall.pose, bodies, message, sizeof message), CARILLON_BAD_INPUT) << bodies;
    EXPECT_NE(std::strstr(message, "give 1 pose"), nullptr) << message;
  }
  ASSERT_EQ(fall.start(), CARILLON_OK);
  for (const int32_t count : {-1, std::numeric_limits<int32_t>::min()}) {
    EXPECT_EQ(carillon_touches_step(fall.touches, 0.1, &fall.pose, 1, &fall.point, count, message, sizeof message), CARILLON_BAD_INPUT);
    EXPECT_NE(std::strstr(message, "count"), nullptr) << message;
  }
  EXPECT_EQ(fall.step(1e300, 0), CARILLON_BAD_INPUT);
  EXPECT_EQ(fall.step(0.1, 1), CARILLON_OK);
  fall.point.impulse_n_s = -HUGE_VAL;
  EXPECT_EQ(fall.step(0.2, 1), CARILLON_OK);
  carillon_touches_counters counters;
  carillon_touches_counters_init(&counters);
  ASSERT_EQ(carillon_touches_get_counters(fall.touches, &counters), CARILLON_OK);
  EXPECT_EQ(counters.steps, 2);
  EXPECT_EQ(counters.bad_points, 1);
}

/// Any bits in any field: a status, and finite events.
TEST(CTouches, AnyNumbersAreSurvived) {
  std::mt19937 chance(11);
  const std::array values{0.0, -1.0, 1e-300, 1e-12, 0.5, 1.0, 30.0, 1e300, HUGE_VAL, kNan};
  int accepted = 0;
  for (int round = 0; round < 40; ++round) {
    Fall fall;
    ASSERT_EQ(fall.start(), CARILLON_OK);
    for (int n = 1; n < 40; ++n) {
      carillon_pose pose = fall.pose;
      carillon_point point = fall.point;
      const auto spoil = [&](double& x) {
        if (chance() % 30 == 0) x = values[chance() % values.size()];
      };
      for (double& x : pose.position_m) spoil(x);
      for (double& x : pose.velocity_m_s) spoil(x);
      for (double& x : pose.spin_rad_s) spoil(x);
      for (double* x : {&point.gap_m, &point.impulse_n_s, &point.curvature_per_m, &point.normal[0], &point.normal[2]}) spoil(*x);
      for (double& x : point.point_m) spoil(x);
      for (double& x : point.friction_n_s) spoil(x);
      if (chance() % 20 == 0) point.b = static_cast<int32_t>(chance());
      pose.flags = chance() % 40 == 0 ? chance() : 0;
      const carillon_status status = carillon_touches_step(fall.touches, n * 1e-3, &pose, 1, &point, 1, nullptr, 0);
      EXPECT_TRUE(status == CARILLON_OK || status == CARILLON_BAD_INPUT) << status;
      accepted += status == CARILLON_OK ? 1 : 0;
    }
    EXPECT_FALSE(std::isnan(fall.received.impulse_n_s[2]));
  }
  EXPECT_GT(accepted, 500);
}

}  // namespace
