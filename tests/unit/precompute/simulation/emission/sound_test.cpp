// Moving, turning and coupled sources, receivers, changes of the step, checkpoints.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/simulation/emission/motions.hpp"

namespace carillon::emission {
namespace {

using namespace testing;

double find_most(std::span<const double> sound) {
  double most = 0.0;
  for (const double one : sound) most = std::max(most, std::abs(one));
  return most;
}

TEST(Sound, UniformMotionAcrossStepChange) {
  const auto part = make_part(air::testing::make_ball(3, 0.05));
  Options options = make_options(300, {1.0, 2.0, 0.5}, 16);
  const auto motion = [](const Vec3&, double t) { return t * Vec3{20.0, -7.0, 3.0}; };
  Emission sound(MPI_COMM_SELF, part, options);
  double time_s = 0.0;
  int steps = 16;
  for (int sample = 0; sample < 301; ++sample) {
    if (sample == 100 || sample == 180) sound.set_steps_per_sample(steps = sample == 100 ? 112 : 20);
    for (int n = 0; n < steps; ++n) {
      sound.add_step(calc_displacement(part, motion, time_s).data());
      time_s += 1.0 / (48000.0 * steps);
    }
  }
  sound.finish();
  EXPECT_LT(find_most(sound.calc_sound(0)), 1e-7);  // -46 dB of the threshold of hearing, of a body at 21 m/s
}

TEST(Sound, ToneAcrossStepChange) {
  const auto part = make_part(air::testing::make_ball(2, 0.01));
  const Options options = make_options(600, {0.0, 0.0, 0.3}, 16);
  const auto motion = [](const Vec3& x, double t) { return 1e-6 * std::sin(kTwoPi * 3000.0 * t) * normalise(x); };
  const auto whole = hear(part, options, motion);
  Emission sound(MPI_COMM_SELF, part, options);
  for (int sample = 0; sample <= 600; ++sample) {
    const int steps = sample < 300 ? 16 : 64;
    if (sample == 300) {
      EXPECT_TRUE(sound.is_at_sample());
      sound.set_steps_per_sample(64);
    }
    for (int n = 0; n < steps; ++n)
      sound.add_step(calc_displacement(part, motion, (sample + static_cast<double>(n) / steps) / 48000.0).data());
  }
  sound.finish();
  const auto changed = sound.calc_sound(0);
  for (std::size_t n = 0; n < whole.size(); ++n) EXPECT_NEAR(changed[n], whole[n], 2e-3 * find_most(whole)) << n;
}

TEST(Sound, ImpulsesOfAClosedSurface) {
  // From rest to rest the integral of the pressure is 0, and its double integral is rho dV / (4 pi r), for one pole as for monopoles.
  air::testing::Skin skin = air::testing::make_ball(2, 0.01);
  const auto part = make_part(skin);
  const auto shape = [](const Vec3& x) { return Vec3{0.01 * x[0], -0.004 * x[1], 0.002 * x[2]}; };
  const auto time = [](double t) {
    const double part = std::clamp((t - 0.001) / 0.003, 0.0, 1.0);
    return part * part * part * (10.0 - part * (15.0 - 6.0 * part));
  };
  double change = -calc_volume(skin);
  for (Vec3& x : skin.nodes_m) x = x + shape(x);
  change += calc_volume(skin);
  Options options = make_options(500, {0.3, 0.0, 0.4});
  for (const Radiation radiation : {Radiation::kKirchhoff, Radiation::kRayleigh}) {
    options.radiation = radiation;
    double sum = 0.0, twice = 0.0, size = 0.0;
    for (const double pressure : hear_shape(part, options, shape, time)) {
      sum += pressure / options.sample_rate_hz;
      twice += sum / options.sample_rate_hz;
      size += std::abs(pressure) / options.sample_rate_hz;
    }
    const double sources = radiation == Radiation::kRayleigh ? 2.0 : 1.0;
    EXPECT_LT(std::abs(sum), 1e-6 * size);
    EXPECT_NEAR(twice / (sources * kRho * change / (2.0 * kTwoPi * 0.5)), 1.0, 2e-4);
  }
}

TEST(Sound, RetardedPotentialOfASwingingSource) {
  // A small pulsating sphere on a pendulum, t = s + r(s) / c, M = -r' / c. A point source gives rho Q'(s) / (4 pi r (1 - M)); front and
  // rear facets arrive at different times, and their areas grow, which adds M 2/3 (1 - M)^-2: the sum over facets of V.S' (n.x) is 2/3 of
  // V.n Q.
  const double radius = 1e-3, freq_hz = 2000.0, omega = kTwoPi * freq_hz, swing = kTwoPi * 3.0;
  const Vec3 ear{0.0, 1.5, 0.0};
  const auto centre = [&](double t) { return Vec3{0.0, 0.6 * std::sin(swing * t), 0.0}; };
  const air::testing::Skin skin = air::testing::make_ball(2, radius);
  Options options = make_options(9600, ear, 16);
  options.radiation = Radiation::kRayleigh;  // monopoles only, twice
  const double amplitude = 1e-6;
  const auto sound =
      hear(make_part(skin), options, [&](const Vec3& x, double t) { return centre(t) + amplitude * std::sin(omega * t) * normalise(x); });
  double area = 0.0;
  for (const Triangle& t : skin.triangles) {
    const Vec3 twice = cross(skin.nodes_m[t[1]] - skin.nodes_m[t[0]], skin.nodes_m[t[2]] - skin.nodes_m[t[0]]);
    for (const std::int32_t node : t) area += dot(normalise(skin.nodes_m[node]), twice) / 6.0;
  }
  double error = 0.0, power = 0.0, highest = 0.0;
  for (std::size_t n = 1000; n < 9400; ++n) {
    const double t = static_cast<double>(n) / 48000.0;
    double s = t;
    for (int i = 0; i < 60; ++i) s = t - norm(ear - centre(s)) / kC;
    const double r = norm(ear - centre(s)), slope = (norm(ear - centre(s + 1e-6)) - norm(ear - centre(s - 1e-6))) / 2e-6;
    const double mach = -slope / kC, heard = 1.0 / (1.0 - mach) + 2.0 / 3.0 * mach / ((1.0 - mach) * (1.0 - mach));
    const double wanted = -kRho * omega * omega * amplitude * area * std::sin(omega * s) / (kTwoPi * r) * heard;
    error += (sound[n] - wanted) * (sound[n] - wanted);
    power += wanted * wanted;
    highest = std::max(highest, std::abs(slope));
  }
  EXPECT_GT(highest, 10.0);
  EXPECT_LT(std::sqrt(error / power), 3e-3);
}

TEST(Sound, SilentTumblingRigidBody) {
  // A spinning cube does not change its volume.
  air::testing::Skin skin = air::testing::make_ball(4, 0.05);
  const auto part = make_part(skin);
  const double spin = kTwoPi * 40.0;
  const auto sound = hear(part, make_options(2000, {0.5, 0.1, 0.0}, 16), [&](const Vec3& x, double t) {
    const double c = std::cos(spin * t), s = std::sin(spin * t);
    return Vec3{c * x[0] - s * x[1], s * x[0] + c * x[1], x[2]} - x;
  });
  // A ball of facets: rough to a per cent of its radius. The surface speed is 12 m/s.
  const double scale = kRho * 12.6 * 0.0314 * spin / (2.0 * kTwoPi * 0.5);
  EXPECT_LT(find_most(std::span(sound).subspan(200)), 2e-2 * scale);
}

// The two sides of a sheet act as one; with nodes of their own they are two surfaces.
TEST(Sound, SheetAsTwoSurfaces) {
  const auto listen = [](std::int32_t apart) {
    SurfacePart part;
    const std::vector<Vec3> corners{{-0.1, -0.1, 0}, {0.1, -0.1, 0}, {0.1, 0.1, 0}, {-0.1, 0.1, 0}};
    part.nodes_m = corners;
    if (apart > 0) part.nodes_m.insert(part.nodes_m.end(), corners.begin(), corners.end());
    part.triangles = {{0, 1, 2}, {0, 2, 3}, {apart, apart + 2, apart + 1}, {apart, apart + 3, apart + 2}};
    for (std::size_t i = 0; i < part.nodes_m.size(); ++i) part.node_number.push_back(static_cast<std::int64_t>(i));
    part.triangle_number = {0, 1, 2, 3};
    part.body = {0, 0, 0, 0};
    return hear(part, make_options(1000, {0.3, 0.2, 0.5}), [](const Vec3& x, double t) {
      return Vec3{0, 0, 1e-6 * (1.0 + 3.0 * x[0]) * std::sin(kTwoPi * 3000.0 * t)};
    });
  };
  const std::vector<double> sheet = listen(0), surfaces = listen(4);
  double most = 0.0, difference = 0.0;
  for (std::size_t n = 0; n < sheet.size(); ++n) {
    most = std::max(most, std::abs(surfaces[n]));
    difference = std::max(difference, std::abs(sheet[n] - surfaces[n]));
  }
  EXPECT_GT(most, 1e-6);
  EXPECT_LT(difference, 1e-9 * most);
}

TEST(Sound, ReceiverDirectivity) {
  const auto part = make_part(air::testing::make_ball(2, 1e-3));
  Options options = make_options(800, {0.0, 0.0, 1.0}, 16);
  Microphone eight;
  eight.place_m = {0.0, 0.0, 1.0};
  eight.directivity = 1.0;
  eight.axis = {1.0, 0.0, 0.0};
  Microphone heart = eight;
  heart.directivity = 0.5;
  heart.axis = {0.0, 0.0, -1.0};
  Microphone away = heart;
  away.axis = {0.0, 0.0, 1.0};
  options.receivers.insert(options.receivers.end(), {eight, heart, away});
  Emission sound(MPI_COMM_SELF, part, options);
  for (int n = 0; n <= 800 * 16; ++n)
    sound.add_step(calc_displacement(
                       part, [](const Vec3& x, double t) { return 1e-6 * std::sin(kTwoPi * 1000.0 * t) * normalise(x); }, n / 768e3)
                       .data());
  sound.finish();
  const auto first = sound.calc_sound(0), third = sound.calc_sound(2);
  const double whole = find_most(std::span(first).subspan(400));
  EXPECT_LT(find_most(sound.calc_sound(1)), 2e-3 * whole);
  EXPECT_NEAR(find_most(std::span(third).subspan(400)), whole, 1e-3 * whole);
  EXPECT_LT(find_most(sound.calc_sound(3)), 2e-3 * whole);
}

TEST(Sound, EarPositions) {
  const auto ears = make_ears({1.0, -2.0, 0.5}, {1.0, 5.0, 3.0});
  ASSERT_EQ(ears.size(), 2U);
  EXPECT_NEAR(ears[0].place_m[0], 0.9, 1e-12);
  EXPECT_NEAR(ears[1].place_m[0], 1.1, 1e-12);
  EXPECT_NEAR(ears[0].place_m[2], 0.5, 1e-12);
  EXPECT_THROW(make_ears({0, 0, 1}, {0, 0, 0}), InputError);
}

TEST(Sound, BitIdenticalResumption) {
  const auto part = make_part(air::testing::make_ball(3, 0.03));
  for (const Radiation radiation : {Radiation::kKirchhoff, Radiation::kRayleigh, Radiation::kPaper2001}) {
    Options options = make_options(220, {0.2, 0.1, 0.4}, 16);
    options.radiation = radiation;
    options.has_visibility = true;
    const auto motion = [](const Vec3& x, double t) {
      return Vec3{3.0 * t, 0.0, 0.0} + 1e-6 * std::sin(kTwoPi * 3000.0 * t + 40.0 * x[0]) * normalise(x);
    };
    const auto get = [&](int n) { return calc_displacement(part, motion, n / 768e3); };
    const auto whole = hear(part, options, motion);
    for (const int cut : {3, 777, 16 * 120}) {
      std::vector<std::byte> state;
      {
        Emission first(MPI_COMM_SELF, part, options);
        for (int n = 0; n < cut; ++n) first.add_step(get(n).data());
        state = first.save();
      }
      Emission second(MPI_COMM_SELF, part, options);
      second.load(state);
      for (int n = cut; n <= 220 * 16; ++n) second.add_step(get(n).data());
      second.finish();
      EXPECT_EQ(second.calc_sound(0), whole) << cut;
      EXPECT_THROW(second.load(std::span<const std::byte>(state).first(state.size() - 1)), InputError);
    }
  }
}

TEST(Sound, UnstableMotion) {
  const auto part = make_part(air::testing::make_ball(1, 0.03));
  Emission sound(MPI_COMM_SELF, part, make_options(80, {0.0, 0.0, 0.3}, 16));
  for (int n = 0; n <= 80 * 16; ++n)
    sound.add_step(calc_displacement(
                       part, [&](const Vec3& x, double) { return (n == 400 ? std::numeric_limits<double>::quiet_NaN() : 0.0) * x; }, 0.0)
                       .data());
  EXPECT_TRUE(sound.has_fault());
  EXPECT_NE(tests::catch_message<SolveError>([&] { sound.finish(); }).find("not stable"), std::string::npos);
}

TEST(Sound, MissingSteps) {
  const auto part = make_part(air::testing::make_ball(1, 0.03));
  Emission sound(MPI_COMM_SELF, part, make_options(50, {0.0, 0.0, 0.3}, 16));
  for (int n = 0; n < 20 * 16; ++n)
    sound.add_step(calc_displacement(
                       part, [](const Vec3&, double) { return Vec3{}; }, 0.0)
                       .data());
  EXPECT_NE(tests::catch_message<SolveError>([&] { sound.finish(); }).find("20 samples of 50"), std::string::npos);
}

TEST(Sound, InvalidInput) {
  auto part = make_part(air::testing::make_ball(1, 0.03));
  Options options = make_options(50, {0.0, 0.0, 0.3}, 17);
  EXPECT_NE(tests::catch_message<InputError>([&] {
              Emission(MPI_COMM_SELF, part, options);
            }).find("17 steps a sample cannot be filtered; take 20"),
            std::string::npos);
  options.steps_per_sample = 16;
  part.triangle_number[1] = 0;
  EXPECT_NE(tests::catch_message<InputError>([&] { Emission(MPI_COMM_SELF, part, options); }).find("triangle 0 is on two ranks"),
            std::string::npos);
  part.triangle_number[1] = 1;
  part.triangles[5] = {3, 3, 4};
  EXPECT_NE(tests::catch_message<InputError>([&] { Emission(MPI_COMM_SELF, part, options); }).find("triangle 5 of a surface has no area"),
            std::string::npos);
}

}  // namespace
}  // namespace carillon::emission
