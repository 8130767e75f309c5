// Deflections above the linear range, against a plate's closed form and the whole displacement field (all modes, all vertices of one side,
// every second sample).
#include "runtime/synth/bending.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/synth/resonator_bank.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kYoungPa = 2e11, kPoisson = 0.3, kDensityKgM3 = 7800.0;

/// A square steel sheet hinged on all sides, as a closed box of n x n cells: phi = 2 / sqrt(mass) sin sin along z, omega^2 = D k^4 / (rho
/// h), for m, n up to `highest`.
bank::Bank make_sheet(double side_m, double thickness_m, int cells, int highest, double decay_per_s) {
  bank::Bank bank;
  const auto row = static_cast<std::int32_t>(cells + 1);
  for (const double z : {-0.5 * thickness_m, 0.5 * thickness_m})
    for (int j = 0; j <= cells; ++j)
      for (int i = 0; i <= cells; ++i) bank.vertices_m.push_back({side_m * i / cells, side_m * j / cells, z});
  const std::int32_t top = row * row;
  const auto add = [&](std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
    bank.triangles.push_back({a, b, c});
    bank.triangles.push_back({a, c, d});
  };
  for (std::int32_t j = 0; j < cells; ++j) {
    for (std::int32_t i = 0; i < cells; ++i) {
      const std::int32_t at = j * row + i;
      add(at, at + row, at + row + 1, at + 1);
      add(top + at, top + at + 1, top + at + row + 1, top + at + row);
    }
    add(j, top + j, top + j + 1, j + 1);
    add(cells * row + j, cells * row + j + 1, top + cells * row + j + 1, top + cells * row + j);
    add(j * row, (j + 1) * row, top + (j + 1) * row, top + j * row);
    add(j * row + cells, top + j * row + cells, top + (j + 1) * row + cells, (j + 1) * row + cells);
  }
  const double area = side_m * side_m, mass = kDensityKgM3 * thickness_m * area;
  const double stiffness = kYoungPa * std::pow(thickness_m, 3) / (12.0 * (1.0 - kPoisson * kPoisson));
  std::vector<std::array<int, 2>> numbers;
  for (int m = 1; m <= highest; ++m)
    for (int n = 1; n <= highest; ++n) numbers.push_back({m, n});
  std::sort(numbers.begin(), numbers.end(),
            [](const auto& a, const auto& b) { return a[0] * a[0] + a[1] * a[1] < b[0] * b[0] + b[1] * b[1]; });
  std::vector<double> shapes;
  for (const Vec3& v : bank.vertices_m)
    for (const auto& [m, n] : numbers) {
      const double phi = 2.0 / std::sqrt(mass) * std::sin(m * kPi * v[0] / side_m) * std::sin(n * kPi * v[1] / side_m);
      shapes.insert(shapes.end(), {0.0, 0.0, phi});
    }
  for (const auto& [m, n] : numbers) {
    const double k2 = (m * m + n * n) * kPi * kPi / area;
    bank.eigenvalue_rad2_s2.push_back(stiffness * k2 * k2 / (kDensityKgM3 * thickness_m));
    bank.decay_per_s.push_back(decay_per_s);
    bank.residual.push_back(0.0);
    bank.radiation_gain.push_back(1.0);
  }
  bank::quantise_shapes(bank, shapes);
  bank.rigid.mass_kg = mass;
  bank.rigid.volume_m3 = area * thickness_m;
  bank.material = {kYoungPa, kPoisson, kDensityKgM3, 0.0, 2.0 * decay_per_s};
  bank.element = "T10";
  bank.provenance = "{}";
  return bank;
}

double play(const bank::Bank& bank, const std::vector<events::Event>& events, std::size_t blocks, int frames = kBlock) {
  Synthesiser synthesiser({.microphones_m = {Vec3{}}, .max_strikes = 256});
  const int body = synthesiser.add_body(Model::make(bank), {.position_m = {0, 1, 0}, .effects = {Effect::kModal, Effect::kHertzPulse}});
  for (const events::Event& event : events) synthesiser.push(event);
  std::vector<float> out(frames);
  float* channel = out.data();
  for (std::size_t b = 0; b < blocks; ++b) synthesiser.process(&channel, 1, frames);
  return synthesiser.get_deflection(body);
}

/// An impulse at a vertex.
events::Impulse make_strike(const bank::Bank& bank, std::int32_t vertex, double time_s, double impulse_n_s, double duration_s) {
  for (std::size_t t = 0; t < bank.triangles.size(); ++t)
    for (std::size_t c = 0; c < 3; ++c)
      if (bank.triangles[t][c] == vertex) {
        events::Impulse impulse{.time_s = time_s,
                                .triangle = static_cast<std::int32_t>(t),
                                .barycentric = {0, 0, 0},
                                .impulse_n_s = {0, 0, impulse_n_s},
                                .duration_s = duration_s};
        impulse.barycentric[c] = 1.0;
        return impulse;
      }
  return {};
}

TEST(Bending, ASheetUnderALoadThatGrowsSlowlyBendsAsNavierHasIt) {
  constexpr double kSide = 0.2, kThickness = 0.001, kEnd = 0.3, kStep = 1e-3;
  constexpr int kCells = 20;
  const bank::Bank bank = make_sheet(kSide, kThickness, kCells, 13, 400.0);
  // Timoshenko, Woinowsky-Krieger, "Theory of plates and shells" (1959), table 23: w = 0.01160 F a^2 / D under a force at the centre.
  const double stiffness = kYoungPa * std::pow(kThickness, 3) / (12.0 * (1.0 - kPoisson * kPoisson));
  const double thickness = kThickness / (1.0 + 2.0 * kThickness / kSide);  // twice the volume over the surface
  const auto load = [&](double thicknesses) {
    const double force_n = thicknesses * thickness * stiffness / (0.01160 * kSide * kSide);
    const events::Impulse at = make_strike(bank, (kCells / 2) * (kCells + 1) + kCells / 2, 0.0, 1.0, 0.0);
    std::vector<Vec3> impulses;
    for (double t = 0.5 * kStep; t < kEnd; t += kStep) impulses.push_back({0, 0, force_n * kStep * std::min(1.0, t / (0.7 * kEnd))});
    std::vector<events::Event> events;
    events::split_force({.step_s = kStep, .triangle = at.triangle, .barycentric = at.barycentric}, impulses,
                        [&](const events::Force& piece) { events.emplace_back(piece); });
    return play(bank, events, static_cast<std::size_t>(kEnd * 48000.0 / kBlock));
  };
  EXPECT_NEAR(load(10.0), 10.0, 0.3);
  EXPECT_NEAR(load(0.6), 0.6, 0.02);
  EXPECT_EQ(load(0.45), 0.0);
  EXPECT_EQ(load(0.01), 0.0);
}

TEST(Bending, OneModeSwingsAsFarAsItsImpulseSays) {
  bank::Bank bank = make_sheet(0.2, 0.001, 8, 1, 0.5);
  const double thickness = 0.001 / 1.01, omega = std::sqrt(bank.eigenvalue_rad2_s2[0]), phi = bank.shape_scale[0] * 32767.0;
  for (const double thicknesses : {0.2, 0.49, 0.52, 3.0}) {
    const double impulse = thicknesses * thickness * omega / (phi * phi);
    const double found = play(bank, {make_strike(bank, 40, 0.01, impulse, 0.0)}, 100);
    if (thicknesses < kLinearThicknesses)
      EXPECT_EQ(found, 0.0) << thicknesses;
    else
      EXPECT_NEAR(found, thicknesses, 0.01 * thicknesses);
  }
}

TEST(Bending, RandomBlowsAreJudgedAsByTheWholeDisplacementField) {
  std::mt19937_64 random(11);
  const auto pick = [&](double low, double high) { return std::uniform_real_distribution(low, high)(random); };
  int beyond = 0, within = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const int cells = 6 + trial % 5;
    bank::Bank bank = make_sheet(pick(0.05, 0.4), pick(3e-4, 4e-3), cells, 3 + trial % 4, 1.0);
    for (std::size_t m = 0; m < bank.mode_count(); ++m) {
      const double omega = std::sqrt(bank.eigenvalue_rad2_s2[m]);
      bank.decay_per_s[m] = trial % 4 == 0 && m % 3 == 1 ? omega * pick(0.9, 1.6) : pick(0.5, 60.0);  // some overdamped
    }
    const double thickness = find_judged_thickness_m(bank);
    std::vector<events::Impulse> blows;
    std::vector<events::Event> events;
    const double size = std::exp(pick(-3.0, 1.0));
    double time_s = 0.004;
    for (int i = 0; i < 4; ++i) {
      const auto vertex = static_cast<std::int32_t>(pick(0.0, 0.999) * static_cast<double>(bank.vertex_count()));
      const double omega = std::sqrt(bank.eigenvalue_rad2_s2[0]);
      const double j = size * pick(-1.0, 1.0) * thickness * bank.rigid.mass_kg * omega;
      blows.push_back(make_strike(bank, vertex, time_s, j, 0.0));
      events.emplace_back(blows.back());
      time_s += pick(1e-3, 3e-2);
    }
    const double found = play(bank, events, 80, trial % 2 == 0 ? kBlock : 77);
    // Closed form of each mode between blows: exp(-d t) times cos and sin, or cosh and sinh.
    double largest = 0.0;
    const std::size_t modes = bank.mode_count();
    std::vector<double> q(modes), v(modes);
    std::size_t next = 0;
    const std::size_t samples = trial % 2 == 0 ? 80 * kBlock : 80 * 77;
    double now_s = 0.0;
    const auto move = [&](double to_s) {
      const double h = to_s - now_s;
      for (std::size_t m = 0; m < modes; ++m) {
        const double d = bank.decay_per_s[m], square = bank.eigenvalue_rad2_s2[m] - d * d, w = std::sqrt(std::abs(square));
        const double c = square > 0.0 ? std::cos(w * h) : std::cosh(w * h), s = (square > 0.0 ? std::sin(w * h) : std::sinh(w * h)) / w;
        const double e = std::exp(-d * h), q0 = q[m], v0 = v[m];
        q[m] = e * (q0 * (c + d * s) + v0 * s);
        v[m] = e * (v0 * (c - d * s) - q0 * bank.eigenvalue_rad2_s2[m] * s);
      }
      now_s = to_s;
    };
    for (std::size_t n = 0; n < samples; n += 2) {
      const double at_s = static_cast<double>(n) / 48000.0;
      for (; next < blows.size() && blows[next].time_s <= at_s; ++next) {
        move(blows[next].time_s);
        for (std::size_t m = 0; m < modes; ++m)
          for (std::size_t c = 0; c < 3; ++c)
            v[m] += blows[next].barycentric[c] * blows[next].impulse_n_s[2] * bank.shape_at(bank.triangles[blows[next].triangle][c], m)[2];
      }
      move(at_s);
      for (std::size_t vertex = 0; vertex < bank.vertex_count() / 2; ++vertex) {
        double w = 0.0;
        for (std::size_t m = 0; m < modes; ++m) w += bank.shape_at(vertex, m)[2] * q[m];
        largest = std::max(largest, std::abs(w) / thickness);
      }
    }
    if (largest < kLinearThicknesses) {
      EXPECT_EQ(found, 0.0) << trial << ": " << largest;
      ++within;
    } else if (largest > 1.1 * kLinearThicknesses) {
      EXPECT_GT(found, 0.8 * largest) << trial;
      EXPECT_LT(found, 1.01 * largest) << trial;
      ++beyond;
    }
  }
  EXPECT_GT(beyond, 8);
  EXPECT_GT(within, 8);
}

TEST(Bending, IsNotJudgedWhereTheBankHasLargeMotionOrTension) {
  bank::Bank bank = make_sheet(0.2, 0.001, 8, 1, 0.5);
  EXPECT_GT(find_judged_thickness_m(bank), 0.0);
  bank::Bank held = bank;
  held.element = "analytic";
  held.provenance = R"({"job": {"body": {"string": {"length_m": 0.65}}}})";
  EXPECT_EQ(find_judged_thickness_m(held), 0.0);
  held.provenance = R"({"job": {"body": {"plate": {}}}})";
  EXPECT_GT(find_judged_thickness_m(held), 0.0);
  bank::Bank coupled = bank;
  coupled.quartic.modes = {0};
  EXPECT_EQ(find_judged_thickness_m(coupled), 0.0);
  bank.rigid.volume_m3 = 0.0;
  EXPECT_EQ(find_judged_thickness_m(bank), 0.0);
  EXPECT_EQ(play(bank, {make_strike(bank, 40, 0.01, 100.0, 0.0)}, 50), 0.0);
}

}  // namespace
}  // namespace carillon::synth
