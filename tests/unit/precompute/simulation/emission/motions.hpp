// Bodies with analytic motion, and their received sound.
#pragma once

#include <mpi.h>

#include <cmath>
#include <complex>
#include <cstdint>
#include <functional>
#include <numbers>
#include <numeric>
#include <span>
#include <vector>

#include "precompute/simulation/emission/emission.hpp"
#include "tests/unit/precompute/air/bodies.hpp"

namespace carillon::emission::testing {

inline constexpr double kRho = 1.21, kC = 343.0, kTwoPi = 2.0 * std::numbers::pi;

/// The whole surface as one body on one rank.
inline SurfacePart make_part(const air::testing::Skin& skin) {
  SurfacePart part;
  part.nodes_m = skin.nodes_m;
  part.triangles = skin.triangles;
  part.node_number.resize(skin.nodes_m.size());
  std::iota(part.node_number.begin(), part.node_number.end(), std::int64_t{0});
  part.triangle_number.resize(skin.triangles.size());
  std::iota(part.triangle_number.begin(), part.triangle_number.end(), std::int64_t{0});
  part.body.assign(skin.triangles.size(), 0);
  return part;
}

/// Displacement at time t of a node at rest position x.
using Motion = std::function<Vec3(const Vec3& x, double t)>;

inline std::vector<double> calc_displacement(const SurfacePart& part, const Motion& motion, double t) {
  std::vector<double> u;
  for (const Vec3& x : part.nodes_m) {
    const Vec3 moved = motion(x, t);
    u.insert(u.end(), {moved[0], moved[1], moved[2], 0.0});
  }
  return u;
}

inline Options make_options(std::uint64_t frames, const Vec3& place_m, int steps = 16) {
  Options options;
  options.frames = frames;
  options.steps_per_sample = steps;
  options.high_pass_hz = 0.0;
  Microphone receiver;
  receiver.place_m = place_m;
  options.receivers = {receiver};
  options.has_visibility = false;
  return options;
}

/// Runs to the end.
inline std::vector<double> hear(const SurfacePart& part, const Options& options, const Motion& motion) {
  Emission sound(MPI_COMM_SELF, part, options);
  const double rate_hz = options.sample_rate_hz * options.steps_per_sample;
  const auto steps = static_cast<std::int64_t>(options.frames) * options.steps_per_sample;
  for (std::int64_t n = 0; n <= steps; ++n) sound.add_step(calc_displacement(part, motion, static_cast<double>(n) / rate_hz).data());
  sound.finish();
  return sound.calc_sound(0);
}

/// The same for u(x, t) = shape(x) * time(t), faster.
inline std::vector<double> hear_shape(const SurfacePart& part, const Options& options, const std::function<Vec3(const Vec3&)>& shape,
                                      const std::function<double(double)>& time) {
  Emission sound(MPI_COMM_SELF, part, options);
  const double rate_hz = options.sample_rate_hz * options.steps_per_sample;
  const auto steps = static_cast<std::int64_t>(options.frames) * options.steps_per_sample;
  const auto shapes = calc_displacement(
      part, [&](const Vec3& x, double) { return shape(x); }, 0.0);
  std::vector<double> u(shapes.size());
  for (std::int64_t n = 0; n <= steps; ++n) {
    const double now = time(static_cast<double>(n) / rate_hz);
    for (std::size_t i = 0; i < u.size(); ++i) u[i] = now * shapes[i];
    sound.add_step(u.data());
  }
  sound.finish();
  return sound.calc_sound(0);
}

/// Re and Im of the amplitude of e^{-2 pi i f t} in samples [begin, end), under a Hann window.
inline std::complex<double> find_amplitude(std::span<const double> sound, double freq_hz, double rate_hz, std::size_t begin,
                                           std::size_t end) {
  double cc = 0.0, cs = 0.0, ss = 0.0, c1 = 0.0, s1 = 0.0;
  for (std::size_t n = begin; n < end; ++n) {
    const double turn = kTwoPi * freq_hz * static_cast<double>(n) / rate_hz, c = std::cos(turn), s = std::sin(turn);
    cc += c * c;
    cs += c * s;
    ss += s * s;
    c1 += c * sound[n];
    s1 += s * sound[n];
  }
  const double det = cc * ss - cs * cs;
  return {(c1 * ss - s1 * cs) / det, (c1 * cs - s1 * cc) / det};
}

inline double to_db(double ratio) { return 20.0 * std::log10(ratio); }

}  // namespace carillon::emission::testing
