// No exception leaves a function of carillon.h: after any failed allocation, and with any options.
#include <carillon.h>
#include <gtest/gtest.h>

#include <array>
#include <climits>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "tests/support/heap_counter.hpp"
#include "tests/support/paths.hpp"

namespace {

using carillon::tests::g_until_failure;

const std::string kBank = carillon::tests::get_source_dir() + "/tests/unit/runtime/bank/pinned/version_1_5.hdf";
constexpr std::uint32_t kEffects = CARILLON_MODAL | CARILLON_HERTZ_PULSE | CARILLON_AIR_DELAY | CARILLON_DOPPLER | CARILLON_TWO_EARS |
                                   CARILLON_ROUGHNESS | CARILLON_ROLLING | CARILLON_CONTACT_DAMPING | CARILLON_DIRECTIVITY;

void process(carillon_synth* synth, int blocks) {
  std::array<std::array<float, 512>, 2> sound{};  // not on the heap
  float* const out[] = {sound[0].data(), sound[1].data()};
  for (int i = 0; i < blocks; ++i) {
    carillon_process(synth, out, 2, 512);
    for (const auto& channel : sound)
      for (const float x : channel) ASSERT_TRUE(std::isfinite(x));
  }
}

/// Calls every function that may allocate. False once one has failed.
class Session {
 public:
  ~Session() {
    carillon_destroy(synth_);
    carillon_model_release(model_);
    carillon_bank_close(edited_);
    carillon_bank_close(bank_);
  }
  carillon_synth* get_synth() const { return synth_; }
  int32_t get_body() const { return body_; }

  carillon_status play() {
    char message[100];
    carillon_status status = carillon_bank_open(kBank.c_str(), &bank_, message, sizeof message);
    if (status != CARILLON_OK) return status;
    carillon_edits edits;
    carillon_edits_init(&edits);
    edits.size_scale = 2.0;
    if ((status = carillon_bank_edit(bank_, &edits, &edited_, message, sizeof message)) != CARILLON_OK) return status;
    carillon_impulse strike;
    carillon_impulse_init(&strike);
    strike.impulse_n_s[2] = 0.01;
    strike.time_s = 0.01;
    if ((status = carillon_vary_impulse(bank_, 0.5, 1, 2, &strike)) != CARILLON_OK) return status;
    carillon_model_options model_options;
    carillon_model_options_init(&model_options);
    if ((status = carillon_model_make(bank_, &model_options, &model_, message, sizeof message)) != CARILLON_OK) return status;
    carillon_options options;
    carillon_options_init(&options);
    options.max_bodies = 2;
    options.head_radius_m = 0.09;
    if ((status = carillon_create(&options, &synth_, message, sizeof message)) != CARILLON_OK) return status;
    carillon_body_options body_options;
    carillon_body_options_init(&body_options);
    body_options.effects = kEffects | CARILLON_HEAD;
    if ((status = carillon_add_body_with(synth_, model_, &body_options, &body_, message, sizeof message)) != CARILLON_OK) return status;
    process(synth_, 2);
    carillon_push_impulse(synth_, &strike);
    // The first swap is in progress when the second comes, which carillon_collect then sends.
    for (int swap = 0; swap < 2; ++swap)
      if ((status = carillon_swap_model(synth_, body_, model_, message, sizeof message)) != CARILLON_OK) return status;
    process(synth_, 2);
    carillon_collect(synth_);
    process(synth_, 2);
    int32_t other = -1;
    const double place[3] = {1.0, 0.0, 0.0};
    if ((status = carillon_add_body(synth_, model_, place, &other, message, sizeof message)) != CARILLON_OK) return status;
    process(synth_, 2);
    carillon_remove_body(synth_, other);
    process(synth_, 2);
    carillon_collect(synth_);
    return CARILLON_OK;
  }

 private:
  carillon_bank *bank_ = nullptr, *edited_ = nullptr;
  carillon_model* model_ = nullptr;
  carillon_synth* synth_ = nullptr;
  int32_t body_ = -1;
};

TEST(NoException, LeavesAfterAnyFailedAllocation) {
  int failures = 0;
  for (long place = 0;; ++place) {
    Session session;
    g_until_failure = place;
    carillon_status status = CARILLON_OK;
    EXPECT_NO_THROW(status = session.play()) << place;
    const bool has_failed = g_until_failure < 0;
    g_until_failure = -1;
    if (!has_failed) {
      EXPECT_EQ(status, CARILLON_OK);
      break;
    }
    ++failures;
    // CARILLON_BAD_INPUT: HDF5 does not report the reason.
    EXPECT_TRUE(status == CARILLON_SYSTEM || status == CARILLON_OK || (status == CARILLON_BAD_INPUT && session.get_synth() == nullptr))
        << place << ": " << status;
    if (session.get_body() < 0) continue;
    // Pending swaps follow in later calls.
    for (int i = 0; i < 3; ++i) {
      process(session.get_synth(), 2);
      carillon_collect(session.get_synth());
    }
    EXPECT_EQ(carillon_get_effects(session.get_synth(), session.get_body()), kEffects | CARILLON_HEAD);
    process(session.get_synth(), 2);
  }
  EXPECT_GT(failures, 100);
}

/// A body that falls on the ground and stays there.
carillon_status fall(const carillon_bank* bank, carillon_touches** touches) {
  char message[100];
  carillon_touches_options options;
  carillon_touches_options_init(&options);
  options.sink = [](void*, int32_t, const void*) {};
  carillon_status status = carillon_touches_create(nullptr, &options, touches, message, sizeof message);
  if (status != CARILLON_OK) return status;
  carillon_touches_body body;
  carillon_touches_body_init(&body);
  body.body = 0;
  body.bank = bank;
  int32_t index = -1;
  if ((status = carillon_touches_add(*touches, &body, &index, message, sizeof message)) != CARILLON_OK) return status;
  carillon_pose pose{};
  pose.rotation[0] = 1.0;
  pose.velocity_m_s[2] = -1.0;
  if ((status = carillon_touches_start(*touches, 0.0, &pose, 1, message, sizeof message)) != CARILLON_OK) return status;
  carillon_point point{};
  point.b = -1;
  point.normal[2] = 1.0;
  point.impulse_n_s = std::nan("");
  pose.velocity_m_s[2] = 0.0;
  for (int n = 1; n < 6; ++n)
    if ((status = carillon_touches_step(*touches, 0.01 * n, &pose, 1, &point, 1, message, sizeof message)) != CARILLON_OK) return status;
  return carillon_touches_remove(*touches, index);
}

TEST(NoException, LeavesTouchesAfterAnyFailedAllocation) {
  carillon_bank* bank = nullptr;
  ASSERT_EQ(carillon_bank_open(kBank.c_str(), &bank, nullptr, 0), CARILLON_OK);
  int failures = 0;
  for (long place = 0;; ++place) {
    carillon_touches* touches = nullptr;
    g_until_failure = place;
    carillon_status status = CARILLON_OK;
    EXPECT_NO_THROW(status = fall(bank, &touches)) << place;
    const bool has_failed = g_until_failure < 0;
    g_until_failure = -1;
    carillon_touches_destroy(touches);
    // Sorting does without its buffer.
    EXPECT_TRUE(status == CARILLON_OK || (has_failed && status == CARILLON_SYSTEM)) << place << ": " << status;
    if (!has_failed) break;
    ++failures;
  }
  EXPECT_GT(failures, 50);
  carillon_bank_close(bank);
}

TEST(NoException, LeavesWithAnyOptions) {
  carillon_bank* bank = nullptr;
  carillon_model* model = nullptr;
  carillon_model_options model_options;
  carillon_model_options_init(&model_options);
  ASSERT_EQ(carillon_bank_open(kBank.c_str(), &bank, nullptr, 0), CARILLON_OK);
  ASSERT_EQ(carillon_model_make(bank, &model_options, &model, nullptr, 0), CARILLON_OK);
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const std::array values{0.0, -1.0, 1e-320, 1e-12, 0.5, 1.0, 30.0, 1e30, kInf, -kInf, std::nan("")};
  const std::array counts{0, -1, 1, 2, 64, INT_MAX, INT_MIN};
  int accepted = 0;
  for (unsigned seed = 0; seed < 1500; ++seed) {
    std::mt19937 random(seed);
    const auto spoil = [&](double& x) {
      if (random() % 6 == 0) x = values[random() % values.size()];
    };
    const auto spoil_count = [&](int32_t& x) {
      if (random() % 6 == 0) x = counts[random() % counts.size()];
    };
    carillon_options options;
    carillon_options_init(&options);
    carillon_body_options body_options;
    carillon_body_options_init(&body_options);
    if (seed % 3 == 0) {
      for (double* x : {&options.longest_m, &options.listener_m[1], &options.budget, &options.ground_roughness_m, &options.ground_friction,
                        &options.head_radius_m, &options.floor_height_m, &options.floor_reflection})
        spoil(*x);
      for (int32_t* x : {&options.max_bodies, &options.max_strikes, &options.ring_events, &options.max_waypoints}) spoil_count(*x);
    }
    for (double* x : {&body_options.position_m[0], &body_options.rotation[1], &body_options.longest_m, &body_options.silence_pa,
                      &body_options.roughness_m, &body_options.friction})
      spoil(*x);
    spoil_count(body_options.max_waypoints);
    body_options.effects = random() % 2 == 0 ? std::uint32_t{CARILLON_AIR_DELAY} : random() & (2 * CARILLON_CASCADE - 1);
    carillon_synth* synth = nullptr;
    EXPECT_NO_THROW({
      if (carillon_create(&options, &synth, nullptr, 0) == CARILLON_OK) {
        int32_t body = -1;
        if (carillon_add_body_with(synth, model, &body_options, &body, nullptr, 0) == CARILLON_OK) {
          ++accepted;
          for (int swap = 0; swap < 6; ++swap) {
            (void)carillon_swap_model(synth, body, model, nullptr, 0);
            (void)carillon_swap_model(synth, body, model, nullptr, 0);
            process(synth, 1);
            carillon_collect(synth);
          }
        }
        carillon_destroy(synth);
      }
    }) << seed;
  }
  EXPECT_GT(accepted, 100);
  carillon_model_release(model);
  carillon_bank_close(bank);
}

TEST(NoException, AVariedStrikeIsFiniteOrRefused) {
  carillon_bank* bank = nullptr;
  ASSERT_EQ(carillon_bank_open(kBank.c_str(), &bank, nullptr, 0), CARILLON_OK);
  int refused = 0;
  for (const double size : {1e-300, 1e-3, 1e150, 1e160, 1e300, 1.7e308}) {
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
      carillon_impulse strike;
      carillon_impulse_init(&strike);
      strike.time_s = 1.0;
      strike.duration_s = 1e-3;
      strike.impulse_n_s[seed % 3] = size;
      const carillon_impulse before = strike;
      const carillon_status status = carillon_vary_impulse(bank, 1.0, seed, 0, &strike);
      refused += status == CARILLON_OK ? 0 : 1;
      for (int k = 0; k < 3; ++k) {
        ASSERT_TRUE(std::isfinite(strike.impulse_n_s[k]) && std::isfinite(strike.barycentric[k]));
        if (status != CARILLON_OK) {
          ASSERT_EQ(strike.impulse_n_s[k], before.impulse_n_s[k]);
        }
      }
      ASSERT_TRUE(std::isfinite(strike.duration_s));
    }
  }
  EXPECT_GT(refused, 0);
  carillon_bank_close(bank);
}

}  // namespace
